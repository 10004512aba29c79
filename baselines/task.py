"""What a controller may know of its task: published numbers, none of which changes within an episode."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from flexarm_baselines.arrays import Array, Floats
from flexarm_baselines.policy import env_attribute
from flexarm_env.actions import IDEAL_MOTORS
from flexarm_env.parameters import DIRECTIONS, ArmParameters
from flexarm_env.physics.paths import ReferencePath


@dataclass(frozen=True)
class Task:
    """The task of a torque controller, as the environment publishes it.

    It holds the nominal values of what an environment draws for each episode (`randomisation`), and nothing about
    noise, jitter and dropout of its sensors. But for races, torque controllers read an environment by this class alone.

    Attributes:
        arm: the nominal arm.
        path: the reference of a lap from its first corner on, by the time since the lap began.
        period: control period [s].
        torque_limit: torque limit of shoulder and elbow [N m]. Shape (2,).
        sensor: what the late sensor reads, see the option.
        sensor_position: distance of the late sensor from the elbow [m].
        delay: delay of the late sensor [s].
        actuation_delay: from an action to its effect [s].
        imu: link of the IMU, its distance from the link's root [m], and its delay [s]; None: there is none.
        payloads: what the tip carries in each control period of the lap [kg], NaN: the arm's or the episode's own
            payload; None: its own throughout. Shape (periods,).
        motors: options by which the motors are not ideal.
        blocks: where each block of an observation lies.
        scale: what each number of an observation was divided by. Shape (k,).
    """

    arm: ArmParameters = field(repr=False)
    path: ReferencePath
    period: float = 0.01
    torque_limit: tuple[float, float] = (150.0, 50.0)
    sensor: str = "true"
    sensor_position: float = 4.5
    delay: float = 0.0
    actuation_delay: float = 0.0
    imu: tuple[int, float, float] | None = None
    payloads: Floats | None = field(default=None, repr=False)
    motors: tuple[str, ...] = ()
    blocks: dict[str, slice] = field(default_factory=dict, repr=False)
    scale: Floats = field(default_factory=lambda: np.ones(0), repr=False)

    @property
    def lap_time(self) -> float:
        """Duration of a lap [s]."""
        return self.path.lap_time

    @property
    def periods(self) -> int:
        """Control periods in a lap."""
        return round(self.lap_time / self.period)

    @property
    def reference(self) -> Floats:
        """Where the tip should be at each instant of the lap, its end included [m]. Shape (periods + 1, 2)."""
        times = self.period * np.arange(self.periods + 1)
        return self.path.position(np.minimum(times, self.lap_time))

    @classmethod
    def of(cls, env: Any, path: ReferencePath | None = None) -> Task:
        """Read the task of an environment, single or vector, whose action is the torque.

        Args:
            env: the environment.
            path: the reference by time, in a race; None: the environment's, which is no race.

        Raises:
            ValueError: if its action is something else, it has no single reference, or its Cartesian blocks are not in
                the world's frame.
        """
        settings = env_attribute(env, "settings")
        wanted = "torque" if path is None else "race"
        if settings.action_mode != wanted:
            raise ValueError(f"env: must have action_mode = {wanted!r}, got action_mode = {settings.action_mode!r}")
        if settings.frame != "world":
            raise ValueError(f"env: Cartesian blocks must be in the world's frame, got frame = {settings.frame!r}")
        paths = dict(zip(DIRECTIONS, settings.paths, strict=False))
        if settings.has_own_path or len(settings.paths) != len(DIRECTIONS) or settings.direction not in paths:
            raise ValueError(
                f"env: must have one reference in one direction, got reference = {settings.reference!r}, direction = "
                f"{settings.direction!r}, randomisation of {', '.join(settings.randomisation) or 'nothing'}"
            )
        return cls(
            arm=settings.flexible_arm.parameters,
            path=paths[settings.direction] if path is None else path,
            period=settings.control_period,
            torque_limit=tuple(settings.motor_limit),
            sensor=settings.sensor,
            sensor_position=settings.sensor_position,
            delay=max(settings.sensor_delays),
            actuation_delay=settings.actuation_delay,
            imu=_imu(settings),
            payloads=payloads_on_the_way(settings),
            motors=tuple(name for name, value in IDEAL_MOTORS.items() if getattr(settings, name) != value),
            blocks=env_attribute(env, "observation_blocks"),
            scale=env_attribute(env, "observation_scale"),
        )

    def check_true_point(self) -> None:
        """Check that the late sensor reads where its point on link 2 is, as models of it have it.

        Raises:
            ValueError: if it does not.
        """
        if self.sensor != "true":
            raise ValueError(f"env: sensor = {self.sensor!r}: must be 'true', a filter's model of the late sensor")

    def read(self, observations: Array, block: str) -> Floats:
        """Return a block of observations in its unit.

        Args:
            observations: Shape (n, k).
            block: its name.

        Raises:
            ValueError: if the observation has no such block.
        """
        if block not in self.blocks:
            raise ValueError(f"observation: must have the block {block!r}, has {', '.join(self.blocks)}")
        place = self.blocks[block]
        return observations[:, place].astype(np.float64) * self.scale[place]

    def time_of(self, observations: Array) -> Floats:
        """Return the moment of the lap, to the nearest control period, by the block `lap_phase` [s]. Shape (n,)."""
        cosine, sine = self.read(observations, "lap_phase").T
        share = np.arctan2(sine, cosine) / (2.0 * np.pi)
        return self.period * np.mod(np.round(share * self.periods), self.periods)


def _imu(settings: Any) -> tuple[int, float, float] | None:
    """Return `Task.imu` of an environment."""
    link, place = settings.imu_link, settings.imu_position
    if link is None:
        return None
    return link, settings.flexible_arm.parameters.link_lengths[link - 1] if place is None else place, settings.imu_delay


def payloads_on_the_way(settings: Any) -> Floats | None:
    """Return `Task.payloads` of an environment; the latest change of the lap counts, before the first the last one."""
    if not settings.payload_changes:
        return None
    phases, masses = zip(*settings.payload_changes, strict=True)
    count = round(settings.lap_time / settings.control_period)
    latest = np.searchsorted(phases, (np.arange(count) + 1e-6) / count, side="right") - 1
    return np.array([np.nan if mass is None else mass for mass in masses])[latest]
