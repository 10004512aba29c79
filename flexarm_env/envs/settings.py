"""`Settings`: the options of the environments with defaults, validation, and derived values.

The defaults are those of `FlexArm/Square-v0`; the other ids change some (`registration`). The environments' pages are
made from the text beside each option.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import MISSING, Field, dataclass, fields
from typing import Any, Literal, get_args

import numpy as np

from flexarm_env.actions import MODES, ActionMode, modes_reading
from flexarm_env.allowed import (
    Allowed,
    Custom,
    Flag,
    Integer,
    Number,
    OneOf,
    Optional,
    Pair,
    allowed_of,
    check_fields,
    declared,
)
from flexarm_env.codegen.declarations import Program
from flexarm_env.envs.choices import (
    DEFAULT_OBSERVATION,
    DEFAULT_WEIGHTS,
    PHYSICS_STEP,
    STARTS,
    Frame,
    Start,
)
from flexarm_env.envs.consistency import (
    SHORTEST_HOLD,
    checked_arm,
    checked_hold,
    checked_paths,
    checked_previews,
    checked_waypoints,
    checked_weights,
    refuse_off_link,
    refuse_options_without_effect,
)
from flexarm_env.envs.quantities import NAMED_QUANTITIES, QUANTITIES, checked_ranges
from flexarm_env.episode.step import PROGRAMS
from flexarm_env.lazy import cached_property
from flexarm_env.parameters import (
    DIRECTIONS,
    EITHER,
    LARGEST_NOISE,
    MAX_DELAY,
    SENSOR_MODELS,
    WAVE_SPEED,
    Compensation,
    Corner,
    Delayed,
    ElbowBranch,
    LawParameters,
    RateJacobian,
    SensorModel,
    SensorParameters,
    SquareParameters,
    arm_parameters,
)
from flexarm_env.physics.paths import PATHS, ReferencePath, way_points
from flexarm_env.simulation.arm import FlexibleArm
from flexarm_env.simulation.stability import STABLE_ANGLE, count_readings, count_steps, default_step, fastest_rates
from flexarm_env.validation import known_names, names, shown


def _option(default: Any, text: str, allowed: Allowed) -> Any:
    return declared(default, allowed, text=text)


_LATE = Number(0.0, MAX_DELAY, "s")
_HOLD = Custom(checked_hold, "s", f"0, or {SHORTEST_HOLD:g} to {MAX_DELAY:g}")
_LIMIT = Optional(Number(1e-9, 1e9, "m"))


@dataclass(frozen=True, kw_only=True)
class Settings:
    """All options; `Settings.of` makes one from keyword arguments."""

    arm: str | Mapping[str, Any] = _option(
        "default",
        '"default" (2 modes a link, complete dynamics, 1 % modal damping), "paper", or a mapping of `ArmParameters` '
        'fields, with `preset` ("default" or "paper") for those it does not set; {"kinematics": "foreshortened"} is '
        "the arm whose bent links keep their length",
        Custom(checked_arm),
    )
    action_mode: str = _option("torque", "what an action is; see Action space", OneOf(tuple(MODES)))
    control_period: float = _option(0.01, "an action is held so long", Number(1e-5, 1.0, "s"))
    physics_step: float | None = _option(
        None,
        "longest integration step; None: 1 ms, for the gain 0.25 ms, or less if the fastest mode demands it",
        Optional(Number(1e-9, 1.0, "s")),
    )
    torque_limit: tuple[float, float] | None = _option(
        None,
        "of shoulder and elbow; None: 150 and 50, for the gain no limit (limited, the law loses the path)",
        allowed_of(LawParameters, "torque_limit"),
    )
    torque_rate_limit: tuple[float, float] = _option(
        # The second modes of the default arm, 36 Hz and more, feel less than a tenth of what a step of the torque does.
        (3000.0, 1000.0),
        "change of the torque per second at action 1; the default reverses the default torques in 0.1 s",
        Pair(1e-6, 1e12, "N m/s"),
    )
    gain_limit: float = _option(1.0, "lambda at action 1", Number(1e-6, 1e6, "1"))
    shift_limit: tuple[float, float] = _option(
        (0.3, 0.3), "shift of the joints' reference at action 1", Pair(1e-6, np.pi, "rad")
    )
    inner_stiffness: tuple[float, float] = _option(
        (1000.0, 130.0), "of the inner tracking law", Pair(0.0, 1e9, "N m/rad")
    )
    inner_resistance: tuple[float, float] = _option(
        (40.0, 30.0), "of the inner tracking law", Pair(0.0, 1e9, "N m s/rad")
    )
    proportional_gain: float = _option(
        150.79, "Kp of the paper's law (11)", allowed_of(LawParameters, "proportional_gain")
    )
    derivative_gain: float = _option(17.364, "Kd of the paper's law (12)", allowed_of(LawParameters, "derivative_gain"))
    compensation: Compensation = _option(
        "none", "delay of the law's command; see `LawParameters`", allowed_of(LawParameters, "compensation")
    )
    law_sensor: Literal["joints", "sensor"] = _option(
        "joints",
        'what the paper\'s law acts on: "joints" (collocated, not late) or the late "sensor"',
        OneOf(("joints", "sensor")),
    )
    rate_jacobian: RateJacobian = _option(
        "delayed", "see `SensorParameters`", allowed_of(SensorParameters, "rate_jacobian")
    )
    delayed: Delayed = _option("position", "see `SensorParameters`", allowed_of(SensorParameters, "delayed"))
    sensor: SensorModel = _option(
        "true",
        "what the sensor on link 2 reads: " + "; ".join(f'"{name}": {one.text}' for name, one in SENSOR_MODELS.items()),
        allowed_of(SensorParameters, "model"),
    )
    sensor_position: float = _option(4.5, "of the sensor from the elbow", allowed_of(SensorParameters, "position"))
    delay: float | tuple[float, float] | None = _option(
        None, "of the sensor's reading; None: by the wave speed", allowed_of(SensorParameters, "delay")
    )
    wave_speed: float = _option(WAVE_SPEED, "c (15)", allowed_of(SensorParameters, "wave_speed"))
    noise: float = _option(
        0.0, "standard deviation of each coordinate of the sensor's reading", allowed_of(SensorParameters, "noise")
    )
    jitter: float = _option(0.0, "largest additional delay, drawn evenly for each reading", _LATE)
    hold: float = _option(0.0, "period of a slower sensor's clock (sample and hold); 0: none", _HOLD)
    dropout: float = _option(0.0, "probability that a reading is lost", Number(0.0, 1.0, "1"))
    encoder_noise: tuple[float, float] = _option(
        (0.0, 0.0), "standard deviations of joint angles and rates", Pair(0.0, LARGEST_NOISE, "rad, rad/s")
    )
    second_sensor_link: int | None = _option(
        None,
        "link of a second sensor, which sees the true point; None: there is none",
        Optional(Integer(1, 2)),
    )
    second_sensor_position: float | None = _option(
        None,
        "of the second sensor from its link's root; None: at the link's tip",
        Optional(allowed_of(SensorParameters, "position")),
    )
    second_sensor_delay: float = _option(0.0, "of the second sensor's reading", _LATE)
    second_sensor_noise: float = _option(
        0.0,
        "standard deviation of each coordinate of the second sensor's reading",
        allowed_of(SensorParameters, "noise"),
    )
    actuation_delay: float = _option(0.0, "from an action to its effect; an inner law is not delayed", _LATE)
    observation: tuple[str, ...] = _option(
        DEFAULT_OBSERVATION, "names of the blocks, in order; see Observation space", Custom(names)
    )
    frame: Frame = _option(
        "link", 'frame of Cartesian blocks: "link" (turned by -theta1) or "world"', OneOf(("link", "world"))
    )
    previews: tuple[float, ...] = _option(
        (0.05, 0.1, 0.2, 0.3, 0.45, 0.6, 1.0), "horizons of the block `previews`", Custom(checked_previews, "s")
    )
    last_actions: int = _option(1, "how many the block `last_actions` holds", Integer(1, 100))
    scaled: bool = _option(True, "divide each block by its scale", Flag())
    reference: str | Sequence[str] = _option(
        "square",
        '"square", "circle", "line", "figure_eight", "waypoints", "moves" (drawn from rest to rest), or several of the '
        "first five, one of which is drawn for each episode",
        Custom(checked_paths),
    )
    waypoints: Sequence[tuple[float, float]] | None = _option(
        None, 'corners of the reference "waypoints"', Optional(Custom(checked_waypoints, "m"))
    )
    side: float = _option(
        12.6, "of the square, or the square around the other paths", allowed_of(SquareParameters, "side")
    )
    lap_time: float = _option(16.0, "of a lap", allowed_of(SquareParameters, "lap_time"))
    start_corner: Corner = _option("lower left", "where a lap starts", allowed_of(SquareParameters, "start_corner"))
    direction: str = _option("clockwise", 'of a lap; "either": drawn for each episode', OneOf((*DIRECTIONS, EITHER)))
    elbow_branch: str = _option(
        EITHER,
        'sign of theta2 at the start and in the inverse kinematics; "either": drawn for each episode',
        OneOf((*get_args(ElbowBranch), EITHER)),
    )
    start: Start = _option("mix", "how an episode starts; see Starting state", OneOf(tuple(STARTS)))
    start_spread: tuple[float, float] = _option(
        (0.05, 0.05),
        "largest deviations of a moving start: joint angles, tip deflections of the first modes",
        Pair(0.0, 0.5, "rad, m"),
    )
    randomisation: Mapping[str, tuple[float, float]] = _option(
        {},
        f"ranges from which quantities are drawn for each episode: {NAMED_QUANTITIES}",
        Custom(checked_ranges),
    )
    reward_weights: Mapping[str, float] = _option(
        DEFAULT_WEIGHTS, "of the reward's terms; what is not named is 0", Custom(checked_weights)
    )
    deflection_limit: float | None = _option(
        1.5, "a link's tip deflection that ends an episode; None: any is allowed", _LIMIT
    )
    error_limit: float | None = _option(
        2.5, "distance of the true tip from the reference that ends an episode; None: any is allowed", _LIMIT
    )

    @classmethod
    def of(cls, options: Mapping[str, Any], owner: str = "Settings") -> Settings:
        """Make settings from keyword arguments.

        Args:
            options: the arguments.
            owner: name of the class that received them, for messages.

        Raises:
            TypeError: for an unknown name, with the nearest known one.
            ValueError: for a bad value.
        """
        known_names(owner, options, [one.name for one in fields(cls)])
        return cls(**options)

    def __post_init__(self) -> None:
        """Validate all options; lists (as in JSON) become tuples."""
        check_fields(self)
        refuse_options_without_effect(
            self, {one.name: (default_of(one), modes_reading(one.name)) for one in fields(self)}
        )
        for what in ("law", "sensor_parameters", "flexible_arm", "second_sensor", "paths", "substeps", "history_slots"):
            getattr(self, what)  # each derived value has its own checks

    # --- what follows ----------------------------------------------------------------------------------------------

    @property
    def mode(self) -> ActionMode:
        """The action mode."""
        return MODES[self.action_mode]

    @property
    def program(self) -> Program:
        """Program of the kernels that step the environments."""
        return PROGRAMS[self.mode.program]

    def range_of(self, name: str) -> tuple[float, float]:
        """Return the least and the largest value of a quantity (`quantities.QUANTITIES`) that any episode may have."""
        own = self.own_value(name)
        return self.randomisation.get(name, (own, own))

    def own_value(self, name: str) -> float:
        """Return the value of a quantity if it is neither drawn nor requested."""
        return QUANTITIES[name].own(self)

    @cached_property
    def law(self) -> LawParameters:
        """Parameters of the paper's law."""
        return LawParameters(self.proportional_gain, self.derivative_gain, self.compensation, self.torque_limit)

    @cached_property
    def sensor_parameters(self) -> SensorParameters:
        """Parameters of the sensor on link 2."""
        return SensorParameters(
            self.sensor,
            self.sensor_position,
            self.delay,
            self.delayed,
            self.rate_jacobian,
            self.noise,
            self.wave_speed,
        )

    @cached_property
    def flexible_arm(self) -> FlexibleArm:
        """The arm."""
        arm = FlexibleArm(arm_parameters(self.arm))
        refuse_off_link("sensor_position", self.sensor_position, 2, arm.parameters)
        return arm

    @cached_property
    def second_sensor(self) -> tuple[int, float] | None:
        """Link of the second sensor, and its distance from the link's root [m]."""
        if self.second_sensor_link is None:
            return None
        link, position, p = self.second_sensor_link, self.second_sensor_position, self.flexible_arm.parameters
        if position is None:
            return link, p.link_lengths[link - 1]
        refuse_off_link("second_sensor_position", position, link, p)
        return link, position

    @cached_property
    def paths(self) -> list[ReferencePath]:
        """Paths of `reference`, in one of `DIRECTIONS` and then in the other; empty if each episode draws its own."""
        if self.reference == ("moves",):
            return []
        tasks = [SquareParameters(self.side, self.lap_time, self.start_corner, one) for one in DIRECTIONS]
        found = [
            (name, way_points(task, self.waypoints or ()) if name == "waypoints" else PATHS[name](task))
            for task in tasks
            for name in self.reference
        ]
        for name, path in found:
            try:
                path.check_reach(self.flexible_arm.parameters)
            except ValueError as error:
                what = f"waypoints = {self.waypoints!r}" if name == "waypoints" else f"side = {self.side} m"
                raise ValueError(f"{what}: {error}") from None
        return [path for _, path in found]

    @property
    def disturbed(self) -> bool:
        """Whether noise, jitter, dropouts, a sensor with its own clock, or actuation delays can occur."""
        noise = (self.noise, *self.encoder_noise, self.second_sensor_noise)
        own = any((*noise, self.jitter, self.dropout, self.hold, self.actuation_delay))
        return own or not self.randomisation.keys().isdisjoint(("noise", "actuation_delay"))

    @property
    def motor_limit(self) -> tuple[float, float]:
        """Largest torques of shoulder and elbow [N m]; inf where there is no limit."""
        return self.torque_limit or self.mode.torque_limit or (np.inf, np.inf)

    @property
    def action_limit(self) -> tuple[float, ...]:
        """Physical value of the action 1 in each channel."""
        if self.mode.limit == "torque_limit":
            return self.motor_limit
        limit = getattr(self, self.mode.limit)
        return limit if isinstance(limit, tuple) else (limit,)

    @cached_property
    def substeps(self) -> int:
        """Integration steps in a control period."""
        fastest = max(fastest_rates(self))
        longest = STABLE_ANGLE[self.mode.integrator] / fastest
        under_law = self.mode.law == "joints"
        what = "fastest pole under the inner law" if under_law else "fastest mode"
        if self.physics_step is None:
            explicit = self.mode.integrator == "explicit"
            wanted = min(PHYSICS_STEP, longest) if explicit else default_step(fastest)
            law = ", with inner_stiffness and inner_resistance" if under_law else ""
            cause = f"arm = {shown(self.arm)}{law}: its {what}, {fastest:.4g} rad/s, asks for steps of {wanted:.4g} s"
        elif self.physics_step <= longest:
            wanted, cause = self.physics_step, f"physics_step = {self.physics_step} s"
        else:
            raise ValueError(
                f"physics_step = {self.physics_step} s: too long for the arm's {what}, {fastest:.4g} rad/s; "
                f"at most {longest:.4g} s is allowed"
            )
        return count_steps(self.control_period, wanted, cause)

    @cached_property
    def sensor_delays(self) -> tuple[float, float]:
        """Delay of the shoulder's and of the elbow's reading if it is neither drawn nor requested [s]."""
        return self.sensor_parameters.joint_delays(self.flexible_arm.parameters.link_lengths[0])

    @property
    def kept_actions(self) -> int:
        """Number of actions that the kernels keep: those observed, and those that have yet to act."""
        periods = int(np.ceil(self.range_of("actuation_delay")[1] / self.control_period))
        return max(2, self.last_actions, periods + 1)

    @cached_property
    def history_slots(self) -> int:
        """Number of slots of the delay line, for the oldest reading and the period before the first one.

        It spans whole control periods, so that readings at the same moments of a period use the same few slots, which
        stay in the processor's cache.
        """
        latest = max(*self.sensor_delays, self.range_of("delay")[1])
        oldest = max(latest + self.jitter + 4.0 * self.hold, self.second_sensor_delay)
        longest = oldest + 2.0 * self.control_period
        periods = int(np.ceil(longest / self.control_period + 4.0 / self.substeps))
        cause = f"delay = {latest} s, jitter = {self.jitter} s, hold = {self.hold} s"
        if self.second_sensor is not None:
            cause += f", second_sensor_delay = {self.second_sensor_delay} s"
        return count_readings(self.substeps * periods, self.control_period / self.substeps, cause)


def default_of(one: Field[Any]) -> Any:
    """Return the default value of a dataclass's field."""
    return one.default_factory() if one.default_factory is not MISSING else one.default
