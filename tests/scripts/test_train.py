"""Trainings with every setting and seed, reused where finished; the median is shipped with its files and tables."""

import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from flexarm_agents import PPOConfig, StandardScore, config_of, load_policy
from flexarm_agents.files import write_json
from flexarm_agents.jobs.executors import _run_share
from flexarm_agents.policies.load import POLICIES
from scripts import train as sweep
from scripts.common.trainings import Training, trained
from scripts.shipped import board
from scripts.shipped.curves import keep_curves
from scripts.shipped.trainings import export, median
from tests.support.refusals import refuses
from tests.support.trainings import TINY, row


def test_seeds_are_numbers_and_ranges() -> None:
    assert sweep.seeds_of("7,0-2,1") == [0, 1, 2, 7]
    for text in ("", "a", "3-1", "1-", "-1", "1.5"):
        with refuses(ValueError, "seeds", "numbers and ranges"):
            sweep.seeds_of(text)


def test_a_sweep_has_all_combinations_and_each_its_folder() -> None:
    settings = sweep.settings_of({"learning_rate": [1e-3, 2e-3], "options": [{}, {"noise": 0.01}]}, PPOConfig())
    assert len(settings) == 4
    jobs = sweep.jobs_of(PPOConfig(), settings, [0, 1], Path("out"))
    assert len({folder for _, folder in jobs}) == 8
    assert {config.learning_rate for config, _ in jobs} == {1e-3, 2e-3}
    (one, folder), *_ = sweep.jobs_of(PPOConfig(), [{}], [0], Path("out"))
    assert (one, folder.parent) == (PPOConfig(), sweep.jobs_of(one, [{}], [5], Path("out"))[0][1].parent)
    with refuses(ValueError, "sweep['envs'] = 3", "a list"):
        sweep.settings_of({"envs": 3}, PPOConfig())
    for name in ("learning_rates", "seed"):
        with refuses(TypeError, name):
            sweep.settings_of({name: [1]}, PPOConfig())


def test_finished_trainings_are_taken_over_and_a_failed_one_hides_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "sweep.json").write_text(json.dumps({"learning_rate": [1e-3, 2e-3]}))

    def here(function: Callable[[Any], Any], jobs: Sequence[Any], stoppable: bool) -> Iterator[tuple[int, Any]]:
        assert stoppable
        return reversed([*enumerate(_run_share(function, jobs))])

    monkeypatch.setattr(sweep, "executor", lambda *given: SimpleNamespace(run=here))
    base = PPOConfig(**TINY | {"steps": 128})  # one rollout, one evaluation
    options = sweep.Options("0-1", tmp_path / "sweep.json", tmp_path / "out")
    monkeypatch.setattr(sweep, "read", lambda: (base, options))
    sweep.main()
    rows = json.loads((tmp_path / "out" / "trainings.json").read_text())["settings"]
    assert [row["setting"] for row in rows] == [{"learning_rate": 1e-3}, {"learning_rate": 2e-3}]
    assert [one["seed"] for row in rows for one in row["trainings"]] == [0, 1, 0, 1]
    assert capsys.readouterr().out.count("| learning_rate = ") == 2
    folders = [Path(one["folder"]) for row in rows for one in row["trainings"]]
    before = [(folder / "checkpoint.zip").stat().st_mtime_ns for folder in folders]
    written = json.loads((folders[3] / "config.json").read_text())
    (folders[3] / "config.json").write_text(json.dumps(written | {"envs": 8}))  # another training is there
    with refuses(OSError, "1 failed", "the other trainings are kept"):
        sweep.main()
    assert [(folder / "checkpoint.zip").stat().st_mtime_ns for folder in folders] == before
    again = json.loads((tmp_path / "out" / "trainings.json").read_text())["settings"]
    assert again[0] == rows[0]
    assert [one["seed"] for one in again[1]["trainings"]] == [0]


def training(seed: int, rms: float | None) -> Training:
    return Training(config_of(**{**TINY, "seed": seed}), Path("nowhere"), row(1, rms, rms))


