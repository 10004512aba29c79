"""`Settings`: every option of the environments, with defaults, validation, and what follows from them.

The defaults are those of `FlexArm/Square-v0`; the other ids change some (`registration`). The text beside each option
is its documentation: the environments' pages are made from it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import MISSING, Field, dataclass, field, fields, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from flexarm_env.envs.choices import (
    DEFAULT_OBSERVATION,
    DEFAULT_WEIGHTS,
    LARGEST_NOISE,
    MODES,
    PHYSICS_STEP,
    STARTS,
    TORQUE_LIMIT,
    Frame,
    Mode,
    Start,
)
from flexarm_env.envs.consistency import (
    checked_ranges,
    checked_reference,
    checked_weights,
    refuse_options_without_effect,
)
from flexarm_env.parameters import (
    MAX_DELAY,
    WAVE_SPEED,
    Compensation,
    Corner,
    Delayed,
    Direction,
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
from flexarm_env.simulation.stability import ELBOWS, STABLE_ANGLE, default_step, fastest_pole
from flexarm_env.validation import choice, flag, integer, known_names, listed, names, number, pair


def _option(default: Any, text: str, unit: str = "", modes: Sequence[str] = tuple(MODES)) -> Any:
    kind = {"default_factory": lambda: default} if isinstance(default, dict) else {"default": default}
    return field(metadata={"text": text, "unit": unit, "modes": tuple(modes)}, **kind)


_LAW = ("gain",)
_INNER = ("residual", "reference")


@dataclass(frozen=True, kw_only=True)
class Settings:
    """All options; `Settings.of` makes one from keyword arguments."""

    arm: str | Mapping[str, Any] = _option(
        "default",
        '"default" (2 modes a link, complete dynamics, 1 % modal damping), "paper", or a mapping of `ArmParameters` '
        'fields, with `preset` ("default" or "paper") for those it does not set; {"kinematics": "foreshortened"} is '
        "the arm whose bent links keep their length",
    )
    action_mode: Mode = _option("torque", "what an action is; see Action space")
    control_period: float = _option(0.01, "an action is held so long", "s")
    physics_step: float | None = _option(
        None, "longest integration step; None: 1 ms, for the gain 0.25 ms, or less if the fastest mode demands it", "s"
    )
    torque_limit: tuple[float, float] | None = _option(
        None, "of shoulder and elbow; None: 150 and 50, for the gain no limit (limited, the law loses the path)", "N m"
    )
    gain_limit: float = _option(1.0, "lambda at action 1", "1", _LAW)
    shift_limit: tuple[float, float] = _option(
        (0.3, 0.3), "shift of the joints' reference at action 1", "rad", ("reference",)
    )
    inner_stiffness: tuple[float, float] = _option((1000.0, 130.0), "of the inner tracking law", "N m/rad", _INNER)
    inner_resistance: tuple[float, float] = _option((40.0, 30.0), "of the inner tracking law", "N m s/rad", _INNER)
    proportional_gain: float = _option(150.79, "Kp of the paper's law (11)", "N/m", _LAW)
    derivative_gain: float = _option(17.364, "Kd of the paper's law (12)", "N s/m", _LAW)
    compensation: Compensation = _option("none", "delay of the law's command; see `LawParameters`", "", _LAW)
    law_sensor: Literal["joints", "sensor"] = _option(
        "joints", 'what the paper\'s law acts on: "joints" (collocated, not late) or the late "sensor"', "", _LAW
    )
    rate_jacobian: RateJacobian = _option("delayed", "see `SensorParameters`", "", _LAW)
    delayed: Delayed = _option("position", "see `SensorParameters`", "", _LAW)
    sensor: SensorModel = _option(
        "true",
        'what the sensor on link 2 sees: the "true" point, the "rigid" one or the "collocated"; see `SensorParameters`',
    )
    sensor_position: float = _option(4.5, "of the sensor from the elbow", "m")
    delay: float | tuple[float, float] | None = _option(None, "of the sensor's reading; None: by the wave speed", "s")
    wave_speed: float = _option(WAVE_SPEED, "c (15)", "m/s")
    noise: float = _option(0.0, "standard deviation of each coordinate of the sensor's reading", "m")
    jitter: float = _option(0.0, "largest additional delay, drawn evenly for each reading", "s")
    hold: float = _option(0.0, "period of a slower sensor's clock (sample and hold); 0: none", "s")
    dropout: float = _option(0.0, "probability that a reading is lost", "1")
    encoder_noise: tuple[float, float] = _option(
        (0.0, 0.0), "standard deviations of joint angles and rates", "rad, rad/s"
    )
    actuation_delay: float = _option(0.0, "from an action to its effect; an inner law is not delayed", "s")
    observation: tuple[str, ...] = _option(DEFAULT_OBSERVATION, "names of the blocks, in order; see Observation space")
    frame: Frame = _option("link", 'frame of Cartesian blocks: "link" (turned by -theta1) or "world"')
    previews: tuple[float, ...] = _option(
        (0.05, 0.1, 0.2, 0.3, 0.45, 0.6, 1.0), "horizons of the block `previews`", "s"
    )
    last_actions: int = _option(1, "how many the block `last_actions` holds")
    scaled: bool = _option(True, "divide each block by its scale")
    reference: str | Sequence[str] = _option(
        "square",
        '"square", "circle", "line", "figure_eight", "waypoints", "moves" (drawn from rest to rest), or several of the '
        "first five, one of which is drawn for each episode",
    )
    waypoints: Sequence[tuple[float, float]] | None = _option(None, 'corners of the reference "waypoints"', "m")
    side: float = _option(12.6, "of the square, or the square around the other paths", "m")
    lap_time: float = _option(16.0, "of a lap", "s")
    start_corner: Corner = _option("lower left", "where a lap starts")
    direction: Direction = _option("clockwise", "of a lap")
    elbow_branch: ElbowBranch = _option("positive", "sign of theta2 at the start and in the inverse kinematics")
    start: Start = _option(
        "mix",
        "how an episode starts; see Starting state",
    )
    start_spread: tuple[float, float] = _option(
        (0.05, 0.05), "largest deviations of a moving start: joint angles, tip deflections of the first modes", "rad, m"
    )
    randomisation: Mapping[str, tuple[float, float]] = _option(
        {},
        "ranges from which quantities are drawn for each episode: `delay` [s] (both joints), `payload_mass` [kg], "
        "`stiffness` (factor), `damping` (modal damping ratio), `noise` [m], `actuation_delay` [s]",
    )
    reward_weights: Mapping[str, float] = _option(DEFAULT_WEIGHTS, "of the reward's terms; what is not named is 0")
    deflection_limit: float | None = _option(
        1.5, "a link's tip deflection that ends an episode; None: any is allowed", "m"
    )
    error_limit: float | None = _option(
        2.5, "distance of the true tip from the reference that ends an episode; None: any is allowed", "m"
    )

    @classmethod
    def of(cls, options: Mapping[str, Any]) -> Settings:
        """Settings from keyword arguments.

        Raises:
            TypeError: for an unknown name, with the nearest known one.
            ValueError: for a bad value.
        """
        known_names("option", options, [one.name for one in fields(cls)])
        return cls(**options)

    def __post_init__(self) -> None:
        """Validate; lists (as JSON has them) become tuples."""
        for name, value in self._checked().items():
            object.__setattr__(self, name, value)
        refuse_options_without_effect(
            self, {one.name: (default_of(one), one.metadata["modes"]) for one in fields(self)}
        )
        for what in ("law", "sensor_parameters", "flexible_arm", "paths", "substeps"):
            getattr(self, what)  # made once, with its own checks

    def _checked(self) -> dict[str, Any]:
        optional: dict[str, Any] = {}
        if self.physics_step is not None:
            optional["physics_step"] = number("physics_step", self.physics_step, "s", above=0.0)
        if self.torque_limit is not None:
            optional["torque_limit"] = pair("torque_limit", self.torque_limit, "N m", above=0.0)
        if isinstance(self.delay, list | np.ndarray):
            optional["delay"] = tuple(self.delay)
        for name in ("deflection_limit", "error_limit"):
            if getattr(self, name) is not None:
                optional[name] = number(name, getattr(self, name), "m", above=0.0)
        return optional | {
            "action_mode": choice("action_mode", self.action_mode, MODES),
            "control_period": number("control_period", self.control_period, "s", least=1e-5, most=1.0),
            "side": number("side", self.side, "m", least=1e-3, most=1e3),
            "lap_time": number("lap_time", self.lap_time, "s", least=1e-3, most=1e5),
            "noise": number("noise", self.noise, "m", least=0.0, most=LARGEST_NOISE),
            "gain_limit": number("gain_limit", self.gain_limit, above=0.0),
            "shift_limit": pair("shift_limit", self.shift_limit, "rad", above=0.0, most=np.pi),
            "inner_stiffness": pair("inner_stiffness", self.inner_stiffness, "N m/rad", least=0.0),
            "inner_resistance": pair("inner_resistance", self.inner_resistance, "N m s/rad", least=0.0),
            "law_sensor": choice("law_sensor", self.law_sensor, ("joints", "sensor")),
            "jitter": number("jitter", self.jitter, "s", least=0.0, most=MAX_DELAY),
            "hold": number("hold", self.hold, "s", least=1e-6 if self.hold else 0.0, most=MAX_DELAY),  # a divisor
            "dropout": number("dropout", self.dropout, least=0.0, most=1.0),
            "encoder_noise": pair("encoder_noise", self.encoder_noise, "rad, rad/s", least=0.0, most=LARGEST_NOISE),
            "actuation_delay": number("actuation_delay", self.actuation_delay, "s", least=0.0, most=MAX_DELAY),
            "observation": names("observation", self.observation),
            "frame": choice("frame", self.frame, ("link", "world")),
            "previews": tuple(
                number(f"previews[{n}]", x, "s", above=0.0) for n, x in enumerate(listed("previews", self.previews))
            ),
            "last_actions": integer("last_actions", self.last_actions, 1, 100),
            "scaled": flag("scaled", self.scaled),
            "reference": checked_reference(self.reference, self.waypoints),
            "start": choice("start", self.start, STARTS),
            "start_spread": pair("start_spread", self.start_spread, "rad, m", least=0.0, most=0.5),
            "randomisation": checked_ranges(self.randomisation),
            "reward_weights": checked_weights(self.reward_weights),
        }

    # --- what follows ----------------------------------------------------------------------------------------------

    @cached_property
    def law(self) -> LawParameters:
        """The paper's law."""
        return LawParameters(self.proportional_gain, self.derivative_gain, self.compensation, self.torque_limit)

    @cached_property
    def sensor_parameters(self) -> SensorParameters:
        """The sensor on link 2."""
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
        length2 = arm.parameters.link_lengths[1]
        if self.sensor_position > length2:
            raise ValueError(f"sensor_position = {self.sensor_position} m: must be on link 2, > 0 and <= {length2} m")
        return arm

    @cached_property
    def task(self) -> SquareParameters:
        """Measures of the paths."""
        return SquareParameters(self.side, self.lap_time, self.start_corner, self.direction, self.elbow_branch)

    @cached_property
    def paths(self) -> list[ReferencePath]:
        """The paths that an episode may be given; none where each episode draws its own."""
        if self.reference == ("moves",):
            return []
        found = [
            way_points(self.task, self.waypoints or ()) if name == "waypoints" else PATHS[name](self.task)
            for name in self.reference
        ]
        for name, path in zip(self.reference, found, strict=True):
            try:
                path.check_reach(self.flexible_arm.parameters)
            except ValueError as error:
                what = f"waypoints = {self.waypoints!r}" if name == "waypoints" else f"side = {self.side} m"
                raise ValueError(f"{what}: {error}") from None
        return found

    @property
    def disturbed(self) -> bool:
        """Whether noise, jitter, dropouts, a sensor with a clock of its own, or late motors can occur.

        No reset may ask for any of these where this is false.
        """
        own = (self.noise, *self.encoder_noise, self.jitter, self.dropout, self.hold, self.actuation_delay)
        return any(own) or not self.randomisation.keys().isdisjoint(("noise", "actuation_delay"))

    @property
    def motor_limit(self) -> tuple[float, float]:
        """Largest torques of shoulder and elbow [N m]; inf where there is no limit."""
        if self.action_mode == "gain":
            return self.torque_limit or (np.inf, np.inf)
        return self.torque_limit or TORQUE_LIMIT

    @property
    def action_limit(self) -> tuple[float, ...]:
        """Physical value of the action 1 in each channel."""
        if self.action_mode == "gain":
            return (self.gain_limit,)
        return self.shift_limit if self.action_mode == "reference" else self.motor_limit

    @cached_property
    def substeps(self) -> int:
        """Integration steps in a control period."""
        fastest = max(self._fastest_rates())
        longest = STABLE_ANGLE[self.action_mode] / fastest
        if self.physics_step is None:
            wanted = default_step(fastest) if self.action_mode == "gain" else min(PHYSICS_STEP, longest)
        elif self.physics_step <= longest:
            wanted = self.physics_step
        else:
            what = (
                "fastest pole under the inner law" if self.action_mode in ("residual", "reference") else "fastest mode"
            )
            raise ValueError(
                f"physics_step = {self.physics_step} s: too long for the arm's {what}, {fastest:.4g} rad/s; "
                f"at most {longest:.4g} s is allowed"
            )
        return int(np.ceil(self.control_period / wanted - 1e-9))

    def _fastest_rates(self) -> list[float]:
        """Of the stiffest and lightest arm that an episode may draw; under the inner law, of the closed loop."""
        own = self.flexible_arm.parameters
        stiffness = self.randomisation.get("stiffness", (1.0, 1.0))[1]
        payload = self.randomisation.get("payload_mass", (own.payload_mass, own.payload_mass))[0]
        damping = self.randomisation.get("damping", (0.0, own.modal_damping_ratio))[1]
        rigidities = (own.flexural_rigidities[0] * stiffness, own.flexural_rigidities[1] * stiffness)
        arm = FlexibleArm(
            replace(own, flexural_rigidities=rigidities, payload_mass=payload, modal_damping_ratio=damping)
        )
        rates = [arm.fastest_rate()]
        if self.action_mode in ("residual", "reference"):
            rates += [fastest_pole(arm, theta2, self.inner_stiffness, self.inner_resistance) for theta2 in ELBOWS]
        return rates


def default_of(one: Field[Any]) -> Any:
    """Default value of a dataclass's field."""
    return one.default_factory() if one.default_factory is not MISSING else one.default
