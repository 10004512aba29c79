"""`reset(options=...)`: what a user may ask of the episodes that begin, turned into the kernels' orders."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexarm_env.envs.batch import START_CODES, BatchSimulator
from flexarm_env.envs.choices import STARTS
from flexarm_env.envs.observation import check_moving_start
from flexarm_env.kernels.entries import DRAWN, column
from flexarm_env.parameters import HEAVIEST_PAYLOAD
from flexarm_env.simulation.limits import state_limits
from flexarm_env.validation import choice, entries, real_array, shown

Array = NDArray[np.float64]
OPTIONS = {
    "start": "how the arm starts: " + ", ".join(f'"{name}"' for name in STARTS),
    "time": "moment of the lap at which the episode starts [s], below the lap time; to the nearest integration step",
    "path": "name of the reference, where the environment has several",
    "parameters": f"mapping of quantities of the episode: {', '.join(DRAWN)}",
    "state": "initial state in the public order, shape (4 + 4 m,)",
}
LEAST_STIFFNESS = 1e-3


def reset_requests_of(options: Mapping[str, Any] | None, simulator: BatchSimulator) -> Array:
    """Orders for a fleet's episodes.

    Args:
        options: keys of `OPTIONS`; each value one for all environments, or one for each.
        simulator: the environments.

    Returns:
        Shape (N, columns), see `entries.Column`.

    Raises:
        TypeError, ValueError: for an unknown key or a bad value, naming it and what is allowed.
    """
    if options is None:
        return simulator.usual_requests
    if not isinstance(options, Mapping):
        raise TypeError(f"options = {shown(options)}: must be a mapping or None")
    if not options:
        return simulator.usual_requests
    for name in options:
        if name not in OPTIONS:
            raise ValueError(f"options[{shown(name)}]: no such option; the options are {', '.join(OPTIONS)}")
    reset_requests = simulator.usual_requests.copy()
    if "start" in options:
        names = [choice("options['start']", name, STARTS) for name in _each("start", options["start"], simulator)]
        for name in set(names):
            check_moving_start(simulator.settings, name)
        reset_requests[:, column.START] = [START_CODES[name] for name in names]
    if "time" in options:
        lap = simulator.settings.lap_time
        reset_requests[:, column.PHASE] = _numbers(
            "options['time']", options["time"], simulator, 0.0, np.nextafter(lap, 0.0)
        )
    if "path" in options:
        reset_requests[:, column.PATH] = _path_indices(options["path"], simulator)
    for name, value in _mapping("parameters", options.get("parameters", {})).items():
        if name not in DRAWN:
            raise ValueError(
                f"options['parameters'][{shown(name)}]: no such quantity; there are {', '.join(map(repr, DRAWN))}"
            )
        least, most = _range(name, simulator)
        hint = f" (`randomisation` at make can allow more: {{{name!r}: (least, most)}})"
        reset_requests[:, column.DRAWN + list(DRAWN).index(name)] = _numbers(
            f"options['parameters'][{name!r}]", value, simulator, least, most, hint
        )
    if "state" in options:
        reset_requests[:, column.STATE :] = _states(options["state"], simulator)
    return reset_requests


def _range(name: str, simulator: BatchSimulator) -> tuple[float, float]:
    """What memory, integration step and bounds were laid out for: the environment's own value and its range."""
    settings = simulator.settings
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


def _each(name: str, value: Any, simulator: BatchSimulator) -> list[Any]:
    """One value for each environment."""
    found = entries(value)
    if found is None:
        return [value] * len(simulator)
    if len(found) != len(simulator):
        raise ValueError(
            f"options[{name!r}] = {shown(value)}: must be one value or {len(simulator)}, one for each environment"
        )
    return found


def _numbers(label: str, value: Any, simulator: BatchSimulator, least: float, most: float, hint: str = "") -> Array:
    array = real_array(label, value)
    if array.shape not in ((), (len(simulator),)):
        raise ValueError(f"{label}: must be one number or {len(simulator)}, got shape {array.shape}")
    inside = (array >= least) & (array <= most) & np.isfinite(array)
    if not inside.all():
        raise ValueError(f"{label} = {float(array[~inside].flat[0])!r}: must be from {least:.6g} to {most:.6g}{hint}")
    return np.broadcast_to(array, len(simulator))


def _path_indices(value: Any, simulator: BatchSimulator) -> list[int]:
    names = simulator.settings.reference
    if not simulator.settings.paths:
        raise ValueError(f"options['path'] = {shown(value)}: each episode draws its own moves; it has no names")
    return [names.index(choice("options['path']", name, names)) for name in _each("path", value, simulator)]


def _mapping(name: str, value: Any) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise TypeError(f"options[{name!r}] = {shown(value)}: must be a mapping")
    return value


def _states(value: Any, simulator: BatchSimulator) -> Array:
    limits = state_limits(simulator.settings.flexible_arm)
    states = real_array("options['state']", value)
    if states.shape not in ((len(limits),), (len(simulator), len(limits))):
        raise ValueError(f"options['state']: must have shape ({len(limits)},) for each arm, got {states.shape}")
    rows = np.broadcast_to(states, (len(simulator), len(limits)))
    if not np.all(np.abs(rows) <= limits):
        arm, entry = np.argwhere(~(np.abs(rows) <= limits))[0]
        raise ValueError(
            f"options['state'][{entry}] = {rows[arm, entry]}: must be finite, at most {limits[entry]:.6g} in magnitude"
        )
    return rows
