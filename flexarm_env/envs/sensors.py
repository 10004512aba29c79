"""The sensors at points of the links, each declared once.

Rows of the arena, slots of the delay line, random numbers, blocks of observations with their bounds, keys of infos,
checks of options and documentation follow from the declarations.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple
from zlib import crc32

import numpy as np

from flexarm_env.parameters import ArmParameters
from flexarm_env.physics.sensing import POSITION

# Signs of numbers in the mirrored episode, in which the y axis of every frame points the other way.
SCALAR, ANGLE, VECTOR = (1,), (-1,), (1, -1)


class Part(NamedTuple):
    """Numbers that a sensor gives, which are a block of observations.

    Attributes:
        block: its name.
        what: description.
        unit: of its numbers.
        scale: divisor of its numbers where observations are scaled.
        size: how many numbers.
        mirror: their signs in the mirrored episode, repeated over the block.
    """

    block: str
    what: str
    unit: str
    scale: float
    size: int = 2
    mirror: tuple[int, ...] = VECTOR


@dataclass(frozen=True, kw_only=True, eq=False)
class Sensor:
    """Declaration of a sensor.

    A further sensor is mounted by its option ``<name>_link``. Its others are ``<name>_position`` (distance from the
    link's root; None: the tip), ``<name>_delay``, and those that `options` names, with a value for each part.

    Attributes:
        name: with which the names of its options begin.
        words: what it is called, with its article.
        reads: what a policy learns from it, a name in `blocks.INFORMATION`.
        quantity: what it measures (`sensing.QUANTITIES_AT_A_POINT`).
        parts: of a reading, in its order.
        error: of a position: the reference's point at the time of the reading, minus the reading.
        info: key of infos that holds the reading.
        options: further options that it has, of "noise", "bias" and "range".
        draws: place of its noise among the random numbers of a control period (`sensor.noise_place`), even; None: one
            far from all others, by its name.
        text: for the documentation.
    """

    name: str
    words: str
    reads: str
    quantity: str = POSITION
    parts: tuple[Part, ...]
    error: Part | None = None
    info: str
    options: tuple[str, ...] = ("noise",)
    draws: int | None = None
    text: str = ""

    @property
    def title(self) -> str:
        """What it is called."""
        return self.words.partition(" ")[2]

    @property
    def noise_offset(self) -> int:
        """See `draws`."""
        return crc32(self.name.encode()) << 20 if self.draws is None else self.draws

    @property
    def blocks(self) -> tuple[str, ...]:
        """Names of its blocks."""
        return tuple(part.block for part in (*self.parts, *([self.error] if self.error else [])))

    @property
    def size(self) -> int:
        """How many numbers a reading has."""
        return sum(part.size for part in self.parts)

    @property
    def unit(self) -> str:
        """Units of its reading."""
        return ", ".join(part.unit for part in self.parts)

    @property
    def option_names(self) -> tuple[str, ...]:
        """Options that have an effect where it is mounted."""
        return tuple(f"{self.name}_{suffix}" for suffix in ("position", "delay", *self.options))

    def of_each_number(self, settings: Any, option: str, default: float) -> tuple[float, ...]:
        """Return the value of an option for each number of a reading."""
        value = getattr(settings, f"{self.name}_{option}") if option in self.options else default
        values = value if isinstance(value, tuple) else (value,) * len(self.parts)
        return tuple(x for x, part in zip(values, self.parts, strict=True) for _ in range(part.size))


class Mounted(NamedTuple):
    """A further sensor of an environment.

    Attributes:
        sensor: its declaration.
        link: 1 or 2.
        position: distance from the link's root [m].
        delay: [s].
        noise: standard deviation of each number that it reads.
        bias: standard deviation of each number's bias.
        range: largest magnitude that each number can have.
        first: place of its reading among those of all further sensors.
    """

    sensor: Sensor
    link: int
    position: float
    delay: float
    noise: tuple[float, ...]
    bias: tuple[float, ...]
    range: tuple[float, ...]
    first: int


LINK_2 = Sensor(
    name="sensor",
    words="the sensor on link 2",
    reads="late tip",
    parts=(Part("sensed_position", "latest reading of the sensor on link 2: late, noisy", "m", 6.3),),
    error=Part("sensor_error", "target as long ago as the nominal delay (`delay`) says minus the reading", "m", 0.5),
    info="sensed",
)
SECOND = Sensor(
    name="second_sensor",
    words="a second sensor",
    reads="second sensor",
    parts=(
        Part(
            "second_sensed_position",
            "latest reading of the second sensor (`second_sensor_link`): late, noisy",
            "m",
            6.3,
        ),
    ),
    error=Part(
        "second_sensor_error",
        "the same point of the rigid arm on the target as long ago as `second_sensor_delay` says, minus the reading",
        "m",
        0.5,
    ),
    info="second_sensed",
    draws=6,
    text="""\
`second_sensor_link` adds a second position sensor on either link, to compare sets of sensors. It reads the true point
at `second_sensor_position`, `second_sensor_delay` seconds ago, with noise of its own (`second_sensor_noise`), in every
control period; `jitter`, `sensor_period`, `dropout` and a drawn `delay` are the first sensor's. `second_sensor_error`
compares a reading with the *same point* of a rigid arm that was on the target then, by the declared position and delay.
It is 0 if the arm is unbent and on the target.""",
)
IMU = Sensor(
    name="imu",
    words="an IMU",
    reads="IMU",
    quantity="inertial",
    parts=(
        Part(
            "accelerometer",
            "latest specific force by the IMU (`imu_link`), along and across the link's tangent",
            "m/s^2",
            20.0,
        ),
        Part("gyro", "latest rate of the link's tangent by the IMU", "rad/s", 3.0, 1, ANGLE),
    ),
    info="imu",
    options=("noise", "bias", "range"),
    text="""\
`imu_link` mounts an inertial measurement unit on a link at `imu_position`. Its accelerometer reads the *specific force*
along and across the link's tangent at that point, which turns as the link bends; its gyro reads the tangent's rate.
Gravity is at right angles to the plane, so the specific force is the point's acceleration. Each number has white noise
(`imu_noise`), a bias that is drawn from a normal distribution for each episode (`imu_bias`), and a full-scale range
beyond which it saturates (`imu_range`). The torque of a control period acts from its start, so a reading at its end
shows the torque that has been held. `imu_delay` makes readings late: between two integration steps they are linear, and
before an episode's first step they are those of its start, with idle motors.""",
)
FURTHER = (SECOND, IMU)
SENSORS = (LINK_2, *FURTHER)


