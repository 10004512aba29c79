"""`Observations`: what a policy observes as a function of states, late readings and past actions, with its derivatives.

The formulas are those of the environment (`flexarm_env.episode.features`), run on dual numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexarm_env.actions import IDEAL_MOTORS
from flexarm_env.codegen.tangents import jacobian
from flexarm_env.envs.blocks import BLOCKS
from flexarm_env.envs.sensors import FURTHER
from flexarm_env.envs.settings import Settings
from flexarm_env.envs.vector import FlexArmVectorEnv
from flexarm_env.episode.features import Measurements, features, in_frame, joint_errors
from flexarm_env.kernels.delay_line import hermite
from flexarm_env.kernels.entries import DRAWN
from flexarm_env.validation import shown

Floats = NDArray[np.float64]
# What environments must be for the chain of derivatives to be complete: nothing random between arm and policy, and
# nothing late but the sensor.
NEEDED: dict[str, Any] = {
    "action_mode": "torque",
    "sensor": "true",
    "randomisation": {},
    "noise": 0.0,
    "jitter": 0.0,
    "sensor_period": 0.0,
    "dropout": 0.0,
    "payload_changes": None,
    "pulse_force": (0.0, 0.0),
    "outage_duration": 0.0,
    "gauge_drift": (0.0, 0.0),
    "encoder_noise": (0.0, 0.0),
    "encoder_resolution": (0.0, 0.0),
    "actuation_delay": 0.0,
    **IDEAL_MOTORS,
    **{f"{sensor.name}_link": None for sensor in FURTHER},
}


class Seen(NamedTuple):
    """Inputs of an observation that depend on the arm and its sensors, at some instants."""

    states: Floats  # of the arms. Shape (..., 4 + 4 m)
    readings: Floats  # latest ones of the sensor on link 2 [m]. Shape (..., 2)
    earlier: Floats  # those a control period before [m]. Shape (..., 2)
    actions: Floats  # past ones, the newest first. Shape (..., actions, 2)


class Task(NamedTuple):
    """Inputs of an observation that depend on the task alone, in the world's frame."""

    reference: Floats  # position [m] and velocity [m/s]. Shape (..., 4)
    aim: Floats  # joint angles and rates of the rigid arm on the reference. Shape (..., 4)
    present_aim: Floats  # the same with the elbow on its present side. Shape (..., 4)
    sensor_reference: Floats  # where the tip should have been at the time of the reading [m]. Shape (..., 2)
    sensor_velocity: Floats  # how that changes between two readings [m/s]. Shape (..., 2)
    previews: Floats  # how far the reference will have moved [m]. Shape (..., 2 per horizon)
    # Cosine and sine of the lap's phase, the episode's time, the reading's age [s], and parameters. Shape (..., 4 + k)
    clock: Floats


class Instant(NamedTuple):
    """An instant at which the arm's point is read for a late reading of the sensor on link 2."""

    periods: int  # so many control periods before the one that begins when the reading arrives; 0: it begins then
    substeps: int  # integration steps from the beginning of that earlier period to the instant
    position: float  # weight of the point's position
    rate: float  # weight of its velocity [s]


