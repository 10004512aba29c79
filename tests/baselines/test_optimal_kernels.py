"""The solver's sweeps: against dense solutions of the same quadratic problems, and differences."""

from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from flexarm_baselines.optimal import kernels
from flexarm_baselines.optimal.adjoint import torque_gradient
from flexarm_baselines.optimal.sweep import CostToGo, sweep

N, SIZE = 6, 4
small = st.floats(-3.0, 3.0)


class Linear(kernels.Model):
    """A time-varying linear-quadratic problem about a trajectory: x_(t+1) = A x + B u + defect."""

    @classmethod
    def drawn(cls, seed: int) -> "Linear":
        rng = np.random.default_rng(seed)
        roots, bends = rng.normal(size=(N + 1, 2, SIZE)), rng.normal(size=(N, 2, SIZE + 2))
        return cls(
            np.eye(SIZE) + 0.3 * rng.normal(size=(N, SIZE, SIZE)),
            rng.normal(size=(N, SIZE, 2)),
            rng.normal(size=(N + 1, SIZE)),
            roots.swapaxes(1, 2) @ roots,
            rng.uniform(0.1, 1.0, size=(2, 2)),
            rng.normal(size=(N + 1, 2)),
            0.1 * rng.normal(size=(N, SIZE)),
            0.1 * bends.swapaxes(1, 2) @ bends,
        )

    def cost(self, changes: np.ndarray) -> Any:
        x, total = np.zeros(SIZE), 0.0
        torques = self.torques.copy()
        torques[1:] += changes
        for t in range(N + 1):
            total += self.gradient[t] @ x + 0.5 * x @ self.hessian[t] @ x
            if t < N:
                z = np.concatenate([x, changes[t]])
                total += 0.5 * z @ self.curvature[t] @ z
                total += self.weights[0] @ torques[t + 1] ** 2
                total += self.weights[1] @ (torques[t + 1] - torques[t]) ** 2
                x = self.by_state[t] @ x + self.by_torque[t] @ changes[t] + self.defects[t]
        return total

    def dense(self) -> tuple[np.ndarray, np.ndarray]:
        """Return gradient and Hessian of the cost by all changes; the cost is quadratic, so differences are exact."""
        unit = np.eye(2 * N).reshape(2 * N, N, 2)
        at = self.cost(np.zeros((N, 2)))
        plus, minus = (np.array([self.cost(sign * e) for e in unit]) for sign in (1.0, -1.0))
        both = np.array([[self.cost(a + b) for b in unit] for a in unit])
        return 0.5 * (plus - minus), both - plus[:, None] - plus[None] + at


def applied(problem: Linear, forward: np.ndarray, gains: np.ndarray) -> np.ndarray:
    """Return changes of the torques when steps and gains act on the linear system."""
    x, before, changes = np.zeros(SIZE), np.zeros(2), []
    for t in range(N):
        before = forward[t] + gains[t] @ np.concatenate([x, before])
        changes.append(before)
        x = problem.by_state[t] @ x + problem.by_torque[t] @ before + problem.defects[t]
    return np.array(changes)


@settings(max_examples=20)
@given(st.integers(0, 10_000))
def test_a_sweep_solves_the_linear_quadratic_problem(seed: int) -> None:
    problem = Linear.drawn(seed)
    gradient, hessian = problem.dense()
    exact = -np.linalg.solve(hessian, gradient).reshape(N, 2)
    found = sweep(problem)
    np.testing.assert_allclose(applied(problem, found.forward, found.gains), exact, rtol=1e-6, atol=1e-7)


def test_a_sweep_over_the_first_half_meets_the_cost_to_go_of_the_second() -> None:
    """Bellman's principle: with what follows as a cost beyond the end, half a run has the whole run's steps."""
    problem, half = Linear.drawn(3), N // 2
    whole = sweep(problem)
    own = problem._replace(**{name: table[:half] for name, table in problem._asdict().items() if name != "weights"})
    # the cost of the instant where the halves meet is in what follows
    nothing = {name: np.concatenate([(part := getattr(own, name)), 0.0 * part[:1]]) for name in ("gradient", "hessian")}
    own = own._replace(torques=problem.torques[: half + 1], **nothing)
    found = sweep(own, beyond=CostToGo(whole.slopes[half], whole.curvatures[half]))
    np.testing.assert_allclose(found.forward, whole.forward[:half])
    np.testing.assert_allclose(found.gains, whole.gains[:half])
    np.testing.assert_allclose(found.slopes, whole.slopes[: half + 1], atol=1e-9)
    np.testing.assert_allclose(found.curvatures, whole.curvatures[: half + 1], atol=1e-9)


