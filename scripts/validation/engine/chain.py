"""A chain of another engine (`flexarm_env.chain`) and a model of ours, moved and looked at in the same way.

**Shapes.** A link's deflection is read in the same way off a model and off a chain: w(x) is the integral over arc
length of the angle between tangent and root tangent, which is what strain gauges know (w'' is the curvature), and what
makes w'(L) the tip's angle, as the models have it. A bent start is no transfer of shapes: it is each one's own
equilibrium under the same force.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol

import mujoco
import numpy as np
from numpy.typing import NDArray

from flexarm_env import ArmParameters, FlexibleArm
from flexarm_env.chain import model as chain

Array = NDArray[np.float64]
HELD = 1e-3  # torques are constant for [s]
# Step times the fastest rate. Runge-Kutta's classical method is stable up to 2.83, but near that takes the fastest
# vibrations away, which moves the chain's tip by 1 mm after torque jumps; at half of 2.5 it is 0.1 mm at most.
CHAIN_ANGLE = 1.25
MODEL_ANGLE = 0.5
PLACES = 41  # where a link's deflection is read, root and tip among them


class Sight(NamedTuple):
    """An arm at an instant.

    Attributes:
        tip: x, y [m]. Shape (2,).
        joints: theta1, theta2 [rad]. Shape (2,).
        rates: of these [rad/s]. Shape (2,).
        deflection: w at each link's tip [m]. Shape (2,).
    """

    tip: Array
    joints: Array
    rates: Array
    deflection: Array


class Bend(NamedTuple):
    """How an arm's links lie and bend.

    Attributes:
        roots: angles of the root tangents from the x axis [rad]. Shape (2,).
        root_rates: of these [rad/s]. Shape (2,).
        deflections: w at `PLACES` evenly spaced places of each link [m]. Shape (2, PLACES).
        deflection_rates: of these [m/s]. Shape (2, PLACES).
    """

    roots: Array
    root_rates: Array
    deflections: Array
    deflection_rates: Array


class Plant(Protocol):
    """Something to which torques are applied."""

    def advance(self, torque: Array, periods: int) -> Array:
        """Hold a torque [N m] for some `HELD`; where the tip is after each. Shape (periods, 2)."""

    def look(self) -> Sight:
        """Return the arm's present outputs."""

    def bend(self) -> Bend:
        """Its links now."""


class Chain:
    """The chain, undamped unless its arm is damped.

    Attributes:
        parameters: of the arm.
        model: MuJoCo's.
        data: MuJoCo's.
        substeps: integration steps in `HELD`.
        shoulder_and_elbow: places of theta1 and theta2 among the angles.
    """

    def __init__(self, elements: int, arm: ArmParameters, angle: float = CHAIN_ANGLE) -> None:
        """Build it, at rest and straight, integrated by the classical Runge-Kutta method.

        Damping of the material makes the fastest modes too fast for that; such a chain is integrated by `implicitfast`,
        of first order.

        Args:
            elements: bending elements a link, one less than segments.
            arm: the arm.
            angle: largest product of step and fastest rate.
        """
        self.parameters = arm
        self.model = chain.chain_model(elements + 1, arm)
        if arm.damping_ratio == 0.0 or arm.damping_model == "modal":
            self.model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
        self.substeps = int(np.ceil(HELD * chain.frequencies(self.model)[-1] / angle))
        self.model.opt.timestep = HELD / self.substeps
        self.data = mujoco.MjData(self.model)
        self.shoulder_and_elbow = np.array([0, self.model.joint(chain.ELBOW).qposadr[0]])
        self._elbow_body = self.model.joint(chain.ELBOW).bodyid[0]
        self._tip = self.model.site(chain.TIP).id
        half = 0.5 / elements
        self._ends = np.concatenate([[0.0], half + np.arange(elements) / elements, [1.0]])  # of segments, L = 1
        self._lengths = np.outer(arm.link_lengths, np.diff(self._ends))

    def advance(self, torque: Array, periods: int = 1) -> Array:
        """See `Plant.advance`."""
        self.data.ctrl[:] = torque
        tips = np.empty((periods, 2))
        for tip in tips:
            mujoco.mj_step(self.model, self.data, self.substeps)
            mujoco.mj_kinematics(self.model, self.data)
            tip[:] = self.data.site_xpos[self._tip, :2]
        return tips

    def look(self) -> Sight:
        """Return the arm's present outputs."""
        mujoco.mj_kinematics(self.model, self.data)
        at = self.shoulder_and_elbow
        tip = self.data.site_xpos[self._tip, :2].copy()
        return Sight(tip, self.data.qpos[at], self.data.qvel[at], (self._lengths * self._turned(self.data.qpos)).sum(1))

    def bend(self) -> Bend:
        """Its links now."""
        places = np.linspace(0.0, 1.0, PLACES)
        roots, read = [], []
        for angles in (self.data.qpos, self.data.qvel):
            slopes = self._lengths * self._turned(angles)
            roots.append(np.cumsum(angles)[self.shoulder_and_elbow])
            read.append(np.array([np.interp(places, self._ends, np.append(0.0, np.cumsum(link))) for link in slopes]))
        return Bend(*roots, *read)

    def _turned(self, angles: Array) -> Array:
        """Angles, or rates, of the segments less those of their link's first one. Shape (2, elements + 1)."""
        absolute = np.cumsum(angles).reshape(2, -1)
        return absolute - absolute[:, :1]

    def place(self, joints: Array, force: Array | None = None) -> None:
        """Put it at rest, straight or bent by a force at the tip while the joints are held.

        Args:
            joints: theta1, theta2 [rad].
            force: x, y [N].
        """
        self.data.qpos[self.shoulder_and_elbow] = joints
        if force is None or not np.any(force):
            return
        springs = self.model.jnt_stiffness.ravel()
        bending = springs > 0.0
        jacobian = np.zeros((3, self.model.nv))

        def balanced(angles: Array) -> Array:
            self.data.qpos[bending] = angles
            mujoco.mj_kinematics(self.model, self.data)
            mujoco.mj_comPos(self.model, self.data)
            mujoco.mj_jacSite(self.model, self.data, jacobian, None, self._tip)
            return (force @ jacobian[:2])[bending] / springs[bending]

        self.data.qpos[bending] = fixed_point(balanced, self.data.qpos[bending])


