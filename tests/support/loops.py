"""The paper's law in the environments' simulator, driven by gains and noise that a test chooses."""

from typing import Any

import gymnasium
import numpy as np
from numpy.typing import ArrayLike

from flexarm_env import ArmParameters, LawParameters, SensorParameters
from flexarm_env.envs.batch import BatchSimulator
from flexarm_env.envs.reset_options import reset_requests_of
from flexarm_env.envs.settings import Settings
from tests.support.envs import PAPER, Array
from tests.support.oracle import Problem, oracle

END_EFFECTOR, NEAR_ELBOW = SensorParameters(), SensorParameters(position=0.5)
SHARED, PER_JOINT = LawParameters(compensation="shared"), LawParameters(compensation="per_joint")
NEARBY = 1e-12  # [m]; a path needs two points, and one so short, travelled within a day, is a point


def arm_of(modes: int) -> ArmParameters:
    return ArmParameters.linear(modes_per_link=modes)


def resting_at(x: float, y: float) -> dict[str, Any]:
    return {"reference": "waypoints", "waypoints": [(x, y), (x + NEARBY, y)], "lap_time": 1e5}


class LawLoop:
    """One arm of `FlexArm/Paper-v0`, whose invalid states end nothing."""

    def __init__(self, **options: Any) -> None:
        """Lay it out; `options`: beside those of the id."""
        self.simulator = BatchSimulator(Settings.of(gymnasium.spec(PAPER).kwargs | options), 1)

    def begin(self, state: ArrayLike) -> Array:
        """Begin at a public state; return it. Shape (4 + 4 m,)."""
        requests = reset_requests_of({"state": state}, self.simulator)
        self.simulator.start(np.zeros(1, dtype=np.uint64), np.zeros(1, dtype=np.int64), requests)
        return self.state

    def advance(self, gain: float, noise: ArrayLike = (0.0, 0.0)) -> Array:
        """Hold a gain, and noise of the sensor [m], for a period; return the state then. Shape (4 + 4 m,)."""
        for name, values in (("GAIN_LIMIT", [gain]), ("NOISE", noise)):
            self.simulator._lane_rows(name)[0, :, 0] = values
        self.simulator.actions[:] = 1.0
        self.simulator.step()
        return self.state

    @property
    def state(self) -> Array:
        """The present state. Shape (4 + 4 m,)."""
        return self.simulator.result(0)[self.simulator.parts["STATE"]]


def loop_of(problem: Problem, physics_step: float | None = None) -> LawLoop:
    sensor, law = problem.sensor, problem.law
    corners = [problem.reference(at, at)[0] for at in problem.side_time * np.arange(4)]
    return LawLoop(
        arm=problem.arm,
        sensor=sensor.model,
        sensor_position=sensor.position,
        delay=sensor.delay,
        delayed=sensor.delayed,
        rate_jacobian=sensor.rate_jacobian,
        proportional_gain=law.proportional_gain,
        derivative_gain=law.derivative_gain,
        compensation=law.compensation,
        torque_limit=law.torque_limit,
        physics_step=physics_step,
        reference="waypoints",
        waypoints=[(at.real, at.imag) for at in corners],
        lap_time=4.0 * problem.side_time,
    )


def simulated(problem: Problem, physics_step: float | None = None) -> Array:
    """States at all control instants. Shape (periods + 1, 4 + 4 m)."""
    loop = loop_of(problem, physics_step)
    states = [loop.begin(problem.start_state())]
    states += [loop.advance(gain, noise) for gain, noise in zip(problem.gains(), problem.noises(), strict=True)]
    return np.array(states)


def assert_accurate(
    problem: Problem, coordinates: float, rates: float, step: float | None = None, expected: Array | None = None
) -> None:
    """Bound the errors of coordinates and of rates, each relative to its range over the run; expected: the oracle's."""
    exact = oracle(problem) if expected is None else expected
    relative = (np.abs(simulated(problem, step) - exact) / np.ptp(exact, axis=0)).max(axis=0)
    of_coordinates, of_rates = (float(half.max()) for half in np.split(relative, 2))
    good = of_coordinates < coordinates and of_rates < rates
    assert good, f"coordinates {of_coordinates:.1e}, rates {of_rates:.1e} of their range"
