"""`Observer`: a Kalman filter that gives a network the present tip and vibrations in the place of late readings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from flexarm_agents.environments import check_id, check_options, settings_of
from flexarm_agents.policies.encoders import Array, Encoder, Memory
from flexarm_baselines.lqg import adaptive, controller
from flexarm_baselines.observers import Estimate, KalmanFilter, Readings
from flexarm_env.actions import IDEAL_MOTORS
from flexarm_env.envs.bounds import modal_range
from flexarm_env.envs.observation import observation_layout
from flexarm_env.envs.settings import Settings
from flexarm_env.validation import choice

KINDS = ("none", "nominal", "delay")  # no filter; one with the nominal delay; one that estimates the delay
NEEDED = ("joint_angles", "joint_rates", "sensed_position", "reference_position", "reference_velocity", "last_actions")
FILTERED = ("joint_angles", "sensed_position")  # blocks that only the filter reads
ERROR_SCALE, RATE_SCALE = 0.5, 3.0  # [m], [m/s]; as of the blocks `sensor_error` and `sensor_error_rate`
Floats = NDArray[np.float64]


def check_observed(settings: Settings) -> None:
    """Check that an environment has the actions, motors and blocks that an observer needs.

    Raises:
        ValueError: if it has not.
    """
    if settings.action_mode != "torque":
        raise ValueError(f"action_mode = {settings.action_mode!r}: must be 'torque' with an observer")
    if settings.real_motors:
        raise ValueError(f"{' or '.join(IDEAL_MOTORS)}: motors must be ideal with an observer, which knows no others")
    missing = [name for name in NEEDED if name not in settings.observation]
    if missing:
        raise ValueError(f"observation: must have {', '.join(map(repr, missing))} with an observer")


class Parts(NamedTuple):
    """What an observer works with."""

    filter: KalmanFilter  # the Kalman filter
    settings: Settings  # of the environment
    blocks: dict[str, slice]  # where each block lies in an observation
    scale: Floats  # divisor of each number of an observation. Shape (k,)
    seen: list[int]  # numbers of an observation that the network sees
    estimated: Floats  # divisor of each number of the estimate that the network sees


@dataclass(frozen=True)
class Observer(Encoder):
    """A Kalman filter of the nominal arm; an `Encoder`.

    The network sees the observation without `FILTERED`, then estimates of the tip's error and its rate, in the frame
    of the observation, of the modal coordinates and of their rates.
    """

    kind: str  # "nominal", or "delay": the filter estimates the late sensor's delay with the state
    environment: str  # id of the environment whose nominal arm, sensor and period the filter has
    options: dict[str, Any] = field(default_factory=dict, repr=False)  # options of that environment
    ARRAYS: ClassVar[tuple[str, ...]] = ("observer_scale",)
    knows: ClassVar[tuple[str, ...]] = ("plant parameters",)

    def __post_init__(self) -> None:
        choice("kind", self.kind, KINDS[1:])
        object.__setattr__(self, "environment", check_id(self.environment))
        object.__setattr__(self, "options", check_options(self.environment, self.options))

    @cached_property
    def parts(self) -> Parts:
        """What it works with."""
        settings = settings_of(self.environment, self.options)
        check_observed(settings)
        layout = observation_layout(settings, settings.program)
        arm, period, delay = settings.flexible_arm, settings.control_period, max(settings.sensor_delays)
        if self.kind == "nominal":
            kalman = KalmanFilter(arm, period, delay, settings.sensor_position, controller.QUICK)
        else:
            known = adaptive.ESTIMATED["delay"]
            deviation, drift = {"delay": known.deviation}, {"delay": known.drift}
            position, noise = settings.sensor_position, adaptive.NOISE
            kalman = KalmanFilter(arm, period, delay, position, noise, deviation, drift)
        seen = [n for name, part in layout.blocks.items() if name not in FILTERED for n in range(part.start, part.stop)]
        modes = [modal_range(settings, rates).scale for rates in (False, True)]
        estimated = np.array([*[ERROR_SCALE] * 2, *[RATE_SCALE] * 2, *modes[0], *modes[1]])
        return Parts(kalman, settings, layout.blocks, layout.scale, sorted(seen), estimated)

    @property
    def size(self) -> int:  # type: ignore[override]
        """Length of an observation."""
        return len(self.parts.scale)

    @property
    def inputs(self) -> int:
        """Number of the network's inputs."""
        return len(self.parts.seen) + len(self.parts.estimated)

    def reset(self, observations: Array) -> tuple[Array, Memory]:
        """See `Encoder`; the first estimate has straight links."""
        estimate = self._fresh(observations)
        return self._shown(observations, estimate), tuple(estimate)

    def advance(self, observations: Array, memory: Memory) -> tuple[Array, Memory]:
        """See `Encoder`; the memory is an `Estimate`. An estimate that diverged is reset."""
        kalman, limit = self.parts.filter, np.asarray(self.parts.settings.motor_limit)
        torque = self._read(observations, "last_actions")[:, :2] * limit
        estimate = kalman.predict(Estimate(*memory), torque)
        lost = ~kalman.is_sound(estimate)
        if lost.any():
            fresh = self._fresh(observations[lost])
            for part, new in zip(estimate, fresh, strict=True):
                part[lost] = new
        estimate, _ = kalman.correct(estimate, self._readings(observations))
        return self._shown(observations, estimate), tuple(estimate)

    def header(self) -> dict[str, Any]:
        """See `Encoder`."""
        return {"observer": {"kind": self.kind, "environment": self.environment, "options": self.options}}

    @property
    def observer_scale(self) -> Array:
        """The scale of the estimates, which tells arms with another number of modes apart."""
        return self.parts.estimated.astype(np.float32)

    @classmethod
    def from_file(cls, header: Mapping[str, Any], arrays: Mapping[str, Array]) -> Self:
        """See `Encoder`."""
        made = cls(**header["observer"])
        if not np.array_equal(made.observer_scale, arrays["observer_scale"]):
            raise ValueError(f"observer_scale: must be that of {made.environment} with its options")
        return made

    def _read(self, observations: Array, block: str) -> Floats:
        part = self.parts.blocks[block]
        return observations[:, part].astype(np.float64) * self.parts.scale[part]

    def _axis(self, observations: Array) -> Floats:
        """Return cosine and sine of the angle of the observations' frame. Shape (n, 2)."""
        angle = self._read(observations, "joint_angles")[:, 0] * (self.parts.settings.frame == "link")
        return np.stack([np.cos(angle), np.sin(angle)], axis=1)

    def _readings(self, observations: Array) -> Readings:
        """Return what encoders and the late sensor read, in the world's frame."""
        joints = np.concatenate([self._read(observations, name) for name in ("joint_angles", "joint_rates")], axis=1)
        cosine, sine = self._axis(observations).T
        return Readings(joints, _turned(cosine, -sine, self._read(observations, "sensed_position")))

    def _fresh(self, observations: Array) -> Estimate:
        kalman, joints = self.parts.filter, self._readings(observations).joints
        state = np.zeros((len(observations), 2 * kalman.arm.size))
        state[:, :2], state[:, kalman.arm.size : kalman.arm.size + 2] = joints[:, :2], joints[:, 2:]
        return kalman.start(state)

    def _shown(self, observations: Array, estimate: Estimate) -> Array:
        """Return the network's inputs. Shape (n, inputs)."""
        parts, states = self.parts, self.parts.filter.state(estimate)
        arm = parts.filter.arm
        tip = arm.output_jacobians(states)[0].sensed
        cosine, sine = self._axis(observations).T
        error = self._read(observations, "reference_position") - _turned(cosine, sine, tip[:, :2])
        rate = self._read(observations, "reference_velocity") - _turned(cosine, sine, tip[:, 2:])
        found = np.concatenate([error, rate, states[:, 2 : arm.size], states[:, arm.size + 2 :]], axis=1)
        scaled = np.clip(found / parts.estimated, -LARGEST, LARGEST)
        return np.concatenate([observations[:, parts.seen], scaled.astype(np.float32)], axis=1)


LARGEST = 20.0  # magnitude at which a scaled estimate is clipped for the network


def _turned(cosine: Floats, sine: Floats, vectors: Floats) -> Floats:
    """Return vectors' components along axes at an angle. Shape (n, 2)."""
    x, y = vectors.T
    return np.stack([cosine * x + sine * y, cosine * y - sine * x], axis=1)