class Modal:
    """One of our models, integrated by its own Runge-Kutta method.

    Attributes:
        arm: the model.
        state: public state. Shape (4 + 4 m,).
    """

    def __init__(self, arm: FlexibleArm) -> None:
        """At rest and straight."""
        self.arm = arm
        self.state = np.zeros(2 * arm.size)
        self._substeps = int(np.ceil(HELD * arm.fastest_rate() / MODEL_ANGLE))
        places = np.linspace(0.0, 1.0, PLACES)
        self._shapes = [link.shape(link.length * places) for link in arm.modes]

    def advance(self, torque: Array, periods: int = 1) -> Array:
        """See `Plant.advance`."""
        return self.follow(np.tile(torque, (periods, 1)))

    def follow(self, torques: Array) -> Array:
        """Hold each torque [N m] for `HELD`; where the tip is after each. Shape (n, 2)."""
        run = self.arm.simulate(self.state, torques, len(torques) * HELD, HELD, self._substeps)
        self.state = run.state[-1]
        return run.tip[1:]

    def look(self) -> Sight:
        """Return the arm's present outputs."""
        q, rates = np.split(self.state, 2)
        return Sight(self.arm.tip(q), q[:2], rates[:2], self.arm.tip_deflection(q))

    def bend(self) -> Bend:
        """Its links now."""
        m = self.arm.parameters.modes_per_link
        y, v = np.split(self.arm.internal_state(self.state), 2)
        deflections = [
            np.array([shape @ part for shape, part in zip(self._shapes, (x[1 : m + 1], x[m + 2 :]), strict=True)])
            for x in (y, v)
        ]
        return Bend(y[[0, m + 1]], v[[0, m + 1]], *deflections)


class Gauges:
    """Reads a model's coordinates off any arm: the deflection that they can express, in the mean square over mass."""

    def __init__(self, arm: FlexibleArm) -> None:
        """For the coordinates of a model."""
        self.arm = arm
        places = np.linspace(0.0, 1.0, PLACES)
        weight = np.full(PLACES, 2.0 / 3.0)  # Simpson's rule
        weight[1::2], weight[[0, -1]] = 4.0 / 3.0, 1.0 / 3.0
        self._filters = []
        for link in arm.modes:
            shapes = link.shape(link.length * places)
            weighted = shapes * weight[:, None]
            self._filters.append(np.linalg.solve(weighted.T @ shapes, weighted.T))

    def modal(self, bend: Bend) -> tuple[Array, Array]:
        """Modal coordinates and rates of both links. Shape (2, m) each."""
        read = [np.array([f @ w for f, w in zip(self._filters, part, strict=True)]) for part in bend[2:]]
        return read[0], read[1]

    def state(self, bend: Bend) -> Array:
        """Public state of the model. Shape (4 + 4 m,)."""
        q, rates = self.modal(bend)
        y, v = (np.concatenate([[a[0]], x[0], [a[1]], x[1]]) for a, x in ((bend.roots, q), (bend.root_rates, rates)))
        return self.arm.public_state(np.concatenate([y, v]))


def bent_by(arm: FlexibleArm, joints: Array, force: Array) -> Array:
    """Coordinates of a model bent by a force at the tip while the joints are held: K q = J' F. Shape (2 + 2 m,).

    Args:
        arm: the model.
        joints: theta1, theta2 [rad].
        force: x, y [N].
    """
    stiffness = np.concatenate([link.stiffness for link in arm.modes])

    def balanced(modal: Array) -> Array:
        jacobian = arm.point_jacobian(np.concatenate([joints, modal]), 2, arm.parameters.link_lengths[1])
        return (force @ jacobian)[2:] / stiffness

    return np.concatenate([joints, fixed_point(balanced, np.zeros(arm.size - 2))])


def fixed_point(function: Callable[[Array], Array], start: Array) -> Array:
    """x with function(x) = x, by damped repetition.

    Raises:
        RuntimeError: if it does not settle.
    """
    x = start.copy()
    for _ in range(300):
        change = function(x) - x
        x += 0.5 * change
        if np.abs(change).max() < 1e-12:
            return x
    raise RuntimeError("the shape under this force was not found: it bends too far")
