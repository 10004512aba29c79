"""The studies of controllers, learning and the linear arm: what is run is kept, and pages have what a trial gives."""

import json
from collections.abc import Iterator
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from matplotlib import pyplot as plt

from flexarm_agents import DAggerConfig, PPOConfig, StandardScore, evaluate
from flexarm_agents.environments import make_batch, make_one
from flexarm_agents.evaluation.scoring import rank
from flexarm_agents.training.config import config_of, read_config
from flexarm_agents.training.loop import EVALUATION_SEED
from flexarm_baselines.registry import CONTROLLERS
from flexarm_env.envs.settings import Settings
from flexarm_env.envs.vector import FlexArmVectorEnv
from scripts.analysis import figures, margins, passivity, simulated, tables, zeros
from scripts.analysis.__main__ import STUDIES as OF_ANALYSIS
from scripts.common.markdown import DOCS, shown_blocks
from scripts.common.study import Trials, run_all
from scripts.control.__main__ import STUDIES
from scripts.control.filtered import safety_filter_table
from scripts.control.trials import cell, run_laps
from scripts.learning import forecast, inverse
from scripts.learning import train as learning
from scripts.learning.__main__ import STUDIES as OF_LEARNING
from tests.support.refusals import refuses
from tests.support.trainings import TINY


@pytest.mark.parametrize("name", STUDIES)
def test_every_table_stands_on_a_page(name: str) -> None:
    for block in STUDIES[name].tables:
        assert len(shown_blocks()[block].splitlines()) > 3


def test_the_page_has_every_controller_with_the_scores_of_its_laps() -> None:
    lines = shown_blocks()["registered"].splitlines()[2:]
    rows = {cells[1].strip(" `"): cells for cells in (line.split("|") for line in lines)}
    assert list(rows) == [name for name, one in CONTROLLERS.items() if one.environment != "FlexArm/Race-v0"]
    assert [one.strip() for one in rows["ifdc"][4:6]] == [cell(lap, 1) for lap in run_laps("ifdc").values()]


def test_a_lost_lap_is_infinite_among_the_errors_behind_a_filter() -> None:
    errors = [[0.01 * n, 0.0] for n in range(1, 10)]
    lines = safety_filter_table({"0.4": {"unknown": [*errors, None], "acts": 0.21}}).splitlines()
    assert [one.strip() for one in lines[-1].split("|")[1:-1]] == ["0.4", "1 of 10", "60", "lost", "21%"]


def score(duration: float, error: float | None) -> dict[str, Any]:
    return {"complete": error is not None, "duration": duration, "rms": error, "rms_after_2s": error}


def test_a_lost_lap_has_the_median_time_of_its_draws() -> None:
    lost = [score(duration, None) for duration in (3.0, 11.0, 2.0)]
    assert cell(lost) == "lost at 3.0 s (2.0 to 11.0)"
    assert cell(lost[:1]) == "lost at 3.0 s"
    assert cell([lost[0], score(16.0, 0.02)]) == "lost 1 of 2 at 3.0 s"
    assert cell([score(16.0, 0.02)], 1) == "20.0 / 20.0"


DONE: list[int] = []


def counted(value: int) -> dict[str, int]:
    DONE.append(value)
    return {"square": value**2}


def test_trials_are_run_once(tmp_path: Path) -> None:
    """Those that a run has finished are not run again; other code makes all of them anew."""
    first = Trials("scripts.control.trials", lambda: {"two": partial(counted, 2)})
    both = Trials("scripts.control.trials", lambda: {"three": partial(counted, 3), "two": partial(counted, 2)})
    assert first(tmp_path, 1) == {"two": {"square": 4}}
    assert both(tmp_path, 1) == {"three": {"square": 9}, "two": {"square": 4}}
    assert DONE == [2, 3]
    kept = json.loads((tmp_path / "results.json").read_text())
    (tmp_path / "results.json").write_text(json.dumps(kept | {"code": "another"}))
    assert both(tmp_path, 1) == {"three": {"square": 9}, "two": {"square": 4}}
    assert DONE == [2, 3, 3, 2]