def test_it_expects_the_decrease_that_comes() -> None:
    problem = Linear.drawn(1)._replace(defects=np.zeros((N, SIZE)))
    forward, gains, *_, (slope, curve) = sweep(problem)
    change = problem.cost(applied(problem, forward, gains)) - problem.cost(np.zeros((N, 2)))
    np.testing.assert_allclose(slope + curve, change, rtol=1e-9)
    np.testing.assert_allclose(slope, -2.0 * curve, rtol=1e-9)


def test_motors_that_do_the_same_at_hardly_any_cost_have_finite_steps() -> None:
    """The curvature by their torques is singular to rounding."""
    problem = Linear.drawn(4)
    alike = np.repeat(problem.by_torque[:, :, :1], 2, axis=2)
    problem = problem._replace(
        by_torque=alike, curvature=np.zeros_like(problem.curvature), weights=np.full((2, 2), 1e-20)
    )
    forward, gains, *_, expected = sweep(problem)
    assert np.isfinite(forward).all()
    assert np.isfinite(gains).all()
    assert expected[0] < 0.0


def test_a_model_bent_downward_beyond_all_measure_has_finite_steps() -> None:
    """Its curvature by the torques is negative and of rank one to rounding, and far more than their own cost."""
    step, gains, bounds = np.zeros(2), np.zeros((2, 3)), kernels.Bounds(np.ones(2), np.zeros(2))
    across = np.array([4565.14378166, -9380.57261558])
    bent = -np.outer(across, across) / across[0]
    for size in 10.0 ** np.arange(0, 13):
        model = kernels.Quadratic(np.zeros(3), np.zeros((3, 3)), np.ones(2), size * bent, np.ones((2, 3)))
        kernels.minimise(np.full((2, 2), 1e-15), bounds, np.zeros(2), model, np.zeros((2, 2)), step, gains)
        assert np.isfinite(step).all()
        assert np.isfinite(gains).all()


def test_steps_keep_the_limits_and_a_held_torque_has_no_gain() -> None:
    problem = Linear.drawn(2)
    limits = np.full(2, 0.3)
    problem = problem._replace(torques=np.clip(problem.torques, -limits, limits))
    forward, gains, *_ = sweep(problem, limits)
    at = np.abs(problem.torques[1:] + forward)
    assert np.all(at <= limits + 1e-12)
    held = at >= limits - 1e-12
    assert held.any()
    assert not held.all()
    assert np.all(gains[held] == 0.0)
    assert np.all(np.abs(gains[~held]).max(axis=1) > 0.0)


@given(small, small, small, small, small, st.tuples(small, small), st.tuples(small, small))
def test_the_minimum_over_a_rectangle(
    a: float, b: float, c: float, q1: float, q2: float, one: tuple[float, float], two: tuple[float, float]
) -> None:
    """No point of the rectangle is better: the gradient there does not point inward (Karush, Kuhn, Tucker)."""
    root = np.array([[a, b], [0.0, c]])
    matrix, q = root.T @ root + 0.01 * np.eye(2), np.array([q1, q2])
    box, step = np.sort(np.array([one, two]), axis=0), np.zeros(2)
    kernels.box_minimum(matrix[0, 0], matrix[0, 1], matrix[1, 1], q1, q2, box, step)
    assert np.all((box[0] <= step) & (step <= box[1]))
    moved = np.clip(step - (q + matrix @ step), *box)
    np.testing.assert_allclose(moved, step, atol=1e-9)


@settings(max_examples=20)
@given(st.integers(0, 10_000))
def test_the_gradient_is_a_difference_with_and_without_feedback(seed: int) -> None:
    problem = Linear.drawn(seed)._replace(defects=np.zeros((N, SIZE)))
    gains = 0.1 * np.random.default_rng(seed).normal(size=(N, 2, SIZE + 2))
    for feedback in (np.zeros_like(gains), gains):
        found = np.zeros((N, 2))
        arguments = (problem.by_state, problem.by_torque, problem.gradient, problem.weights, problem.torques)
        torque_gradient(*arguments, feedback, found, np.zeros((N, SIZE)))
        unit = 1e-4 * np.eye(2 * N).reshape(2 * N, N, 2)
        ends = [[problem.cost(applied(problem, sign * e, feedback)) for e in unit] for sign in (1.0, -1.0)]
        exact = (np.array(ends[0]) - ends[1]).reshape(N, 2) / 2e-4
        np.testing.assert_allclose(found, exact, rtol=1e-5, atol=1e-5)


def test_runs_of_a_batch_do_not_depend_on_each_other() -> None:
    drawn = [Linear.drawn(seed)._replace(weights=Linear.drawn(0).weights) for seed in range(3)]
    tables = Linear(*(np.stack(one) for one in zip(*drawn, strict=True)))
    whole = sweep(tables._replace(weights=drawn[0].weights), np.ones(2))
    for n, one in enumerate(drawn):
        for alone, own in zip(sweep(one, np.ones(2)), whole, strict=True):
            np.testing.assert_array_equal(alone, own[n])
