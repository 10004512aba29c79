"""The equations on other engines' numbers: the same rates, steps and tips, and their derivatives."""

from typing import Any

import numpy as np
import pytest
import torch

from flexarm_env import FlexibleArm, formulas
from flexarm_env.torch_step import step as torch_step
from tests.support.lagrange import DRY, loaded_arm, random_state
from tests.support.refusals import refuses

VARIANTS: list[tuple[int, dict[str, Any]]] = [
    (1, {}),
    (2, {"kinematics": "foreshortened", "mode_shapes": "polynomial", **DRY}),
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
    """Against the arm's own; its Jacobian is that of the rate, and a torque acts through the mass matrix alone."""
    linear = arm.linearise(state, TORQUE)
    unmoved, by_torque = np.split(linear.B, 2)
    assert not unmoved.any()
    np.testing.assert_allclose(arm.mass_matrix(state[: arm.size]) @ by_torque, np.eye(arm.size, 2), atol=1e-9)
    scale = np.abs(linear.rate).max()
    np.testing.assert_allclose(rate, linear.rate, rtol=1e-12, atol=1e-12 * scale)
    np.testing.assert_allclose(tip, arm.tip(state[: arm.size]), rtol=1e-12)
    moved = formulas.step(arm, state, TORQUE, STEP, np.sin, np.cos)
    np.testing.assert_allclose(stepped, moved, rtol=1e-12, atol=1e-12 * np.abs(moved).max())
    np.testing.assert_allclose(by_state, linear.A, atol=1e-12 * np.abs(linear.A).max())


def test_numpy_steps_as_the_arm_does(arm: FlexibleArm, state: np.ndarray) -> None:
    found, own = formulas.step(arm, state, TORQUE, STEP, np.sin, np.cos), arm.step(state, TORQUE, STEP, step=STEP)
    np.testing.assert_allclose(found, own, rtol=1e-12, atol=1e-12 * np.abs(own).max())


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


# --- gradients through `FlexibleArm.step` in torch -------------------------------------------------------------------


PERIOD = {"period": 0.002, "step": 1e-3}


@pytest.fixture(scope="module")
def small() -> FlexibleArm:
    return FlexibleArm(loaded_arm(1))


def tensors(small: FlexibleArm, count: int = 3) -> list[torch.Tensor]:
    """States, torques and quantities of some arms, to be differentiated by."""
    rng = np.random.default_rng(0)
    states = np.array([random_state(small.parameters, seed) for seed in range(count)])
    values = (states, rng.normal(size=(count, 2)) * 20.0, *rng.uniform(0.5, 1.0, (3, count)))
    return [torch.tensor(value, requires_grad=True) for value in values]


def moved(small: FlexibleArm, state: Any, torque: Any, payload_mass: Any, stiffness: Any, damping: Any) -> torch.Tensor:
    """Compute the step with its quantities by place."""
    return torch_step(small, state, torque, **PERIOD, payload_mass=payload_mass, stiffness=stiffness, damping=damping)


def test_it_is_the_arms_step(small: FlexibleArm) -> None:
    given = tensors(small)
    arrays = [x.detach().numpy() for x in given]
    names = ("payload_mass", "stiffness", "damping")
    expected = small.step(*arrays[:2], **PERIOD, **dict(zip(names, arrays[2:], strict=True)))
    np.testing.assert_array_equal(moved(small, *given).detach().numpy(), expected)
    with torch.no_grad():
        np.testing.assert_array_equal(moved(small, *given).numpy(), expected)


def test_gradcheck(small: FlexibleArm) -> None:
    # the damping ratio is near 0.01 and its effect small: differences of 1e-6 leave five digits
    assert torch.autograd.gradcheck(lambda *x: moved(small, *x), tensors(small), eps=1e-6, atol=1e-5, rtol=1e-4)


def test_gradients_of_repeated_arguments_are_sums(small: FlexibleArm) -> None:
    states, torques, *_ = tensors(small)
    torque, payload = torques[0].detach().requires_grad_(), torch.tensor(0.4, dtype=torch.float64, requires_grad=True)
    torch_step(small, states, torque, **PERIOD, payload_mass=payload).square().sum().backward()
    assert torque.grad is not None
    assert payload.grad is not None
    same = torque.detach().expand(3, 2).clone().requires_grad_()
    torch_step(small, states.detach(), same, **PERIOD, payload_mass=0.4).square().sum().backward()
    assert same.grad is not None
    torch.testing.assert_close(torque.grad, same.grad.sum(0))
    assert payload.grad.shape == ()


def test_a_second_derivative_is_refused(small: FlexibleArm) -> None:
    """At once: a gradient without a history of its own would lose it silently."""
    given = tensors(small)
    with pytest.raises(RuntimeError, match="gradient of a gradient"):
        torch.autograd.grad(moved(small, *given).sum(), given[1], create_graph=True)


@pytest.mark.parametrize(
    ("changes", "parts"),
    [
        ({"state": np.zeros(8)}, ("state", "torch tensor")),
        ({"torque": torch.zeros(2)}, ("torque", "torch.float64", "torch.float32")),
        ({"stiffness": torch.ones(1)}, ("stiffness", "torch.float64", "torch.float32")),
    ],
    ids=str,
)
def test_tensors_of_another_kind_are_refused(
    small: FlexibleArm, changes: dict[str, Any], parts: tuple[str, ...]
) -> None:
    zeros = {"state": torch.zeros(8, dtype=torch.float64), "torque": torch.zeros(2, dtype=torch.float64)}
    with refuses(TypeError, *parts):
        torch_step(small, **(zeros | changes), **PERIOD)
