"""Checks of an environment's options: each value, and which options go together.

An option without effect is an error; it is never ignored.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import Any

import numpy as np

from flexarm_env.envs.choices import MOVE_POINTS
from flexarm_env.envs.distributions import ends_of
from flexarm_env.envs.sensors import FURTHER, Sensor
from flexarm_env.episode import reward
from flexarm_env.parameters import HEAVIEST_PAYLOAD, SENSOR_MODELS, arm_parameters
from flexarm_env.physics.paths import FARTHEST, PATHS
from flexarm_env.validation import entries, finite_array, listed, mapping, number, real_array, shown


def _is_mounted(sensor: Sensor) -> Callable[[Any], bool]:
    return lambda settings: getattr(settings, f"{sensor.name}_link") is not None


def _is_observed(sensor: Sensor) -> Callable[[Any], bool]:
    return lambda settings: not set(settings.observation).isdisjoint(sensor.blocks)


# Options that switch others on: where one is 0 and not drawn, those that follow it have no effect.
SWITCHES = {"pulse_force": ("pulse_time", "pulse_duration", "pulse_period"), "outage_duration": ("outage_time",)}


def _is_on(switch: str) -> Callable[[Any], bool]:
    return lambda settings: bool(np.any(getattr(settings, switch))) or switch in settings.randomisation


def on_a_named_path(settings: Any) -> bool:
    """Return whether an episode may follow one of `PATHS`."""
    return not set(settings.reference).isdisjoint(PATHS)


def _late(settings: Any) -> bool:
    return SENSOR_MODELS[settings.sensor].late


NAMED = f"with a reference among {', '.join(map(repr, PATHS))}"
# Options with the condition under which they have an effect, and that condition in words.
EFFECT: dict[str, tuple[Callable[[Any], bool], str]] = {
    # a race's horizons are distances: its id has other ones than the default, also where no block shows them
    "previews": (lambda s: "previews" in s.observation or s.mode.races, "with the observation block 'previews'"),
    "last_actions": (lambda s: "last_actions" in s.observation, "with the observation block 'last_actions'"),
    "wave_speed": (lambda s: s.delay is None and _late(s), "where it sets the sensor's delay"),
    **{name: (_is_on(switch), f"with {switch} other than 0") for switch, of in SWITCHES.items() for name in of},
    "gauge_drift": (
        lambda s: not {"modal_coordinates", "modal_rates"}.isdisjoint(s.observation),
        "with an observation block of the strain gauges, 'modal_coordinates' or 'modal_rates'",
    ),
    **dict.fromkeys(("jitter", "sensor_period"), (_late, "with a sensor that is late, not with a collocated one")),
    **{
        f"{sensor.name}_link": (
            _is_observed(sensor),
            f"with an observation block of it, {' or '.join(map(repr, sensor.blocks))}",
        )
        for sensor in FURTHER
    },
    **{
        name: (_is_mounted(sensor), f"with {sensor.words}: {sensor.name}_link = 1 or 2")
        for sensor in FURTHER
        for name in sensor.option_names
    },
    "start_spread": (lambda s: s.start in ("moving", "mix"), "with start = 'moving' or 'mix'"),
    "lap_time": (
        lambda s: lap_time_of(s.waypoints) == s.lap_time or (lap_time_of(s.waypoints) is None and not s.mode.races),
        "without way-points that have times, whose last one is the lap time, and not in a race, which has no clock",
    ),
    "corner_time": (
        lambda s: s.reference not in (("moves",), ("drawn",), ("target",)),
        "with a named path or way-points, not with 'moves', 'drawn' or 'target'",
    ),
    **dict.fromkeys(("side", "start_corner", "direction"), (on_a_named_path, NAMED)),
    **dict.fromkeys(
        ("compensation", "delayed"), (lambda s: s.feedback_source == "sensor", "with feedback_source = 'sensor'")
    ),
    "rate_jacobian": (
        lambda s: s.feedback_source == "sensor" and SENSOR_MODELS[s.sensor].reading == "angles",
        "with feedback_source = 'sensor' and a sensor that reads joint angles, not a 'true' one",
    ),
}


def refuse_options_without_effect(settings: Any, declared: Mapping[str, tuple[Any, tuple[str, ...]]]) -> None:
    """Refuse options that have no effect and differ from their default.

    `declared` has the default of each option, and the action modes that read it.
    """
    for name, (default, modes) in declared.items():
        value = getattr(settings, name)
        if value == default:
            continue
        if settings.action_mode not in modes:
            raise ValueError(
                f"{name} = {shown(value)}: has no effect with action_mode = {settings.action_mode!r}; "
                f"only with {' or '.join(map(repr, modes))}"
            )
        has_effect, where = EFFECT.get(name, (lambda s: True, ""))
        if not has_effect(settings):
            raise ValueError(f"{name} = {shown(value)}: has no effect here; only {where}")
    _refuse_contradictions(settings)
    if settings.mode.races:
        _refuse_no_race(settings)
    elif any(settings.reward_weights.get(name, 0.0) for name in reward.OF_RACES):
        raise ValueError(f"reward_weights: {', '.join(reward.OF_RACES)}: only with action_mode = 'race'")


def _refuse_contradictions(settings: Any) -> None:
    units = _ends(settings, "torque_resolution")[1]
    limits = _ends(settings, "torque_limit", settings.motor_limit)[0]
    if any(unit > most for unit, most in zip(units, limits, strict=True)):
        raise ValueError(f"torque_resolution = {units} N m: must be at most torque_limit = {limits} N m")
    if settings.feedback_source == "sensor":
        for name in ("jitter", "sensor_period", "dropout", "outage_duration"):
            if getattr(settings, name) != 0.0:
                raise ValueError(
                    f"{name} = {getattr(settings, name)}: the law acts on the sensor in continuous time; "
                    "must be 0 with feedback_source = 'sensor'"
                )
    (hold,), (jitter,) = _ends(settings, "sensor_period")[0], _ends(settings, "jitter")[1]
    if hold and (jitter + settings.control_period) / hold > MOST_TICKS:
        raise ValueError(
            f"sensor_period = {hold} s: more than {MOST_TICKS} of the sensor's ticks in jitter = {jitter} s "
            f"and control_period = {settings.control_period} s; must be longer"
        )
    ((shortest,), (longest,)), (_, (duration,)) = (_ends(settings, f"pulse_{one}") for one in ("period", "duration"))
    if longest > 0.0 and shortest < duration:
        raise ValueError(f"pulse_period = {shortest} s: must be 0, or at least pulse_duration = {duration} s")
    if settings.compensation != "none" and not _late(settings):
        raise ValueError(
            f"compensation = {settings.compensation!r}: a {settings.sensor} sensor has no delay to compensate; it must "
            "be 'none'"
        )
    if not _late(settings) and "delay" in settings.randomisation:
        raise ValueError(f"randomisation['delay']: a {settings.sensor} sensor has no delay")
    for sensor in FURTHER:
        for name in sensor.blocks:
            if name in settings.observation and not _is_mounted(sensor)(settings):
                raise ValueError(
                    f"observation block {name!r}: there is no {sensor.title}; give {sensor.name}_link (1 or 2) too"
                )
    if settings.payload_changes is not None:
        _refuse_same_payloads(settings)
    if "previews" in settings.observation and not settings.previews:
        raise ValueError("previews = (): must hold a horizon, or `observation` not name the block 'previews'")
    if settings.reference == ("moves",) and settings.lap_time < FEWEST_PERIODS * settings.control_period:
        raise ValueError(
            f"lap_time = {settings.lap_time} s: must be at least {FEWEST_PERIODS} control periods "
            f"({FEWEST_PERIODS * settings.control_period} s) for moves there and back"
        )
    if "lap_time" in settings.randomisation:
        _refuse_laps(settings)
    if settings.mode.shifts:
        periods = settings.actuation_delay / settings.control_period
        if abs(periods - round(periods)) > 1e-6 or "actuation_delay" in settings.randomisation:
            raise ValueError(
                f"actuation_delay = {settings.actuation_delay} s: must be a whole number of control periods "
                f"with action_mode = {settings.action_mode!r}, and not be drawn"
            )


def _refuse_same_payloads(settings: Any) -> None:
    masses = {mass for _, mass in settings.payload_changes} - {None}
    if None in dict(settings.payload_changes).values():
        masses |= set(settings.range_of("payload_mass"))
    if len(masses) < 2:
        raise ValueError(f"payload_changes = {settings.payload_changes}: must have two masses at least [kg]")


def _refuse_no_race(settings: Any) -> None:
    """Refuse what a race cannot have: its reference rests at first, on one of the closed paths, without a clock."""
    refuse_moving_race("start", settings.start)
    if not (settings.paths and "lap_time" not in settings.randomisation):
        raise ValueError(
            f"reference = {shown(settings.reference)}: a race needs paths that are given, and no lap_time in "
            "randomisation"
        )
    step = settings.reference_speed * settings.control_period
    if min(path.lap_time for path in settings.paths) <= step:
        raise ValueError(f"reference_speed = {settings.reference_speed} m/s: a lap must be longer than {step:g} m")


def refuse_moving_race(label: str, start: str) -> None:
    """Refuse a start of a race other than at rest."""
    if start not in ("corner", "corners"):
        raise ValueError(f"{label} = {start!r}: a race begins at rest; must be 'corner' or 'corners'")


def _ends(settings: Any, name: str, given: tuple[float, ...] | None = None) -> tuple[tuple[float, ...], ...]:
    """Return the least and the largest values of an option in any episode, of which each number is drawn by itself.

    `given`: its value where it is not drawn, if that is not the option's own.
    """
    own, drawn = given or getattr(settings, name), settings.randomisation.get(name)
    own = own if isinstance(own, tuple) else (own,)
    if drawn is None:
        return own, own
    return tuple(zip(*map(ends_of, drawn if len(own) > 1 else [drawn]), strict=True))


def _refuse_laps(settings: Any) -> None:
    """Refuse that episodes draw the time of a lap where it is fixed."""
    label, shortest = "randomisation['lap_time']", settings.laps[0]
    if lap_time_of(settings.waypoints) is not None:
        raise ValueError(f"{label}: the way-points have times, or are a function of it; must be left out")
    if settings.reference == ("target",):
        raise ValueError(f"{label}: a target that is moved has no lap; must be left out")
    if settings.reference == ("moves",) and min(shortest, settings.lap_time) < MOVE_POINTS * settings.control_period:
        raise ValueError(
            f"{label}, lap_time: must be at least {MOVE_POINTS} control periods "
            f"({MOVE_POINTS * settings.control_period:g} s) for moves, got {min(shortest, settings.lap_time)} s"
        )


FEWEST_PERIODS = 40  # of a lap of moves: ten for each
SHORTEST_HOLD = 1e-6  # [s]
MOST_TICKS = 20_000  # most ticks of a sensor's clock that are searched for the newest reading
# Learners keep returns and their squares in float32, up to 3.4e38: six such terms over 100 000 steps remain below it.
LARGEST_WEIGHT = 1e12


def checked_arm(name: str, value: Any) -> Any:
    """Check the option `arm` and return it as it was given; see `arm_parameters` for the errors."""
    arm_parameters(value)
    return dict(value) if isinstance(value, Mapping) else value


def checked_changes(name: str, value: Any) -> tuple[tuple[float, float | None], ...]:
    """Check the changes of the payload: shares of the lap that increase, and masses [kg] or None."""
    found: list[tuple[float, float | None]] = []
    for n, given in enumerate(listed(name, value)):
        pair = entries(given) or []
        if len(pair) != 2:
            raise ValueError(f"{name}[{n}] = {shown(given)}: must be a share of the lap and a mass [kg] or None")
        phase, mass = number(f"{name}[{n}][0]", pair[0], least=0.0, most=1.0), pair[1]
        if mass is not None:
            mass = number(f"{name}[{n}][1]", mass, "kg", least=0.0, most=HEAVIEST_PAYLOAD)
        found.append((phase, mass))
    if len(found) < 2 or any(one[0] >= other[0] for one, other in pairwise(found)):
        raise ValueError(f"{name} = {shown(value)}: must be two changes at least, at shares that increase")
    if (found[0][0], found[-1][0]) == (0.0, 1.0):
        raise ValueError(f"{name} = {shown(value)}: must not be at shares 0 and 1, which are one moment of the lap")
    return tuple(found)


def checked_previews(name: str, value: Any) -> tuple[float, ...]:
    """Check the horizons of the previews [s]; of a race [m]."""
    unit = "s; in a race m"
    return tuple(number(f"{name}[{n}]", x, unit, least=1e-6, most=1e5) for n, x in enumerate(listed(name, value)))


def checked_paths(name: str, value: Any) -> tuple[Any, ...]:
    """Check the kinds of the paths; `own_paths.settled` checks names."""
    if isinstance(value, str) or callable(value):
        return (value,)
    if (several := entries(value)) is None:
        raise TypeError(
            f"{name} = {shown(value)}: must be a name or several, of {', '.join(map(repr, (*PATHS, 'waypoints')))}, or "
            "'moves', 'drawn' or 'target'; a path of your own is reference='waypoints' with waypoints=[(x, y), ...] "
            "[m], or a function of time"
        )
    return tuple(
        one if isinstance(one, str) or callable(one) else _checked_table(f"{name}[{n}]", one)
        for n, one in enumerate(several)
    )


def checked_waypoints(name: str, value: Any) -> Any:
    """Check the way-points of the user's path: x, y [m], or time [s], x, y [m]; or a function; or several by name."""
    if callable(value):
        return value
    if isinstance(value, Mapping):
        return {
            key: one if callable(one) else _checked_table(f"{name}[{shown(key)}]", one)
            for key, one in mapping(name, value).items()
        }
    return _checked_table(name, value)


