"""What an agent of `FlexArm/Square-v0` would see of any arm: of MuJoCo's chain, or of a model with other modes.

Encoders and the late sensor read the arm itself. The strain gauges' modal coordinates are read off the deflection: that
part of it which the environment's own modes can express (`flexarm_env.chain.gauges`). The parts and their scales are
the environment's; on its own arm this gives its own observations (tests/scripts/test_validation_engine.py).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexarm_env.chain.gauges import Gauges
from flexarm_env.chain.links import Sight
from flexarm_env.envs.single import FlexArmEnv
from flexarm_env.episode.features import Measurements, features, joint_aim
from flexarm_env.parameters import EITHER
from scripts.validation.engine.chain import Plant
from scripts.validation.engine.programmes import HELD

Array = NDArray[np.float64]


class Observer:
    """Makes an environment's observations from any arm that is driven by torques.

    Attributes:
        settings: the environment's.
        periods: instants `HELD` apart in a control period.
    """

    def __init__(self, env: FlexArmEnv) -> None:
        """For an environment with a late "true" sensor without noise, clock or losses, torques as actions.

        Raises:
            ValueError: for one with another sensor or action, or whose episodes draw the side of the elbow.
        """
        s = self.settings = env.settings
        if (s.sensor, s.action_mode) != ("true", "torque") or s.noise or s.jitter or s.hold or s.dropout:
            raise ValueError("env: must be driven by torques and have a late 'true' sensor without noise or losses")
        if isinstance(s.delay, tuple):
            raise ValueError(f"env: delay = {s.delay}: must be one number; a 'true' sensor has one reading")
        if EITHER in (s.direction, s.elbow_branch):
            raise ValueError(f"env: direction = {s.direction!r}, elbow_branch = {s.elbow_branch!r}: must not be drawn")
        self.periods = round(s.control_period / HELD)
        self._blocks, self._scale = env.observation_blocks, env.observation_scale
        self._path, self._gauges = s.paths[0], Gauges(env.arm)
        self._lengths = env.arm.parameters.link_lengths
        self._branch = 1.0 if s.elbow_branch == "positive" else -1.0
        self._delay = (sum(self._lengths) / s.wave_speed) if s.delay is None else s.delay
        self._tips: list[Array] = []
        self._error = np.zeros(2)

    def note(self, tips: Array) -> None:
        """Take over where the tip was, every `HELD` from time 0 on. Shape (n, 2)."""
        self._tips += list(tips)

    def look(self, plant: Plant, last_action: Array) -> NDArray[np.float32]:
        """Return the observation at the instant noted last.

        Args:
            plant: the arm.
            last_action: what acted until now, within [-1, 1].
        """
        time = HELD * (len(self._tips) - 1)
        known = self._known(plant.look(), time)
        seen = features(known)
        modal, modal_rates = self._gauges.modal(plant.bend())
        parts: dict[str, ArrayLike] = {
            "elbow_direction": seen.directions[:2],
            "joint_rates": known.encoders[2:],
            "joint_error": seen.joint_error,
            "joint_error_rate": seen.joint_error_rate,
            "encoder_error": seen.encoder_error,
            "reference_position": seen.reference,
            "reference_velocity": seen.reference_velocity,
            "sensor_error": seen.sensor_error,
            "sensor_error_rate": seen.sensor_error_rate,
            "modal_coordinates": modal.ravel(),
            "modal_rates": modal_rates.ravel(),
            "previews": self._previews(time, seen.frame_axis),
            "last_actions": last_action,
        }
        observation = np.empty(len(self._scale))
        for name, place in self._blocks.items():
            observation[place] = np.asarray(parts[name])
        return (observation / self._scale).astype(np.float32)

    def _known(self, sight: Sight, time: float) -> Measurements:
        reference = [*self._path.position(time), *self._path.velocity(time)]
        taken = time - self._delay
        reading = self._reading(taken)
        error = self._path.position(max(taken, 0.0)) - reading
        first = len(self._tips) == 1
        error_rate = np.zeros(2) if first else (error - self._error) / self.settings.control_period
        self._error = error
        return Measurements(
            encoders=[*sight.joints, *sight.rates],
            reference=reference,
            reference_joints=joint_aim(self._lengths, self._branch, reference, sight.joints[0]),
            link_sensor=reading.tolist(),
            sensor_error=error.tolist(),
            sensor_error_rate=error_rate.tolist(),
            lengths=self._lengths,
            phase=time / self.settings.lap_time % 1.0,
            frame=1.0 if self.settings.frame == "link" else 0.0,
        )

    def _reading(self, taken: float) -> Array:
        """Where the tip was; between instants on a straight line, before the start at rest."""
        place = max(taken, 0.0) / HELD
        before = min(int(place), len(self._tips) - 1)
        after = min(before + 1, len(self._tips) - 1)
        return self._tips[before] + (place - before) * (self._tips[after] - self._tips[before])

    def _previews(self, time: float, axis: list[float]) -> Array:
        horizons = time + np.array(self.settings.previews)
        moved = self._path.position(horizons) - self._path.position(time)
        (c, s) = axis
        return (moved @ np.array([[c, -s], [s, c]])).ravel()