def test_workers_run_trials() -> None:
    """Python's own functions: for one of this module, each worker would import all that the module does."""
    trials = {"two": partial(divmod, 7, 2), "three": partial(divmod, 7, 3)}
    assert dict(run_all(trials, 2, "quotients")) == {"two": (3, 1), "three": (2, 1)}
    with pytest.raises(ZeroDivisionError):
        list(run_all(trials | {"none": partial(divmod, 7, 0)}, 2, "quotients"))


@pytest.mark.parametrize("name", OF_LEARNING)
def test_the_pages_have_what_the_data_say(name: str, tmp_path: Path) -> None:
    study = OF_LEARNING[name]
    agents = study.results(tmp_path, 1)
    for block, tabulate in study.tables.items():
        assert tabulate(agents) == shown_blocks()[block]
    for picture, draw in study.pictures.items():
        figure = draw(agents)
        assert all(axis.lines for axis in figure.axes)
        plt.close(figure)
        assert (DOCS / "figures" / f"{picture}.png").is_file()


def test_a_forecast_is_learned_beside_the_policy() -> None:
    """The best policy keeps the forecast that it was judged with."""
    made = config_of(**TINY | {"environment": "FlexArm/SquareDelayMedium-v0", "options": {}, "lags": [1, 3]})
    assert isinstance(made, PPOConfig)
    policy, score, rows = forecast.trained(made)
    assert [row["steps"] for row in rows] == [256, 512]
    encoder = policy.encoder
    assert isinstance(encoder, forecast.Forecaster)
    with make_one(made.environment, made.options) as env:
        assert evaluate(env, policy, EVALUATION_SEED) == score
    random = np.random.default_rng(0)
    inputs = random.standard_normal((512, encoder.inputs), dtype=np.float32)
    present = np.tanh(inputs[:, : encoder.inputs - encoder.readings])

    def error() -> float:
        found = encoder.network(torch.from_numpy(inputs[:, : encoder.readings])).detach().numpy()
        return float(np.square(found - present).mean())

    before = error()
    for _ in range(20):
        encoder.learn(inputs, present)
    assert error() < 0.5 * before


@pytest.fixture
def driven() -> Iterator[FlexArmVectorEnv]:
    options = {**inverse.INTERFACE, "previews": [0.02, 0.05], "start": "corners"}
    with closing(make_batch("FlexArm/SquareDelayEasy-v0", 2, options)) as env:
        yield env


def test_an_inverse_model_sees_deflections_and_goals_from_its_first_link(driven: FlexArmVectorEnv) -> None:
    """The elbow is at a right angle; the tip is off by 0.1 m, and the target moves along the first link."""
    encoder = inverse.GoalEncoder.of(driven.settings, (1, 2, 3, 4))
    for turn in (0.0, 1.0, -2.5):
        along = np.exp(1j * turn)
        tip = (4.5 + 4.5j) * along
        points = [tip + 0.1j * along, 0.0, tip, 0.3 * along, 0.6 * along]  # read, no torques, target, its way
        vectors = np.array([turn + 0.5j * np.pi, 0.0, *points]).view(float)
        inputs = encoder.reset(vectors[None].astype(np.float32))[0][0]
        assert inputs[:4] == pytest.approx([0.0, 1.0, 0.0, 0.0], abs=1e-6)
        assert inputs[12:16] == pytest.approx([0.0, 0.1] * 2, abs=1e-5)  # ages 0 and 1 show the moments 3 and 4 ago
        assert inputs[-4:] == pytest.approx([0.3, 0.0, 0.6, 0.0], abs=1e-5)


def test_an_inverse_model_refuses_what_it_cannot_see(driven: FlexArmVectorEnv) -> None:
    with refuses(ValueError, "lags = (1, 2): "):
        inverse.GoalEncoder.of(driven.settings, (1, 2))
    with refuses(ValueError, "frame = 'link': must be 'world'"):
        inverse.GoalEncoder.of(Settings.of({**inverse.INTERFACE, "frame": "link"}), (1, 2, 3))


