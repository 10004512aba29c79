"""Tracking in joint space: shaped references, feed-forward of the rigid or the flexible arm, filtered joint feedback.

At 100 Hz a torque is held for so long that feedback of the joints' rates as they are read destabilises the free
vibrations of light, flexible links: no gains settle them within seconds. Readings that pass a low-pass filter first
do, with gains that are soft beside the links. What is quick must then come from the reference and its feed-forward.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from scipy.interpolate import CubicSpline

from flexarm_baselines.arrays import Array, Floats
from flexarm_baselines.controller import Memory, Seen, TorqueController
from flexarm_baselines.flexible_motion import FlexibleMotion, flexible_motion, rigid_motion
from flexarm_baselines.joint_reference import joint_motion, nearest_turn
from flexarm_baselines.shaping import ShapedReference, impulses
from flexarm_baselines.task import Task
from flexarm_env.simulation.arm import FlexibleArm
from flexarm_env.validation import choice, integer, number, pair

FINE = 5e-3  # [s]; grid on which motions are computed
MARGIN = 1.0  # [s] of motion before and after what is used
AT_REST = 0.05  # [rad/s]; joints that are slower rest
FEEDFORWARDS = ("none", "rigid", "flexible")


@dataclass(frozen=True)
class JointFeedback:
    """Gains on the joints' deviations, which pass low-pass filters of first order.

    Attributes:
        stiffness: of shoulder and elbow [N m/rad].
        resistance: [N m s/rad].
        angle_filter: time constant of the angles' filter [s]; 0: none.
        rate_filter: time constant of the rates' filter [s]; 0: none.
    """

    stiffness: tuple[float, float] = (103.0, 140.0)
    resistance: tuple[float, float] = (106.0, 36.0)
    angle_filter: float = 0.07
    rate_filter: float = 0.19

    def __post_init__(self) -> None:
        """Check the numbers."""
        pair("stiffness", self.stiffness, "N m/rad", least=0.0)
        pair("resistance", self.resistance, "N m s/rad", least=0.0)
        number("angle_filter", self.angle_filter, "s", least=0.0)
        number("rate_filter", self.rate_filter, "s", least=0.0)


@dataclass(frozen=True)
class Shape:
    """How the reference is shaped.

    Attributes:
        shaper: impulses against the arm's first free vibration: "none", "ZV", "ZVD" or "EI".
        window: width of the window that rounds corners [s]; 0: none.
        times: how often it is applied.
        ramp: time in which an arm at rest joins the motion, by a polynomial of its joint angles [s].
    """

    shaper: str = "none"
    window: float = 0.225
    times: int = 4
    ramp: float = 1.2

    def __post_init__(self) -> None:
        """Check the numbers; `ShapedReference` checks the others."""
        number("ramp", self.ramp, "s", least=0.0)
        integer("times", self.times, 2)
