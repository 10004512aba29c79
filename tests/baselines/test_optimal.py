"""Optimal motion: the solver against scipy's, starts, refusals."""

from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize

from flexarm_baselines.optimal import (
    Branch,
    DivergingStartError,
    SolverOptions,
    TrackingProblem,
    along,
    follow,
    joint_path,
    lap_problem,
    optimise,
    plan_lap,
    usual_starts,
)
from flexarm_baselines.optimal import laps as lap_plans
from flexarm_baselines.optimal.adjoint import torque_gradient
from flexarm_baselines.optimal.solver import Iteration, dynamics_curvature, rollout
from flexarm_env import ArmParameters, SquareParameters
from flexarm_env.simulation.feedback import Rollout
from tests.support.late_arm import ARM, SIZE, START
from tests.support.optimal import IDLE, PERIODS, problem, solved
from tests.support.refusals import refused


def gradient(case: TrackingProblem, torques: np.ndarray) -> np.ndarray:
    run = rollout(case, torques)
    slopes, expansion, found = ARM.step_jacobians(run.states[:-1], torques), case.expand(run.states), torques.copy()
    model = slopes.by_state, slopes.by_torque, expansion.gradient, expansion.weights, case.with_torque_before(torques)
    torque_gradient(*model, np.zeros((len(torques), 2, SIZE + 2)), found, np.empty_like(run.states[1:]))
    return found


def test_it_finds_what_scipy_finds() -> None:
    case, solution = solved()
    bounds = [(-limit, limit) for _ in range(PERIODS) for limit in case.limits]

    def value(flat: np.ndarray) -> tuple[float, np.ndarray]:
        torques = flat.reshape(PERIODS, 2)
        return 1e4 * float(case.cost(rollout(case, torques))), 1e4 * gradient(case, torques).ravel()

    options = {"maxiter": 3000, "maxfun": 5000, "ftol": 1e-15, "gtol": 1e-9}
    other = minimize(value, np.zeros(2 * PERIODS), jac=True, bounds=bounds, method="L-BFGS-B", options=options)
    assert solution.converged
    assert np.all(np.diff([iteration.cost for iteration in solution.log]) < 0.0)
    assert solution.log[-1].residual <= 1e-7 < solution.log[0].residual
    np.testing.assert_allclose(solution.log[-1].cost, other.fun / 1e4, rtol=1e-7)
    np.testing.assert_allclose(solution.run.torques, other.x.reshape(PERIODS, 2), atol=0.05)
    at_limit = np.abs(solution.run.torques) == case.limits
    assert at_limit.any()
    assert not at_limit.all()


def test_the_gradient_is_that_of_the_cost() -> None:
    case = problem(
        deflection_limit=0.01,
        tip_weights=np.linspace(1.0, 2.0, PERIODS + 1),
        residuals=lambda x, t: [0.1 * x[4] * (1.0 + t)],
    )
    torques = 5.0 * np.random.default_rng(0).normal(size=(PERIODS, 2))
    found = gradient(case, torques)
    for t, k in ((0, 0), (7, 1), (PERIODS - 1, 0)):
        ends = []
        for sign in (1.0, -1.0):
            moved = torques.copy()
            moved[t, k] += sign * 1e-3
            ends.append(float(case.cost(rollout(case, moved))))
        np.testing.assert_allclose(found[t, k], (ends[0] - ends[1]) / 2e-3, rtol=1e-5)


