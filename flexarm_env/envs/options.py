"""`Options`: the options of the environments with defaults, units and allowed values.

The defaults are those of `FlexArm/Square-v0`; the other ids change some (`registration`). The environments' pages are
made from the text beside each option.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from difflib import get_close_matches
from typing import Any, get_args

import numpy as np

from flexarm_env.allowed import (
    Custom,
    Flag,
    Integer,
    Number,
    OneOf,
    Optional,
    Pair,
    ZeroOr,
    allowed_of,
)
from flexarm_env.envs.choices import DEFAULT_OBSERVATION, DEFAULT_WEIGHTS, STARTS, Frame, Start
from flexarm_env.envs.consistency import (
    SHORTEST_HOLD,
    checked_paths,
    checked_previews,
    checked_waypoints,
    checked_weights,
)
from flexarm_env.envs.distributions import checked_distribution
from flexarm_env.envs.motion_options import MotionOptions
from flexarm_env.envs.motion_options import option as _option
from flexarm_env.envs.motion_options import own as _own
from flexarm_env.envs.quantities import QUANTITIES, SHARED_BY_ARMS
from flexarm_env.kernels.entries import DRAWN
from flexarm_env.parameters import (
    DIRECTIONS,
    EITHER,
    LARGEST_NOISE,
    MAX_DELAY,
    SENSOR_MODELS,
    WAVE_SPEED,
    ArmParameters,
    Corner,
    ElbowBranch,
    SensorModel,
    SensorParameters,
    SquareParameters,
)
from flexarm_env.physics.paths import PATHS
from flexarm_env.validation import entries, function, mapping, names, shown

_LATE = Number(0.0, MAX_DELAY, "s")
_HOLD = ZeroOr(SHORTEST_HOLD, MAX_DELAY, "s")  # it is a divisor
_INERTIAL = Pair(0.0, LARGEST_NOISE, "m/s^2, rad/s")
_LIMIT = Optional(Number(1e-9, 1e9, "m"))


@dataclass(frozen=True, kw_only=True)
class Options(MotionOptions):
    """All options as declared; `settings.Settings` checks them together."""

    sensor: SensorModel = _own(
        "true",
        "what the sensor on link 2 reads: " + "; ".join(f'"{name}": {one.text}' for name, one in SENSOR_MODELS.items()),
        allowed_of(SensorParameters, "model"),
    )
    sensor_position: float = _own(  # `Settings` has the number in place of None
        None,
        "distance of the sensor from the elbow; None: at the tip",
        Optional(allowed_of(SensorParameters, "position")),
    )
    delay: float | tuple[float, float] | None = _own(
        None,
        "delay of the sensor's reading; None: distance over the wave speed; `randomisation` draws one from a range",
        allowed_of(SensorParameters, "delay"),
    )
    wave_speed: float = _own(
        WAVE_SPEED, "wave speed c (15), which sets the delay", allowed_of(SensorParameters, "wave_speed")
    )
    noise: float = _own(
        0.0,
        "standard deviation of the noise in each coordinate of the sensor's reading",
        allowed_of(SensorParameters, "noise"),
    )
    jitter: float = _own(0.0, "largest additional delay, drawn uniformly for each reading", _LATE)
    sensor_period: float = _own(0.0, "period of the sensor's own clock (sample and hold); 0: it has none", _HOLD)
    dropout: float = _own(0.0, "probability that a reading is lost", Number(0.0, 1.0, "1"))
    outage_time: float = _own(
        0.0, "when an outage of the sensor begins, since the episode began", Number(0.0, 1e6, "s")
    )
    outage_duration: float = _own(
        0.0, "how long the outage lasts: readings that would be taken in it are lost", Number(0.0, 1e6, "s")
    )
    gauge_drift: tuple[float, float] = _own(
        (0.0, 0.0),
        "drift of the first modal coordinate of each link as strain gauges read it, 0 at the episode's start",
        Pair(-1e3, 1e3, "1/s"),
    )
    encoder_noise: tuple[float, float] = _own(
        (0.0, 0.0), "standard deviations of the noise of joint angles and rates", Pair(0.0, LARGEST_NOISE, "rad, rad/s")
    )
    encoder_resolution: tuple[float, float] = _option(
        (0.0, 0.0),
        "angle of a count of the encoders of shoulder and elbow; rates are changes of the count over a control period "
        "at the present rate; 0: any angle can be read",
        Pair(0.0, np.pi, "rad"),
    )
    second_sensor_link: int | None = _option(
        None,
        "link of a second sensor, which reads the true point; None: there is none",
        Optional(Integer(1, 2)),
    )
    second_sensor_position: float | None = _own(
        None,
        "distance of the second sensor from its link's root; None: at the link's tip",
        Optional(allowed_of(SensorParameters, "position")),
    )
    second_sensor_delay: float = _own(0.0, "delay of the second sensor's reading", _LATE)
    second_sensor_noise: float = _own(
        0.0,
        "standard deviation of the noise in each coordinate of the second sensor's reading",
        allowed_of(SensorParameters, "noise"),
    )
    imu_link: int | None = _option(
        None, "link of an inertial measurement unit (IMU); None: there is none", Optional(Integer(1, 2))
    )
    imu_position: float | None = _own(
        None,
        "distance of the IMU from its link's root; None: at the link's tip",
        Optional(allowed_of(SensorParameters, "position")),
    )
    imu_delay: float = _own(0.0, "delay of the IMU's reading", _LATE)
    imu_noise: tuple[float, float] = _own(
        (0.0, 0.0), "standard deviations of the noise of accelerometer and gyro", _INERTIAL
    )
    imu_bias: tuple[float, float] = _own(
        (0.0, 0.0), "standard deviations of the biases of accelerometer and gyro, drawn for each episode", _INERTIAL
    )
    imu_range: tuple[float, float] = _own(
        (160.0, 35.0),
        "full-scale ranges of accelerometer and gyro; the defaults are 16 g and 2000 degrees per second",
        Pair(1e-3, 1e6, "m/s^2, rad/s"),
    )
    actuation_delay: float = _own(0.0, "time from an action to its effect; an inner law is not delayed", _LATE)
    observation: tuple[str, ...] = _option(
        DEFAULT_OBSERVATION, "names of the blocks of an observation, in order", Custom(names)
    )
    frame: Frame = _option(
        "link", 'frame of blocks in m and m/s: "link" (turned by -theta1) or "world"', OneOf(("link", "world"))
    )
    previews: tuple[float, ...] = _option(
        (0.05, 0.1, 0.2, 0.3, 0.45, 0.6, 1.0),
        "how far ahead the block `previews` looks; in a race in m",
        Custom(checked_previews, "s"),
    )
    last_actions: int = _option(1, "number of actions in the block `last_actions`", Integer(1, 100))
    scaled: bool = _option(True, "divide each block by its scale", Flag())
    reference: Any = _own(
        "square",
        "path of the tip: a name, a function from time to x, y, or several of these and of tables like `waypoints`, of "
        'which each episode draws one. Alone only: "moves", "drawn", "target" (`set_reference` moves it)',
        Custom(
            checked_paths,
            text=", ".join(f'"{name}"' for name in (*PATHS, "waypoints", "moves", "drawn", "target")) + ", a function",
        ),
    )
    waypoints: Any = _own(
        None,
        'of the reference "waypoints": corners of a closed path at constant speed; or each with its time before it, '
        "from 0 to the end of the lap; or a function of time; or a mapping of such by the names in `reference`. Of "
        '"drawn": a function from a numpy generator to them, called for each episode. Of "target": where it rests',
        Optional(Custom(checked_waypoints, "m, or s, m, m")),
    )
    side: float = _option(
        12.6, "side of the square, or of the square around another path", allowed_of(SquareParameters, "side")
    )
    lap_time: float = _option(16.0, "duration of a lap", allowed_of(SquareParameters, "lap_time"))
    corner_time: float = _option(
        0.0,
        "time over which each corner of the path is blended: the reference is the path's mean over it, at most the "
        "time of the shortest side; 0: sharp corners",
        Number(0.0, 1e5, "s"),
    )
    start_corner: Corner = _option("lower left", "where a lap starts", allowed_of(SquareParameters, "start_corner"))
    direction: str = _own(
        "clockwise", 'direction of a lap; "either": drawn for each episode', OneOf((*DIRECTIONS, EITHER))
    )
    elbow_branch: str = _own(
        EITHER,
        'sign of theta2 at the start and in the inverse kinematics; "either": drawn for each episode',
        OneOf((*get_args(ElbowBranch), EITHER)),
    )
    start: Start = _option("mix", "how an episode starts", OneOf(tuple(STARTS)))
    start_spread: tuple[float, float] = _option(  # `Settings` has the numbers in place of None
        None,
        "largest deviations of a moving start: joint angles, tip deflections of the first modes; None: 0.05 and 0.05 "
        "for a reach of 9 m, the latter in proportion for others",
        Optional(Pair(0.0, 0.5, "rad, m")),
    )
    randomisation: Mapping[str, tuple[Any, ...]] = _own(
        {},
        "distributions from which quantities and options are drawn for each episode (docs/how_to/randomise.md)",
        Custom(lambda name, value: checked_ranges(name, value)),
    )
    reward_weights: Mapping[str, float] = _option(
        DEFAULT_WEIGHTS,
        "weights of the reward's terms, also below 0; a term without one has weight 0",
        Custom(checked_weights),
    )
    reward: Callable[[dict[str, Any]], Any] | None = _option(
        None,
        "function from the quantities of the infos, arrays with a row for each environment, to the rewards; None: the "
        "weighted terms",
        Optional(Custom(function, text="function")),
    )
    termination: Callable[[dict[str, Any]], Any] | None = _option(
        None,
        "function from the same to whether episodes end, a bool for each environment, beside the limits",
        Optional(Custom(function, text="function")),
    )
    deflection_limit: float | None = _option(
        1.5, "deflection of a link's tip that ends an episode; None: no limit", _LIMIT
    )
    error_limit: float | None = _option(
        2.5, "distance of the true tip from the target that ends an episode; None: no limit", _LIMIT
    )


OF_PATHS = ("side", "lap_time")  # an episode that draws one has a path of its own


def _drawable() -> dict[str, Number]:
    found = {name: Number(one.least, one.most, DRAWN[name]) for name, one in QUANTITIES.items()}
    for one in (*fields(Options), *fields(ArmParameters)):
        allowed = getattr(one.metadata["allowed"], "other", one.metadata["allowed"])
        of_an_arm = one.name not in (*SHARED_BY_ARMS, "damping_ratio")
        if isinstance(allowed, Number) and (one.metadata.get("own", of_an_arm) or one.name in OF_PATHS):
            found.setdefault(one.name, allowed)
    return found


DRAWABLE = _drawable()  # allowed values of what episodes may draw, by name; a `Pair`: two numbers


def each_of(name: str, given: Any) -> tuple[Any, ...]:
    """Return what is given for each number of a name in `DRAWABLE`."""
    return tuple(given) if isinstance(DRAWABLE[name], Pair) else (given,)


def checked_ranges(label: str, randomisation: Any) -> dict[str, tuple[Any, ...]]:
    """Check what is drawn for each episode: a distribution for each name in `DRAWABLE`, or two for two numbers."""
    ranges = {}
    for name, given in mapping(label, randomisation).items():
        if name not in DRAWABLE:
            near = "".join(f"did you mean {one!r}? " for one in get_close_matches(str(name), DRAWABLE, 1))
            known = ", ".join(map(repr, DRAWABLE))
            raise ValueError(f"{label}[{shown(name)}]: no such quantity; {near}there are {known}")
        what, allowed = f"{label}[{name!r}]", DRAWABLE[name]
        if not isinstance(allowed, Pair):
            ranges[name] = checked_distribution(what, given, allowed)
            continue
        both = entries(given) or []
        if len(both) != 2 or any(entries(each) is None for each in both):
            raise TypeError(f"{what} = {shown(given)}: must be two distributions, one for each of its numbers")
        ranges[name] = tuple(checked_distribution(f"{what}[{n}]", each, allowed) for n, each in enumerate(both))
    return ranges
