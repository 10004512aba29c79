"""Derivatives of the state that many arms reach after a control period with torques held: exact Jacobians, gradients.

They are those of the steps of the classical Runge-Kutta method (`step_jacobians`), not of the continuous motion.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexarm_env.codegen import cache, compiler
from flexarm_env.codegen.compiler import Entries
from flexarm_env.codegen.declarations import Program
from flexarm_env.codegen.memory import aligned_zeros
from flexarm_env.kernels.entries import extent
from flexarm_env.kernels.step_gradients import GRADIENTS, trail_rows
from flexarm_env.kernels.step_jacobians import TANGENTS
from flexarm_env.kernels.variants import Variant
from flexarm_env.lazy import cached_property
from flexarm_env.parameters import HEAVIEST_PAYLOAD, ArmParameters
from flexarm_env.physics.constants import ARM_QUANTITIES, ConstantChanges, Constants, constant_changes
from flexarm_env.physics.link_modes import LinkModes
from flexarm_env.physics.modal_elimination import elimination
from flexarm_env.simulation.open_loop import LARGEST, count_instants
from flexarm_env.validation import finite_rows, number, real_array

Array = NDArray[np.float64]
LANES = 8  # of a block, where there is more than one arm
KEPT = 64  # most rows of quantities whose constants are kept for the next call
# Least and largest value of each quantity.
RANGES = {"payload_mass": (0.0, HEAVIEST_PAYLOAD), "stiffness": (1e-3, 1e3), "damping": (0.0, 1.0)}


class StepJacobians(NamedTuple):
    """A state after a control period, and its derivatives; [x] stands for the unit of each entry of a state.

    Attributes:
        state: after the period, as `FlexibleArm.step` gives it, to rounding. Shape (..., 4 + 4 m).
        by_state: by each entry of the state before [x_i/x_j]. Shape (..., 4 + 4 m, 4 + 4 m).
        by_torque: by the held torques of shoulder and elbow [x_i per N m]. Shape (..., 4 + 4 m, 2).
        by_quantity: by payload [x_i/kg], the factor on the links' stiffness [x_i], and the damping ratio [x_i];
            of these each alone changes, the others and all else of the arm stay. Shape (..., 4 + 4 m, 3).
    """

    state: Array
    by_state: Array
    by_torque: Array
    by_quantity: Array


class StepGradients(NamedTuple):
    """Derivatives of a weighted sum of the entries of the state after a control period.

    Attributes:
        by_state: by each entry of the state before [1/x_j, in units of the sum]. Shape (..., 4 + 4 m).
        by_torque: by the held torques of shoulder and elbow [1/(N m)]. Shape (..., 2).
    """

    by_state: Array
    by_torque: Array


class Arms(NamedTuple):
    """Arms in one call, one after the other.

    Attributes:
        leading: axes of the results.
        states: public, new. Shape (n, 4 + 4 m).
        inputs: constants of each arm or of all for the kernels, and their derivatives (`HeldTorque._kernel_inputs`).
    """

    leading: tuple[int, ...]
    states: Array
    inputs: tuple[Array, Array]

    @property
    def lanes(self) -> int:
        """Lanes of a block, as suit the number of arms."""
        return 1 if len(self.states) == 1 else LANES

    def shaped(self, results: Array) -> Array:
        """Give results, one for each arm, the leading axes."""
        return results.reshape(*self.leading, *results.shape[1:])


class HeldTorque(ABC):
    """The derivatives of an arm's discrete model: one control period under held torques."""

    parameters: ArmParameters
    modes: tuple[LinkModes, LinkModes]
    constants: Constants
    _latest: tuple[Array, tuple[Array, Array]] | None = None  # of `_inputs_of`

    @abstractmethod
    def longest_step(self, damping: float | None = None, payload_mass: float | None = None) -> float:
        """Return the longest step of the explicit integrator that the arm's fastest mode allows [s].

        Args:
            damping: damping ratio; None: the arm's own.
            payload_mass: [kg]; None: the arm's own.
        """

    def step_jacobians(
        self,
        state: ArrayLike,
        torque: ArrayLike,
        period: float = 0.01,
        *,
        step: float = 1e-3,
        payload_mass: ArrayLike | None = None,
        stiffness: ArrayLike | None = None,
        damping: ArrayLike | None = None,
    ) -> StepJacobians:
        """Compute `step` and its derivatives, exact to rounding error; arguments and errors as there."""
        given = payload_mass, stiffness, damping
        arms, torques = self._driven(state, torque, given)
        h, steps = self._steps(period, step, given)
        count, size = arms.states.shape
        jacobians = tuple(np.empty((count, size, columns)) for columns in (size, 2, len(ARM_QUANTITIES)))
        module, arena = self._kernels(TANGENTS, arms.lanes)
        cache.call(module.run_tangents, arena, *arms.inputs, torques, h, steps, arms.states, jacobians)
        return StepJacobians(*map(arms.shaped, (arms.states, *jacobians)))

    def step_gradients(
        self,
        state: ArrayLike,
        torque: ArrayLike,
        weights: ArrayLike,
        period: float = 0.01,
        *,
        step: float = 1e-3,
        payload_mass: ArrayLike | None = None,
        stiffness: ArrayLike | None = None,
        damping: ArrayLike | None = None,
    ) -> StepGradients:
        """Differentiate a weighted sum of the entries of `step`'s state, exactly to rounding error.

        This is ``weights @ jacobian`` for the Jacobians of `step_jacobians`, by adjoints: it costs a third of them.

        Args:
            state: see `step`.
            torque: see `step`.
            weights: of the entries of the state after the period. Shape (..., 4 + 4 m).
            period: see `step`.
            step: see `step`.
            payload_mass: see `step`.
            stiffness: see `step`.
            damping: see `step`.
        """
        given = payload_mass, stiffness, damping
        summed = finite_rows("weights", weights, 4 * self.parameters.modes_per_link + 4)
        arms, torques = self._driven(state, torque, given, weights=summed.shape[:-1])
        h, steps = self._steps(period, step, given)
        count, size = arms.states.shape
        gradients = np.empty((count, size)), np.empty((count, 2))
        module, arena = self._kernels(GRADIENTS, arms.lanes)
        known = arena, aligned_zeros(trail_rows(size // 2, steps) * arms.lanes), arms.inputs[0], torques
        cache.call(module.run_gradients, *known, h, steps, arms.states, rows_of(summed, arms.leading), gradients)
        return StepGradients(*map(arms.shaped, gradients))

    @cached_property
    def changes(self) -> ConstantChanges:
        """How the constants change with `constants.ARM_QUANTITIES`."""
        return constant_changes(self.parameters, self.modes)

    def _steps(self, period: float, step: float, quantities: tuple[ArrayLike | None, ...]) -> tuple[float, int]:
        """Return the length [s] and the number of the steps of a period.

        The arm's fastest rate grows with the root of the stiffness, with damping, and as the payload falls.
        """
        period, step = number("period", period, "s", above=0.0), number("step", step, "s", above=0.0)
        count = count_instants(period, step, 1, name="period")
        own, (payload, stiffness, damping) = self.parameters, quantities
        ratio = own.damping_ratio if damping is None else float(np.max(np.asarray(damping), initial=own.damping_ratio))
        lightest = own.payload_mass if payload is None else float(np.min(np.asarray(payload), initial=own.payload_mass))
        slower = 1.0 if stiffness is None else float(np.sqrt(np.max(np.asarray(stiffness), initial=1.0)))
        if lightest < own.payload_mass and step <= self.longest_step(ratio, 0.0) / slower:
            return period / count, count  # short enough for any payload: each estimate's own rate is not needed
        if step > (longest := self.longest_step(ratio, lightest) / slower):
            raise ValueError(
                f"step = {step!r}: too long for the arm's fastest mode; at most {longest:.4g} s is allowed"
            )
        return period / count, count

    @cached_property
    def _own(self) -> tuple[Array, Array]:
        return self._kernel_inputs(self.changes.own[None])

    def _inputs_of(self, quantities: Array) -> tuple[Array, Array]:
        """Return `_kernel_inputs`, kept for the next call: a controller asks for the same few rows again and again."""
        if (latest := self._latest) is None or not np.array_equal(latest[0], quantities):
            latest = quantities, self._kernel_inputs(quantities)
            self._latest = latest if len(quantities) <= KEPT else None
        return latest[1]

    def _kernel_inputs(self, quantities: Array) -> tuple[Array, Array]:
        """Return the constants of arms with these quantities (`layout.arm_rows`), and their derivatives.

        Args:
            quantities: Shape (n, 3).

        Returns:
            Shape (n, numbers), and (n, 3 * constants).
        """
        flat = known = self.changes.constants(quantities)
        if not self.constants.foreshortened:
            e = elimination(Constants.unflat(list(flat.T), self.parameters.modes_per_link, dry=self.constants.dry))
            assert e is not None
            known = np.concatenate([flat, np.stack(e.flat(), axis=-1)], axis=1)
        return known, self.changes.derivatives(quantities).reshape(len(quantities), -1)

    def _driven(
        self,
        state: ArrayLike,
        torque: ArrayLike,
        quantities: tuple[ArrayLike | None, ...],
        **others: tuple[int, ...],
    ) -> tuple[Arms, Array]:
        """Return `_arms`, and the torque of each [N m]. Shape (n, 2)."""
        torques = finite_rows("torque", torque, 2, LARGEST)
        arms = self._arms(state, {"torque": torques.shape[:-1], **others}, quantities)
        return arms, rows_of(torques, arms.leading)

    def _arms(
        self, state: ArrayLike, others: Mapping[str, tuple[int, ...]], quantities: tuple[ArrayLike | None, ...]
    ) -> Arms:
        """Check states and quantities, and broadcast all leading axes.

        Args:
            state: Shape (..., 4 + 4 m).
            others: leading axes of the other arguments, by name.
            quantities: as `step` takes them, in the order of `ARM_QUANTITIES`. Shape (...) each.
        """
        states = finite_rows("state", state, 4 * self.parameters.modes_per_link + 4, LARGEST)
        given = {
            name: _quantity(name, unit, value)
            for (name, unit), value in zip(ARM_QUANTITIES.items(), quantities, strict=True)
            if value is not None
        }
        shapes = {"state": states.shape[:-1], **others} | {name: value.shape for name, value in given.items()}
        try:
            leading = np.broadcast_shapes(*shapes.values())
        except ValueError:
            listed = ", ".join(f"{name} {shape}" for name, shape in shapes.items())
            raise ValueError(f"leading axes must broadcast, got {listed}") from None
        inputs = self._own
        if given:
            drawn = [given.get(name, own) for name, own in zip(ARM_QUANTITIES, self.changes.own, strict=True)]
            rows = np.stack(np.broadcast_arrays(*drawn), axis=-1)
            inputs = self._inputs_of(rows.reshape(-1, len(ARM_QUANTITIES)))
            if len(inputs[0]) > 1:
                one, other = (rows_of(table.reshape(*rows.shape[:-1], -1), leading) for table in inputs)
                inputs = one, other
        return Arms(leading, rows_of(states, leading), inputs)

    def _kernels(self, program: Program, lanes: int) -> tuple[Entries, Array]:
        complete, k = self.parameters.velocity_forces == "complete", self.constants
        module, words = _loaded(program, self.parameters.modes_per_link, complete, lanes, k.foreshortened, k.dry)
        return module, aligned_zeros(words)


@lru_cache
def _loaded(
    program: Program, modes: int, complete: bool, lanes: int, foreshortened: bool, dry: bool
) -> tuple[Entries, int]:
    """Return kernels and the length of their arena; arguments as in `Variant`."""
    variant = Variant(program, modes, complete, lanes, foreshortened=foreshortened, dry=dry)
    return compiler.load(variant), lanes * extent(variant.rows)


def rows_of(array: Array, leading: tuple[int, ...]) -> Array:
    """Return one row for each arm, new and in C order, as kernels require. Shape (n, entries)."""
    whole = np.broadcast_to(array, (*leading, array.shape[-1]))
    return np.array(whole, order="C").reshape(-1, array.shape[-1])


def _quantity(name: str, unit: str, value: ArrayLike) -> Array:
    array, (least, most) = real_array(name, value), RANGES[name]
    inside = (array >= least) & (array <= most)
    if not np.all(inside):
        bad = float(array[~inside].ravel()[0])
        raise ValueError(f"{name} = {bad!r}: must be a number from {least:g} to {most:g} [{unit}]")
    return array
