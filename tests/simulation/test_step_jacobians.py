"""Jacobians and gradients of a control period: against complex steps of the plain formulas."""

from functools import partial
from typing import Any

import numpy as np
import pytest

from flexarm_env import FlexibleArm
from flexarm_env.codegen.declarations import plain_python
from flexarm_env.kernels.entries import extent
from flexarm_env.kernels.step_gradients import GRADIENTS, run_gradients, trail_rows
from flexarm_env.kernels.step_jacobians import TANGENTS, run_tangents
from flexarm_env.kernels.variants import Variant
from flexarm_env.simulation.held_torque import LANES
from tests.support.complex_steps import jacobian, stepped
from tests.support.lagrange import DRY, loaded_arm, random_state

QUICK: tuple[int, dict[str, Any]] = (1, DRY)  # its batches' kernels are all that is compiled here by default
LINEAR, RIGID = {"kinematics": "linear"}, {"velocity_forces": "rigid"}
BENT = {"kinematics": "foreshortened", "mode_shapes": "polynomial"}
SLOW = [pytest.param((1, RIGID), marks=pytest.mark.slow)]
SLOW += [
    pytest.param((modes, {"kinematics": kinematics, "mode_shapes": shapes}), marks=pytest.mark.slow)
    for modes in (1, 2, 3, 4)
    for kinematics in ("linear", "foreshortened")
    for shapes in ("cantilever", "polynomial")
]
DRAWN = np.array([0.7, 1.2, 0.03])  # payload [kg], factor on the stiffness, damping ratio
COUNT = LANES + 3  # a full block and one with lanes to spare


class Case:
    """An arm, some of its states and torques, and its steps."""

    def __init__(self, modes: int, options: dict[str, Any]) -> None:
        self.arm = FlexibleArm(loaded_arm(modes, **options))
        self.states = np.array([random_state(self.arm.parameters, seed) for seed in range(COUNT)])
        self.torques = np.random.default_rng(0).normal(size=(COUNT, 2)) * 20.0
        self.steps = 2
        self.h = min(1e-3, 0.9 * self.arm.longest_step())
        self.period: dict[str, Any] = {"period": self.steps * self.h, "step": self.h}

    def moved(self, at: tuple[np.ndarray, ...], place: int, value: np.ndarray) -> np.ndarray:
        """State after the steps where one of state, torque and quantities is another."""
        return stepped(self.arm, *at[:place], value, *at[place + 1 :], self.h, self.steps)

    def driven(self, program: Any) -> tuple[Any, np.ndarray, Variant]:
        """Return what drivers in plain Python take: the first arm with `DRAWN`, its torques, their variant."""
        arms, torques = self.arm._driven(self.states[0], self.torques[0], tuple(DRAWN))
        k, modes = self.arm.constants, self.arm.parameters.modes_per_link
        return arms, torques, Variant(program, modes, self.arm._complete, 1, foreshortened=k.foreshortened, dry=k.dry)

    def quantities(self) -> dict[str, np.ndarray]:
        rng, own = np.random.default_rng(1), self.arm.changes.own
        names = ("payload_mass", "stiffness", "damping")
        return {name: x * rng.uniform(0.5, 1.5, COUNT) for name, x in zip(names, own, strict=True)}


@pytest.fixture(scope="module", params=[QUICK, *SLOW], ids=str)
def case(request: pytest.FixtureRequest) -> Case:
    return Case(*request.param)


@pytest.fixture(scope="module")
def small() -> Case:
    return Case(*QUICK)


def column_errors(found: np.ndarray, exact: np.ndarray) -> np.ndarray:
    """Largest error of each column over its largest entry."""
    return np.asarray(np.abs(found - exact).max(axis=0) / np.abs(exact).max(axis=0))


def test_they_are_complex_steps_of_the_plain_formulas(case: Case) -> None:
    drawn = case.quantities()
    result = case.arm.step_jacobians(case.states, case.torques, **case.period, **drawn)
    for n in (0, LANES + 2):
        at = case.states[n], case.torques[n], np.array([values[n] for values in drawn.values()])
        for place, found in enumerate((result.by_state, result.by_torque, result.by_quantity)):
            exact = jacobian(partial(case.moved, at, place), at[place])
            assert column_errors(found[n], exact).max() < 1e-11, place  # the condition of the mass matrix is 1e4


def test_the_state_is_the_plain_kernels_to_the_last_bit(case: Case) -> None:
    """The plain kernel in a batch, and as `simulate` runs it."""
    found = case.arm.step_jacobians(case.states, case.torques, **case.period)
    np.testing.assert_array_equal(found.state, case.arm.step(case.states, case.torques, **case.period))
    for x, tau, state in zip(case.states, case.torques, found.state, strict=True):
        run = case.arm.simulate(x, np.tile(tau, (case.steps, 1)), case.steps * case.h, step=case.h)
        np.testing.assert_array_equal(run.state[-1], state)