def test_curvature_of_the_dynamics_is_a_difference_of_the_gradient() -> None:
    """Of one period: the slope at its end, held, times the end at shifted states and torques."""
    case, run = problem(), rollout(problem(), 5.0 * np.random.default_rng(0).normal(size=(PERIODS, 2)))
    slopes = ARM.step_jacobians(run.states[:-1], run.torques)
    by_end = np.random.default_rng(1).normal(size=(PERIODS, SIZE))
    found = dynamics_curvature(case, run, (slopes.by_state, slopes.by_torque), by_end)
    np.testing.assert_array_equal(found, found.swapaxes(1, 2))

    def value(z: np.ndarray) -> float:
        return float(by_end[3] @ ARM.step(z[:SIZE], z[SIZE:]))

    z, unit = np.concatenate([run.states[3], run.torques[3]]), np.eye(SIZE + 2) * ([1e-3] * SIZE + [0.1] * 2)
    for a, b in ((1, 1), (5, 7), (0, 4), (2, 8), (8, 9)):
        ends = [value(z + s * unit[a] + t * unit[b]) for s in (1.0, -1.0) for t in (1.0, -1.0)]
        exact = (ends[0] - ends[1] - ends[2] + ends[3]) / (4.0 * unit[a, a] * unit[b, b])
        np.testing.assert_allclose(found[3, a, b], exact, rtol=1e-3, atol=1e-5)


NO_TIME = Branch(1.0, "negative", 0.0)
BENT = float(np.abs(ARM.tip_deflection(solved()[1].run.states[:, :4])).max())


@pytest.mark.parametrize(
    ("changes", "figure", "share"),
    [
        ({"residuals": lambda x, t: [x[4], x[5]]}, lambda run: np.mean(run.states[:, 4:6] ** 2), 0.5),
        ({"deflection_limit": 0.5 * BENT}, lambda run: np.abs(ARM.tip_deflection(run.states[:, :4])).max(), 0.52),
        ({"change_weight": 0.1}, lambda run: np.sum(np.diff(run.torques, axis=0) ** 2), 0.2),
    ],
    ids=["residuals", "deflection", "changes"],
)
def test_what_is_weighed_more_is_made_smaller(changes: dict[str, Any], figure: Any, share: float) -> None:
    assert figure(optimise(problem(**changes), IDLE).run) < share * figure(solved()[1].run)


def test_no_iteration_returns_the_start_and_progress_is_called_for_each() -> None:
    case, seen = problem(), []
    none = optimise(case, IDLE, SolverOptions(iterations=0), seen.append)
    assert not seen
    assert not none.converged
    np.testing.assert_array_equal(none.run.torques, 0.0)
    some = optimise(case, IDLE, SolverOptions(iterations=2), seen.append)
    assert seen == list(some.log[1:])
    assert len(seen) == 2


def test_a_start_that_costs_nothing_is_best() -> None:
    found = optimise(problem(tip_weights=np.zeros(PERIODS + 1)), IDLE)
    assert found.converged
    assert found.log == (Iteration(0.0, 0.0, 0.0, 0.0),)


def test_joint_angles_are_on_the_branches_in_their_time() -> None:
    lap = lap_problem(ARM, SquareParameters(lap_time=4.0))
    joints = joint_path(lap, [Branch(0.0, "positive"), Branch(1.0, "negative", 0.5)])
    sides = np.sign(joints[:, 1])
    assert np.all(sides[:101] == 1.0)
    assert np.all(sides[151:] == -1.0)
    assert np.abs(np.diff(joints, axis=0)).max() < 0.3
    lengths = ARM.parameters.link_lengths
    angle = np.cumsum(joints, axis=1)
    tip = sum(n * np.stack([np.cos(a), np.sin(a)], axis=1) for n, a in zip(lengths, angle.T, strict=True))
    np.testing.assert_allclose(tip[151:], lap.reference[151:], atol=1e-9)


def test_the_arm_follows_a_start() -> None:
    lap = lap_problem(ARM, SquareParameters(lap_time=16.0, elbow_branch="negative"))
    run = along(lap, [Branch(0.0, "negative")])
    away = np.linalg.norm(ARM.tip(run.states[:, :4]) - lap.reference, axis=1)
    assert np.sqrt(np.mean(away**2)) < 0.1
    assert np.all(np.abs(run.torques) <= lap.limits)


