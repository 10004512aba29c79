"""The paper's law with its late sensor on a chain of another engine (`flexarm_env.chain.law`)."""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np
from numpy.typing import NDArray

from flexarm_env import ArmParameters, LawParameters, SensorParameters, SquareParameters, inverse_kinematics, square
from flexarm_env.chain.law import Pair, TipLaw
from flexarm_env.chain.links import Sight
from scripts.validation.engine.chain import EngineChain
from scripts.validation.engine.programmes import HELD

Array = NDArray[np.float64]
ANGLE = 1.8  # step times the chain's fastest rate; semi-implicit Euler allows 2


def law_lap(
    elements: int, arm: ArmParameters, gain_of: Callable[[Array], float], seconds: float, angle: float = ANGLE
) -> list[Sight]:
    """Run a chain under the paper's law with its late sensor at the end effector, from rest on the first corner.

    Args:
        elements: bending elements a link.
        arm: the arm.
        gain_of: lambda from the links' tip deflections [m], asked every `HELD`.
        seconds: length of the run [s].
        angle: largest product of step and fastest rate.

    Returns:
        The chain every `HELD`, the start included.
    """
    plant = EngineChain(elements, arm, angle)
    plant.model.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
    loop = _Loop(plant, round(seconds / HELD) * plant.substeps)
    sights = [plant.look()]
    for _ in range(round(seconds / HELD)):
        gain = gain_of(sights[-1].deflection)
        for _ in range(plant.substeps):
            loop.advance(gain)
        sights.append(plant.look())
    return sights


class _Loop:
    """The law with its delay line, on the first lap of the square."""

    def __init__(self, plant: EngineChain, steps: int) -> None:
        sensor, path = SensorParameters(), square(SquareParameters())
        step, length = plant.model.opt.timestep, plant.parameters.link_lengths[0]
        times = step * np.arange(steps)
        self._reference = np.hstack([path.position(times), path.velocity(times)]).tolist()
        plant.place(inverse_kinematics(plant.parameters, path.table[0, 1:], "positive"))
        self._law = TipLaw(plant, LawParameters(), (length, sensor.position))
        self._late = [delay / step for delay in sensor.joint_delays(length)]  # in steps
        self._past: list[Pair] = []

    def advance(self, gain: float) -> None:
        """One step."""
        reference = self._reference[len(self._past)]
        self._past.append(self._law.chain.joints())
        self._law.step(gain, reference, (self._delayed(0), self._delayed(1)))

    def _delayed(self, joint: int) -> float:
        """Interpolate a joint's angle as it was by its own delay ago; between steps on a straight line."""
        place = max(len(self._past) - 1 - self._late[joint], 0.0)
        before = int(place)
        start, end = self._past[before][joint], self._past[min(before + 1, len(self._past) - 1)][joint]
        return start + (place - before) * (end - start)
