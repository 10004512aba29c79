"""Many arms over one control period with torques held: states, and their exact Jacobians.

The classical Runge-Kutta method of fourth order, as in `FlexibleArm.simulate`; the Jacobians are those of its steps
(`step_jacobians`), not of the continuous motion.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
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
    """The discrete model of an arm: one control period under held torques."""

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

    def step(
        self,
        state: ArrayLike,
        torque: ArrayLike,
        period: float = 0.01,
        *,
        step: float = 1e-3,
        payload_mass: ArrayLike | None = None,
        stiffness: ArrayLike | None = None,
        damping: ArrayLike | None = None,
    ) -> Array:
        """Compute the state a control period later, of one arm or of many at once.

        Leading axes of all arguments broadcast. A state that stops being finite comes back as NaN or infinite.

        Args:
            state: Shape (..., 4 + 4 m).
            torque: held over the period, of shoulder and elbow [N m]. Shape (..., 2).
            period: [s]; a whole number of steps.
            step: step of the Runge-Kutta method [s].
            payload_mass: [kg], 0 to 1000; None: the arm's own. Shape (...).
            stiffness: factor on the stiffness of both links, 0.001 to 1000; None: 1. Shape (...).
            damping: damping ratio (`physics.damping`) at that stiffness, 0 to 1; None: the arm's own. Shape (...).

        Returns:
            States, new. Shape (..., 4 + 4 m).

        Raises:
            ValueError: for bad input; a step too long is refused with the longest that is allowed.
        """
        given = payload_mass, stiffness, damping
        arms, torques = self._driven(state, torque, given)
        h, steps = self._steps(period, step, given)
        module, arena = self._kernels(TANGENTS, arms.lanes)
        cache.call(module.run_steps, arena, arms.inputs[0], torques, h, steps, arms.states)
        return arms.shaped(arms.states)

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
        cache.call(module.run_gradients, *known, h, steps, arms.states, _rows(summed, arms.leading), gradients)
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
        return arms, _rows(torques, arms.leading)

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
                one, other = (_rows(table.reshape(*rows.shape[:-1], -1), leading) for table in inputs)
                inputs = one, other
        return Arms(leading, _rows(states, leading), inputs)

    def _kernels(self, program: Program, lanes: int) -> tuple[Entries, Array]:
        complete, k = self.parameters.velocity_forces == "complete", self.constants
        module, words = _loaded(program, self.parameters.modes_per_link, complete, lanes, k.foreshortened, k.dry)
        return module, aligned_zeros(words)


def step_each(arms: Sequence[HeldTorque], state: Array, torque: Array, period: float, step: float) -> Array:
    """Return `HeldTorque.step` of arms that differ in numbers alone. Shape (arms, n, 4 + 4 m).

    Args:
        arms: of one number of modes, kinematics and velocity forces; only the first one's longest step is checked.
        state: of all of them. Shape (n, 4 + 4 m).
        torque: on all of them. Shape (n, 2).
        period: see `HeldTorque.step`.
        step: see there.
    """
    if len(kinds := {(len(one._own[0][0]), one.parameters.velocity_forces, one.constants.dry) for one in arms}) != 1:
        raise ValueError(f"arms of {len(kinds)} kinds; shapes, kinematics and forces must be the same")
    h, steps = arms[0]._steps(period, step, (None, None, None))
    leading = len(arms), len(state)
    known = np.repeat(np.concatenate([one._own[0] for one in arms]), len(state), axis=0)
    states = _rows(state, leading)
    module, arena = arms[0]._kernels(TANGENTS, LANES)
    cache.call(module.run_steps, arena, known, _rows(torque, leading), h, steps, states)
    return states.reshape(*leading, -1)


@lru_cache
def _loaded(
    program: Program, modes: int, complete: bool, lanes: int, foreshortened: bool, dry: bool
) -> tuple[Entries, int]:
    """Return kernels and the length of their arena; arguments as in `Variant`."""
    variant = Variant(program, modes, complete, lanes, foreshortened=foreshortened, dry=dry)
    return compiler.load(variant), lanes * extent(variant.rows)


def _rows(array: Array, leading: tuple[int, ...]) -> Array:
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
