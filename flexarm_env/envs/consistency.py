"""Which options of an environment go together; an option without effect is an error, not ignored."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from flexarm_env.envs.choices import HEAVIEST_PAYLOAD, LARGEST_NOISE
from flexarm_env.episode import reward
from flexarm_env.kernels.layout import DRAWN
from flexarm_env.parameters import MAX_DELAY
from flexarm_env.physics.paths import PATHS
from flexarm_env.validation import choice, mapping, names, number, pair


def _on_a_named_path(settings: Any) -> bool:
    return not set(settings.reference).isdisjoint(PATHS)


_NAMED = f"with a reference among {', '.join(map(repr, PATHS))}"
# Options with the condition under which they have an effect, and that condition in words.
_EFFECT: dict[str, tuple[Callable[[Any], bool], str]] = {
    "previews": (lambda s: "previews" in s.observation, "with the observation block 'previews'"),
    "last_actions": (lambda s: "last_actions" in s.observation, "with the observation block 'last_actions'"),
    "wave_speed": (lambda s: s.delay is None and s.sensor != "collocated", "where it sets the sensor's delay"),
    "jitter": (lambda s: s.sensor != "collocated", "with a sensor that is late, not with a collocated one"),
    "hold": (lambda s: s.sensor != "collocated", "with a sensor that is late, not with a collocated one"),
    "start_spread": (lambda s: s.start in ("moving", "mix"), "with start = 'moving' or 'mix'"),
    "side": (_on_a_named_path, _NAMED),
    "start_corner": (_on_a_named_path, _NAMED),
    "direction": (_on_a_named_path, _NAMED),
    "compensation": (lambda s: s.law_sensor == "sensor", "with law_sensor = 'sensor'"),
    "delayed": (lambda s: s.law_sensor == "sensor", "with law_sensor = 'sensor'"),
    "rate_jacobian": (
        lambda s: s.law_sensor == "sensor" and s.sensor != "true",
        "with law_sensor = 'sensor' and a sensor that is not 'true'",
    ),
}


def refuse_options_without_effect(settings: Any, declared: Mapping[str, tuple[Any, tuple[str, ...]]]) -> None:
    """An option that nothing reads must be left at its default.

    Args:
        settings: `Settings`.
        declared: default of each option, and the action modes that read it.

    Raises:
        ValueError: naming the option, its value, and what it would need.
    """
    for name, (default, modes) in declared.items():
        value = getattr(settings, name)
        if value == default:
            continue
        if settings.action_mode not in modes:
            raise ValueError(
                f"{name} = {value!r}: has no effect with action_mode = {settings.action_mode!r}; "
                f"only with {' or '.join(map(repr, modes))}"
            )
        has_effect, where = _EFFECT.get(name, (lambda s: True, ""))
        if not has_effect(settings):
            raise ValueError(f"{name} = {value!r}: has no effect here; only {where}")
    _refuse_contradictions(settings)


def _refuse_contradictions(settings: Any) -> None:
    if settings.law_sensor == "sensor":
        for name in ("jitter", "hold", "dropout"):
            if getattr(settings, name) != 0.0:
                raise ValueError(
                    f"{name} = {getattr(settings, name)}: the law acts on the sensor in continuous time; "
                    "must be 0 with law_sensor = 'sensor'"
                )
    if settings.sensor == "collocated":
        if settings.compensation != "none":
            raise ValueError(
                f"compensation = {settings.compensation!r}: a collocated sensor has no delay to compensate; "
                "it must be 'none'"
            )
        if "delay" in settings.randomisation:
            raise ValueError("randomisation['delay']: a collocated sensor has no delay")
    if "previews" in settings.observation and not settings.previews:
        raise ValueError("previews = (): must hold a horizon, or `observation` not name the block 'previews'")
    if settings.reference == ("moves",) and settings.lap_time < FEWEST_PERIODS * settings.control_period:
        raise ValueError(
            f"lap_time = {settings.lap_time} s: must be at least {FEWEST_PERIODS} control periods "
            f"({FEWEST_PERIODS * settings.control_period} s) for moves there and back"
        )
    if settings.action_mode == "reference":
        periods = settings.actuation_delay / settings.control_period
        if abs(periods - round(periods)) > 1e-6 or "actuation_delay" in settings.randomisation:
            raise ValueError(
                f"actuation_delay = {settings.actuation_delay} s: must be a whole number of control periods "
                "with action_mode = 'reference', and not be drawn"
            )


FEWEST_PERIODS = 40  # of a lap of moves: ten for each


def checked_reference(reference: Any, waypoints: Any) -> tuple[str, ...]:
    """Names of the paths.

    Raises:
        TypeError, ValueError: for unknown names, or way-points that do not fit them.
    """
    wanted = (reference,) if isinstance(reference, str) else names("reference", reference)
    allowed = (*PATHS, "waypoints") if len(wanted) > 1 else (*PATHS, "waypoints", "moves")
    for name in wanted:
        choice("reference", name, allowed)
    if ("waypoints" in wanted) != (waypoints is not None):
        raise ValueError(
            f"waypoints = {waypoints!r}: must be given with the reference 'waypoints', and only with it; "
            f"reference = {reference!r}"
        )
    return tuple(wanted)


def checked_ranges(randomisation: Any) -> dict[str, tuple[float, float]]:
    """Ranges of the quantities that are drawn for each episode.

    Raises:
        TypeError, ValueError: for an unknown quantity or a bad range.
    """
    least = {name: 0.1 if name == "stiffness" else 0.0 for name in DRAWN}
    most = {"stiffness": 10.0, "damping": 1.0, "noise": LARGEST_NOISE, "payload_mass": HEAVIEST_PAYLOAD}
    most |= dict.fromkeys(("delay", "actuation_delay"), MAX_DELAY)
    ranges = {}
    for name, limits in mapping("randomisation", randomisation).items():
        if name not in DRAWN:
            raise ValueError(f"randomisation[{name!r}]: no such quantity; there are {', '.join(map(repr, DRAWN))}")
        low, high = pair(f"randomisation[{name!r}]", limits, DRAWN[name], least=least[name], most=most[name])
        if low > high:
            raise ValueError(f"randomisation[{name!r}] = {limits!r}: the first must not be above the second")
        ranges[name] = (low, high)
    return ranges


def checked_weights(reward_weights: Any) -> dict[str, float]:
    """Weights of the reward's terms.

    Raises:
        TypeError, ValueError: for an unknown term or a bad weight.
    """
    weights = {}
    for name, value in mapping("reward_weights", reward_weights).items():
        if name not in reward.TERMS:
            raise ValueError(f"reward_weights[{name!r}]: no such term; there are {', '.join(map(repr, reward.TERMS))}")
        weights[name] = number(f"reward_weights[{name!r}]", value, least=0.0)
    if not any(weights.values()):
        raise ValueError(f"reward_weights = {reward_weights!r}: one at least must be > 0")
    return weights
