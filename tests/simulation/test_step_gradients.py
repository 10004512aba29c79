"""Gradients of a control period: against complex steps of the plain formulas, and against its Jacobians."""

from typing import Any

import numpy as np
import pytest

from flexarm_env import FlexibleArm
from flexarm_env.codegen.declarations import plain_python
from flexarm_env.kernels.entries import extent
from flexarm_env.kernels.step_gradients import GRADIENTS, run_gradients, trail_rows
from flexarm_env.kernels.variants import Variant
from flexarm_env.simulation.held_torque import LANES
from tests.support.complex_steps import jacobian, stepped
from tests.support.lagrange import DRY, loaded_arm, random_state

STEPS = 3
LINEAR = {"kinematics": "linear"}
BENT = {"kinematics": "foreshortened", "mode_shapes": "polynomial"}
SLOW = [pytest.param((modes, options), marks=pytest.mark.slow) for modes in (1, 2, 3, 4) for options in (LINEAR, BENT)]


@pytest.mark.parametrize("modes", [1, 2])
@pytest.mark.parametrize("options", [LINEAR, {"velocity_forces": "rigid"}, BENT, LINEAR | DRY], ids=str)
def test_the_drivers_give_them_in_plain_python(modes: int, options: dict[str, Any]) -> None:
    """Nothing is compiled; the quantities are not the arm's own."""
    arm = FlexibleArm(loaded_arm(modes, **options))
    h, size = min(1e-3, 0.9 * arm.longest_step()), 2 * arm.size
    state, torque, drawn = random_state(arm.parameters, 1), np.array([20.0, -7.0]), np.array([0.7, 1.2, 0.03])
    weights = np.random.default_rng(0).normal(size=size)
    arms, torques = arm._driven(state, torque, tuple(drawn))
    k = arm.constants
    variant = Variant(GRADIENTS, modes, arm._complete, 1, foreshortened=k.foreshortened, dry=k.dry)
    found = np.zeros((1, size)), np.zeros((1, 2))
    with plain_python(variant):
        arena, trail = np.zeros((extent(variant.rows), 1)), np.zeros((trail_rows(arm.size, STEPS), 1))
        run_gradients(arena, trail, arms.inputs[0], torques, h, STEPS, arms.states, weights[None], found)
    by_state = jacobian(lambda x: stepped(arm, x, torque, drawn, h, STEPS), state)
    by_torque = jacobian(lambda tau: stepped(arm, state, tau, drawn, h, STEPS), torque)
    for own, exact in zip(found, (weights @ by_state, weights @ by_torque), strict=True):
        np.testing.assert_allclose(own[0], exact, rtol=0.0, atol=1e-12 * np.abs(exact).max())


@pytest.mark.parametrize("kind", [(3, BENT), *SLOW], ids=str)
def test_they_are_products_with_the_jacobians(kind: tuple[int, dict[str, Any]]) -> None:
    arm = FlexibleArm(loaded_arm(kind[0], **kind[1]))
    count, rng = LANES + 3, np.random.default_rng(2)
    states = np.array([random_state(arm.parameters, seed) for seed in range(count)])
    torques, weights = 20.0 * rng.normal(size=(count, 2)), rng.normal(size=states.shape)
    h = min(1e-3, 0.9 * arm.longest_step())
    options: dict[str, Any] = {"period": STEPS * h, "step": h, "payload_mass": rng.uniform(0.0, 1.0, count)}
    jacobians = arm.step_jacobians(states, torques, **options)
    found = arm.step_gradients(states, torques, weights, **options)
    for own, slope in zip(found, (jacobians.by_state, jacobians.by_torque), strict=True):
        exact = np.einsum("ni,nij->nj", weights, slope)
        np.testing.assert_allclose(own, exact, rtol=0.0, atol=1e-12 * np.abs(exact).max())


def test_leading_axes_broadcast() -> None:
    arm = FlexibleArm(loaded_arm(3, **BENT))
    states = np.array([random_state(arm.parameters, seed) for seed in range(2)])
    found = arm.step_gradients(states, (1.0, 2.0), np.eye(16)[:, None])
    assert found.by_state.shape == (16, 2, 16)
    assert found.by_torque.shape == (16, 2, 2)
    np.testing.assert_allclose(
        np.moveaxis(found.by_state, 0, 1), arm.step_jacobians(states, (1.0, 2.0)).by_state, rtol=1e-11, atol=1e-10
    )