@pytest.mark.slow
def test_one_arm_alone_is_the_same_to_the_last_bit(case: Case) -> None:
    size = 2 * case.arm.size
    together = case.arm.step_jacobians(case.states, case.torques, **case.period, **case.quantities())
    for n in (0, COUNT - 1):
        own = {name: values[n] for name, values in case.quantities().items()}
        alone = case.arm.step_jacobians(case.states[n], case.torques[n], **case.period, **own)
        assert [x.shape for x in alone] == [(size,), (size, size), (size, 2), (size, 3)]
        for one, many in zip(alone, together, strict=True):
            np.testing.assert_array_equal(one, many[n])
        stepped_alone = case.arm.step(case.states[n], case.torques[n], **case.period, **own)
        np.testing.assert_array_equal(stepped_alone, alone.state)


@pytest.mark.parametrize("options", [RIGID, BENT, BENT | DRY], ids=str)
def test_the_drivers_give_them_in_plain_python(options: dict[str, Any]) -> None:
    """Nothing is compiled; the recorded kernels round their sums with products twice."""
    case = Case(1, options)
    arms, torques, variant = case.driven(TANGENTS)
    states, jacobians = arms.states.copy(), tuple(np.zeros((1, 8, columns)) for columns in (8, 2, 3))
    with plain_python(variant):
        arena = np.zeros((extent(variant.rows), 1))
        run_tangents(arena, *arms.inputs, torques, case.h, case.steps, states, jacobians)
    at = case.states[0], case.torques[0], DRAWN
    np.testing.assert_allclose(states[0], np.real(stepped(case.arm, *at, case.h, case.steps)), rtol=1e-12)
    for place, found in enumerate(jacobians):
        assert column_errors(found[0], jacobian(partial(case.moved, at, place), at[place])).max() < 1e-11, place


def test_leading_axes_broadcast(small: Case) -> None:
    n = 2 * small.arm.size
    states, torques = small.states[:6].reshape(2, 3, n), small.torques[:3]
    found = small.arm.step_jacobians(states, torques, **small.period, payload_mass=np.full((2, 1), 0.2))
    assert [x.shape for x in found] == [(2, 3, n), (2, 3, n, n), (2, 3, n, 2), (2, 3, n, 3)]
    row = small.arm.step_jacobians(states[1], torques, **small.period, payload_mass=0.2)
    for one, many in zip(row, found, strict=True):
        np.testing.assert_array_equal(one, many[1])
    assert small.arm.step(np.zeros((0, n)), (0.0, 0.0)).shape == (0, n)


def test_arguments_stay_as_they_were_and_results_are_new(small: Case) -> None:
    states, torques = small.states.copy(), small.torques.copy()
    first = small.arm.step_jacobians(states, torques, **small.period)
    kept = [x.copy() for x in first]
    small.arm.step_jacobians(states + 0.1, torques, **small.period)
    np.testing.assert_array_equal(states, small.states)
    for x, before in zip(first, kept, strict=True):
        np.testing.assert_array_equal(x, before)


@pytest.mark.parametrize(
    ("modes", "options"), [*((1, one) for one in (LINEAR, RIGID, BENT, LINEAR | DRY)), (2, LINEAR), (2, BENT)], ids=str
)
def test_the_drivers_give_gradients_in_plain_python(modes: int, options: dict[str, Any]) -> None:
    case = Case(modes, options)
    arms, torques, variant = case.driven(GRADIENTS)
    weights = np.random.default_rng(0).normal(size=2 * case.arm.size)
    found = np.zeros((1, len(weights))), np.zeros((1, 2))
    with plain_python(variant):
        arena, trail = np.zeros((extent(variant.rows), 1)), np.zeros((trail_rows(case.arm.size, case.steps), 1))
        run_gradients(arena, trail, arms.inputs[0], torques, case.h, case.steps, arms.states, weights[None], found)
    at = case.states[0], case.torques[0], DRAWN
    for place, own in enumerate(found):
        exact = weights @ jacobian(partial(case.moved, at, place), at[place])
        np.testing.assert_allclose(own[0], exact, rtol=0.0, atol=1e-12 * np.abs(exact).max())


@pytest.mark.parametrize("kind", [(3, BENT), *SLOW], ids=str)
def test_gradients_are_products_with_the_jacobians(kind: tuple[int, dict[str, Any]]) -> None:
    case, rng = Case(*kind), np.random.default_rng(2)
    weights = rng.normal(size=case.states.shape)
    options = case.period | {"payload_mass": rng.uniform(0.0, 1.0, COUNT)}
    jacobians = case.arm.step_jacobians(case.states, case.torques, **options)
    found = case.arm.step_gradients(case.states, case.torques, weights, **options)
    for own, slope in zip(found, (jacobians.by_state, jacobians.by_torque), strict=True):
        exact = np.einsum("ni,nij->nj", weights, slope)
        np.testing.assert_allclose(own, exact, rtol=0.0, atol=1e-12 * np.abs(exact).max())


def test_leading_axes_of_gradients_broadcast() -> None:
    case = Case(3, BENT)
    found = case.arm.step_gradients(case.states[:2], (1.0, 2.0), np.eye(16)[:, None])
    assert [x.shape for x in found] == [(16, 2, 16), (16, 2, 2)]
    exact = case.arm.step_jacobians(case.states[:2], (1.0, 2.0)).by_state
    np.testing.assert_allclose(np.moveaxis(found.by_state, 0, 1), exact, rtol=1e-11, atol=1e-10)
