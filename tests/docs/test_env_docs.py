"""docs/environments, `FlexArmEnv`'s docstring and the folded specification: fresh and true."""

import ast
import inspect
import re
from dataclasses import fields
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from PIL import Image

from flexarm_env import FlexibleArm
from flexarm_env.actions import MODES, modes_reading
from flexarm_env.envs import documentation, documentation_texts
from flexarm_env.envs.blocks import BLOCKS, PLANT
from flexarm_env.envs.registration import IDS
from flexarm_env.envs.settings import Settings
from flexarm_env.envs.single import FlexArmEnv
from flexarm_env.envs.termination import ENDS
from scripts.docs import env_pictures, environments, to_beat, widgets
from tests.support.envs import terms_of
from tests.support.programs import ROOT

DOCS = ROOT / "docs" / "environments"
DOCSTRING = FlexArmEnv.__doc__ or ""
Row = dict[str, str]


@pytest.fixture(params=IDS, scope="module")
def name(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="module")
def env(name: str) -> FlexArmEnv:
    made = gym.make(f"FlexArm/{name}").unwrapped
    assert isinstance(made, FlexArmEnv)
    return made


def section(text: str, title: str) -> str:
    return text.partition(f"\n## {title}\n")[2].partition("\n## ")[0]


def rows(text: str) -> list[Row]:
    """Lines of the first table, by the names of its columns; without the marks of code."""
    lines = [line for line in text.splitlines() if line.startswith("|")]
    cells = [[cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]] for line in lines]
    assert len({len(line) for line in cells}) == 1
    return [dict(zip(cells[0], line, strict=True)) for line in cells[2:]]


def bare(cell: str) -> str:
    return cell.strip("`")


def page(name: str) -> str:
    return (DOCS / f"{environments.stem(name)}.md").read_text(encoding="utf-8")


def specified(name: str, title: str) -> list[Row]:
    return rows(documentation.sections(IDS[name])[title])


def numbers(cell: str) -> np.ndarray:
    return np.array([np.inf if part == "none" else float(part) for part in cell.split(", ")])


def test_the_committed_pages_are_what_the_code_says() -> None:
    pages = environments.pages()
    assert set(pages) == {path.name for path in DOCS.glob("*.md")}
    for file, text in pages.items():
        assert text == (DOCS / file).read_text(encoding="utf-8"), f"{file}: run python -m scripts.docs.environments"


def test_every_id_has_its_moving_picture() -> None:
    pictures = {f"{environments.stem(name)}.webp" for name in IDS}
    assert pictures == {path.name for path in DOCS.glob("*.webp")}
    assert set(environments.PICTURES) == set(IDS)
    for name in pictures:
        with Image.open(DOCS / name) as picture:
            assert picture.size == (env_pictures.SIZE, env_pictures.SIZE)
            assert 20 <= picture.n_frames <= env_pictures.FRAMES  # type: ignore[attr-defined]
        assert (DOCS / name).stat().st_size < 150_000


def test_a_moving_picture_is_drawn(tmp_path: Path) -> None:
    pictures = env_pictures.frames("Reach-v0", most=2)
    assert [picture.shape for picture in pictures] == [(600, 600, 3)] * 2
    assert (pictures[0] != pictures[1]).any()
    assert len(np.unique(pictures[1].reshape(-1, 3), axis=0)) > 50
    env_pictures.write(tmp_path / "reach.webp", pictures)
    with Image.open(tmp_path / "reach.webp") as picture:
        assert picture.n_frames == 2  # type: ignore[attr-defined]
        assert picture.info["loop"] == 0


def test_help_of_a_made_environment_is_the_specification() -> None:
    env = gym.make("FlexArm/Square-v0").unwrapped
    assert inspect.getdoc(env) == DOCSTRING.strip()
    assert "\n## Description\n\nThe set-up" in DOCSTRING


