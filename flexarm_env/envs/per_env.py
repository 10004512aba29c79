"""`per_env`: options that may differ between the environments of a batch, their checks, and the resulting settings.

Options that select kernels, shapes, kinematics or the physics step are the same in the whole batch.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any

from flexarm_env.allowed import allowed_of
from flexarm_env.envs.corners import ends
from flexarm_env.envs.options import OF_PATHS
from flexarm_env.envs.own_paths import OF_EACH
from flexarm_env.envs.quantities import SHARED_BY_ARMS
from flexarm_env.envs.settings import Settings, present_names
from flexarm_env.kernels.variants import shared_model
from flexarm_env.parameters import SENSOR_MODELS, arm_parameters
from flexarm_env.validation import entries, known_names, mapping, shown

OPTIONS = tuple(one.name for one in fields(Settings) if one.metadata["own"])
# Names of `common_values` that draws may change: actions and observations keep the environment's own, lanes hold paths.
_FREE = ("gain_limit", "action_limit", "kept", "paths", *OF_PATHS)
_SHARED_OPTIONS = tuple(one.name for one in fields(Settings) if one.name not in OPTIONS)


def settings_of_each(options: Mapping[str, Any], per_env: Any, count: int, owner: str) -> Settings | list[Settings]:
    """Make the settings of the environments of a batch: one for all, or those of each, equal ones the same object.

    Args:
        options: options of all environments.
        per_env: mapping of names among `OPTIONS` to a value for each environment, in the place of that in `options`;
            None: all have the same options.
        count: number of environments.
        owner: name of the class that received the options, for messages.
    """
    if per_env is None:
        return Settings.of(options, owner)
    options = present_names(options)
    known_names(owner, options, [one.name for one in fields(Settings)])
    own_values = present_names(mapping("per_env", per_env))
    columns = {name: _column(name, values, count) for name, values in own_values.items()}
    made: dict[Any, Settings] = {}
    each = []
    for i in range(count):
        try:
            own = {name: allowed_of(Settings, name).check(name, values[i]) for name, values in columns.items()}
            key = tuple(_plain(arm_parameters(x) if name == "arm" else x) for name, x in own.items())
            if key not in made:
                made[key] = Settings.of({**options, **own}, owner)
        except (TypeError, ValueError) as error:
            kind = TypeError if isinstance(error, TypeError) else ValueError
            raise kind(f"per_env, environment {i}: {error}") from None
        each.append(made[key])
    return each


def _plain(value: Any) -> Any:
    """Return what is equal for equal values: functions go by identity, as two of them may look alike."""
    if isinstance(value, Mapping):
        return tuple((name, _plain(one)) for name, one in value.items())
    return tuple(map(_plain, value)) if isinstance(value, tuple) else id(value) if callable(value) else repr(value)


def common_values(settings: Settings) -> dict[str, Any]:
    """Return what all environments of a batch share, by name; batches are made of settings with equal values."""
    arm = settings.flexible_arm.parameters
    kept = (settings.motor_limit, settings.kept_actions) if settings.mode.accumulates else None
    observed = settings.scaled and "inner_gain" in settings.observation
    return {
        **{name: getattr(arm, name) for name in SHARED_BY_ARMS},  # first: options may follow from the arm
        **{name: getattr(settings, name) for name in _SHARED_OPTIONS},
        "sensor": shared_model(settings.sensor),
        "gain_limit": settings.gain_limit if observed else None,
        "action_limit": settings.action_limit if settings.mode.limit != "gain_limit" else None,
        "kept": kept,
        "real motors": settings.real_motors,
        "dry friction": settings.dry_joints,
        "pulses": settings.pulsed,
        "drift of gauges": settings.drifting,
        "substeps": settings.substeps,
        "paths": settings.reference if settings.has_own_path else "known",
    }


def refuse_unlike(each: Sequence[Settings]) -> None:
    """Refuse settings of a batch that differ in what all its environments share; also what its episodes may draw.

    Raises:
        ValueError: naming the option, the environment, its value and that of environment 0.
    """
    for settings in {id(one): one for one in each}.values():
        _refuse_unlike((settings, *ends(settings)), "randomisation", _FREE)
    _refuse_unlike(each, "per_env, environment {}")


def _refuse_unlike(each: Sequence[Settings], label: str, free: Sequence[str] = ()) -> None:
    first = each[0]
    common = common_values(first)
    equal = {id(first)}
    for i, one in enumerate(each):
        if id(one) in equal:
            continue
        equal.add(id(one))
        for name, value in common_values(one).items():
            if value != common[name] and name not in free:
                raise ValueError(f"{label.format(i)}: {_unlike(name, one, first)}")


def _unlike(name: str, one: Settings, first: Settings) -> str:
    """Say in what settings differ from those of environment 0, by a name of `common_values`."""
    if name in _SHARED_OPTIONS:
        return f"{name} = {shown(getattr(one, name))}: it is the batch's; environment 0 has {getattr(first, name)!r}"
    if name in SHARED_BY_ARMS:
        own, common = (getattr(s.flexible_arm.parameters, name) for s in (one, first))
        return (
            f"arm = {shown(one.arm)}: its {name} = {own!r}, that of environment 0 {common!r}; shapes and kinematics "
            "are the batch's and must be the same"
        )
    if name == "sensor":
        alike = [other for other in SENSOR_MODELS if shared_model(other) == shared_model(first.sensor)]
        return (
            f"sensor = {one.sensor!r}: its readings are of another kind than those of environment 0, "
            f"{first.sensor!r}; allowed beside that: {', '.join(map(repr, alike))}"
        )
    if name == "gain_limit":
        return (
            f"gain_limit = {one.gain_limit}: it scales the observation's block 'inner_gain'; environment 0 has "
            f"{first.gain_limit}; with scaled = False they may differ"
        )
    if name == "action_limit":
        return (
            f"torque_limit = {shown(one.torque_limit)}: the action 1 would be {one.action_limit}, for environment 0 "
            f"it is {first.action_limit}; it must be the same"
        )
    if name == "kept":
        return (
            f"torque_limit or actuation_delay: with action_mode = {one.action_mode!r} all environments must have the "
            "same"
        )
    if name == "paths":
        kinds, drawn = ", ".join(map(repr, OF_EACH)), " or ".join(OF_PATHS)
        return (
            f"reference = {shown(one.reference)}: all environments must have it where it is one of {kinds} or {drawn} "
            f"is drawn, and all draw {drawn} or none"
        )
    if name in ("real motors", "dry friction", "pulses", "drift of gauges"):
        return f"{name}: all environments must have some, or none; a tiny value stands for 0"
    steps = [s.control_period / s.substeps for s in (one, first)]
    return (
        f"physics_step = None: its arm would be integrated by steps of {steps[0]:.4g} s, that of environment 0 by "
        f"{steps[1]:.4g} s; give all the same physics_step, e.g. {min(steps):.4g} s"
    )


def _column(name: str, values: Any, count: int) -> list[Any]:
    if name not in OPTIONS:
        raise ValueError(f"per_env[{shown(name)}]: it is the batch's, or no option; there are {', '.join(OPTIONS)}")
    found = entries(values)
    if found is None or len(found) != count:
        raise ValueError(f"per_env[{name!r}] = {shown(values)}: must be a list of {count}, one for each environment")
    return found