def mounting(settings: Any, sensor: Sensor) -> Mounted:
    """Return how a further sensor is mounted in an environment that has it."""
    (found,) = (one for one in settings.further_sensors if one.sensor is sensor)
    return found


def mounted(settings: Any) -> tuple[Mounted, ...]:
    """Return the further sensors of an environment."""
    arm, found, first = settings.flexible_arm.parameters, [], 0
    for sensor in sorted(FURTHER, key=lambda one: one.quantity != POSITION):  # kernels expect positions first
        link, position, delay = (getattr(settings, f"{sensor.name}_{name}") for name in ("link", "position", "delay"))
        if link is None:
            continue
        if position is None:
            position = arm.link_lengths[link - 1]
        refuse_off_link(f"{sensor.name}_position", position, link, arm)
        noise = sensor.of_each_number(settings, "noise", 0.0)
        bias = sensor.of_each_number(settings, "bias", 0.0)
        largest = sensor.of_each_number(settings, "range", np.inf)
        found.append(Mounted(sensor, link, position, delay, noise, bias, largest, first))
        first += len(noise)
    return tuple(found)


def refuse_off_link(name: str, position: float, link: int, arm: ArmParameters) -> None:
    """Refuse a sensor's position beyond the end of its link."""
    length = arm.link_lengths[link - 1]
    if position > length:
        raise ValueError(
            f"{name} = {position} m: must be on link {link}, > 0 and <= {length} m (link_lengths of the arm)"
        )
