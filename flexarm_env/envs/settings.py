"""`Settings`: the options of an environment, checked together, and what follows from them."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import MISSING, Field, dataclass, fields, replace
from typing import Any

import gymnasium
import numpy as np

from flexarm_env.actions import IDEAL_MOTORS, MODES, TORQUE_LIMIT, ActionMode, modes_reading
from flexarm_env.allowed import allowed_of, check_fields
from flexarm_env.codegen.declarations import Program
from flexarm_env.envs.choices import REACH
from flexarm_env.envs.consistency import lap_time_of, refuse_options_without_effect
from flexarm_env.envs.corners import as_given, ends, worst
from flexarm_env.envs.distributions import ends_of
from flexarm_env.envs.options import OF_PATHS, Options
from flexarm_env.envs.own_paths import OF_EACH, rows_of, settled
from flexarm_env.envs.quantities import QUANTITIES
from flexarm_env.envs.sensors import Mounted, mounted, refuse_off_link
from flexarm_env.episode.step import PROGRAMS
from flexarm_env.lazy import cached_property
from flexarm_env.parameters import DIRECTIONS, LawParameters, SensorParameters, SquareParameters, arm_parameters
from flexarm_env.physics.paths import PATHS, ReferencePath, by_distance, rounded, way_points
from flexarm_env.simulation.arm import FlexibleArm
from flexarm_env.simulation.stability import (
    Integration,
    count_readings,
    count_substeps,
    extreme_arms,
    fastest_rates,
)
from flexarm_env.simulation.step_error import TOLERANCE, enough_steps, expected_error
from flexarm_env.validation import known_names, shown

OF_EPISODES = ("real_motors", "dry_joints", "pulsed", "drifting")  # what holds for all of an environment's episodes
# Options of the last release, and their names now.
OLD_NAMES = {"inner_resistance": "inner_damping", "law_sensor": "feedback_source", "hold": "sensor_period"}
_OF_IDS = ("feedback_source",)  # an id has set it where a user gives the old name to `make`, which then counts


def present_names(options: Mapping[str, Any], of_file: bool = False) -> dict[str, Any]:
    """Return options by their present names; warn of old ones, unless a file has them, and refuse both together."""
    for old in [name for name in OLD_NAMES if name in options]:
        if (new := OLD_NAMES[old]) in options and new not in _OF_IDS:
            raise ValueError(f"{old} = {shown(options[old])} beside {new}: give {new} alone; {old} is its old name")
        if not of_file:
            message = f"{old} is now {new}; the old name goes with the next release"
            warnings.warn(message, DeprecationWarning, stacklevel=4)
    return {OLD_NAMES.get(name, name): value for name, value in options.items()}


@dataclass(frozen=True, kw_only=True)
class Settings(Options):
    """The options of an environment with what follows from them; `Settings.of` makes it from keyword arguments."""

    @classmethod
    def of(cls, options: Mapping[str, Any], owner: str = "Settings") -> Settings:
        """Make settings from keyword arguments; `owner`: the class that received them, for messages."""
        options = present_names(options)
        known_names(owner, options, [one.name for one in fields(cls)])
        return cls(**options)

    def __post_init__(self) -> None:
        """Validate all options; lists (as in JSON) become tuples."""
        check_fields(self)
        for name, value in zip(("reference", "waypoints"), settled(self), strict=True):
            object.__setattr__(self, name, value)
        arm = arm_parameters(self.arm)
        spread = (0.05, 0.05 * (arm.reach / REACH))  # which copies of settings are given by number
        declared = {one.name: (default_of(one), modes_reading(one.name)) for one in fields(self)}
        if self.start_spread in (None, spread):
            declared["start_spread"] = self.start_spread, declared["start_spread"][1]
        refuse_options_without_effect(self, declared)
        if (lap := lap_time_of(self.waypoints)) is not None:
            object.__setattr__(self, "lap_time", allowed_of(type(self), "lap_time").check("waypoints[-1][0]", lap))
        if self.sensor_position is None:
            object.__setattr__(self, "sensor_position", arm.link_lengths[1])
        if self.start_spread is None:
            object.__setattr__(self, "start_spread", spread)
        if self.reward is None and max(self.reward_weights.values()) <= 0.0:
            gymnasium.logger.warn(
                f"reward_weights = {shown(self.reward_weights)}: no reward is above 0: ending an episode early pays"
            )
        for what in ("law", "sensor_parameters", "flexible_arm", *OF_EPISODES):
            getattr(self, what)  # each derived value has its own checks
        self._refuse_what_does_not_fit()
        for one, word in zip(ends(self), ("least", "largest"), strict=False):
            try:
                Settings(**as_given(one))
            except ValueError as error:
                raise ValueError(f"randomisation: with the {word} of what is drawn, {error}") from None
        for what in ("integration", "history_slots"):
            getattr(self, what)

    def _refuse_what_does_not_fit(self) -> None:
        """Refuse sensors and paths beyond the arm, all at once."""
        found = []
        checks = (self._check_sensor, lambda: self.further_sensors, self._check_paths, lambda: self.path_rows)
        for check in checks:
            try:
                check()
            except ValueError as error:
                found.append(str(error))
        if found:
            raise ValueError("; ".join(dict.fromkeys(found)))

    def _check_sensor(self) -> None:
        refuse_off_link("sensor_position", self.sensor_position, 2, self.flexible_arm.parameters)

    def having(self, values: Mapping[str, Any]) -> Settings:
        """Return the settings of an episode that has drawn these options and parameters of the arm, unchecked.

        Nothing else of the kind is drawn, and the integration step stays.

        Args:
            values: one number or two, by names in `options.DRAWABLE` other than `quantities.QUANTITIES`.
        """
        arm: dict[str, Any] = {}
        known = {one.name: getattr(self, one.name) for one in fields(self)}
        for name, numbers in values.items():
            own = tuple(map(float, np.ravel(numbers)))
            (known if name in known else arm)[name] = own if len(own) > 1 else own[0]
        kept = ["integration", *OF_EPISODES, *([] if arm else ["flexible_arm"])]
        kept += ["paths"] if values.keys().isdisjoint(OF_PATHS) else []
        known |= {name: self.__dict__[name] for name in kept if name in self.__dict__}
        known["randomisation"] = {name: one for name, one in self.randomisation.items() if name in QUANTITIES}
        if arm:
            known["arm"] = replace(self.flexible_arm.parameters, **arm)
        found = object.__new__(Settings)
        found.__dict__.update(known)
        return found

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
        low, high = ends_of(self.randomisation.get(name, (own, own)))
        changes = self.payload_changes or () if name == "payload_mass" else ()
        also = [mass for _, mass in changes if mass is not None]
        return min(low, *also, low), max(high, *also, high)

    @property
    def laps(self) -> tuple[float, float]:
        """The shortest and the longest lap of any episode [s]."""
        return ends_of(self.randomisation.get("lap_time", (self.lap_time, self.lap_time)))

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
        return FlexibleArm(arm_parameters(self.arm))

    @cached_property
    def further_sensors(self) -> tuple[Mounted, ...]:
        """The sensors beside the one on link 2."""
        return mounted(self)

    @cached_property
    def paths(self) -> list[ReferencePath]:
        """Paths of `reference`, in one of `DIRECTIONS` and then in the other; empty if each episode has its own."""
        if self.reference[0] in OF_EACH:
            return []
        return [self.path(n) for n in range(len(DIRECTIONS) * len(self.reference))]

    def path(self, index: int) -> ReferencePath:
        """Make one of `paths`."""
        turn, n = divmod(index, len(self.reference))
        name, task = self.reference[n], SquareParameters(self.side, self.lap_time, self.start_corner, DIRECTIONS[turn])
        path = PATHS[name](task) if name in PATHS else way_points(task, self._way_points(name))
        found = rounded(path, self.corner_time)
        return by_distance(found) if self.mode.races else found

    def _way_points(self, name: str) -> Any:
        return self.waypoints[name] if isinstance(self.waypoints, Mapping) else self.waypoints

    def _check_paths(self) -> None:
        for name, path in zip(self.reference * len(DIRECTIONS), self.paths, strict=False):
            try:
                path.check_reach(self.flexible_arm.parameters)
            except ValueError as error:
                what = f"side = {self.side} m" if name in PATHS else f"waypoints = {shown(self._way_points(name))}"
                raise ValueError(f"{what}: {error}") from None

    @property
    def has_own_path(self) -> bool:
        """Whether each environment of a batch has memory for a path, which an episode may change."""
        return not (self.paths and self.randomisation.keys().isdisjoint(OF_PATHS))

    @cached_property
    def path_rows(self) -> int:
        """How many rows the table of an environment's own path has that Python writes; 0: there is none."""
        return rows_of(self) if self.has_own_path and self.reference != ("moves",) else 0

    @property
    def has_own_terms(self) -> bool:
        """Whether a function of the user's rewards or ends episodes."""
        return self.reward is not None or self.termination is not None

    @property
    def disturbed(self) -> bool:
        """Whether noise, jitter, lost readings, counted angles, a sensor's own clock or late torques can occur."""
        noise = (self.noise, *self.encoder_noise, *(x for one in self.further_sensors for x in one.noise + one.bias))
        own = any(
            (
                *(*noise, *self.encoder_resolution, self.jitter, self.dropout, self.outage_duration),
                *(self.sensor_period, self.actuation_delay),
            )
        )
        return (
            own
            or any(one.disturbed for one in ends(self))
            or not self.randomisation.keys().isdisjoint(("noise", "actuation_delay"))
        )

    @property
    def motor_limit(self) -> tuple[float, float]:
        """Largest torques of shoulder and elbow [N m]; inf where there is no limit."""
        return self.torque_limit or self.mode.torque_limit or (np.inf, np.inf)

    @cached_property
    def real_motors(self) -> bool:
        """Whether torques pass through motors that are not ideal in any episode."""
        given = ((getattr(one, name), value) for one in (self, *ends(self)) for name, value in IDEAL_MOTORS.items())
        return any(own != value for own, value in given)

    @cached_property
    def dry_joints(self) -> bool:
        """Whether joints have dry friction in any episode."""
        return any(any(arm_parameters(one.arm).breakaway) for one in (self, *ends(self)))

    @cached_property
    def pulsed(self) -> bool:
        """Whether forces act at the tip in any episode."""
        return any(any(one.pulse_force) for one in (self, *ends(self)))

    @cached_property
    def drifting(self) -> bool:
        """Whether strain gauges drift in any episode."""
        return any(any(one.gauge_drift) for one in (self, *ends(self)))

    @property
    def action_limit(self) -> tuple[float, ...]:
        """Physical value of the action 1 in each channel."""
        if self.mode.limit == "torque_limit":
            return (*self.motor_limit, *[self.reference_speed] * self.mode.races)
        limit = getattr(self, self.mode.limit)
        return limit if isinstance(limit, tuple) else (limit,)

    @property
    def substeps(self) -> int:
        """Integration steps in a control period."""
        return self.integration.substeps

    @cached_property
    def integration(self) -> Integration:
        """How the arm is integrated; warns of a step that is coarser than the default."""
        corner = worst(self, lambda one: max(fastest_rates(one)))
        slow = worst(self, lambda one: -max(fastest_rates(one)))
        under_law = self.mode.law == "joints"
        what = "fastest pole under the inner law" if under_law else "fastest mode"
        name = f"arm = {shown(self.arm)}" + (", with inner_stiffness and inner_damping" if under_law else "")
        period, known = self.control_period, (self.mode.integrator, max(fastest_rates(corner)), name, what)
        count = count_substeps(period, self.physics_step, *known)
        if self.mode.integrator == "implicit":
            return Integration("ARS(4,4,3)", 3, period / count, count, None)
        limits = corner.motor_limit if np.isfinite(max(corner.motor_limit)) else TORQUE_LIMIT
        steep = worst(self, lambda one: arm_parameters(one.arm).steepest_friction)
        arms = {one.flexible_arm.parameters for one in (self, slow)} | {*extreme_arms(corner), *extreme_arms(steep)}
        if self.physics_step is None:
            count = max(enough_steps(arm, limits, period, count) for arm in arms)
        error = max(expected_error(arm, limits, period / count) for arm in arms)
        if self.physics_step is not None and error > TOLERANCE:
            gymnasium.logger.warn(
                f"physics_step = {self.physics_step} s: after a second of full random torques the tip is off by about "
                f"{1e3 * error:.2g} mm; the default keeps {1e3 * TOLERANCE:g} mm"
            )
        return Integration("RK4 of positions and momenta", 4, period / count, count, error)

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
        if ends(self):
            return worst(self, lambda one: one.history_slots).history_slots
        latest = max(*self.sensor_delays, self.range_of("delay")[1])
        oldest = max(latest + self.jitter + 4.0 * self.sensor_period, *(one.delay for one in self.further_sensors), 0.0)
        longest = oldest + 2.0 * self.control_period
        periods = int(np.ceil(longest / self.control_period + 4.0 / self.substeps))
        cause = f"delay = {latest} s, jitter = {self.jitter} s, sensor_period = {self.sensor_period} s"
        cause += "".join(f", {one.sensor.name}_delay = {one.delay} s" for one in self.further_sensors)
        return count_readings(self.substeps * periods, self.control_period / self.substeps, cause)


def default_of(one: Field[Any]) -> Any:
    """Return the default value of a dataclass's field."""
    return one.default_factory() if one.default_factory is not MISSING else one.default
