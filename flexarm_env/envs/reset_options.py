"""`reset(options=...)`: checks of the options, and the kernels' reset requests that follow from them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexarm_env.envs.batch import BatchSimulator
from flexarm_env.envs.bounds import check_moving_start
from flexarm_env.envs.choices import STARTS
from flexarm_env.envs.consistency import NAMED, on_a_named_path, refuse_moving_race
from flexarm_env.envs.corners import further_draws
from flexarm_env.envs.distributions import ends_of
from flexarm_env.envs.kernel_inputs import BRANCH_CODES, DIRECTION_CODES, START_CODES
from flexarm_env.envs.quantities import orderable
from flexarm_env.kernels.entries import DRAWN, column
from flexarm_env.simulation.limits import state_limits
from flexarm_env.validation import choice, entries, mapping, real_array, shown

Array = NDArray[np.float64]
OPTIONS = {
    "start": "how the arm starts: " + ", ".join(f'"{name}"' for name in STARTS),
    "time": "moment of the lap at which the episode starts [s], below the lap time; to the nearest integration step",
    "path": "name of the path, where the environment has several",
    "direction": "of the lap: " + ", ".join(f'"{name}"' for name in DIRECTION_CODES),
    "elbow_branch": "side of theta2 of the rigid arm on the target: " + ", ".join(f'"{name}"' for name in BRANCH_CODES),
    "parameters": f"mapping of quantities of the episode: {', '.join(DRAWN)}; and of what else `randomisation` names",
    "state": "initial state of the arm in the public order, shape (4 + 4 m,); clock, sensors' memory, last actions and "
    "random numbers begin anew (`get_state` and `set_state` keep them)",
}


def reset_requests_of(
    options: Mapping[str, Any] | None, simulator: BatchSimulator, lasting: Array | None = None
) -> Array:
    """Make the requests for the resets of a batch.

    Args:
        options: mapping of keys of `OPTIONS` to a value for all environments, or one for each.
        simulator: the environments.
        lasting: requests where `options` has none; None: the settings'.

    Returns:
        Requests, see `entries.Column`. Shape (N, columns).
    """
    asked = mapping("options", {} if options is None else options)
    usual = simulator.usual_requests if lasting is None else lasting
    if not asked:
        return usual
    for name in asked:
        if name not in OPTIONS:
            raise ValueError(f"options[{shown(name)}]: no such option; the options are {', '.join(OPTIONS)}")
    reset_requests = usual.copy()
    if "start" in asked:
        names = [choice("options['start']", name, STARTS) for name in _each("start", asked["start"], simulator)]
        different = {(id(one), name): one for one, name in zip(simulator.each, names, strict=True)}
        for (_, name), one in different.items():
            check_moving_start(one, name)
            if one.mode.races:
                refuse_moving_race("options['start']", name)
        reset_requests[:, column.START] = [START_CODES[name] for name in names]
    if "time" in asked:
        if simulator.settings.mode.races:
            raise ValueError("options['time']: a race has no clock; must be left out")
        lap = min(one.laps[0] for one in simulator.each)
        reset_requests[:, column.PHASE] = _numbers(
            "options['time']", asked["time"], simulator, 0.0, np.nextafter(lap, 0.0)
        )
    if "path" in asked:
        reset_requests[:, column.PATH] = _path_indices(asked["path"], simulator)
    if "direction" in asked:
        reset_requests[:, column.DIRECTION] = _directions(asked["direction"], simulator)
    if "elbow_branch" in asked:
        reset_requests[:, column.BRANCH] = _codes("elbow_branch", asked["elbow_branch"], BRANCH_CODES, simulator)
    for name, value in mapping("options['parameters']", asked.get("parameters", {})).items():
        _request_parameter(reset_requests, name, value, simulator)
    if "state" in asked:
        states = _states(asked["state"], simulator)
        reset_requests[:, column.STATE : column.STATE + states.shape[1]] = states
    return reset_requests


def _request_parameter(reset_requests: Array, name: str, value: Any, simulator: BatchSimulator) -> None:
    """Request a quantity of the episode, or an option or parameter of the arm that it would draw."""
    label, each = f"options['parameters'][{shown(name)}]", [further_draws(settings) for settings in simulator.each]
    known = (*DRAWN, *(other for other in simulator.draws.further if all(other in draws for draws in each)))
    if name not in known:
        raise ValueError(f"{label}: no such quantity, or it is not drawn; there are {', '.join(map(repr, known))}")
    if name in DRAWN:
        least, most = np.array([orderable(settings, name) for settings in simulator.each]).T
        hint = f" (`randomisation` at make can allow more: {{{name!r}: (least, most)}})"
        found = _numbers(label, value, simulator, least, most, hint)
        reset_requests[:, column.DRAWN + list(DRAWN).index(name)] = found
        return
    where, given = simulator.draws.further[name], real_array(label, value)
    size = where.stop - where.start
    if size > 1 and given.shape[-1:] != (size,):
        raise ValueError(f"{label}: must have shape ({size},) or ({len(simulator)}, {size}), got {given.shape}")
    for n in range(size):
        ends = [ends_of(draws[name][n]) for draws in each]
        numbers = given[..., n] if size > 1 else given
        reset_requests[:, where.start + n] = _numbers(label, numbers, simulator, *np.array(ends).T)


def _each(name: str, value: Any, simulator: BatchSimulator) -> list[Any]:
    found = entries(value)
    if found is None:
        return [value] * len(simulator)
    if len(found) != len(simulator):
        raise ValueError(
            f"options[{name!r}] = {shown(value)}: must be one value or {len(simulator)}, one for each environment"
        )
    return found


def _numbers(
    label: str, value: Any, simulator: BatchSimulator, least: float | Array, most: float | Array, hint: str = ""
) -> Array:
    array = real_array(label, value)
    if array.shape not in ((), (len(simulator),)):
        raise ValueError(f"{label}: must be one number or {len(simulator)}, got shape {array.shape}")
    numbers, lowest, highest = np.broadcast_arrays(array, least, most, np.empty(len(simulator)))[:3]
    inside = (numbers >= lowest) & (numbers <= highest) & np.isfinite(numbers)
    if not inside.all():
        i = int(np.argmin(inside))
        raise ValueError(f"{label} = {numbers[i].item()!r}: must be from {lowest[i]:.6g} to {highest[i]:.6g}{hint}")
    return numbers


def _path_indices(value: Any, simulator: BatchSimulator) -> list[int]:
    if not simulator.settings.paths:
        raise ValueError(f"options['path'] = {shown(value)}: each episode has its own path; it has no names")
    given = zip(_each("path", value, simulator), simulator.each, simulator.first_paths.tolist(), strict=True)
    return [first + one.reference.index(choice("options['path']", name, one.reference)) for name, one, first in given]


def _directions(value: Any, simulator: BatchSimulator) -> list[float]:
    if not all(map(on_a_named_path, simulator.each)):
        raise ValueError(f"options['direction'] = {shown(value)}: has no effect here; only {NAMED}")
    return _codes("direction", value, DIRECTION_CODES, simulator)


def _codes(name: str, value: Any, codes: Mapping[str, float], simulator: BatchSimulator) -> list[float]:
    return [codes[choice(f"options[{name!r}]", one, codes)] for one in _each(name, value, simulator)]


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
