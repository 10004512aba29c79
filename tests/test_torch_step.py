"""Gradients through `FlexibleArm.step` in torch."""

from typing import Any

import numpy as np
import pytest
import torch

from flexarm_env import FlexibleArm
from flexarm_env.torch_step import step
from tests.support.lagrange import loaded_arm, random_state
from tests.support.refusals import refuses

PERIOD = {"period": 0.002, "step": 1e-3}


@pytest.fixture(scope="module")
def arm() -> FlexibleArm:
    return FlexibleArm(loaded_arm(1))


def tensors(arm: FlexibleArm, count: int = 3) -> list[torch.Tensor]:
    """States, torques and quantities of some arms, to be differentiated by."""
    rng = np.random.default_rng(0)
    states = np.array([random_state(arm.parameters, seed) for seed in range(count)])
    values = (states, rng.normal(size=(count, 2)) * 20.0, *rng.uniform(0.5, 1.0, (3, count)))
    return [torch.tensor(value, requires_grad=True) for value in values]


def moved(arm: FlexibleArm, state: Any, torque: Any, payload_mass: Any, stiffness: Any, damping: Any) -> torch.Tensor:
    """Compute the step with its quantities by place."""
    return step(arm, state, torque, **PERIOD, payload_mass=payload_mass, stiffness=stiffness, damping=damping)


def test_it_is_the_arms_step(arm: FlexibleArm) -> None:
    given = tensors(arm)
    arrays = [x.detach().numpy() for x in given]
    names = ("payload_mass", "stiffness", "damping")
    expected = arm.step(*arrays[:2], **PERIOD, **dict(zip(names, arrays[2:], strict=True)))
    np.testing.assert_array_equal(moved(arm, *given).detach().numpy(), expected)
    with torch.no_grad():
        np.testing.assert_array_equal(moved(arm, *given).numpy(), expected)


def test_gradcheck(arm: FlexibleArm) -> None:
    # the damping ratio is near 0.01 and its effect small: differences of 1e-6 leave five digits
    assert torch.autograd.gradcheck(lambda *x: moved(arm, *x), tensors(arm), eps=1e-6, atol=1e-5, rtol=1e-4)


def test_gradients_of_repeated_arguments_are_sums(arm: FlexibleArm) -> None:
    states, torques, *_ = tensors(arm)
    torque, payload = torques[0].detach().requires_grad_(), torch.tensor(0.4, dtype=torch.float64, requires_grad=True)
    step(arm, states, torque, **PERIOD, payload_mass=payload).square().sum().backward()
    assert torque.grad is not None
    assert payload.grad is not None
    same = torque.detach().expand(3, 2).clone().requires_grad_()
    step(arm, states.detach(), same, **PERIOD, payload_mass=0.4).square().sum().backward()
    assert same.grad is not None
    torch.testing.assert_close(torque.grad, same.grad.sum(0))
    assert payload.grad.shape == ()


def test_a_second_derivative_is_refused(arm: FlexibleArm) -> None:
    """At once: a gradient without a history of its own would lose it silently."""
    given = tensors(arm)
    with pytest.raises(RuntimeError, match="gradient of a gradient"):
        torch.autograd.grad(moved(arm, *given).sum(), given[1], create_graph=True)


@pytest.mark.parametrize(
    ("changes", "parts"),
    [
        ({"state": np.zeros(8)}, ("state", "torch tensor")),
        ({"torque": torch.zeros(2)}, ("torque", "torch.float64", "torch.float32")),
        ({"stiffness": torch.ones(1)}, ("stiffness", "torch.float64", "torch.float32")),
    ],
    ids=str,
)
def test_tensors_of_another_kind_are_refused(arm: FlexibleArm, changes: dict[str, Any], parts: tuple[str, ...]) -> None:
    zeros = {"state": torch.zeros(8, dtype=torch.float64), "torque": torch.zeros(2, dtype=torch.float64)}
    with refuses(TypeError, *parts):
        step(arm, **(zeros | changes), **PERIOD)
