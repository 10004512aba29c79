"""Jacobians of a control period: against complex steps of the plain formulas, by symmetries, by the chain rule."""

from functools import partial
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flexarm_env import ArmParameters, FlexibleArm
from flexarm_env.codegen.declarations import plain_python
from flexarm_env.kernels.entries import extent
from flexarm_env.kernels.step_jacobians import TANGENTS, run_tangents
from flexarm_env.kernels.variants import Variant
from flexarm_env.simulation.held_torque import LANES
from tests.support.complex_steps import jacobian, stepped
from tests.support.lagrange import loaded_arm, random_state

QUICK: tuple[int, dict[str, Any]] = (1, {})  # its batches' kernels are all that is compiled here by default
RIGID = {"velocity_forces": "rigid"}
BENT = {"kinematics": "foreshortened", "mode_shapes": "polynomial"}
SLOW = [
    pytest.param(kind, marks=pytest.mark.slow)
    for kind in [
        (1, RIGID),
        *(
            (modes, {"kinematics": kinematics, "mode_shapes": shapes})
            for modes in (1, 2, 3, 4)
            for kinematics in ("linear", "foreshortened")
            for shapes in ("cantilever", "polynomial")
        ),
    ]
]
COUNT = LANES + 3  # a full block and one with lanes to spare


class Case:
    """An arm, some of its states and torques, and its steps."""

    def __init__(self, modes: int, options: dict[str, Any]) -> None:
        self.arm = FlexibleArm(loaded_arm(modes, **options))
        self.states = np.array([random_state(self.arm.parameters, seed) for seed in range(COUNT)])
        self.torques = np.random.default_rng(0).normal(size=(COUNT, 2)) * 20.0
        self.steps = 3
        self.h = min(1e-3, 0.9 * self.arm.longest_step())
        self.period = {"period": self.steps * self.h, "step": self.h}

    def moved(self, at: tuple[np.ndarray, ...], place: int, value: np.ndarray) -> np.ndarray:
        """State after the steps where one of state, torque and quantities is another."""
        return stepped(self.arm, *at[:place], value, *at[place + 1 :], self.h, self.steps)

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


@pytest.mark.parametrize("options", [RIGID, BENT], ids=str)
def test_the_drivers_give_them_in_plain_python(options: dict[str, Any]) -> None:
    """Nothing is compiled; the recorded kernels round their sums with products twice."""
    case = Case(1, options)
    batch = case.arm._batch(case.states[0], case.torques[0], (0.7, 1.2, 0.03))
    variant = Variant(TANGENTS, 1, case.arm._complete, 1, foreshortened=case.arm.constants.foreshortened)
    states, jacobians = batch.states.copy(), tuple(np.zeros((1, 8, columns)) for columns in (8, 2, 3))
    with plain_python(variant):
        arena = np.zeros((extent(variant.rows), 1))
        run_tangents(arena, *batch.inputs, batch.torques, case.h, case.steps, states, jacobians)
    at = case.states[0], case.torques[0], np.array([0.7, 1.2, 0.03])
    np.testing.assert_allclose(states[0], np.real(stepped(case.arm, *at, case.h, case.steps)), rtol=1e-12)
    for place, found in enumerate(jacobians):
        assert column_errors(found[0], jacobian(partial(case.moved, at, place), at[place])).max() < 1e-11, place


def test_they_are_limits_of_differences(case: Case) -> None:
    x, tau, h = case.states[0], case.torques[0], 1e-6
    by_state, by_torque = (one[0] for one in case.arm.step_jacobians([x, x], tau, **case.period)[1:3])
    for n in range(len(x)):
        ends = case.arm.step(x + h * np.eye(len(x))[n] * np.array([[1.0], [-1.0]]), tau, **case.period)
        np.testing.assert_allclose(by_state[:, n], (ends[0] - ends[1]) / (2.0 * h), rtol=1e-5, atol=1e-5)
    for n in range(2):
        ends = case.arm.step(x, tau + 1e3 * h * np.eye(2)[n] * np.array([[1.0], [-1.0]]), **case.period)
        np.testing.assert_allclose(by_torque[:, n], (ends[0] - ends[1]) / (2e3 * h), rtol=1e-5, atol=1e-7)


def test_another_arm_is_the_arm_with_other_parameters() -> None:
    """The quantities mean what the parameters mean."""
    arm = FlexibleArm(ArmParameters.linear(modes_per_link=1))
    p = arm.parameters
    states, torque = [random_state(p, seed) for seed in (0, 1)], (10.0, -4.0)
    stiff = tuple(1.3 * rigidity for rigidity in p.flexural_rigidities)
    other = FlexibleArm(
        ArmParameters.linear(modes_per_link=1, payload_mass=0.7, flexural_rigidities=stiff, damping_ratio=0.03)
    )
    found = arm.step(states, torque, payload_mass=0.7, stiffness=1.3, damping=0.03)
    np.testing.assert_allclose(found, other.step(states, torque), rtol=1e-10)


