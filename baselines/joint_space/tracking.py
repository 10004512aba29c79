"""Tracking in joint space: shaped references, feed-forward of the rigid or the flexible arm, filtered joint feedback.

At 100 Hz a torque is held for so long that feedback of the joints' rates as they are read destabilises the free
vibrations of light, flexible links: no gains settle them within seconds. Readings that pass a low-pass filter first
do, with gains that are soft beside the links. What is quick must then come from the reference and its feed-forward.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from flexarm_baselines.arrays import Floats, product
from flexarm_baselines.controller import Memory, Seen, TorqueController
from flexarm_baselines.joint_space.flexible_motion import (
    FlexibleMotion,
    first_free_vibration,
    flexible_motion,
    rigid_motion,
)
from flexarm_baselines.joint_space.reference import joint_motion, nearest_turn
from flexarm_baselines.joint_space.shaping import ShapedReference, impulses
from flexarm_baselines.task import Task
from flexarm_env.simulation.arm import FlexibleArm
from flexarm_env.validation import choice, flag, integer, number, pair

FINE = 5e-3  # [s]; grid on which motions are computed
MARGIN = 1.0  # [s] of motion before and after what is used; half of it may go to late motors
AT_REST = 0.05  # [rad/s]; joints that are slower count as at rest
FEEDFORWARDS = ("none", "rigid", "flexible")


@dataclass(frozen=True)
class JointFeedback:
    """Gains on the joints' deviations, which pass low-pass filters of first order.

    Attributes:
        stiffness: of shoulder and elbow [N m/rad].
        resistance: [N m s/rad].
        angle_filter: time constant of the angles' filter [s]; 0: none.
        rate_filter: time constant of the rates' filter [s]; 0: none.
        decoupled: the gains multiply the rigid arm's mass matrix, so that stiffness is in 1/s^2 and resistance in 1/s
            (computed torque).
    """

    stiffness: tuple[float, float] = (40.0, 20.0)
    resistance: tuple[float, float] = (100.0, 15.0)
    angle_filter: float = 0.2
    rate_filter: float = 0.4
    decoupled: bool = False

    def __post_init__(self) -> None:
        """Check the numbers."""
        decoupled = flag("decoupled", self.decoupled)
        pair("stiffness", self.stiffness, "1/s^2" if decoupled else "N m/rad", least=0.0)
        pair("resistance", self.resistance, "1/s" if decoupled else "N m s/rad", least=0.0)
        number("angle_filter", self.angle_filter, "s", least=0.0)
        number("rate_filter", self.rate_filter, "s", least=0.0)


# Soft gains that complete both laps, without feed-forward and through the rigid arm's mass matrix: docs/controllers.md.
STIFF = JointFeedback((89.0, 49.0), (342.0, 51.0), 0.05, 0.25)
DECOUPLED = JointFeedback((0.39, 0.7), (0.62, 2.8), 0.29, 0.25, decoupled=True)


@dataclass(frozen=True)
class Shape:
    """How the reference is shaped.

    Attributes:
        shaper: impulses against the arm's first free vibration: "none", "ZV", "ZVD" or "EI".
        window: width of the window that rounds corners [s]; 0: none.
        times: how often it is applied, 2 to 6.
        ramp: time in which an arm at rest joins the motion, by a polynomial of its joint angles [s].
    """

    shaper: str = "none"
    window: float = 0.225
    times: int = 4
    ramp: float = 1.1

    def __post_init__(self) -> None:
        """Check the numbers; `ShapedReference` checks the others."""
        number("ramp", self.ramp, "s", least=0.0)
        integer("times", self.times, 2)


class Targets(NamedTuple):
    """What the joints should do in each control period of a lap.

    Attributes:
        joints: angles [rad] and rates [rad/s] at its beginning. Shape (..., periods, 4).
        torques: feed-forward, held [N m]. Shape (..., periods, 2).
        gains: on the filtered deviations of `joints`. Shape (..., periods, 2, 4).
    """

    joints: Floats
    torques: Floats
    gains: Floats


class JointTracking(TorqueController):
    """Track a shaped reference in joint space, by the encoders alone.

    An arm at rest joins the motion by a polynomial from its joint angles to those of the reference, on the side on
    which its elbow is; an arm that moves is taken to follow the motion already.

    Attributes:
        shape: how the reference is shaped.
        feedforward: "none", "rigid" (inverse dynamics of the arm with straight links), or "flexible".
        feedback: gains and filters.
    """

    blocks: ClassVar[tuple[str, ...]] = ("joint_angles", "joint_rates", "lap_phase")

    def __init__(
        self,
        task: Task,
        shape: Shape | None = None,
        feedforward: Literal["none", "rigid", "flexible"] = "flexible",
        feedback: JointFeedback | None = None,
    ) -> None:
        """Prepare the shaped reference and the filters; `start` designs each motion that an arm is the first to need.

        Args:
            task: see `Task`.
            shape: see the attribute; None: the defaults of `Shape`.
            feedforward: see the attribute.
            feedback: see the attribute; None: the defaults of `JointFeedback`.
        """
        super().__init__(task)
        self.shape, self.feedback = shape or Shape(), feedback or JointFeedback()
        self.feedforward = choice("feedforward", feedforward, FEEDFORWARDS)
        self.arm = FlexibleArm(task.arm)
        train = impulses(self.shape.shaper, first_free_vibration(self.arm))
        causal = ShapedReference(task.path, train, self.shape.window, times=self.shape.times)
        self.reference = replace(causal, lead=causal.centre)
        self._keys: dict[tuple[float, int | None], int] = {}
        self._targets = Targets(*(np.empty((0, task.periods, *shape)) for shape in ((4,), (2,), (2, 4))))
        filters = np.array([self.feedback.angle_filter] * 2 + [self.feedback.rate_filter] * 2)
        with np.errstate(divide="ignore"):
            self._keep = np.exp(-task.period / filters)

    def start(self, seen: Seen) -> Memory:
        """Choose each arm's motion; its filters begin with its deviations."""
        at_rest = np.abs(seen["joint_rates"]).max(axis=1) < AT_REST
        sides = np.where(seen["joint_angles"][:, 1] < 0.0, -1.0, 1.0)
        later = [self._index(side, None) for side in sides.tolist()]
        first = [
            self._index(side, int(period)) if rests else on
            for side, period, rests, on in zip(sides.tolist(), seen.period, at_rest, later, strict=True)
        ]
        motions = np.array([first, later], dtype=np.float64)
        deviations = self._deviations(seen, motions[0])
        return motions[0], motions[1], np.zeros(len(seen)), deviations

    def torque(self, seen: Seen, memory: Memory) -> tuple[Floats, Memory]:
        """Return feed-forward and feedback; see `TorqueController.torque`."""
        first, later, elapsed, filtered = memory
        motion = np.where(elapsed < self.task.periods, first, later)
        filtered = self._keep * filtered + (1.0 - self._keep) * self._deviations(seen, motion)
        targets, rows = self._targets, (motion.astype(np.int64), seen.period)
        torque = targets.torques[rows] - product(targets.gains[rows], filtered)
        return torque, (first, later, elapsed + 1.0, filtered)

    def _deviations(self, seen: Seen, motion: Floats) -> Floats:
        """Return how far the joints and their rates are from their targets. Shape (n, 4)."""
        measured = np.concatenate([seen["joint_angles"], seen["joint_rates"]], axis=1)
        off = measured - self._targets.joints[motion.astype(np.int64), seen.period]
        off[:, 0] = nearest_turn(off[:, 0], np.zeros(()))
        return off

    def _index(self, side: float, period: int | None) -> int:
        """Return where the targets of a motion are, and compute those that are new."""
        key = (side, period)
        if key not in self._keys:
            pairs = zip(self._targets, self.targets(side, period), strict=True)
            self._targets = Targets(*(np.concatenate([known, new[None]]) for known, new in pairs))
            self._keys[key] = len(self._keys)
        return self._keys[key]

    # --- design ----------------------------------------------------------------------------------------------------

    def targets(self, side: float, period: int | None) -> Targets:
        """Design a lap.

        Args:
            side: side of the elbow, the sign of theta2.
            period: control period of the lap in which the arm starts from rest; None: it follows the motion already.

        Returns:
            The targets of each period of the lap; those before the period of a start are of the next lap.
        """
        begun, size = 0 if period is None else period, self.arm.size
        states, torques = self.motion(side, period)
        joints = states[:-1, [0, 1, size, size + 1]]
        times = self.task.period * (begun + np.arange(len(joints), dtype=np.float64))
        found = Targets(joints, torques, self._gains(times, joints))
        return Targets(*(np.roll(one, begun, axis=0) for one in found))

    def motion(self, side: float, period: int | None) -> tuple[Floats, Floats]:
        """Return the motion of a lap and its feed-forward.

        Args:
            side: see `targets`.
            period: see `targets`.

        Returns:
            States at the beginning of each control period and at the end, Shape (periods + 1, 4 + 4 m), and torques,
            held [N m], Shape (periods, 2).
        """
        task, begun = self.task, 0 if period is None else period
        instants = task.period * (begun + np.arange(task.periods + 1, dtype=np.float64))
        later = max(task.actuation_delay - 0.5 * MARGIN, 0.0)
        count = round((task.lap_time + 2.0 * MARGIN + later) / FINE)
        times = instants[0] - MARGIN + FINE * np.arange(count + 1)
        found = self._carried(times, self._joints(times, side, None if period is None else instants[0]))
        acting = instants + task.actuation_delay  # what is commanded then acts later
        impulse = CubicSpline(times, found.torques).antiderivative()(acting)
        return CubicSpline(times, found.states)(instants), np.diff(impulse, axis=0) / task.period

    def _joints(self, times: Floats, side: float, start: float | None) -> Floats:
        """Return joint angles of the arm with straight links along the shaped reference. Shape (n, 2)."""
        sides = np.full(len(times), side)
        nothing = np.zeros((len(times), 2))
        lap = self.task.lap_time
        wanted = self.reference.position(times + lap)  # of a lap that others went before
        joints = np.unwrap(joint_motion(self.task.arm, wanted, nothing, nothing, sides).angles, axis=0)
        if start is None:
            return joints
        corner = np.broadcast_to(self.task.path.position(start), (1, 2))
        rest = joint_motion(self.task.arm, corner, nothing[:1], nothing[:1], sides[:1]).angles[0]
        begun = np.searchsorted(times, start)
        rest[0] = nearest_turn(rest[0], joints[begun, 0])
        return rest + _minimum_jerk((times - start) / max(self.shape.ramp, FINE))[:, None] * (joints - rest)

    def _carried(self, times: Floats, joints: Floats) -> FlexibleMotion:
        """Return the motion with its feed-forward, at each time that of the arm with the payload of that time.

        Where the payload changes, the motions of both arms should rest.
        """
        (arm, _), *others = self._arms(times)
        found = self._motion(arm, joints)
        for other, now in others:
            own = self._motion(other, joints)
            found.states[now], found.torques[now] = own.states[now], own.torques[now]
        return found

    def _arms(self, times: Floats) -> list[tuple[FlexibleArm, NDArray[np.bool_]]]:
        """Return the arms of the lap, and at which of some times [s] each is there. Shape (n,)."""
        task = self.task
        if task.payloads is None:
            return [(self.arm, np.ones(len(times), dtype=bool))]
        masses = np.where(np.isnan(task.payloads), task.arm.payload_mass, task.payloads)
        now = masses[np.floor(times / task.period + 1e-6).astype(np.int64) % task.periods]
        return [(FlexibleArm(replace(task.arm, payload_mass=float(one))), now == one) for one in np.unique(now)]

    def _motion(self, arm: FlexibleArm, joints: Floats) -> FlexibleMotion:
        if self.feedforward == "flexible":
            return flexible_motion(arm, joints, FINE)
        rigid = rigid_motion(arm, joints, FINE)
        return rigid if self.feedforward == "rigid" else rigid._replace(torques=np.zeros_like(rigid.torques))

    def _gains(self, times: Floats, joints: Floats) -> Floats:
        """Return the gains of each period. Shape (periods, 2, 4)."""
        gains = np.concatenate([np.diag(self.feedback.stiffness), np.diag(self.feedback.resistance)], axis=1)
        if not self.feedback.decoupled:
            return np.tile(gains, (len(joints), 1, 1))
        q = np.zeros((len(joints), self.arm.size))
        q[:, :2] = joints[:, :2]
        found = np.empty((len(joints), 2, 4))
        for arm, now in self._arms(times):
            found[now] = arm.mass_matrix(q[now])[:, :2, :2] @ gains
        return found


def _minimum_jerk(share: Floats) -> Floats:
    """Return the polynomial from rest at 0 to rest at 1, constant outside."""
    s = np.clip(share, 0.0, 1.0)
    return s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
