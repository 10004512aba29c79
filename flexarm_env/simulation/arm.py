"""`FlexibleArm`: an arm with its equations, kinematics and simulation.

Public coordinates: ``q`` = (theta1, theta2, link 1's modal coordinates, link 2's), Shape (..., 2 + 2 m); a *state*
is q followed by its rates, Shape (..., 4 + 4 m). theta1 is the angle of link 1's root tangent from the x axis;
theta2 that of link 2's root tangent from the tangent at link 1's tip. Symbols as in `flexarm_env.physics.dynamics`.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexarm_env.parameters import ArmParameters
from flexarm_env.physics import constants, coordinates
from flexarm_env.physics import dynamics as dyn
from flexarm_env.physics.bent_link import PointShape
from flexarm_env.physics.linearisation import Linearisation, linearise, straight_arms
from flexarm_env.physics.modal_elimination import elimination
from flexarm_env.physics.sensing import Outputs
from flexarm_env.simulation.conditioning import refuse_singular
from flexarm_env.simulation.feedback import FeedbackTorque
from flexarm_env.simulation.open_loop import LARGEST, OpenLoop, TorqueFunction, count_instants, substeps_of
from flexarm_env.simulation.outputs import output_jacobians
from flexarm_env.simulation.trajectory import DivergenceError, Trajectory
from flexarm_env.validation import finite_array, finite_rows, instance, integer, number, real_array, shown

Array = NDArray[np.float64]

# RK4 is stable for undamped modes up to h omega = 2.83; large vibrations change the mass matrix within a step.
STEP_LIMIT = 2.0


class Energy(NamedTuple):
    """Kinetic and strain energy [J]. Shape (...)."""

    kinetic: Array
    strain: Array


class FlexibleArm(FeedbackTorque):
    """A planar arm of two flexible links: its equations, kinematics, and torque-driven simulation.

    Attributes:
        parameters: the arm's parameters.
        modes: `LinkModes` of the two bare links.
        constants: constants of the arm, in the equations.
    """

    def __init__(self, parameters: ArmParameters | None = None) -> None:
        """Compute modes and constants; nothing is compiled before it is simulated.

        Args:
            parameters: default `ArmParameters()`.

        Raises:
            TypeError, ValueError: if it is anything else, or its masses lie too far apart (`conditioning`).
        """
        self.parameters = parameters = ArmParameters() if parameters is None else parameters
        instance("parameters", parameters, ArmParameters)
        self.modes = constants.arm_modes(parameters)
        self.constants = constants.arm_constants(parameters, self.modes)
        refuse_singular(parameters, self.constants)
        self._complete = parameters.velocity_forces == "complete"
        self._elimination = elimination(self.constants)
        self._to_internal = coordinates.to_internal(self.constants)
        self._to_public = coordinates.to_public(self.constants)
        self._places: dict[tuple[int, float], PointShape] = {}  # tip and sensor, for controllers that ask all the time

    def __repr__(self) -> str:
        """Describe the arm in a line."""
        p = self.parameters
        return f"FlexibleArm({p.link_lengths} m, {p.modes_per_link} {p.mode_shapes} modes a link, {p.kinematics})"

    @property
    def size(self) -> int:
        """Number of coordinates, 2 + 2 m."""
        return 2 * self.parameters.modes_per_link + 2

    # --- equations -------------------------------------------------------------------------------------------------

    def mass_matrix(self, q: ArrayLike) -> Array:
        """Return the mass matrix in public coordinates [kg m^2]. Shape (..., 2 + 2 m, 2 + 2 m)."""
        y, cos, sin, _ = self._geometry(self._coordinates("q", q))
        internal = coordinates.stack_matrix(dyn.mass_matrix(self.constants, y, cos, sin))
        return self._to_internal.T @ internal @ self._to_internal

    def velocity_forces(self, q: ArrayLike, rates: ArrayLike) -> Array:
        """Return the velocity forces C in ``B tau = M q'' + C + D q' + K q`` (6) [N m]. Shape (..., 2 + 2 m)."""
        q, rates = self._coordinates("q", q), self._coordinates("rates", rates)
        coordinates.check_leading(q=q.shape[:-1], rates=rates.shape[:-1])
        q, rates = np.broadcast_arrays(q, rates)
        (y, cos, sin, sin_theta2), v = self._geometry(q), self._internal(rates)
        if self._complete:
            h = dyn.velocity_forces(self.constants, y, v, cos, sin)
        else:
            h = dyn.rigid_velocity_forces(self.constants, v, sin_theta2)
        return coordinates.stack(h) @ self._to_internal

    def acceleration(self, state: ArrayLike, torque: ArrayLike = (0.0, 0.0)) -> Array:
        """Return q'' [rad/s^2, 1/s^2] under torques of Shape (..., 2) [N m]. Shape (..., 2 + 2 m)."""
        q, rates = self._split(state)
        tau = finite_rows("torque", torque, 2, LARGEST)
        coordinates.check_leading(state=q.shape[:-1], torque=tau.shape[:-1])
        y, cos, sin, sin_theta2 = self._geometry(q)
        arm, angles = (self.constants, self._elimination, self._complete), (cos, sin, sin_theta2)
        internal = dyn.acceleration(*arm, y, self._internal(rates), list(np.moveaxis(tau, -1, 0)), angles)
        return coordinates.stack(internal) @ self._to_public.T

    def energy(self, state: ArrayLike) -> Energy:
        """Return the kinetic and strain energy [J]. Shape (...) each."""
        return self._energy(*self._split(state))

    def _energy(self, q: Array, rates: Array) -> Energy:
        y, cos, sin, _ = self._geometry(q)
        matrix = dyn.mass_matrix(self.constants, y, cos, sin)
        kinetic = dyn.kinetic_energy(matrix, self._internal(rates))
        return Energy(np.asarray(kinetic), np.asarray(dyn.strain_energy(self.constants, y)))

    def angular_momentum(self, state: ArrayLike) -> Array:
        """Return the angular momentum about the shoulder [kg m^2/s]. Shape (...)."""
        q, rates = self._split(state)
        y, cos, sin, _ = self._geometry(q)
        matrix = dyn.mass_matrix(self.constants, y, cos, sin)
        return np.asarray(dyn.angular_momentum(matrix, self._internal(rates)))

    # --- kinematics ------------------------------------------------------------------------------------------------

    def position(self, q: ArrayLike, link: int, s: ArrayLike) -> Array:
        """Return the position of a material point, with deflection.

        Args:
            q: coordinates. Shape (..., 2 + 2 m).
            link: 1 or 2.
            s: distance from the link's root along its undeformed axis [m], within its length. A number, or an array
                that broadcasts with q's leading axes.

        Returns:
            x, y [m]. Shape (..., 2).
        """
        return self._point(self._coordinates("q", q), link, s)[0]

    def velocity(self, state: ArrayLike, link: int, s: ArrayLike) -> Array:
        """Return the velocity of a material point [m/s]; arguments as in `position`. Shape (..., 2)."""
        q, rates = self._split(state)
        jacobian = self._point(q, link, s)[1]
        return np.einsum("...ij,...j->...i", jacobian, rates)

    def point_jacobian(self, q: ArrayLike, link: int, s: ArrayLike) -> Array:
        """Return d(position)/dq; arguments as in `position`. Shape (..., 2, 2 + 2 m)."""
        return self._point(self._coordinates("q", q), link, s)[1]

    def place(self, link: int, s: float) -> PointShape:
        """Return a material point as the equations know it; arguments as in `position`, s a number."""
        link = integer("link", link, 1, 2)
        length = self.parameters.link_lengths[link - 1]
        distance = number("s", s, "m", least=0.0, most=length)
        if (link, distance) not in self._places:
            modes = self.modes[link - 1]
            self._places[link, distance] = constants.link_place(modes, self.constants.foreshortened, distance)
        return self._places[link, distance]

    def elbow(self, q: ArrayLike) -> Array:
        """Return the tip of link 1 [m]. Shape (..., 2)."""
        return self.position(q, 1, self.parameters.link_lengths[0])

    def tip(self, q: ArrayLike) -> Array:
        """Return the tip of link 2 [m]. Shape (..., 2)."""
        return self.position(q, 2, self.parameters.link_lengths[1])

    def rigid_tip(self, q: ArrayLike) -> Array:
        """Return the tip by rigid kinematics of the joint angles (8), (9) [m]. Shape (..., 2)."""
        return coordinates.rigid_tip(self.parameters.link_lengths, self._coordinates("q", q))

    def tip_deflection(self, q: ArrayLike) -> Array:
        """Return each link's tip off its own root tangent [m]. Shape (..., 2)."""
        return self._tip_deflection(self._coordinates("q", q))

    def _tip_deflection(self, q: Array) -> Array:
        pairs = zip(np.split(q[..., 2:], 2, axis=-1), self.modes, strict=True)
        return np.stack([coordinates @ link.tip_values for coordinates, link in pairs], axis=-1)

    # --- linearisation ---------------------------------------------------------------------------------------------

    def linearise(self, state: ArrayLike, torque: ArrayLike = (0.0, 0.0)) -> Linearisation:
        """Linearise about any state and torque, exact to rounding error.

        Args:
            state: operating point. Shape (4 + 4 m,).
            torque: [N m]. Shape (2,).

        Returns:
            A, B and the rate at the point; an equilibrium has rate 0.
        """
        point = finite_array("state", state, (2 * self.size,), LARGEST)
        tau0 = finite_array("torque", torque, (2,), LARGEST)
        return linearise(self.constants, self._elimination, self._complete, point, tau0)

    def output_jacobians(self, state: ArrayLike, sensor_position: float | None = None) -> tuple[Outputs, Outputs]:
        """Return joints, sensor, tips and deflections, and their derivatives by the state along a new last axis.

        Args:
            state: Shape (..., 4 + 4 m).
            sensor_position: distance of the sensor from the elbow along link 2 [m]; None: at the tip.
        """
        length, states = self.parameters.link_lengths[1], finite_rows("state", state, 2 * self.size, LARGEST)
        s = length if sensor_position is None else number("sensor_position", sensor_position, "m", least=0, most=length)
        return output_jacobians(self.constants, self.place(2, length), self.place(2, s), states)

    def fastest_rate(self) -> float:
        """Return the largest eigenvalue magnitude of the free arm at rest over the elbow's angles [rad/s]."""
        return _fastest_rate(self.parameters)

    def longest_step(self, damping: float | None = None, payload_mass: float | None = None) -> float:
        """Return the longest step of the explicit integrator that the arm's fastest mode allows [s].

        Args:
            damping: damping ratio; None: the arm's own.
            payload_mass: [kg]; None: the arm's own.
        """
        own = self.parameters
        ratio = own.damping_ratio if damping is None else damping
        payload = own.payload_mass if payload_mass is None else payload_mass
        if (ratio, payload) != (own.damping_ratio, own.payload_mass):
            own = replace(own, damping_ratio=ratio, payload_mass=payload)
        return STEP_LIMIT / _fastest_rate(own)

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
            substeps: integration steps in each `step`; "auto": as few as the fastest mode allows, which is stable for
                ordinary motion and does not resolve that mode: for accuracy take more.

        Returns:
            A `Trajectory` of ``steps + 1`` instants.

        Raises:
            ValueError: for bad input; a step too long is refused with the longest that is allowed.
            DivergenceError: if the state stops being finite; it keeps the run until then.
        """
        start = finite_array("initial_state", initial_state, (2 * self.size,), LARGEST)
        step = number("step", step, "s", above=0.0)
        count = substeps_of(step, substeps, self.longest_step(), self.fastest_rate())
        steps = count_instants(number("duration", duration, "s", above=0.0), step, count)
        if callable(torque):
            states, torques = OpenLoop(self.constants, self._complete, start).run(torque, steps, step, count)
        else:
            held = np.zeros((steps, 2)) if torque is None else finite_array("torque", torque, (steps, 2))
            states, torques = self._run_held(start, held, step, count)
        trajectory = self.record(step * np.arange(len(states), dtype=np.float64), states, torques)
        if len(states) <= steps:
            raise DivergenceError(float(trajectory.time[-1]), trajectory)
        return trajectory

    def record(self, time: ArrayLike, state: ArrayLike, torque: ArrayLike, **signals: Any) -> Trajectory:
        """Complete a run's states to a `Trajectory`.

        Args:
            time: [s]. Shape (n,).
            state: Shape (n, 4 + 4 m).
            torque: [N m]. Shape (n, 2).
            **signals: further fields of `Trajectory`.
        """
        states = finite_array("state", state, (None, 2 * self.size))
        q, rates = states[:, : self.size], states[:, self.size :]
        with np.errstate(over="ignore", invalid="ignore"):  # energies of a diverging state overflow before it does
            energy = self._energy(q, rates)
            elbow, tip = (self._point(q, link, self.parameters.link_lengths[link - 1])[0] for link in (1, 2))
            return Trajectory(
                parameters=self.parameters,
                time=real_array("time", time),
                state=states,
                torque=real_array("torque", torque),
                tip=tip,
                elbow=elbow,
                rigid_tip=coordinates.rigid_tip(self.parameters.link_lengths, q),
                tip_deflection=self._tip_deflection(q),
                kinetic_energy=energy.kinetic,
                strain_energy=energy.strain,
                **signals,
            )

    def internal_state(self, state: Array) -> Array:
        """Return (y, v) of public states, see `flexarm_env.physics.dynamics`. Shape (..., 4 + 4 m)."""
        return coordinates.internal_state(self.constants, state)

    def public_state(self, internal: Array) -> Array:
        """Return the inverse of `internal_state`. Shape (..., 4 + 4 m)."""
        return coordinates.public_state(self.constants, internal)

    # --- inside ----------------------------------------------------------------------------------------------------

    def _coordinates(self, name: str, q: ArrayLike) -> Array:
        return finite_rows(name, q, self.size, LARGEST)

    def _split(self, state: ArrayLike) -> tuple[Array, Array]:
        array = finite_rows("state", state, 2 * self.size, LARGEST)
        return array[..., : self.size], array[..., self.size :]

    def _internal(self, q: Array) -> list[Any]:
        return dyn.internal_coordinates(self.constants, list(np.moveaxis(q, -1, 0)))

    def _geometry(self, q: Array) -> tuple[list[Any], Any, Any, Any]:
        """Return y, cosine and sine of a2 - a1, sine of theta2."""
        y = self._internal(q)
        between = y[self.parameters.modes_per_link + 1] - y[0]
        return y, np.cos(between), np.sin(between), np.sin(q[..., 1])

    def _point(self, q: Array, link: int, s: ArrayLike) -> tuple[Array, Array]:
        """Return the position of a material point and its Jacobian with respect to q."""
        length = self.parameters.link_lengths[integer("link", link, 1, 2) - 1]
        distance = real_array("s", s)
        if not np.all((distance >= 0.0) & (distance <= length)):
            raise ValueError(f"s = {shown(s)}: must be a distance on link {link}, 0 to {length} [m]")
        coordinates.check_leading(coordinates=q.shape[:-1], s=distance.shape)
        y = coordinates.stack(self._internal(q))
        at, jacobian = coordinates.material_point(self.modes, self.constants.foreshortened, y, link, distance)
        return at, jacobian @ self._to_internal


@lru_cache(maxsize=256)
def _fastest_rate(parameters: ArmParameters) -> float:
    """See `FlexibleArm.fastest_rate`."""
    rates, _ = straight_arms(FlexibleArm(parameters).constants, np.linspace(0.0, np.pi, 9))
    return float(np.abs(np.linalg.eigvals(rates)).max())