def test_the_specification_builds_no_arm(monkeypatch: pytest.MonkeyPatch) -> None:
    """Importing the package must stay light."""
    for kind, method in ((FlexibleArm, "__init__"), (Settings, "__post_init__")):
        monkeypatch.setattr(kind, method, lambda *given: pytest.fail("an arm was built"))
    assert documentation.specification(FlexArmEnv.__doc__ or "").count("\n## ") > 8


def test_observation_tables(name: str, env: FlexArmEnv) -> None:
    table = specified(name, "Observation space")
    assert [bare(row["block"]) for row in table] == list(env.observation_blocks)
    high = env.observation_space.high  # type: ignore[attr-defined]
    for row, (block, part) in zip(table, env.observation_blocks.items(), strict=True):
        assert bare(row["numbers"]) == f"{part.start}:{part.stop}"
        assert row["unit"] == BLOCKS[block].unit
        physical, scale = high[part] * env.observation_scale[part], env.observation_scale[part]
        np.testing.assert_allclose(np.broadcast_to(numbers(row["bound"]), physical.shape), physical, rtol=1e-3)
        told = numbers(row["scale"]) if env.settings.scaled else np.ones(1)
        np.testing.assert_allclose(np.broadcast_to(told, scale.shape), scale, rtol=1e-3)


def test_option_tables(name: str, env: FlexArmEnv) -> None:
    """Together the defaults make the id's settings, and what has no effect is left out."""
    table = specified(name, "Options")
    defaults = {bare(row["argument"]): ast.literal_eval(bare(row["default"])) for row in table}
    assert Settings.of(defaults) == env.settings
    spec = gym.spec(f"FlexArm/{name}")
    assert {option: defaults[option] for option in spec.kwargs} == spec.kwargs
    for one in fields(Settings):
        assert (one.name in defaults) == (env.settings.action_mode in modes_reading(one.name))
        assert one.metadata["text"]


def test_a_page_is_short_and_tells_every_option_that_differs(name: str) -> None:
    text = page(name)
    assert len(text.splitlines()) <= 40
    different = section(text, "What is different from Square-v0")
    told = [bare(row["option"]) for row in rows(different)] if IDS[name].options else []
    own = IDS[name].options_of
    assert set(told) == {*IDS[name].options, *(one.name for one in (fields(own) if own else ()))}
    assert section(text, "What to beat").strip()


@pytest.mark.parametrize("name", to_beat.BY_ID)
def test_nobody_who_may_play_is_better_than_those_to_beat(name: str) -> None:
    """Of those that act as the id does, and read no more than its observation and the nominal arm's parameters."""
    settings, wanted = Settings.of(IDS[name].options), to_beat.BY_ID[name]
    allowed = {BLOCKS[block].reads for block in settings.observation} | {PLANT}
    errors = {}
    for row in to_beat.board()["rows"]:
        if row["name"] in wanted.rows or (row["action"] == settings.action_mode and set(row["reads"]) <= allowed):
            laps = to_beat.laps_of(row, wanted)
            if laps is not None:
                errors[row["name"]] = to_beat.order(laps)
    best = min(errors[row] for row in wanted.rows)
    assert best[0] <= min(errors.values())[0]
    assert best[1] <= min(errors.values())[1] + 1e-3


def test_the_site_folds_the_specification_of_an_id_and_of_nothing_else(name: str) -> None:
    folded = widgets.specification(page(name))
    assert folded.strip().startswith("<details")
    assert all(f"**{title}**" in folded for title in documentation.sections(IDS[name]))
    assert not re.search(r"^#", folded, re.MULTILINE)
    for shared in ("README.md", "options.md"):
        assert widgets.specification((DOCS / shared).read_text(encoding="utf-8")) == ""


