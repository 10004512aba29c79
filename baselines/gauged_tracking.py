"""`GaugedTracking`: command shaping, with feedback of the whole state, which encoders and strain gauges read.

Gauges read the links' bending at once, so that no observer is needed, and its feedback damps what the shaped command
excites. Sources: Banerjee and Singhose, J. Guidance, Control, and Dynamics 21, 1998 (shaping); Hastings and Book, *A
linear dynamic model for flexible robotic manipulators*, IEEE Control Systems Magazine 7, 1987 (modal coordinates from
strain gauges); Anderson and Moore, *Optimal Control: Linear Quadratic Methods*, 1990, chapter 3 (the gains).
"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from flexarm_baselines.arrays import Floats
from flexarm_baselines.controller import Seen
from flexarm_baselines.joint_space.tracking import JointTracking
from flexarm_baselines.observers import GAUGES
from flexarm_baselines.optimal.linear_quadratic import GOOD, RegulatorWeights
from flexarm_baselines.optimal.plan import Plan
from flexarm_baselines.plan_follower import PlanFollower
from flexarm_baselines.task import Task

STEP = 1e-3  # [s]; of the integration by which the arm is linearised


class GaugedTracking(PlanFollower):
    """Track the motion of `shaped` by a time-varying linear-quadratic regulator of the measured state."""

    blocks: ClassVar[tuple[str, ...]] = ("joint_angles", "joint_rates", *GAUGES, "lap_phase")

    def __init__(self, task: Task, weights: RegulatorWeights = GOOD, **design: Any) -> None:
        """Design the motion from rest on either side of the elbow, and the regulators.

        Args:
            task: see `Task`.
            weights: of the regulators.
            **design: see `JointTracking`.
        """
        shaped = JointTracking(task, **design)
        plans = [
            Plan(
                task.arm,
                *shaped.motion(side, 0),
                reference=task.reference,
                limits=task.torque_limit,
                period=task.period,
                step=STEP,
                payloads=task.payloads,
            )
            for side in (1.0, -1.0)
        ]
        super().__init__(task, plans, weights)

    def _state(self, seen: Seen) -> Floats:
        bending, rates = (seen[name] for name in GAUGES)
        return np.concatenate([seen["joint_angles"], bending, seen["joint_rates"], rates], axis=1)
