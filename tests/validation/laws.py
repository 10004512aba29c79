"""The paper's laws with their late sensor on undamped arms: a chain in MuJoCo (`flexarm_env.chain.law`), our models."""

from collections.abc import Callable

import gymnasium
import mujoco
import numpy as np

import flexarm_env
from flexarm_baselines import FLSAC, IFDC
from flexarm_baselines.paper_law.flsac import REFERENCE_DEFLECTION
from flexarm_baselines.paper_law.fuzzy import paper_system
from flexarm_env import ArmParameters, LawParameters, SensorParameters, SquareParameters, run_batch, square
from flexarm_env.chain.law import Pair, TipLaw
from tests.validation.arms import EngineChain
from tests.validation.kept import kept
from tests.validation.motion import HELD, Array

ANGLE = 1.8  # step times the chain's fastest rate; semi-implicit Euler allows 2


LAWS: dict[str, Callable[[Array], float]] = {  # lambda from the links' tip deflections [m]
    "ifdc": lambda deflection: 1.0,
    "flsac": lambda deflection: float(paper_system(1.0).evaluate(5.0 * deflection[None] / REFERENCE_DEFLECTION)[0]),
}
# From 8 s on, IFDC's arm is through the straight pose, where millimetres decide which way the elbow goes.
SECONDS = {"ifdc": 7.9, "flsac": 16.0}
ELEMENTS = (10, 20)  # of the chains


def on_model(parameters: ArmParameters) -> dict[str, Array]:
    """Return the tip of a model under each law, every `HELD`. Shape (n, 2) each."""
    envs = gymnasium.make_vec("FlexArm/Paper-v0", num_envs=len(LAWS), arm=parameters)
    runs = run_batch(envs, [IFDC(), FLSAC.for_env(envs)], max_steps=round(max(SECONDS.values()) / HELD))
    return {name: run.tip for name, run in zip(LAWS, runs, strict=True)}


@kept
def on_chains() -> tuple[dict[str, Array], dict[str, Array]]:
    """Return the tip under each law, every `HELD`, of the finer chain and of an infinitely fine one. Shape (n, 2)."""
    coarse, fine = ({law: law_lap(n, law) for law in LAWS} for n in ELEMENTS)
    return fine, {law: fine[law] + (fine[law] - coarse[law]) / 3.0 for law in LAWS}  # of second order in 1 / elements


def law_lap(elements: int, law: str) -> Array:
    """Run a chain under a law with its late sensor at the end effector, from rest; return the tip every `HELD`."""
    count = round(SECONDS[law] / HELD)
    plant = EngineChain(elements, ArmParameters.linear(damping_ratio=0.0), ANGLE)
    plant.model.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
    loop = _Loop(plant, count * plant.substeps)
    sights = [plant.look()]
    for _ in range(count):
        gain = LAWS[law](sights[-1].deflection)
        for _ in range(plant.substeps):
            loop.advance(gain)
        sights.append(plant.look())
    return np.array([sight.tip for sight in sights])


class _Loop:
    """The law with its delay line, on the first lap of the square."""

    def __init__(self, plant: EngineChain, steps: int) -> None:
        sensor, path = SensorParameters(), square(SquareParameters())
        step, length = plant.model.opt.timestep, plant.parameters.link_lengths[0]
        times = step * np.arange(steps)
        self._reference = np.hstack([path.position(times), path.velocity(times)]).tolist()
        plant.place(flexarm_env.inverse_kinematics(plant.parameters, path.table[0, 1:], "positive"))
        self._law = TipLaw(plant, LawParameters(), (length, sensor.position))
        self._late = [delay / step for delay in sensor.joint_delays(length)]  # in steps
        self._past: list[Pair] = []

    def advance(self, gain: float) -> None:
        reference = self._reference[len(self._past)]
        self._past.append(self._law.chain.joints())
        self._law.step(gain, reference, (self._delayed(0), self._delayed(1)))

    def _delayed(self, joint: int) -> float:
        """Interpolate a joint's angle as it was by its own delay ago; between steps on a straight line."""
        place = max(len(self._past) - 1 - self._late[joint], 0.0)
        before = int(place)
        start, end = self._past[before][joint], self._past[min(before + 1, len(self._past) - 1)][joint]
        return start + (place - before) * (end - start)
