"""`FlexibleArm`: the friendly object over the equations and the compiled kernels.

Public coordinates: ``q`` = (theta1, theta2, link 1's modal coordinates, link 2's), Shape (..., 2 + 2 m); a *state*
is q followed by its rates, Shape (..., 4 + 4 m). theta1 is the angle of link 1's root tangent from the x axis;
theta2 that of link 2's root tangent from the tangent at link 1's tip. Symbols as in `flexarm_env.dynamics`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexarm_env import dynamics as dyn
from flexarm_env import kernels
from flexarm_env.parameters import ArmParameters
from flexarm_env.stepping import RK4_STEP, RK4_WEIGHT
from flexarm_env.trajectory import Trajectory
from flexarm_env.validation import finite_array, integer, number

Array = NDArray[np.float64]
TorqueFunction = Callable[[float, Array], ArrayLike]

# RK4 is stable for undamped modes up to h omega = 2.83; 2 leaves room for the mass matrix's change with deflection.
STEP_LIMIT = 2.0


class Energy(NamedTuple):
    """Kinetic and strain energy [J]. Shape (...)."""

    kinetic: Array
    strain: Array


class Linearisation(NamedTuple):
    """``d(state)/dt = A (state - state0) + B (torque - torque0) + rate0`` about an operating point.

    Attributes:
        A: Shape (4 + 4 m, 4 + 4 m).
        B: Shape (4 + 4 m, 2).
        rate: d(state)/dt at the operating point, zero at an equilibrium. Shape (4 + 4 m,).
    """

    A: Array
    B: Array
    rate: Array


class DivergenceError(RuntimeError):
    """A simulation whose state stopped being finite.

    Attributes:
        time: of the last finite state [s].
        trajectory: what was computed until then.
    """

    def __init__(self, time: float, trajectory: Trajectory) -> None:
        """Say when; keep what there is."""
        super().__init__(f"the state stopped being finite after t = {time:.6g} s; .trajectory holds the run until then")
        self.time = time
        self.trajectory = trajectory


class FlexibleArm:
    """A planar arm of two flexible links: its equations, kinematics, and torque-driven simulation.

    Attributes:
        parameters: the arm's parameters.
        modes: `LinkModes` of the two bare links.
        constants: what the equations know of the arm.
    """

    def __init__(self, parameters: ArmParameters | None = None) -> None:
        """Compute modes and constants; nothing is compiled before `simulate`.

        Args:
            parameters: default `ArmParameters()`.

        Raises:
            TypeError: if it is anything else.
        """
        parameters = ArmParameters() if parameters is None else parameters
        if not isinstance(parameters, ArmParameters):
            raise TypeError(f"parameters = {parameters!r}: must be an ArmParameters")
        self.parameters = parameters
        self.modes = dyn.arm_modes(parameters)
        self.constants = dyn.arm_constants(parameters, self.modes)
        m = parameters.modes_per_link
        # dy/dq, constant: the internal coordinates are the columns' images
        self._to_internal = np.array(dyn.internal_coordinates(self.constants, np.eye(2 * m + 2))).astype(float)

    @property
    def size(self) -> int:
        """Number of coordinates, 2 + 2 m."""
        return 2 * self.parameters.modes_per_link + 2

    # --- equations -------------------------------------------------------------------------------------------------

    def mass_matrix(self, q: ArrayLike) -> Array:
        """Mass matrix in public coordinates. Shape (..., 2 + 2 m, 2 + 2 m)."""
        y, cos, sin, _ = self._geometry(self._coordinates("q", q))
        internal = _stack_matrix(dyn.mass_matrix(self.constants, y, cos, sin))
        return self._to_internal.T @ internal @ self._to_internal

    def velocity_forces(self, q: ArrayLike, rates: ArrayLike) -> Array:
        """Coriolis and centrifugal forces C in ``tau = M q'' + C + D q' + K q`` (6). Shape (..., 2 + 2 m)."""
        q, rates = np.broadcast_arrays(self._coordinates("q", q), self._coordinates("rates", rates))
        h = self._velocity_forces(self._geometry(q), self._internal(rates))
        return _stack(h) @ self._to_internal

    def acceleration(self, state: ArrayLike, torque: ArrayLike = (0.0, 0.0)) -> Array:
        """q'' under a torque [N m]. Shape (..., 2 + 2 m)."""
        q, rates = self._split(state)
        tau = np.moveaxis(finite_like("torque", torque, 2), -1, 0)
        return self._public_acceleration(q, rates, tau)

    def energy(self, state: ArrayLike) -> Energy:
        """Kinetic and strain energy [J]. Shape (...) each."""
        q, rates = self._split(state)
        y, cos, sin, _ = self._geometry(q)
        matrix = dyn.mass_matrix(self.constants, y, cos, sin)
        kinetic = dyn.kinetic_energy(matrix, self._internal(rates))
        return Energy(np.asarray(kinetic), np.asarray(dyn.strain_energy(self.constants, y)))

    def angular_momentum(self, state: ArrayLike) -> Array:
        """About the shoulder [kg m^2/s]. Shape (...)."""
        q, rates = self._split(state)
        y, cos, sin, _ = self._geometry(q)
        matrix = dyn.mass_matrix(self.constants, y, cos, sin)
        return np.asarray(dyn.angular_momentum(matrix, self._internal(rates)))

    # --- kinematics ------------------------------------------------------------------------------------------------

    def position(self, q: ArrayLike, link: int, s: ArrayLike) -> Array:
        """A material point, with deflection.

        Args:
            q: coordinates. Shape (..., 2 + 2 m).
            link: 1 or 2.
            s: distance from the link's root along its undeformed axis [m]. A number, or shape broadcasting with
                q's leading axes.

        Returns:
            x, y [m]. Shape (..., 2).

        Raises:
            ValueError: for another link, or s off the link.
        """
        return self._point(self._coordinates("q", q), link, s)[0]

    def velocity(self, state: ArrayLike, link: int, s: ArrayLike) -> Array:
        """Velocity of a material point [m/s]; arguments as in `position`. Shape (..., 2)."""
        q, rates = self._split(state)
        jacobian = self._point(q, link, s)[1]
        return np.einsum("...ij,...j->...i", jacobian, rates)

    def point_jacobian(self, q: ArrayLike, link: int, s: ArrayLike) -> Array:
        """d(position)/dq; arguments as in `position`. Shape (..., 2, 2 + 2 m)."""
        return self._point(self._coordinates("q", q), link, s)[1]

    def elbow(self, q: ArrayLike) -> Array:
        """Tip of link 1 [m]. Shape (..., 2)."""
        return self.position(q, 1, self.parameters.link_lengths[0])

    def tip(self, q: ArrayLike) -> Array:
        """Tip of link 2 [m]. Shape (..., 2)."""
        return self.position(q, 2, self.parameters.link_lengths[1])

    def rigid_tip(self, q: ArrayLike) -> Array:
        """Tip by rigid kinematics of the joint angles (8), (9) [m]. Shape (..., 2)."""
        q = self._coordinates("q", q)
        length1, length2 = self.parameters.link_lengths
        one, both = q[..., 0], q[..., 0] + q[..., 1]
        return np.stack(
            [
                length1 * np.cos(one) + length2 * np.cos(both),
                length1 * np.sin(one) + length2 * np.sin(both),
            ],
            axis=-1,
        )

    def tip_deflection(self, q: ArrayLike) -> Array:
        """Each link's tip off its own root tangent [m]. Shape (..., 2)."""
        q = self._coordinates("q", q)
        m = self.parameters.modes_per_link
        links = (q[..., 2 : 2 + m], q[..., 2 + m :])
        pairs = zip(links, self.modes, strict=True)
        return np.stack([coordinates @ link.tip_values for coordinates, link in pairs], axis=-1)

    # --- linearisation ---------------------------------------------------------------------------------------------

    def linearise(self, state: ArrayLike, torque: ArrayLike = (0.0, 0.0)) -> Linearisation:
        """Linearise about any state and torque, exact to rounding error (complex-step derivatives).

        Args:
            state: operating point. Shape (4 + 4 m,).
            torque: [N m]. Shape (2,).

        Returns:
            A, B and the rate at the point; an equilibrium has rate 0.
        """
        point = finite_array("state", state, (2 * self.size,))
        tau0 = finite_array("torque", torque, (2,))
        inputs = np.concatenate([point, tau0])
        step = 1e-30  # a complex step loses no digits to cancellation
        columns = []
        for i in range(len(inputs)):
            moved = inputs.astype(complex)
            moved[i] += 1j * step
            columns.append(self._state_rate(moved[: 2 * self.size], moved[2 * self.size :]).imag / step)
        jacobian = np.stack(columns, axis=1)
        rate = self._state_rate(point, tau0)
        return Linearisation(jacobian[:, : 2 * self.size], jacobian[:, 2 * self.size :], rate)

    def fastest_rate(self) -> float:
        """Largest eigenvalue magnitude of the free arm at rest over the elbow's angles [rad/s]."""
        states = np.zeros((9, 2 * self.size))
        states[:, 1] = np.linspace(0.0, np.pi, 9)
        return max(float(np.abs(np.linalg.eigvals(self.linearise(state).A)).max()) for state in states)

    def longest_step(self) -> float:
        """Longest step of the explicit integrator that the arm's fastest mode allows [s]."""
        return STEP_LIMIT / self.fastest_rate()

    # --- simulation ------------------------------------------------------------------------------------------------

    def simulate(
        self,
        initial_state: ArrayLike,
        torque: TorqueFunction | ArrayLike | None,
        duration: float,
        step: float = 1e-3,
        substeps: int | Literal["auto"] = 1,
    ) -> Trajectory:
        """Integrate the torque-driven arm by the classical Runge-Kutta method of fourth order.

        Args:
            initial_state: Shape (4 + 4 m,).
            torque: a function ``torque(time, state)`` giving shoulder and elbow [N m], evaluated at every stage;
                or an array held over each step, Shape (steps, 2); or None for none.
            duration: a whole number of steps [s].
            step: [s]; the trajectory has one instant a step.
            substeps: integration steps in each `step`; "auto": as few as the fastest mode allows.

        Returns:
            A `Trajectory` of ``steps + 1`` instants.

        Raises:
            ValueError: for bad input; a step too long is refused with the longest that is allowed.
            DivergenceError: if the state stops being finite; it keeps the run until then.
        """
        start = finite_array("initial_state", initial_state, (2 * self.size,))
        step = number("step", step, "s", above=0.0)
        duration = number("duration", duration, "s", above=0.0)
        steps = round(duration / step)
        if steps < 1 or abs(steps * step - duration) > 1e-9 * duration:
            raise ValueError(f"duration = {duration!r}: must be a whole number of steps of {step} s")
        count = self._substeps(step, substeps)
        if callable(torque):
            states, torques = self._run_function(start, torque, steps, step, count)
        else:
            held = np.zeros((steps, 2)) if torque is None else finite_array("torque", torque, (steps, 2))
            states, torques = self._run_held(start, held, step, count)
        trajectory = self.record(step * np.arange(len(states)), states, torques)
        if len(states) <= steps:
            raise DivergenceError(float(trajectory.time[-1]), trajectory)
        return trajectory

    def record(self, time: Array, state: Array, torque: Array, **signals: Any) -> Trajectory:
        """Complete a run's states to a `Trajectory`.

        Args:
            time: [s]. Shape (n,).
            state: Shape (n, 4 + 4 m).
            torque: [N m]. Shape (n, 2).
            **signals: further fields of `Trajectory`.
        """
        q = state[:, : self.size]
        energy = self.energy(state)
        return Trajectory(
            parameters=self.parameters,
            time=time,
            state=state,
            torque=torque,
            tip=self.tip(q),
            elbow=self.elbow(q),
            rigid_tip=self.rigid_tip(q),
            tip_deflection=self.tip_deflection(q),
            kinetic_energy=energy.kinetic,
            strain_energy=energy.strain,
            **signals,
        )

    # --- inside ----------------------------------------------------------------------------------------------------

    def _coordinates(self, name: str, q: ArrayLike) -> Array:
        return finite_like(name, q, self.size)

    def _split(self, state: ArrayLike) -> tuple[Array, Array]:
        array = finite_like("state", state, 2 * self.size)
        return array[..., : self.size], array[..., self.size :]

    def _internal(self, q: Array) -> list[Any]:
        return dyn.internal_coordinates(self.constants, list(np.moveaxis(q, -1, 0)))

    def _geometry(self, q: Array) -> tuple[list[Any], Any, Any, Any]:
        """y, cosine and sine of a2 - a1, sine of theta2; real or complex."""
        y = self._internal(q)
        between = y[self.parameters.modes_per_link + 1] - y[0]
        return y, np.cos(between), np.sin(between), np.sin(q[..., 1])

    def _velocity_forces(self, geometry: tuple[list[Any], Any, Any, Any], v: list[Any]) -> list[Any]:
        y, cos, sin, sin_theta2 = geometry
        if self.parameters.velocity_forces == "complete":
            return dyn.velocity_forces(self.constants, y, v, cos, sin)
        return dyn.rigid_velocity_forces(self.constants, v, sin_theta2)

    def _public_acceleration(self, q: Array, rates: Array, tau: Sequence[Any]) -> Array:
        y, *angles = self._geometry(q)
        complete = self.parameters.velocity_forces == "complete"
        v = self._internal(rates)
        internal = _stack(dyn.acceleration(self.constants, complete, y, v, tau, (angles[0], angles[1], angles[2])))
        return internal @ np.linalg.inv(self._to_internal).T

    def _state_rate(self, state: Array, tau: Array) -> Array:
        q, rates = state[: self.size], state[self.size :]
        return np.concatenate([rates, self._public_acceleration(q, rates, list(tau))])

    def _point(self, q: Array, link: int, s: ArrayLike) -> tuple[Array, Array]:
        """Position of a material point and its Jacobian with respect to q."""
        link = integer("link", link, 1, 2)
        length = self.parameters.link_lengths[link - 1]
        s = np.asarray(s, dtype=float)
        if not np.all((s >= 0.0) & (s <= length)):
            raise ValueError(f"s = {s!r}: must be a distance on link {link}, 0 to {length} [m]")
        m = self.parameters.modes_per_link
        y = _stack(self._internal(q))
        first_s = s if link == 1 else np.asarray(self.parameters.link_lengths[0])
        at, jacobian = _link_point(y[..., : m + 1], first_s, self.modes[0].shape(first_s))
        full = np.zeros((*jacobian.shape[:-1], self.size))
        full[..., : m + 1] = jacobian
        if link == 2:
            relative, jacobian = _link_point(y[..., m + 1 :], s, self.modes[1].shape(s))
            at = at + relative
            full = np.broadcast_to(full, (*relative.shape, self.size)).copy()
            full[..., m + 1 :] = jacobian
        return at, full @ self._to_internal

    def _substeps(self, step: float, substeps: int | str) -> int:
        longest = self.longest_step()
        if substeps == "auto":
            return int(np.ceil(step / longest))
        count = integer("substeps", substeps, 1)
        if step / count > longest:
            raise ValueError(
                f"step = {step} s in {count} substep(s): too long for the arm's fastest mode, "
                f"{self.fastest_rate():.4g} rad/s; at most {longest:.4g} s is allowed "
                f"(or substeps='auto', here {int(np.ceil(step / longest))})"
            )
        return count

    def _arena(self, start: Array) -> tuple[Any, Array, slice]:
        """Kernel module, arena of one lane holding the start, and the slice of its state."""
        m = self.parameters.modes_per_link
        complete = self.parameters.velocity_forces == "complete"
        module = kernels.load(kernels.Variant("open", m, complete, lanes=1))
        rows = kernels.layout("open", m)
        arena = np.zeros(kernels.arena_rows("open", m))
        first, count = rows["CONSTANTS"]
        arena[first : first + count] = self.constants.flat()
        where = slice(rows["Y"][0], rows["Y"][0] + 2 * self.size)  # rates follow positions
        arena[where] = self.internal_state(start)
        return module, arena, where

    def internal_state(self, state: Array) -> Array:
        """(y, v) of public states. Shape (..., 4 + 4 m)."""
        return np.concatenate([_stack(self._internal(half)) for half in np.split(state, 2, axis=-1)], axis=-1)

    def public_state(self, internal: Array) -> Array:
        """Inverse of `internal_state`; sums in a fixed order, the same bits for one state and for many."""
        halves = []
        m = self.parameters.modes_per_link
        for half in np.split(internal, 2, axis=-1):
            theta1, theta2 = dyn.joint_angles(self.constants, list(np.moveaxis(half, -1, 0)))
            halves += [theta1[..., None], theta2[..., None], half[..., 1 : m + 1], half[..., m + 2 :]]
        return np.concatenate(halves, axis=-1)

    def _run_held(self, start: Array, held: Array, step: float, substeps: int) -> tuple[Array, Array]:
        module, arena, _ = self._arena(start)
        torques = np.repeat(held, substeps, axis=0)[:, None, :]
        states = np.zeros((len(held), 1, 2 * self.size))
        done = module.run_open(arena[None], torques, states, step / substeps, substeps) // substeps
        states = np.concatenate([start[None], self.public_state(states[:done, 0])])
        return states, np.concatenate([held, held[-1:]])[: done + 1]

    def _run_function(
        self, start: Array, torque: TorqueFunction, steps: int, step: float, substeps: int
    ) -> tuple[Array, Array]:
        module, arena, where = self._arena(start)
        rows = kernels.layout("open", self.parameters.modes_per_link)
        slope = slice(rows["Y_SLOPE"][0], rows["Y_SLOPE"][0] + 2 * self.size)
        tau = slice(rows["TAU"][0], rows["TAU"][0] + 2)
        h = step / substeps

        def evaluate(time: float, state: Array) -> Array:
            return finite_array(f"torque(time={time:.6g}, state)", torque(time, state), (2,))

        states, torques = [start], [evaluate(0.0, start)]
        for k in range(steps * substeps):
            module.begin_step(arena)
            for node, weight in zip(RK4_STEP, RK4_WEIGHT, strict=True):
                stage = self.public_state(arena[where] + node * h * arena[slope])
                if not np.all(np.isfinite(stage)):
                    return np.array(states), np.array(torques)
                arena[tau] = evaluate((k + node) * h, stage)
                module.slope_kernel(arena, node * h, weight)
            module.end_step(arena, h)
            if (k + 1) % substeps == 0:
                state = self.public_state(arena[where])
                if not np.all(np.isfinite(state)):
                    break
                states.append(state)
                torques.append(evaluate((k + 1) * h, state))
        return np.array(states), np.array(torques)


