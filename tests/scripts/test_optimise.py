"""`python -m scripts.optimise` in short, the plans that it left in the package, LQG's design for a set of plants."""

import json
from copy import copy
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from flexarm_baselines.lqg import LQG, QUICK
from flexarm_baselines.optimal import GOOD, Plan, lap_problem, lap_square, load_plan, plan_names
from flexarm_baselines.optimal.plan import PLANS
from flexarm_env.physics.paths import PATHS
from scripts.common.markdown import shown_blocks
from scripts.control import robust
from scripts.control.robust import FOUND, Design, decay, decays, nominal_task, plants
from scripts.optimise.corner import BLEND, CHANGES, changed_lap
from scripts.optimise.race import PERIOD, Race
from scripts.optimise.score import score
from scripts.optimise.search import _earlier, sequences
from scripts.optimise.tables import TABLES, parts, plan_name, published
from scripts.optimise.tracks import TRACKS
from tests.support.programs import run_study

run_script = partial(run_study, "optimise")


def test_every_sequence_of_branches_is_tried() -> None:
    found = dict(sequences("positive", 16.0))
    assert len(found) == 16
    assert all(name[0] == "+" for name in found)
    assert [branch.side for branch in found["+----"]] == ["positive", "negative"]
    assert [branch.since for branch in found["++-+-"]] == [0.0, 3.8, 7.8, 11.8]
    assert len(found["+++++"]) == 1
    assert list(dict(sequences("negative", 16.0, 1))) == ["-+", "--"]


def test_changed_laps_are_as_fast_and_blended_corners_are_followed_smoothly() -> None:
    for change in CHANGES:
        problem = changed_lap(change)
        speed = np.linalg.norm(np.diff(problem.reference, axis=0), axis=1) / problem.period
        assert speed.max() == pytest.approx(12.6 / 4.0, rel=1e-3), change.text
        turns = np.linalg.norm(np.diff(problem.reference, 2, axis=0), axis=1) / problem.period**2
        sharp = turns > 1.5 * np.sqrt(2.0) * speed.max() / BLEND  # the mean of a corner turns at a constant rate
        assert sharp.any() != change.blend, change.text


@pytest.mark.parametrize("path", PATHS)
def test_names_of_plans_tell_arm_path_and_lap(path: str) -> None:
    assert parts(plan_name("default", path, "swing")) == ("default", path, "swing")


def test_a_plan_of_another_problem_is_not_reused(tmp_path: Path) -> None:
    plan = load_plan("linear_plain")
    plan.save(tmp_path / "plan.npz")
    problem = lap_problem(plan.arm, "plain")
    assert _earlier(tmp_path / "plan.npz", problem, {}) is not None
    others = ({"limits": (75.0, 25.0)}, {"reference": problem.reference + 1e-3}, {"period": 0.02})
    for other in others:
        assert _earlier(tmp_path / "plan.npz", replace(problem, **other), {}) is None
    assert _earlier(tmp_path / "plan.npz", problem, {"deflection_limit": 0.1}) is None


@pytest.mark.slow
def test_a_short_run_goes_on_where_it_was(tmp_path: Path) -> None:
    effort = ("--trial", "1", "--iterations", "1")
    arguments = (*effort, "--arms", "linear", "--paths", "square", "--laps", "plain", "--output", str(tmp_path))
    first = run_script(*arguments)
    assert first.returncode == 0, first.stderr
    plan, report = Plan.load(tmp_path / "linear_plain.npz"), json.loads((tmp_path / "linear_plain.json").read_text())
    assert len(report["costs_by_branches"]) == 16
    assert report["cost"] == min(report["costs_by_branches"].values())
    kept = {path: path.stat().st_mtime_ns for path in (tmp_path / "linear_plain").iterdir()}
    assert len(kept) == 17
    damaged = tmp_path / "linear_plain" / "trial-----.npz"
    damaged.write_bytes(b"cut short")
    second = run_script(*arguments)
    assert second.returncode == 0, second.stderr
    again = {path: path.stat().st_mtime_ns for path in (tmp_path / "linear_plain").iterdir()}
    assert {path for path in kept if kept[path] != again[path]} == {damaged}
    np.testing.assert_array_equal(Plan.load(tmp_path / "linear_plain.npz").torques, plan.torques)