def test_an_inverse_model_learns_what_led_to_a_goal(driven: FlexArmVectorEnv, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(inverse, "PERIODS", 20)
    encoder = inverse.GoalEncoder.of(driven.settings, (1, 2, 3, 4))
    made = inverse.rollout(driven, encoder, None, 0.3, np.random.default_rng(1))
    assert made.observations.shape == (2 * 15, encoder.inputs)  # for 5 periods there is no last goal
    _, infos = driven.reset(seed=int(np.random.default_rng(1).integers(2**31)))
    angles, tips = infos["state"][:, :2], []
    for actions in made.answers.reshape(15, 2, 2):
        tips.append(infos["true_tip"] @ (1.0, 1.0j))
        infos = driven.step(actions.astype(np.float32))[-1]
    goals = encoder.seen(angles, angles[:, None], np.stack([tips[2], tips[5]], axis=1))
    np.testing.assert_allclose(made.observations[:2, -4:], goals, atol=1e-5)


def test_the_best_inverse_model_of_a_training_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(inverse, "PERIODS", 30)
    found = json.loads(learning.file("delays").read_text())["known-inverse"]["config"]
    small = {"arms": 4, "rounds": 3, "updates": 5, "batch": 16, "hidden": [8], "evaluation_laps": 1}
    made = read_config(found | small | {"options": found["options"] | {"previews": [0.02, 0.05]}})
    assert isinstance(made, DAggerConfig)
    policy, score, rows = inverse.trained(made)
    assert [row["steps"] for row in rows] == [4 * 30 * rollouts for rollouts in (4, 5, 6)]
    assert rank([score]) == min(rank([StandardScore.of(row)]) for row in rows)
    with make_one(made.environment, made.options) as env:
        assert evaluate(env, policy, EVALUATION_SEED) == score


def test_each_agent_in_the_data_can_be_trained_anew() -> None:
    for study in learning.STUDIES:
        for name, agent in json.loads(learning.file(study).read_text()).items():
            assert read_config(agent["config"]).seed == 0, name


def test_agents_in_the_data_are_trained_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Those that are named; what a training was is kept while its configuration and the code are the same."""
    tiny = config_of(**TINY).plain()
    known = {"config": tiny, "seconds": 3.0, "trainings": []}
    data = {"delays": {"mine": known, "other": known}, "reward": {"theirs": known}, "teaching": {}}
    for study, agents in data.items():
        (tmp_path / f"{study}.json").write_text(json.dumps(agents))
    monkeypatch.setattr("scripts.learning.train.FOLDER", tmp_path)
    monkeypatch.setattr("scripts.learning.train.DELAYS", (0, 31))

    def trained(*options: str) -> dict[str, Any]:
        monkeypatch.setattr("sys.argv", ["train", "--only", "mine", "--output", str(tmp_path / "runs"), *options])
        learning.main()
        return json.loads((tmp_path / "delays.json").read_text())

    with refuses(ValueError, "seeds = 0"):
        trained()
    first = trained("--seeds", "2")
    assert first["other"] == known
    assert json.loads((tmp_path / "reward.json").read_text()) == data["reward"]
    assert first["mine"]["config"] == tiny
    assert [one["seed"] for one in first["mine"]["trainings"]] == [0, 1]
    for one in first["mine"]["trainings"]:
        assert one["curve"]["steps"] == [256, 512]
        assert {lap: len(errors) for lap, errors in one["measured"]["errors"].items()} == {"swing": 2, "plain": 2}
    assert trained() == first  # as many as there are
    (tmp_path / "runs" / "results.json").unlink()
    assert trained() == first  # the time is that of the trainings
    first["mine"]["config"]["learning_rate"] = 1e-4
    (tmp_path / "delays.json").write_text(json.dumps(first))
    with refuses(ValueError, "learning_rate = 0.0001: the training in "):
        trained()


def prose() -> str:
    return " ".join((DOCS / "analysis.md").read_text().split())


def assert_on_page(block: str, text: str) -> None:
    shown = shown_blocks()[block].splitlines()
    lines = text.splitlines()
    assert len(lines) > 2
    assert [line for line in lines if line not in shown] == [], f"{block}: run python -m scripts.analysis --docs"


def test_the_page_has_the_slowest_zeros() -> None:
    models = {"1 mode, undamped": zeros.undamped(1), "2 modes, undamped": zeros.undamped(2)}
    found = {"zeros": {"by_model": zeros.by_model(models), "locus": zeros.locus(models, 4)}}
    assert_on_page("zeros_by_model", tables.zeros_by_model(found))
    one, exact = found["zeros"]["by_model"][0], found["zeros"]["by_model"][-1]["zero"]
    assert found["zeros"]["locus"]["exact link 1"][0] == pytest.approx(exact)
    for sentence in (
        f"tanh z = 0: {exact:.2f} rad/s",
        f"at {one['entries'][0]:.2f} m, {100 * one['entries'][0] / 4.5:.0f} % of the link",
    ):
        assert sentence in prose()
    plt.close(figures.zeros_locus(found))


def test_the_page_says_where_the_law_is_active() -> None:
    found = {"passivity": passivity.study(20, 1)}
    plt.close(figures.passivity(found))
    law = found["passivity"]["law"]
    assert f"Kd / Kp = {1e3 * law['longest_passive_delay']:.0f} ms" in prose()
    assert f"from {law['active_from']:.0f} rad/s on" in prose()


@pytest.fixture(scope="module")
def linear() -> dict[str, Any]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(margins, "SENSORS", {"end effector": margins.SENSORS["end effector"]})
        rows = margins.rows(["paper's arm"], ["IFDC"])
    return {"rows": rows, "by_modes": margins.by_modes((2,)), "largest_gains": margins.largest_gains([], (1,))}


def test_the_page_has_the_margins(linear: dict[str, Any]) -> None:
    results = {"linear": linear}
    assert_on_page("margins_by_modes", tables.margins_by_modes(results))
    assert_on_page("largest_gains", tables.largest_gains(results))
    late, rates = linear["rows"]
    assert (late["delayed"], rates["delayed"]) == margins.DELAYED
    for sentence in (
        f"{1e3 * late['corner']['delay_margin']:.0f} to {1e3 * late['mid-side']['delay_margin']:.0f} ms for IFDC",
        f"{1e3 * rates['corner']['delay_margin']:.2f} to {1e3 * rates['mid-side']['delay_margin']:.2f} ms",
    ):
        assert sentence in prose()


def test_one_simulated_case_diverges_where_the_linear_theory_says(linear: dict[str, Any]) -> None:
    """A push of the held arm, with late rates, which fail fast."""
    own = next(row["corner"] for row in linear["rows"] if row["delayed"] == "position+rate")
    step = simulated.step(own["delay_margin"], own["omega"])
    test = simulated.held_diverges("end effector", "position+rate", 1.0, margins.PLACES["corner"], step)
    found = test(own["delay_margin"] * np.geomspace(0.8, 1.25, simulated.LANES))
    assert not found[0]
    assert found[-1]


@pytest.mark.slow
def test_all_tables_are_those_of_the_page(tmp_path: Path) -> None:
    for name, study in OF_ANALYSIS.items():
        results = study.results(tmp_path / name, 1)
        for block, tabulate in study.tables.items():
            assert tabulate(results) == shown_blocks()[block]
        for draw in study.pictures.values():
            plt.close(draw(results))
        if name == "margins":
            worst = max(
                abs(end / row[place]["delay_margin"] - 1.0)
                for row in results["linear"]["rows"]
                for case in results.values()
                for place in margins.PLACES
                if "lap" in case and row["arm"] == "paper's arm"
                if all(row[key] == case[key] for key in ("sensor", "delayed", "controller"))
                for end in case[place]
            )
            assert f"within {100.0 * worst:.1f} %" in prose()
