"""The paper's law (10), (14) in continuous time on a chain of another engine.

The law is stiff: the rate feedback reaches 1400 N m s/rad on a first half element that hardly weighs anything. So it is
treated linearly implicitly. With the torque-free acceleration a0 of the two joints and their mobility W = B' M^-1 B,
both from MuJoCo's own factorised mass matrix, the torque that fits the rates at the *end* of a step h is

    (I + h C W) tau = tau0 - C (theta' + h a0),    C = lambda Kd J' J_late,

and MuJoCo takes the step with it by semi-implicit Euler. First order in h, stable for any C.
"""

from __future__ import annotations

from collections.abc import Callable
from math import cos, sin

import mujoco
import numpy as np
from numpy.typing import NDArray

from flexarm_env import ArmParameters, LawParameters, SensorParameters, SquareParameters, inverse_kinematics, square
from scripts.validation.engine.chain import HELD, Chain, Sight

Array = NDArray[np.float64]
Pair = tuple[float, float]
ANGLE = 1.8  # step times the chain's fastest rate; semi-implicit Euler allows 2


def law_lap(
    elements: int, arm: ArmParameters, gain_of: Callable[[Array], float], seconds: float, angle: float = ANGLE
) -> list[Sight]:
    """Run a chain under the paper's law with its late sensor at the end effector, from rest on the first corner.

    Args:
        elements: bending elements a link.
        arm: the arm, undamped.
        gain_of: lambda from the links' tip deflections [m], asked every `HELD`.
        seconds: length of the run [s].
        angle: largest product of step and fastest rate.

    Returns:
        The chain every `HELD`, the start included.
    """
    plant = Chain(elements, arm, angle)
    plant.model.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
    law = _Law(plant, round(seconds / HELD) * plant.substeps)
    sights = [plant.look()]
    for _ in range(round(seconds / HELD)):
        gain = gain_of(sights[-1].deflection)
        for _ in range(plant.substeps):
            law.advance(gain)
        sights.append(plant.look())
    return sights


class _Law:
    """The law with its delay line, and one step of the chain under it; in plain numbers, for speed."""

    def __init__(self, plant: Chain, steps: int) -> None:
        step = plant.model.opt.timestep
        self._model, self._data, self._step = plant.model, plant.data, step
        law, sensor, path = LawParameters(), SensorParameters(), square(SquareParameters())
        self._lengths = (plant.parameters.link_lengths[0], sensor.position)
        self._gains = law.proportional_gain, law.derivative_gain
        times = step * np.arange(steps)
        self._reference = np.hstack([path.position(times), path.velocity(times)]).tolist()
        plant.place(inverse_kinematics(plant.parameters, path.table[0, 1:], "positive"))
        self._late = [delay / step for delay in sensor.joint_delays(plant.parameters.link_lengths[0])]  # in steps
        self._past: list[tuple[float, float]] = []
        self._elbow = int(plant.shoulder_and_elbow[1])
        self._right = np.zeros((3, plant.model.nv))
        self._right[[1, 2], plant.shoulder_and_elbow] = 1.0
        self._solved = np.zeros_like(self._right)
        self._views = plant.data.qpos, plant.data.qvel, plant.data.qfrc_passive, plant.data.qfrc_bias, plant.data.ctrl

    def advance(self, gain: float) -> None:
        """One step."""
        qpos, qvel, passive, bias, ctrl = self._views
        mujoco.mj_step1(self._model, self._data)
        elbow, h = self._elbow, self._step
        x, y, vx, vy = self._reference[len(self._past)]
        self._past.append((float(qpos[0]), float(qpos[elbow])))
        np.subtract(passive, bias, out=self._right[0])
        mujoco.mj_solveM(self._model, self._data, self._solved, self._right)
        free, first, second = self._solved[:, 0].tolist(), self._solved[:, elbow].tolist(), qvel[[0, elbow]].tolist()
        p, d = self._gains
        tip, late = self._rigid(self._delayed(0), self._delayed(1))
        _, now = self._rigid(*self._past[-1])
        force = p * (x - tip[0]) + d * vx, p * (y - tip[1]) + d * vy
        # rates at the end of the step without torque, and how torques change them
        v1, v2 = second[0] + h * free[0], second[1] + h * first[0]
        w11, w12, w22 = h * free[1], h * free[2], h * first[2]
        c = [[gain * d * (j[0] * k[0] + j[1] * k[1]) for k in late] for j in now]
        push = [
            gain * (j[0] * force[0] + j[1] * force[1]) - row[0] * v1 - row[1] * v2
            for j, row in zip(now, c, strict=True)
        ]
        a11, a12 = 1.0 + c[0][0] * w11 + c[0][1] * w12, c[0][0] * w12 + c[0][1] * w22
        a21, a22 = c[1][0] * w11 + c[1][1] * w12, 1.0 + c[1][0] * w12 + c[1][1] * w22
        area = a11 * a22 - a12 * a21
        ctrl[0] = (a22 * push[0] - a12 * push[1]) / area
        ctrl[1] = (a11 * push[1] - a21 * push[0]) / area
        mujoco.mj_step2(self._model, self._data)

    def _delayed(self, joint: int) -> float:
        """Interpolate a joint's angle as it was by its own delay ago; between steps on a straight line."""
        place = max(len(self._past) - 1 - self._late[joint], 0.0)
        before = int(place)
        start, end = self._past[before][joint], self._past[min(before + 1, len(self._past) - 1)][joint]
        return start + (place - before) * (end - start)

    def _rigid(self, theta1: float, theta2: float) -> tuple[Pair, tuple[Pair, Pair]]:
        """Tip by rigid kinematics (8), (9), and the columns of its Jacobian (13)."""
        length_1, length_2 = self._lengths
        near = length_1 * cos(theta1), length_1 * sin(theta1)
        far = length_2 * cos(theta1 + theta2), length_2 * sin(theta1 + theta2)
        tip = near[0] + far[0], near[1] + far[1]
        return tip, ((-tip[1], tip[0]), (-far[1], far[0]))