def test_action_tables(name: str, env: FlexArmEnv) -> None:
    table = specified(name, "Action space")
    assert len(table) == len(env.settings.action_limit)
    for row, limit in zip(table, env.settings.action_limit, strict=True):
        for end, column in ((-1.0, "at a = -1"), (1.0, "at a = 1")):
            assert float(row[column]) == pytest.approx(evaluated(right_side(row["quantity"]), end, limit))
            assert evaluated(right_side(row["action"]), float(row[column]), limit) == pytest.approx(end)


def right_side(cell: str) -> str:
    return bare(cell).partition(" = ")[2]


def evaluated(formula: str, value: float, limit: float) -> float:
    """Evaluate a formula of an action table, for one channel."""
    known = {"a": value} | {mode.quantity: value for mode in MODES.values()}
    known |= {f"{option}_limit": limit for option in ("torque", "torque_rate", "shift", "gain")}
    known |= {"speed": value, "reference_speed": limit}
    return float(eval(formula, {"__builtins__": {}}, known))


@pytest.mark.parametrize(("mode", "key"), [("torque", "torque"), ("residual", "torque"), ("gain", "gain")])
def test_action_formulas_hold_in_the_environment(mode: str, key: str) -> None:
    options = {"torque_limit": (4000.0, 4000.0)} if mode == "residual" else {}  # so that the sum stays below it
    env = FlexArmEnv(action_mode=mode, start="corner", **options)
    action = np.array([0.25, -0.5], np.float32)[: env.action_space.shape[0]]  # type: ignore[index]
    found = []
    for value in (0.0 * action, action):
        env.reset(seed=0)
        found.append(np.atleast_1d(env.step(value)[4][key]))
    if mode == "residual":  # beside the inner law's own torque
        found[1] -= found[0]
    wanted = [evaluated(MODES[mode].formula, a, x) for a, x in zip(action, env.settings.action_limit, strict=True)]
    np.testing.assert_allclose(found[1], wanted, rtol=1e-9)


def test_reward_tables(name: str, env: FlexArmEnv) -> None:
    table = specified(name, "Reward")
    weights = {bare(row["term"]): float(row["weight"]) for row in table}
    assert weights == {term: weight for term, weight in env.settings.reward_weights.items() if weight > 0.0}
    env.reset(seed=0)
    _, reward, _, _, info = env.step(env.action_space.sample())
    assert set(terms_of(info)) == set(weights)
    assert sum(terms_of(info).values()) == pytest.approx(reward)


def test_info_tables(name: str, env: FlexArmEnv) -> None:
    keys, _, fields_of_it = documentation.sections(IDS[name])["Info"].partition(documentation_texts.EPISODE)
    told = [bare(row["key"]) for row in rows(keys)]
    assert list(env.reset(seed=0)[1]) == list(env.step(env.action_space.sample())[4]) == told
    described = [bare(row["field"]) for row in rows(fields_of_it)]
    assert described == list(env.episode._fields)


def test_every_reason_is_told_and_no_other(env: FlexArmEnv) -> None:
    statuses = (-5.0, -4.0, -3.0, -2.0, -1.0, *(entry + 1.0 for entry in range(env.arm.size + 2)))
    assert {env.simulator.failures[status] for status in statuses} == set(ENDS)


def test_arguments_of_a_batch() -> None:
    table = rows(section((DOCS / "README.md").read_text(encoding="utf-8"), "Make a batch"))
    own = [*inspect.signature(environments.FlexArmVectorEnv.__init__).parameters]
    assert [bare(row["argument"]) for row in table] == [name for name in own if name not in ("self", "options")]


def test_no_limit_is_told_as_none() -> None:
    assert documentation.figure(np.inf) == "none"


@pytest.mark.parametrize("name", to_beat.BY_ID)
def test_a_page_begins_with_the_best_entry_that_needs_no_true_state(name: str) -> None:
    named = set(re.findall(r"`([^`]*)`", to_beat.best(name)))
    assert not named & {row["name"] for row in to_beat.board()["rows"] if row["privileged"]}
    assert len(named) <= 2
    assert name == "Reach-v0" or named <= set(to_beat.BY_ID[name].rows)
