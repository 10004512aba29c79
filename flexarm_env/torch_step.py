"""`FlexibleArm.step` for PyTorch: its backward pass multiplies by the compiled Jacobians.

The only module of this package that needs torch; it is not imported by the others.
"""

from __future__ import annotations

from typing import Any

import torch

from flexarm_env.physics.constants import ARM_QUANTITIES
from flexarm_env.simulation.arm import FlexibleArm


class _Step(torch.autograd.Function):
    """One control period; its Jacobians are kept for the backward pass if an argument needs a gradient."""

    @staticmethod
    def forward(
        context: Any,
        arm: FlexibleArm,
        period: float,
        step: float,
        state: torch.Tensor,
        torque: torch.Tensor,
        *quantities: torch.Tensor,
    ) -> torch.Tensor:
        """Compute the state after the period."""
        x, tau, *drawn = (tensor.detach().numpy() for tensor in (state, torque, *quantities))
        named: dict[str, Any] = dict(zip(ARM_QUANTITIES, drawn, strict=True))
        if not any(context.needs_input_grad):
            return torch.from_numpy(arm.step(x, tau, period, step=step, **named))
        found = arm.step_jacobians(x, tau, period, step=step, **named)
        context.save_for_backward(*(torch.from_numpy(array) for array in found[1:]))
        context.shapes = [array.shape for array in (x, tau, *drawn)]
        return torch.from_numpy(found.state)

    @staticmethod
    def backward(context: Any, gradient: torch.Tensor) -> tuple[torch.Tensor | None, ...]:
        """Multiply the gradient by the Jacobians, and sum over axes along which an argument was repeated."""
        if torch.is_grad_enabled():
            raise RuntimeError(
                "flexarm_env.torch_step.step: a gradient of a gradient (create_graph=True) cannot be had, "
                "since the Jacobians have no derivatives"
            )
        by_state, by_torque, by_quantity = (
            torch.einsum("...i,...ij->...j", gradient, jacobian) for jacobian in context.saved_tensors
        )
        gradients = (by_state, by_torque, *by_quantity.unbind(-1))
        pairs = zip(gradients, context.shapes, strict=True)
        return None, None, None, *(found.sum_to_size(shape) for found, shape in pairs)


def step(
    arm: FlexibleArm,
    state: torch.Tensor,
    torque: torch.Tensor,
    period: float = 0.01,
    *,
    step: float = 1e-3,
    payload_mass: torch.Tensor | float | None = None,
    stiffness: torch.Tensor | float | None = None,
    damping: torch.Tensor | float | None = None,
) -> torch.Tensor:
    """Compute the state a control period later, differentiable once by all tensors; see `FlexibleArm.step`.

    Args:
        arm: the arm.
        state: on the CPU, in double precision, as all tensors. Shape (..., 4 + 4 m).
        torque: held over the period [N m]. Shape (..., 2).
        period: [s].
        step: step of the Runge-Kutta method [s].
        payload_mass: [kg]; None: the arm's own. Shape (...).
        stiffness: factor on the links' stiffness; None: 1. Shape (...).
        damping: damping ratio (`physics.damping`); None: the arm's own. Shape (...).

    Returns:
        Shape (..., 4 + 4 m).

    Raises:
        TypeError: for other tensors.
        ValueError: as `FlexibleArm.step`.
        RuntimeError: in the backward pass, where a gradient of a gradient is asked for.
    """
    given = {"payload_mass": payload_mass, "stiffness": stiffness, "damping": damping}
    quantities = {
        name: torch.as_tensor(own if value is None else value, dtype=None if torch.is_tensor(value) else torch.float64)
        for (name, value), own in zip(given.items(), arm.changes.own, strict=True)
    }
    for name, tensor in {"state": state, "torque": torque, **quantities}.items():
        if not torch.is_tensor(tensor):
            raise TypeError(f"{name} = {tensor!r}: must be a torch tensor")
        if tensor.dtype != torch.float64 or tensor.device.type != "cpu":
            raise TypeError(
                f"{name}: must be a tensor of torch.float64 on the CPU, got {tensor.dtype} on {tensor.device}"
            )
    return _Step.apply(arm, period, step, state, torque, *quantities.values())  # type: ignore[no-untyped-call]