def finite_like(name: str, value: ArrayLike, last: int) -> Array:
    """An array of finite numbers with a given last axis, as float64.

    Raises:
        ValueError: for another shape, or an entry that is not finite.
    """
    array = np.asarray(value, dtype=float)
    if array.ndim == 0 or array.shape[-1] != last:
        raise ValueError(f"{name}: must have shape (..., {last}), got {array.shape}")
    return finite_array(name, array, tuple(array.shape))


def _stack(values: Sequence[Any]) -> Array:
    return np.stack(np.broadcast_arrays(*values), axis=-1)


def _stack_matrix(rows: Sequence[Sequence[Any]]) -> Array:
    size = len(rows)
    flat = _stack([value for row in rows for value in row])
    return flat.reshape(*flat.shape[:-1], size, size)


def _link_point(y: Array, s: Array, shape: Array) -> tuple[Array, Array]:
    """Point s e + w n of one link relative to its root, and its Jacobian in (a, q)."""
    angle, coordinates = y[..., 0], y[..., 1:]
    w = np.sum(shape * coordinates, axis=-1)
    cos, sin = np.cos(angle), np.sin(angle)
    at = np.stack([s * cos - w * sin, s * sin + w * cos], axis=-1)
    normal = np.stack([-sin, cos], axis=-1)
    turn = np.stack([-at[..., 1], at[..., 0]], axis=-1)
    bend = normal[..., :, None] * np.broadcast_to(shape, (*w.shape, shape.shape[-1]))[..., None, :]
    return at, np.concatenate([turn[..., None], bend], axis=-1)