def instants(settings: Settings) -> tuple[Instant, ...]:
    """Return the instants of which a reading is the weighted sum.

    The sensor's delay line keeps readings after each integration step; one between two steps is interpolated
    (`flexarm_env.kernels.delay_line`).

    Args:
        settings: of the environment; its delay is neither drawn nor requested.
    """
    substeps = settings.substeps
    step = settings.control_period / substeps
    back = settings.sensor_delays[0] / step
    if back == 0.0:
        return (Instant(0, 0, 1.0, 0.0),)
    whole = int(back)
    at_first, at_last, rate_first, rate_last = (
        float(hermite(a, b, a_rate, b_rate, step, 1.0 - (back - whole))[0])
        for a, b, a_rate, b_rate in np.eye(4).tolist()
    )
    weights = {whole + 1: (at_first, rate_first), whole: (at_last, rate_last)}  # by steps before the reading arrives
    periods = {steps: -(-steps // substeps) for steps in weights}
    return tuple(Instant(n, n * substeps - steps, *weights[steps]) for steps, n in periods.items())


class Observations:
    """The observations of a batch.

    Attributes:
        settings: of the environments.
        blocks: where each block lies in an observation.
        scale: divisor of each number. Shape (k,).
        encoders: indices in a state of what encoders read.
        by_state: derivatives by the state, of the blocks that show numbers of it unchanged. Shape (k, 4 + 4 m).
        by_actions: derivatives by past actions, the newest first. Shape (k, 2 per action).
    """

    def __init__(self, env: FlexArmVectorEnv) -> None:
        """Take the layout; refuse an option with which the derivatives are not complete."""
        self.settings, self.blocks, self.scale = env.settings, env.observation_blocks, env.observation_scale
        check_differentiable(self.settings)
        size = self.settings.flexible_arm.size
        self.encoders = [0, 1, size, size + 1]
        self.by_state = self._selected("STATE", 2 * size)
        first, count = 2 * len(self.settings.previews), 2 * self.settings.last_actions
        self.by_actions = self._selected("TAIL", first + count)[:, first:]

    def task(self, observations: NDArray[np.float32], seen: Seen) -> Task:
        """Recover what the task alone decides from observations; where no block has it, it is 0.

        Args:
            observations: Shape (..., k).
            seen: inputs from which they were made.
        """
        numbers = observations * self.scale
        encoders = np.moveaxis(seen.states[..., self.encoders], -1, 0)

        def observed(name: str, count: int = 2) -> Floats:
            return numbers[..., self.blocks[name]] if name in self.blocks else np.zeros((*numbers.shape[:-1], count))

        def world(name: str, count: int = 2) -> Floats:
            """Return vectors of a block in the world's frame."""
            back = -encoders[0] if self.settings.frame == "link" else 0.0 * encoders[0]
            parts = np.moveaxis(observed(name, count), -1, 0)
            pairs = zip(parts[::2], parts[1::2], strict=True)
            turned = [x for pair in pairs for x in in_frame([np.cos(back), np.sin(back)], pair)]
            return np.stack(turned, axis=-1) if turned else np.zeros((*numbers.shape[:-1], 0))

        def aim(name: str) -> Floats:
            """Return the joint angles and rates from which a block of joint errors and that of its rates are taken."""
            errors = np.concatenate([observed(name), observed(f"{name}_rate")], axis=-1)
            return np.asarray(errors + np.moveaxis(encoders, 0, -1))

        return Task(
            np.concatenate([world("reference_position"), world("reference_velocity")], axis=-1),
            aim("joint_error"),
            aim("present_joint_error"),
            world("sensor_error") + seen.readings,
            world("sensor_error_rate") + (seen.readings - seen.earlier) / self.settings.control_period,
            world("previews", 2 * len(self.settings.previews)),
            np.concatenate(
                [
                    observed("lap_phase"),
                    observed("time", 1),
                    observed("reading_age", 1),
                    observed("episode_parameters", len(DRAWN)),
                ],
                axis=-1,
            ),
        )

    def values(self, seen: Seen, task: Task) -> Floats:
        """Compute observations. Shape (..., k)."""
        point = np.moveaxis(_point(seen, self.encoders), -1, 0)
        found = [np.broadcast_to(number, point.shape[1:]) for number in self._numbers(list(point), seen, task)]
        return np.stack(found, axis=-1)

    def slopes(self, seen: Seen, task: Task) -> Floats:
        """Compute derivatives by encoders, reading and earlier reading. Shape (..., k, 8)."""
        point = _point(seen, self.encoders)
        return jacobian(lambda numbers: self._numbers(numbers, seen, task), point)[1]

    def _numbers(self, point: Sequence[Any], seen: Seen, task: Task) -> list[Any]:
        """Write the numbers of an observation as plain functions of eight numbers; see `slopes`."""
        encoders, reading, earlier = point[:4], point[4:6], point[6:]
        reference, aim, present_aim, sensor_reference, sensor_velocity, previews, clock = (
            list(np.moveaxis(part, -1, 0)) for part in task
        )
        period = self.settings.control_period
        known = Measurements(
            encoders,
            reference,
            aim,
            reading,
            [there - x for there, x in zip(sensor_reference, reading, strict=True)],
            [v - (x - y) / period for v, x, y in zip(sensor_velocity, reading, earlier, strict=True)],
            self.settings.flexible_arm.parameters.link_lengths,
            phase=0.0,
            frame=1.0 if self.settings.frame == "link" else 0.0,
        )
        found = features(known)
        present_error, present_rate = joint_errors(present_aim, encoders)
        pairs = zip(previews[::2], previews[1::2], strict=True)
        ahead = [x for pair in pairs for x in in_frame(found.frame_axis, pair)]
        past = np.moveaxis(seen.actions.reshape(*seen.actions.shape[:-2], -1), -1, 0)
        rows = {f"F_{name.upper()}": values for name, values in found._asdict().items()} | {
            "F_PHASE": clock[:2],
            "TIME": clock[2:3],
            "READING_AGE": clock[3:4],
            "EPISODE": clock[4:],
            "F_PRESENT_JOINT_ERROR": present_error,
            "F_PRESENT_JOINT_ERROR_RATE": present_rate,
            "ENCODERS": encoders,
            "STATE": list(np.moveaxis(seen.states, -1, 0)),
            "TAIL": [*ahead, *past],
            "EFFECTIVE_GAIN": [0.0],
        }
        numbers = []
        for name in self.blocks:
            part, first, count = BLOCKS[name].rows(self.settings)
            numbers += rows[part][first : first + count]
        return [x * (1.0 / scale) for x, scale in zip(numbers, self.scale, strict=True)]

    def _selected(self, part: str, count: int) -> Floats:
        """Return derivatives of an observation by the numbers of a part, some of which it shows unchanged."""
        slopes = np.zeros((len(self.scale), count))
        for name, place in self.blocks.items():
            own, first, size = BLOCKS[name].rows(self.settings)
            if own == part:
                rows = np.arange(place.start, place.stop)
                slopes[rows, first + np.arange(size)] = 1.0 / self.scale[rows]
        return slopes


def check_differentiable(settings: Settings) -> None:
    """Refuse an environment through which derivatives do not run, naming the option."""
    for name, value in NEEDED.items():
        if (given := getattr(settings, name)) != value:
            raise ValueError(f"{name} = {shown(given)}: derivatives run through {value!r} only")


def _point(seen: Seen, encoders: Sequence[int]) -> Floats:
    """Put together what features depend on: encoders and their rates, reading, reading before. Shape (..., 8)."""
    return np.concatenate([seen.states[..., encoders], seen.readings, seen.earlier], axis=-1)