def _checked_table(name: str, value: Any) -> tuple[tuple[float, ...], ...]:
    given = real_array(name, value)
    if given.ndim != 2 or given.shape[1] not in (2, 3):
        raise ValueError(f"{name}: must have shape (n, 2) or (n, 3), got {given.shape}")
    return tuple(tuple(row) for row in finite_array(name, given, given.shape, most=FARTHEST).tolist())


def lap_time_of(waypoints: Any) -> float | None:
    """Return when way-points with times end the lap [s]; None: they have no times.

    Raises:
        ValueError: for paths whose laps are not as long as each other.
    """
    tables = waypoints.values() if isinstance(waypoints, Mapping) else [waypoints]
    laps = {table[-1][0] for table in tables if isinstance(table, tuple) and table and len(table[0]) == 3}
    if len(laps) > 1:
        raise ValueError(f"waypoints: their laps take {sorted(laps)} s; must be equal")
    return laps.pop() if laps else None


def checked_weights(label: str, reward_weights: Any) -> dict[str, float]:
    """Check the weights of the reward's terms."""
    weights = {}
    for name, value in mapping(label, reward_weights).items():
        if name not in reward.TERMS:
            raise ValueError(f"{label}[{shown(name)}]: no such term; there are {', '.join(map(repr, reward.TERMS))}")
        weights[name] = number(f"{label}[{shown(name)}]", value, least=-LARGEST_WEIGHT, most=LARGEST_WEIGHT)
    if not any(weights.values()):
        raise ValueError(f"{label} = {shown(reward_weights)}: one at least must not be 0")
    return weights
