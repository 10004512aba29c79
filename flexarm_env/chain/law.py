"""The paper's law (10), (14) in continuous time on a chain.

The law is stiff: the rate feedback reaches 1400 N m s/rad on a first half element that hardly weighs anything. So it is
treated linearly implicitly. A step h of semi-implicit Euler with implicit dampers D moves the rates by h S f, with
S = (M + h D)^-1 and all forces f of its start. With the free motion a0 of the two joints' rates and their mobility
W = B' S B, the torque that fits the rates at the *end* of the step is

    (I + h C W) tau = tau0 - C (theta' + h a0),    C = lambda Kd J' J_late,

and MuJoCo takes the step with it. First order in h, stable for any C.
"""

from __future__ import annotations

from math import cos, inf, sin
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from flexarm_env.chain.links import Chain
from flexarm_env.chain.model import dampers
from flexarm_env.codegen.scalars import clip
from flexarm_env.parameters import LawParameters
from flexarm_env.physics.sensing import rigid_jacobian, rigid_point

Array = NDArray[np.float64]
Pair = tuple[float, float]
Four = tuple[float, float, float, float]


class TipLaw:
    """The law on a chain, whose steps it takes; in plain numbers, for speed.

    Attributes:
        chain: the chain.
    """

    def __init__(self, chain: Chain, law: LawParameters, lengths: Pair) -> None:
        """Prepare the law for a chain, with the step of its model.

        Args:
            chain: integrated by semi-implicit Euler with implicit dampers ("Euler" or "implicitfast").
            law: gains and limits.
            lengths: length of link 1, and distance of the controlled point from the elbow [m].
        """
        self.chain, self._law, self._lengths = chain, law, lengths
        count, elbow = chain.model.nv, chain.segments
        self._dampers = chain.model.opt.timestep * dampers(chain.model)
        self._damped = bool(self._dampers.any())
        self._elbow = elbow
        self._right = np.zeros((3, count))
        self._right[[1, 2], chain.shoulder_and_elbow] = 1.0
        self._solved, self._mass = np.zeros_like(self._right), np.zeros((count, count))

    def step(self, gain: float, reference: Four, late: Pair) -> Pair:
        """Take a step.

        Args:
            gain: lambda.
            reference: position and velocity [m, m/s].
            late: the joint angles that the law reads [rad].

        Returns:
            The torques that acted [N m].
        """
        model, data = self.chain.model, self.chain.data
        mujoco.mj_step1(model, data)
        torque = self._torque(gain, reference, late, self.chain.joints())
        data.ctrl[:] = torque
        mujoco.mj_step2(model, data)
        return torque

    def _torque(self, gain: float, reference: Four, late: Pair, now: Pair) -> Pair:
        data, at, h = self.chain.data, self._elbow, self.chain.model.opt.timestep
        np.subtract(data.qfrc_passive, data.qfrc_bias, out=self._right[0])
        solved = self._mobilities()
        free, first, second = solved[:, 0].tolist(), solved[:, at].tolist(), data.qvel[[0, at]].tolist()
        p, d = self._law.proportional_gain, self._law.derivative_gain
        (x, y, vx, vy), (tip, late_jacobian) = reference, self._rigid(*late)
        _, jacobian = self._rigid(*now)
        force = p * (x - tip[0]) + d * vx, p * (y - tip[1]) + d * vy
        # rates at the end of the step without torque, and how torques change them
        v1, v2 = second[0] + h * free[0], second[1] + h * first[0]
        w11, w12, w22 = h * free[1], h * free[2], h * first[2]
        c = [[gain * d * (j[0] * k[0] + j[1] * k[1]) for k in late_jacobian] for j in jacobian]
        push = [
            gain * (j[0] * force[0] + j[1] * force[1]) - row[0] * v1 - row[1] * v2
            for j, row in zip(jacobian, c, strict=True)
        ]
        a11, a12 = 1.0 + c[0][0] * w11 + c[0][1] * w12, c[0][0] * w12 + c[0][1] * w22
        a21, a22 = c[1][0] * w11 + c[1][1] * w12, 1.0 + c[1][0] * w12 + c[1][1] * w22
        area = a11 * a22 - a12 * a21
        shoulder, elbow = self._law.torque_limit or (inf, inf)
        return (
            clip((a22 * push[0] - a12 * push[1]) / area, -shoulder, shoulder),
            clip((a11 * push[1] - a21 * push[0]) / area, -elbow, elbow),
        )

    def _mobilities(self) -> Array:
        """Return accelerations by the forces of the step's start, and by 1 N m at either joint. Shape (3, count)."""
        if not self._damped:
            mujoco.mj_solveM(self.chain.model, self.chain.data, self._solved, self._right)
            return self._solved
        mujoco.mj_fullM(self.chain.model, self.chain.data, self._mass)
        return np.linalg.solve(self._mass + self._dampers, self._right.T).T

    def _rigid(self, theta1: float, theta2: float) -> tuple[Any, Any]:
        """Return the controlled point by rigid kinematics, and its Jacobian's columns."""
        one, both = ((sin(angle), cos(angle)) for angle in (theta1, theta1 + theta2))
        return rigid_point(*self._lengths, one, both), rigid_jacobian(*self._lengths, one, both)