@settings(max_examples=30)
@given(seed=st.integers(0, 10_000), turn=st.floats(-3.0, 3.0))
def test_symmetries(small: Case, seed: int, turn: float) -> None:
    """The arm has no preferred direction, and its mirror image moves as it does."""
    state, torque = random_state(small.arm.parameters, seed), np.random.default_rng(seed).normal(size=2) * 20.0
    turned = state + turn * np.eye(len(state))[0]
    states, torques = np.array([state, turned, -state]), np.array([torque, torque, -torque])
    found = small.arm.step_jacobians(states, torques, **small.period)
    np.testing.assert_array_equal(found.by_state[:, :, 0], np.tile(np.eye(len(state))[0], (3, 1)))
    np.testing.assert_allclose(found.by_state[1], found.by_state[0], rtol=1e-9, atol=1e-11)
    for name in ("by_state", "by_torque"):
        np.testing.assert_array_equal(getattr(found, name)[2], getattr(found, name)[0])
    np.testing.assert_array_equal(found.by_quantity[2], -found.by_quantity[0])


@settings(max_examples=30)
@given(seed=st.integers(0, 10_000))
def test_two_periods_are_one_by_the_chain_rule(small: Case, seed: int) -> None:
    states = np.array([random_state(small.arm.parameters, seed + n) for n in range(2)])
    torque = np.random.default_rng(seed).normal(size=2) * 20.0
    first = small.arm.step_jacobians(states, torque, **small.period)
    second = small.arm.step_jacobians(first.state, torque, **small.period)
    both = small.arm.step_jacobians(states, torque, 2.0 * small.period["period"], step=small.h)
    # rates come from momenta between the periods, which loses as many digits as the mass matrix's condition, 1e4, has
    np.testing.assert_allclose(both.state, second.state, rtol=1e-11, atol=1e-12)
    np.testing.assert_allclose(both.by_state, second.by_state @ first.by_state, rtol=1e-10, atol=1e-12)
    for name in ("by_torque", "by_quantity"):
        chained = second.by_state @ getattr(first, name) + getattr(second, name)
        np.testing.assert_allclose(getattr(both, name), chained, rtol=1e-9, atol=1e-12)


def test_a_short_period_is_the_linearisation(small: Case) -> None:
    states, torque, h = small.states[:2], small.torques[0], 1e-7
    found = small.arm.step_jacobians(states, torque, h, step=h)
    for n, state in enumerate(states):
        linear = small.arm.linearise(state, torque)
        slope = (found.by_state[n] - np.eye(len(state))) / h
        np.testing.assert_allclose(slope, linear.A, atol=1e-4 * np.abs(linear.A).max())
        np.testing.assert_allclose(found.by_torque[n] / h, linear.B, atol=1e-4 * np.abs(linear.B).max())


# --- shapes and input -------------------------------------------------------------------------------------------------


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


@pytest.mark.parametrize("name", ["step", "step_jacobians"])
@pytest.mark.parametrize(
    ("changes", "error", "parts"),
    [
        ({"state": np.zeros(7)}, ValueError, ("state", "(..., 8)", "(7,)")),
        ({"state": np.full(8, np.nan)}, ValueError, ("state[0] = nan", "finite")),
        ({"torque": np.zeros((2, 3))}, ValueError, ("torque", "(..., 2)", "(2, 3)")),
        ({"torque": (np.inf, 0.0)}, ValueError, ("torque[0] = inf", "finite")),
        (
            {"state": np.zeros((3, 8)), "torque": np.zeros((2, 2))},
            ValueError,
            ("broadcast", "state (3,)", "torque (2,)"),
        ),
        ({"period": 0.0105}, ValueError, ("period = 0.0105", "whole number of steps of 0.001 s")),
        ({"period": -0.01}, ValueError, ("period = -0.01", "> 0")),
        ({"period": "0.01"}, TypeError, ("period = '0.01'", "number")),
        ({"period": 1.0, "step": 0.1}, ValueError, ("step = 0.1", "fastest mode", "at most")),
        (
            {"step": 0.01, "period": 0.1, "stiffness": [1.0, 100.0]},
            ValueError,
            ("step = 0.01", "fastest mode", "at most"),
        ),
        ({"payload_mass": -0.1}, ValueError, ("payload_mass = -0.1", "from 0 to 1000 [kg]")),
        ({"stiffness": 0.0}, ValueError, ("stiffness = 0.0", "from 0.001 to 1000")),
        ({"stiffness": [1.0, np.nan]}, ValueError, ("stiffness = nan", "from 0.001 to 1000")),
        ({"state": np.full(8, 1e13)}, ValueError, ("state[0] = 1", "at most 1e+12")),
        ({"damping": [[0.1], [2.0]]}, ValueError, ("damping = 2.0", "from 0 to 1")),
        ({"damping": "much"}, ValueError, ("damping", "real numbers")),
    ],
    ids=str,
)
def test_bad_input_is_refused(
    small: Case, name: str, changes: dict[str, Any], error: type[Exception], parts: tuple[str, ...]
) -> None:
    arguments = {"state": np.zeros(8), "torque": (0.0, 0.0)} | changes
    with pytest.raises(error) as caught:
        getattr(small.arm, name)(**arguments)
    assert all(part in str(caught.value) for part in parts), str(caught.value)