def test_the_median_is_in_the_middle_and_early_ends_are_last() -> None:
    five = [training(seed, rms) for seed, rms in enumerate((0.3, None, 0.1, 0.2, None))]
    assert median(five).config.seed == 0
    assert median(five[2:3]).config.seed == 2
    assert median(five[:4]).config.seed == 0  # of seeds 3 and 0


def test_a_finished_training_is_shipped_with_its_card(tmp_path: Path) -> None:
    config = config_of(**TINY)
    first = trained(config, tmp_path / "run")
    again = trained(config, tmp_path / "run")  # taken over
    assert again == first
    figures = {"unknown": {"swing": {"lost": 3}}}
    export([first], [figures], tmp_path, "mine", "a command")
    card = json.loads((tmp_path / "mine.json").read_text())
    assert card["choice"] == "the median of 1 trainings that differ in their seeds, by the mean r.m.s. of both laps"
    assert (card["command"], card["config"], card["evaluation"]) == ("a command", config.plain(), first.best)
    assert sum(card["observes"].values()) == load_policy(tmp_path / "mine.npz").policy.observation_size
    of_one = card["spread"]["plain"]["rms"]
    assert of_one["median"] == of_one["interquartile_mean"] == of_one["worst"] == first.best["plain"]["rms"]
    assert card["trainings"] == [{"seed": 0, **first.best, "board": figures}]
    export([first], [], tmp_path, "elsewhere", "a command")  # its arm is not the board's
    assert json.loads((tmp_path / "elsewhere.json").read_text())["trainings"] == [{"seed": 0, **first.best}]
    notes = load_policy(tmp_path / "mine.npz").notes
    assert (notes["config"], notes["evaluation"]) == (config.plain(), first.best)
    assert card["versions"] == notes["versions"] == json.loads((tmp_path / "run" / "versions.json").read_text())


def test_a_training_of_another_version_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the environments have changed since, its best policy scores otherwise."""
    config = config_of(**TINY)
    trained(config, tmp_path / "run")
    elsewhere = training(0, 0.1)
    monkeypatch.setattr("scripts.common.trainings.evaluate", lambda *given: StandardScore.of(elsewhere.best))
    with refuses(ValueError, "run: its best policy scored swing lap: lost", "remove the folder"):
        trained(config, tmp_path / "run")


def test_curves_are_kept(tmp_path: Path) -> None:
    """Of all agents, those that were not trained now included; a lost lap has no error."""
    laps = [row(100 * n, rms, rms) for n, rms in enumerate((None, 0.2, 0.1), 1)]
    found = [Training(config_of(seed=seed), tmp_path / "mine" / f"seed-{seed}", laps[-1]) for seed in range(2)]
    for one in found:
        one.folder.mkdir(parents=True)
        write_json(one.folder / "evaluations.json", laps)
    keep_curves({"first": found}, tmp_path)
    keep_curves({"second": found[:1]}, tmp_path)
    data = json.loads((tmp_path / "curves.json").read_text())
    assert list(data) == ["first", "second"]
    assert data["first"][1] == {
        "seed": 1,
        "steps": [100, 200, 300],
        "seconds": [1.0, 1.0, 1.0],
        "swing": [None, 0.2, 0.1],
        "plain": [None, 0.2, 0.1],
    }
    assert (tmp_path / "curves.png").stat().st_size > 10_000


def test_agents_stand_beside_controllers() -> None:
    """With all seeds that were measured."""
    card = json.loads((POLICIES / "student.json").read_text())
    rows, _ = board.published()
    card["trainings"] = [{"board": rows[f"agent {name}"]} for name in ("student", "student_unknown", "student_unknown")]
    lines = dict(board.compared({"student": card}))
    assert lines["`lqg`"] == [rows["lqg"]]
    figures = lines["agent `student`"]
    assert figures == [one["board"] for one in card["trainings"]]
    line = board.unknown({"student": card}).splitlines()[-1]
    lost = [sum(lap["lost"] for lap in one["unknown"].values()) for one in figures]
    assert line.startswith(f"| agent `student` | 3 | {lost[1]} / {sum(lost) / 3:.0f} / {lost[0]} |")
