"""`reset(options=...)`: what a user may ask of the episodes that begin, turned into the kernels' orders."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexarm_env.envs.batch import START_CODES, Fleet
from flexarm_env.envs.choices import STARTS
from flexarm_env.envs.observation import refuse_fast_starts
from flexarm_env.kernels.entries import DRAWN, column
from flexarm_env.parameters import HEAVIEST_PAYLOAD
from flexarm_env.simulation.limits import state_limits
from flexarm_env.validation import choice, entries, mapping, real_array, shown

Array = NDArray[np.float64]
OPTIONS = {
    "start": "how the arm starts: " + ", ".join(f'"{name}"' for name in STARTS),
    "time": "moment of the lap at which the episode starts [s], below the lap time; to the nearest integration step",
    "path": "name of the reference, where the environment has several",
    "parameters": f"mapping of quantities of the episode: {', '.join(DRAWN)}",
    "state": "initial state in the public order, shape (4 + 4 m,)",
}
LEAST_STIFFNESS = 1e-3


def orders_of(options: Mapping[str, Any] | None, fleet: Fleet) -> Array:
    """Orders for a fleet's episodes.

    Args:
        options: keys of `OPTIONS`; each value one for all environments, or one for each.
        fleet: the environments.

    Returns:
        Shape (N, columns), see `entries.Column`.

    Raises:
        TypeError, ValueError: for an unknown key or a bad value, naming it and what is allowed.
    """
    asked = mapping("options", {} if options is None else options)
    if not asked:
        return fleet.usual_orders
    for name in asked:
        if name not in OPTIONS:
            raise ValueError(f"options[{shown(name)}]: no such option; the options are {', '.join(OPTIONS)}")
    orders = fleet.usual_orders.copy()
    if "start" in asked:
        names = [choice("options['start']", name, STARTS) for name in _each("start", asked["start"], fleet)]
        for name in set(names):
            refuse_fast_starts(fleet.settings, name)
        orders[:, column.START] = [START_CODES[name] for name in names]
    if "time" in asked:
        lap = fleet.settings.lap_time
        orders[:, column.PHASE] = _numbers("options['time']", asked["time"], fleet, 0.0, np.nextafter(lap, 0.0))
    if "path" in asked:
        orders[:, column.PATH] = _path_indices(asked["path"], fleet)
    for name, value in mapping("options['parameters']", asked.get("parameters", {})).items():
        if name not in DRAWN:
            raise ValueError(
                f"options['parameters'][{shown(name)}]: no such quantity; there are {', '.join(map(repr, DRAWN))}"
            )
        least, most = _range(name, fleet)
        hint = f" (`randomisation` at make can allow more: {{{name!r}: (least, most)}})"
        orders[:, column.DRAWN + list(DRAWN).index(name)] = _numbers(
            f"options['parameters'][{name!r}]", value, fleet, least, most, hint
        )
    if "state" in asked:
        orders[:, column.STATE :] = _states(asked["state"], fleet)
    return orders


def _range(name: str, fleet: Fleet) -> tuple[float, float]:
    """What memory, integration step and bounds were laid out for: the environment's own value and its range."""
    settings = fleet.settings
    arm = settings.flexible_arm.parameters
    own = {
        "delay": max(settings.sensor_delays),
        "payload_mass": arm.payload_mass,
        "stiffness": 1.0,
        "damping": arm.modal_damping_ratio,
        "noise": settings.noise,
        "actuation_delay": settings.actuation_delay,
    }[name]
    low, high = settings.randomisation.get(name, (own, own))
    if name == "payload_mass":  # a heavier arm is a slower one
        return min(low, own), HEAVIEST_PAYLOAD
    if name == "stiffness":
        return LEAST_STIFFNESS, max(high, own)
    if name == "actuation_delay" and settings.action_mode == "reference":
        return own, own
    return 0.0, max(high, own)


def _each(name: str, value: Any, fleet: Fleet) -> list[Any]:
    """One value for each environment."""
    found = entries(value)
    if found is None:
        return [value] * len(fleet)
    if len(found) != len(fleet):
        raise ValueError(
            f"options[{name!r}] = {shown(value)}: must be one value or {len(fleet)}, one for each environment"
        )
    return found


def _numbers(label: str, value: Any, fleet: Fleet, least: float, most: float, hint: str = "") -> Array:
    array = real_array(label, value)
    if array.shape not in ((), (len(fleet),)):
        raise ValueError(f"{label}: must be one number or {len(fleet)}, got shape {array.shape}")
    inside = (array >= least) & (array <= most) & np.isfinite(array)
    if not inside.all():
        raise ValueError(f"{label} = {float(array[~inside].flat[0])!r}: must be from {least:.6g} to {most:.6g}{hint}")
    return np.broadcast_to(array, len(fleet))


def _path_indices(value: Any, fleet: Fleet) -> list[int]:
    names = fleet.settings.reference
    if not fleet.settings.paths:
        raise ValueError(f"options['path'] = {shown(value)}: each episode draws its own moves; it has no names")
    return [names.index(choice("options['path']", name, names)) for name in _each("path", value, fleet)]


def _states(value: Any, fleet: Fleet) -> Array:
    limits = state_limits(fleet.settings.flexible_arm)
    states = real_array("options['state']", value)
    if states.shape not in ((len(limits),), (len(fleet), len(limits))):
        raise ValueError(f"options['state']: must have shape ({len(limits)},) for each arm, got {states.shape}")
    rows = np.broadcast_to(states, (len(fleet), len(limits)))
    if not np.all(np.abs(rows) <= limits):
        arm, entry = np.argwhere(~(np.abs(rows) <= limits))[0]
        raise ValueError(
            f"options['state'][{entry}] = {rows[arm, entry]}: must be finite, at most {limits[entry]:.6g} in magnitude"
        )
    return rows