@pytest.mark.parametrize("name", plan_names())
def test_a_plan_of_the_package_is_whole(name: str) -> None:
    """Its states are of the lap, its tips are as far from the reference as its report says."""
    plan, report = load_plan(name), json.loads((PLANS / f"{name}.json").read_text())
    _, path, lap = parts(name)
    np.testing.assert_array_equal(plan.reference, TRACKS[path].problem(plan.parameters, lap).reference)
    away = np.linalg.norm(plan.arm.tip(plan.states[:, : plan.arm.size]) - plan.reference, axis=1)
    assert np.sqrt(np.mean(away**2)) == pytest.approx(report["score"]["true_tip_rms"], rel=1e-3, abs=1e-6)
    assert np.sqrt(np.mean(away[200:] ** 2)) == pytest.approx(
        report["score"]["true_tip_rms_after_2s"], rel=1e-3, abs=1e-6
    )
    assert np.all(np.abs(plan.torques) <= plan.limits)
    assert np.sign(plan.states[0, 1]) == (1.0 if lap_square(lap).elbow_branch == "positive" else -1.0)
    assert report["residual"] < 0.1
    assert plan.notes["log"] == report["log"]
    assert max(path.stat().st_size for path in PLANS.glob(f"{name}.*")) < 1_000_000


def test_the_page_shows_the_plans_of_the_package() -> None:
    for name, tabulate in TABLES.items():
        assert shown_blocks()[name] == tabulate(published(PLANS))


@pytest.mark.slow
@pytest.mark.parametrize("name", plan_names())
def test_a_plan_of_the_package_replays_to_its_score(name: str) -> None:
    plan, report = load_plan(name), json.loads((PLANS / f"{name}.json").read_text())
    np.testing.assert_allclose(plan.replay().states, plan.states, atol=1e-6)
    _, path, lap = parts(name)
    again = score(plan, lap, TRACKS[path].options)
    for figure in ("true_tip_rms", "true_tip_rms_after_2s", "true_tip_max"):
        assert again[figure] == pytest.approx(report["score"][figure], abs=5e-5), figure


def test_a_slower_race_has_the_speeds_of_the_fast_one_divided() -> None:
    """Speeds by a factor and accelerations by its square: the same way in that many times the time."""
    race = Race()
    fast, slow = (race.lap_times(race.begin(slower)) for slower in (1.5, 3.0))
    np.testing.assert_allclose(slow, 2.0 * np.array(fast), atol=4.0 * PERIOD)


@pytest.fixture(scope="module")
def shipped() -> LQG:
    """Design it along one plan; deviations from the other one decay as fast."""
    return LQG(nominal_task(), [load_plan("default_plain")])


@pytest.mark.parametrize("scale", [0.5, 2.0])
def test_decay_is_that_of_the_slower_part(shipped: LQG, monkeypatch: pytest.MonkeyPatch, scale: float) -> None:
    """Where the plant is the model, errors of the estimate and deviations under the true state go on by themselves."""
    controller = copy(shipped)
    gain = scale * controller.regulator.gain  # twice the gain is too much for torques that are held
    controller.regulator = replace(controller.regulator, gain=gain)
    box = {"payload_mass": 0.0, "stiffness": 1.0, "damping": 0.01, "actuation_delay": 0.0}
    box["delay"] = controller.task.delay
    monkeypatch.setattr(robust, "BOX", {name: (value, value) for name, value in box.items()})
    (plant,) = plants(controller.task, controller.plans, 1)
    parts = {"state": np.ones(plant.matrix.shape[-1]), "error": np.ones(plant.matrix.shape[-1])}
    logs = dict.fromkeys(parts, 0.0)
    known = controller.filter.matrix.shape[-1]
    for k in range(robust.FIRST, robust.LAST):
        matrix, by_torque = plant.matrix[0, k], plant.by_torque[0, k]
        parts["state"] = matrix @ parts["state"] + by_torque @ gain[0, k, :, :known] @ parts["state"][:known]
        parts["error"] = matrix @ (parts["error"] - controller.filter.gain[0, k] @ parts["error"][plant.rows])
        for name, part in parts.items():
            logs[name] += np.log(np.linalg.norm(part))
            parts[name] = part / np.linalg.norm(part)
    slower = -max(logs.values()) / (0.01 * (robust.LAST - robust.FIRST))
    assert decay(controller, plant, 0) == pytest.approx(slower, abs=0.2)  # a transient of a factor of five in 8 s
    assert (slower > 0.0) == (scale < 1.0)


def test_the_shipped_design_damps_deviations_on_other_plants_of_the_box(shipped: LQG) -> None:
    quick = LQG(shipped.task, shipped.plans, noise=QUICK, weights=GOOD)
    others = plants(shipped.task, shipped.plans, 4, seed=10)
    assert decays(shipped, others).min() > 0.0
    assert np.mean(decays(quick, others).min(axis=1) < 0.0) > 0.3


def test_the_shipped_design_is_the_one_that_was_found_in_round_numbers() -> None:
    found, shipped = FOUND.arguments(), {"noise": robust.NOISE, "weights": robust.WEIGHTS}
    for name in ("joint_angle", "joint_rate", "torque"):
        assert getattr(shipped["noise"], name) == pytest.approx(getattr(found["noise"], name), rel=0.15)
    assert shipped["weights"].speed == pytest.approx(found["weights"].speed, rel=0.15)
    assert Design().towards(FOUND, 1.0) == pytest.approx(FOUND)
