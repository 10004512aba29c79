"""The delay at which the simulated, nonlinear loop really diverges, beside the linear theory's."""

from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from flexarm_env import ArmParameters, FlexibleArm
from flexarm_env.analysis.law_loop import rest_angles
from scripts.analysis.margins import GAINS, PLACES, SENSORS, row

Array = NDArray[np.float64]

LANES = 8  # delays tried at once: one block of the kernel
HELD_TIME = {"position": 24.0, "position+rate": 3.0}  # [s]; late rates let fast roots cross, which grow fast
PUSH = 1e-4  # [rad]; small enough that the motion stays linear while it is watched
GROWN = 20.0  # pushes; the motion of a stable loop stays near one
NEARBY = 1e-12  # [m]; a path needs two points, and one so short, travelled within a day, is a point
CONTROL_PERIOD = 1e-3  # [s]
STEPS_PER_RADIAN = 4.0  # of the crossing frequency; at most the default step


def bisect(diverges: Callable[[Array], NDArray[np.bool_]], low: float, high: float, rounds: int) -> tuple[float, float]:
    """Search between two delays [s] the one from which on runs diverge, to a factor; `LANES` delays a round.

    Return the last delay that does not and the first that does [s]; infinite if none does.
    """
    for number in range(rounds):
        tried = np.geomspace(low, high, LANES + 2)[1:-1] if number else np.geomspace(low, high, LANES)
        failed = diverges(tried)
        if number == 0 and (failed[0] or not failed[-1]):
            return (0.0, low) if failed[0] else (high, np.inf)
        first = int(np.argmax(failed)) if failed.any() else LANES
        low, high = (tried[first - 1] if first else low), (tried[first] if first < LANES else high)
    return float(low), float(high)


def arms_with(delays: Array, sensor: str, **options: Any) -> gymnasium.vector.VectorEnv[Any, Any, Any]:
    """Make an environment for each shoulder delay, the elbow's in proportion."""
    position = SENSORS[sensor]["position"]
    ratio = 1.0 if "delay" in SENSORS[sensor] else position / (4.5 + position)
    pairs = [(float(d), float(ratio * d)) for d in delays]
    own: dict[str, Any] = {"per_env": {"delay": pairs}, "sensor_position": position, "max_episode_steps": -1}
    return gymnasium.make_vec("FlexArm/Paper-v0", num_envs=len(delays), **own, **options)


def step(margin: float, omega: float) -> float | None:
    """Integration step that resolves the root that crosses, and the delay itself [s]; None for the default."""
    wanted = min(1.0 / (STEPS_PER_RADIAN * omega), 0.5 * margin)
    return wanted if wanted < 2e-4 else None


def held_diverges(sensor: str, delayed: str, gain: float, place: Any, physics_step: float | None) -> Any:
    """Make a test of delays: does a small push grow, with the arm held at one place of the square?"""
    arm = FlexibleArm(ArmParameters.paper())
    duration = HELD_TIME[delayed]
    resting = {"reference": "waypoints", "waypoints": [place, (place[0] + NEARBY, place[1])], "lap_time": 1e5}
    angles, _ = rest_angles(arm, place, SENSORS[sensor]["position"], "positive")
    state = np.zeros(2 * arm.size)
    state[:2] = angles + PUSH * np.array([1.0, -0.6])

    def diverges(delays: Array) -> NDArray[np.bool_]:
        """Whether the motion grows from the middle third of the time to the last, for each delay [s]."""
        envs = arms_with(delays, sensor, delayed=delayed, gain_limit=gain, physics_step=physics_step, **resting)
        envs.reset(options={"state": state})
        steps, full = round(duration / CONTROL_PERIOD), np.ones((len(delays), 1), dtype=np.float32)
        size, ended = np.zeros((steps, len(delays))), np.zeros(len(delays), dtype=bool)
        for i in range(steps):
            _, _, terminated, _, infos = envs.step(full)
            ended |= terminated
            size[i] = np.abs(infos["state"][:, :2] - angles).max(axis=1)
        third = steps // 3
        early, late = size[third : 2 * third].max(axis=0), size[2 * third :].max(axis=0)
        grows = late > early if delayed == "position" else late > GROWN * PUSH
        return np.asarray(ended | grows)

    return diverges


def lap_diverges(sensor: str, delayed: str, gain: float, physics_step: float | None) -> Any:
    """Make a test of delays: does a lap of the square leave the limits of a valid state?"""

    def diverges(delays: Array) -> NDArray[np.bool_]:
        """Whether the lap ends in an invalid state, for each delay [s]."""
        envs = arms_with(delays, sensor, delayed=delayed, gain_limit=gain, physics_step=physics_step)
        envs.reset()
        failed, full = np.zeros(len(delays), dtype=bool), np.ones((len(delays), 1), dtype=np.float32)
        for _ in range(16_000):
            failed |= envs.step(full)[2]
            if failed.all():
                break
        return failed

    return diverges


def delays(sensor: str, delayed: str, controller: str) -> dict[str, Any]:
    """Find the delays from which on the paper's arm diverges in one case."""
    linear, gain = row(FlexibleArm(ArmParameters.paper()), sensor, delayed, controller), GAINS[controller]
    found: dict[str, Any] = {"sensor": sensor, "delayed": delayed, "controller": controller}
    for place, at in PLACES.items():
        margin = linear[place]["delay_margin"]
        test = held_diverges(sensor, delayed, gain, at, step(margin, linear[place]["omega"]))
        found[place] = bisect(test, 0.6 * margin, 1.6 * margin, 2)
    margin = linear["corner"]["delay_margin"]
    test = lap_diverges(sensor, delayed, gain, step(margin, linear["corner"]["omega"]))
    return found | {"lap": bisect(test, 0.5 * margin, 4.0 * margin, 2)}
