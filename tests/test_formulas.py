"""The equations on other engines' numbers: the same rates, steps and tips, and their derivatives."""

from typing import Any

import numpy as np
import pytest
import torch

from flexarm_env import FlexibleArm, formulas
from tests.support.complex_steps import stepped
from tests.support.lagrange import DRY, loaded_arm, random_state

VARIANTS: list[tuple[int, dict[str, Any]]] = [
    (2, {}),
    (3, {"kinematics": "foreshortened", "mode_shapes": "polynomial", **DRY}),
    (1, {"velocity_forces": "rigid"}),
]
TORQUE = np.array([12.0, -5.0])
STEP = 1e-4


@pytest.fixture(scope="module", params=VARIANTS, ids=str)
def arm(request: pytest.FixtureRequest) -> FlexibleArm:
    modes, options = request.param
    return FlexibleArm(loaded_arm(modes, **options))


@pytest.fixture
def state(arm: FlexibleArm) -> np.ndarray:
    return random_state(arm.parameters, 5)


def check(arm: FlexibleArm, state: np.ndarray, rate: Any, stepped: Any, tip: Any, by_state: Any) -> None:
    """Against the arm's own; its Jacobian is that of the rate."""
    linear = arm.linearise(state, TORQUE)
    scale = np.abs(linear.rate).max()
    np.testing.assert_allclose(rate, linear.rate, rtol=1e-12, atol=1e-12 * scale)
    np.testing.assert_allclose(tip, arm.tip(state[: arm.size]), rtol=1e-12)
    moved = formulas.step(arm, state, TORQUE, STEP, np.sin, np.cos)
    np.testing.assert_allclose(stepped, moved, rtol=1e-12, atol=1e-12 * np.abs(moved).max())
    np.testing.assert_allclose(by_state, linear.A, atol=1e-12 * np.abs(linear.A).max())


def test_numpy_steps_as_the_method_does(arm: FlexibleArm, state: np.ndarray) -> None:
    found = formulas.step(arm, state, TORQUE, STEP, np.sin, np.cos)
    exact = np.real(stepped(arm, state, TORQUE, arm.changes.own, STEP, 1)).astype(float)
    np.testing.assert_allclose(found, exact, rtol=1e-12, atol=1e-12 * np.abs(exact).max())


@pytest.mark.slow
def test_numpy_steps_as_the_kernel_does(arm: FlexibleArm, state: np.ndarray) -> None:
    found = formulas.step(arm, state, TORQUE, STEP, np.sin, np.cos)
    exact = arm.simulate(state, TORQUE[None], STEP, step=STEP).state[-1]
    np.testing.assert_allclose(found, exact, rtol=1e-12, atol=1e-12 * np.abs(exact).max())


def test_torch(arm: FlexibleArm, state: np.ndarray) -> None:
    x, tau, engine = torch.tensor(state), torch.tensor(TORQUE), (torch.sin, torch.cos)
    rate = torch.stack(formulas.state_rate(arm, x, tau, *engine))
    stepped, tip = formulas.step(arm, x, tau, STEP, *engine), formulas.tip(arm, x, *engine)
    by_state = torch.func.jacrev(lambda x: torch.stack(formulas.state_rate(arm, x, tau, *engine)))(x)
    check(arm, state, rate.numpy(), torch.stack(stepped).numpy(), torch.stack(tip).numpy(), by_state.numpy())


def test_jax(arm: FlexibleArm, state: np.ndarray) -> None:
    jax = pytest.importorskip("jax")
    with jax.enable_x64(True):
        np_ = jax.numpy
        x, tau, engine = np_.array(state), np_.array(TORQUE), (np_.sin, np_.cos)
        rate = jax.jit(lambda x: np_.stack(formulas.state_rate(arm, x, tau, *engine)))
        stepped, tip = formulas.step(arm, x, tau, STEP, *engine), formulas.tip(arm, x, *engine)
        check(arm, state, rate(x), np_.stack(stepped), np_.stack(tip), jax.jacfwd(rate)(x))


def test_casadi(arm: FlexibleArm, state: np.ndarray) -> None:
    casadi = pytest.importorskip("casadi")
    x, engine = casadi.SX.sym("x", 2 * arm.size), (casadi.sin, casadi.cos)
    rate = casadi.vertcat(*formulas.state_rate(arm, x, TORQUE, *engine))
    stepped, tip = formulas.step(arm, x, TORQUE, STEP, *engine), formulas.tip(arm, x, *engine)
    results = (rate, casadi.vertcat(*stepped), casadi.vertcat(*tip), casadi.jacobian(rate, x))
    found = [np.array(value) for value in casadi.Function("all", [x], results)(state)]
    check(arm, state, found[0][:, 0], found[1][:, 0], found[2][:, 0], found[3])