def test_a_lap_is_planned_from_the_better_start() -> None:
    lap = SquareParameters(lap_time=1.6, side=6.0, elbow_branch="positive")
    trials = SolverOptions(iterations=3)
    found = plan_lap(ARM, lap, options=trials, trial=2)
    assert [note["branches"] for note in found.notes["starts"]] == [
        [branch._asdict() for branch in start] for start in usual_starts(lap)
    ]
    assert found.notes["log"]["cost"][-1] <= 1.000001 * min(note["cost"] for note in found.notes["starts"])
    assert found.states.shape == (161, SIZE)
    assert found.states[0, 1] > 0.0


test_a_bad_problem_is_refused = refused(
    ({"arm": ArmParameters.linear()}, "TypeError: must be a FlexibleArm"),
    ({"initial_state": np.zeros(7)}, r"initial_state: must have shape \(8,\)"),
    ({"reference": np.zeros((5, 3))}, r"reference: must have shape \(n, 2\)"),
    ({"reference": np.zeros((1, 2))}, "two instants"),
    ({"reference": np.full((5, 2), np.nan)}, r"reference\[0, 0\] = nan"),
    ({"limits": (0.0, 1.0)}, "limits"),
    ({"limits": (1e200, 1.0)}, "limits"),
    ({"tip_weights": np.ones(3)}, "tip_weights: must have shape"),
    ({"tip_weights": -1.0}, r"tip_weights\[0\] = -1.0: must be >= 0"),
    ({"torque_weight": 0.0}, "torque_weight = 0.0"),
    ({"torque_weight": 1e-200}, "torque_weight = 1e-200"),
    ({"change_weight": -1.0}, "change_weight = -1.0"),
    ({"torque_before": (1.0,)}, "TypeError: torque_before"),
    ({"deflection_limit": 0.0}, "deflection_limit = 0.0"),
    ({"residuals": 3}, "TypeError: residuals = 3"),
    ({"period": 0.0}, "period = 0.0"),
    by=lambda changes: TrackingProblem(
        **{"arm": ARM, "initial_state": START, "reference": np.zeros((5, 2)), **changes}
    ),
)


def test_a_start_that_diverges_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    case = problem(limits=(1e9, 1e9))
    diverging = Rollout(IDLE.states, np.full((PERIODS, 2), 1e9))
    for torques in (diverging.torques, np.full((PERIODS, 2), np.nan)):
        with pytest.raises(DivergingStartError, match="start: it diverges"):
            optimise(case, Rollout(IDLE.states, torques))
    monkeypatch.setattr(lap_plans, "optimise", lambda *_: optimise(case, diverging))
    with pytest.raises(DivergingStartError, match="all of them diverge"):
        plan_lap(ARM, SquareParameters(lap_time=0.4), starts=[[Branch(0.0, "positive")]], trial=0)


test_other_bad_input_is_refused = refused(
    (lambda: optimise(problem(), Rollout(IDLE.states, np.zeros((3, 2)))), r"start.torques: .* \(25, 2\)"),
    (lambda: SolverOptions(iterations=-1), "iterations = -1"),
    (lambda: SolverOptions(tolerance=0.0), r"tolerance = 0\.0"),
    (lambda: lap_problem(ARM, "round"), "lap = 'round': must be one of"),
    (lambda: lap_problem(ARM, "plain", period=0.3), "whole number of periods"),
    (lambda: plan_lap(ArmParameters.linear(), "plain"), "TypeError: arm = "),
    (lambda: plan_lap(ARM, "plain", starts=[]), "starts: must hold one"),
    (lambda: joint_path(problem(), []), "one at least"),
    (lambda: joint_path(problem(), [Branch(0.0, "left")]), r"branches\[0\].side = 'left'"),
    (lambda: joint_path(problem(), [Branch(1.0, "positive"), Branch(1.0, "negative")]), "times must increase"),
    (lambda: joint_path(problem(), [Branch(0.0, "positive"), NO_TIME]), r"branches\[1\].duration = 0.0"),
    (lambda: follow(problem(), np.zeros((3, 2))), r"joints: must have shape \(26, 2\)"),
)
