"""A chain in MuJoCo (`flexarm_env.chain`) and a model of ours, moved and read in the same way."""

from typing import NamedTuple

import mujoco
import numpy as np

from flexarm_env import ArmParameters, FlexibleArm
from flexarm_env.chain.gauges import PLACES, filters
from flexarm_env.chain.links import Chain
from flexarm_env.chain.model import chain_model, frequencies
from tests.validation.motion import HELD, MODEL_ANGLE, Array, Motion, Programme, fixed_point

# Step times the fastest rate. Runge-Kutta's classical method is stable up to 2.83, but near that takes the fastest
# vibrations away, which moves the chain's tip by 1 mm after torque jumps; at half of 2.5 it is 0.1 mm at most.
CHAIN_ANGLE = 1.25


class Sight(NamedTuple):
    tip: Array  # x, y [m]
    joints: Array  # theta1, theta2 [rad]
    rates: Array  # their rates [rad/s]
    deflection: Array  # w at each link's tip [m]


class Bend(NamedTuple):
    roots: Array  # angles of the root tangents from the x axis [rad]. Shape (2,)
    root_rates: Array  # their rates [rad/s]. Shape (2,)
    deflections: Array  # w at `PLACES` evenly spaced places of each link [m]. Shape (2, PLACES)
    deflection_rates: Array  # their rates [m/s]. Shape (2, PLACES)


class EngineChain(Chain):
    """The chain, undamped unless its arm is damped.

    Attributes:
        substeps: integration steps in `HELD`.
    """

    def __init__(self, elements: int, arm: ArmParameters, angle: float = CHAIN_ANGLE) -> None:
        """Build it, at rest and straight, integrated by the classical Runge-Kutta method.

        Damping of the material makes the fastest modes too fast for that; such a chain is integrated by `implicitfast`,
        of first order. `elements` bend, one less than segments; `angle`: largest product of step and fastest rate.
        """
        model = chain_model(elements + 1, arm)
        if arm.damping_ratio == 0.0 or arm.damping_model == "modal":
            model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
        self.substeps = int(np.ceil(HELD * frequencies(model)[-1] / angle))
        model.opt.timestep = HELD / self.substeps
        super().__init__(model, arm)
        self._end = self.point_weights(2, arm.link_lengths[1])

    def place(self, joints: Array, force: Array | None = None) -> None:
        """Put it at rest, straight or bent by a force at the tip [N] while the joints are held [rad]."""
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
            return np.asarray((force @ jacobian[:2])[bending] / springs[bending])

        self.data.qpos[bending] = fixed_point(balanced, self.data.qpos[bending])

    def advance(self, torque: Array, periods: int = 1) -> Array:
        """Hold a torque [N m] for some `HELD`; where the tip is after each. Shape (periods, 2)."""
        tips = np.empty((periods, 2))
        for tip in tips:
            self.step(torque, self.substeps)
            tip[:] = self.tip()
        return tips

    def look(self) -> Sight:
        at = self.shoulder_and_elbow
        deflection = turned(self, self.data.qpos).sum(1)
        return Sight(self.tip(), self.data.qpos[at], self.data.qvel[at], deflection)

    def bend(self) -> Bend:
        places = np.linspace(0.0, 1.0, PLACES)
        roots, read = [], []
        for angles in (self.data.qpos, self.data.qvel):
            roots.append(np.cumsum(angles)[self.shoulder_and_elbow])
            raised = np.cumsum(turned(self, angles), axis=1)
            read.append(np.array([np.interp(places, self._ends, np.append(0.0, link)) for link in raised]))
        return Bend(*roots, *read)

    def end(self) -> Array:
        """Position of the tip and its velocity [m, m/s]. Shape (4,)."""
        return self.point(self._end)


def turned(chain: Chain, angles: Array) -> Array:
    """Return what each segment adds to its link's deflection, from angles or rates. Shape (2, segments)."""
    absolute = np.cumsum(angles).reshape(2, -1)
    return np.asarray(chain.lengths * (absolute - absolute[:, :1]))


class Gauges:
    """Reads a model's coordinates off any arm: what they can express of its deflection (`flexarm_env.chain.gauges`)."""

    def __init__(self, arm: FlexibleArm) -> None:
        self.arm, self._filters = arm, filters(arm)

    def state(self, bend: Bend) -> Array:
        """Public state of the model. Shape (4 + 4 m,)."""
        q, rates = (np.array([f @ w for f, w in zip(self._filters, part, strict=True)]) for part in bend[2:])
        y, v = (np.concatenate([[a[0]], x[0], [a[1]], x[1]]) for a, x in ((bend.roots, q), (bend.root_rates, rates)))
        return self.arm.public_state(np.concatenate([y, v]))


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
        return self.follow(np.tile(torque, (periods, 1)))

    def follow(self, torques: Array) -> Array:
        """Hold each torque [N m] for `HELD`; where the tip is after each. Shape (n, 2)."""
        run = self.arm.rollout(self.state, torques, period=HELD, step=HELD / self._substeps)
        self.state = run.states[-1]
        return self.arm.tip(run.states[1:, : self.arm.size])

    def look(self) -> Sight:
        q, rates = np.split(self.state, 2)
        return Sight(self.arm.tip(q), q[:2], rates[:2], self.arm.tip_deflection(q))

    def bend(self) -> Bend:
        m = self.arm.parameters.modes_per_link
        y, v = np.split(self.arm.internal_state(self.state), 2)
        one, two = self._shapes
        deflections = (np.array([one @ x[1 : m + 1], two @ x[m + 2 :]]) for x in (y, v))
        return Bend(y[[0, m + 1]], v[[0, m + 1]], *deflections)

    def end(self) -> Array:
        length = self.arm.parameters.link_lengths[1]
        return np.concatenate([self.arm.tip(self.state[: self.arm.size]), self.arm.velocity(self.state, 2, length)])


Plant = EngineChain | Modal


def chain_motion(programme: Programme, elements: int, angle: float = CHAIN_ANGLE) -> Motion:
    """Run a programme on a chain of bending elements; angle: see `EngineChain`."""
    arm = EngineChain(elements, programme.parameters(), angle)
    arm.place(programme.joints, programme.pull)
    arm.data.qvel[0] = programme.spin
    sights = [arm.look()]
    for torque in programme.torques():
        arm.advance(torque)
        sights.append(arm.look())
    return Motion(*(np.array([getattr(sight, name) for sight in sights]) for name in Motion._fields))
