"""Paths of the user's: tables and functions of time by name, drawn for each episode, or a target that is moved.

`settings` are `Settings` throughout; tables are those of `polyline.reference_at`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexarm_env.parameters import SquareParameters
from flexarm_env.physics.paths import FARTHEST, PATHS, ReferencePath, missed_by, subdivided, way_points, with_velocities
from flexarm_env.validation import choice, finite_array, names, real_array, shown
from flexarm_env.way_points import MOST, sampled

Array = NDArray[np.float64]
OF_EACH = ("moves", "drawn", "target")  # references with a path for each environment; such a one stands alone
SIDES = 100  # of a drawn path, or as many as the one that is drawn when the environment is made
_FURTHER = 5  # rows of a target's table beside its past and its previews: now, where it stops, the end of the lap
FAR = 1e9  # when the lap of a target ends that the user has moved [s]


def settled(settings: Any) -> tuple[tuple[str, ...], Any]:
    """Return the options `reference`, with a name for each path, and `waypoints`, with tables for functions of time."""
    given, reference = settings.waypoints, list(settings.reference)
    own = dict(given) if isinstance(given, Mapping) else {} if given is None else {"waypoints": given}
    for n, one in enumerate(reference):
        if not isinstance(one, str):
            reference[n] = "waypoints" if len(reference) == 1 else f"path_{n + 1}"
            if reference[n] in own:
                raise ValueError(f"waypoints = {shown(given)}: must be left out; `reference` has a path of its own")
            own[reference[n]] = one
    allowed = (*PATHS, *(OF_EACH if len(reference) == 1 else ()), *(own or ("waypoints",)))
    found = names("reference", [choice("reference", one, allowed) for one in reference])
    wanted = {"waypoints"} if found[0] in OF_EACH[1:] else set(found).difference(PATHS, OF_EACH)
    if own.keys() != wanted or not wanted.isdisjoint((*PATHS, *OF_EACH)):
        raise ValueError(
            f"waypoints = {shown(given)}: must be given with the reference 'waypoints', 'drawn', 'target' or the names "
            f"of its paths, and only with it; reference = {shown(found)}"
        )
    if found != ("drawn",):
        own = {name: _as_table(name, one, settings) for name, one in own.items()}
    elif not callable(own["waypoints"]):
        raise ValueError(f"waypoints = {shown(given)}: must be a function of a generator with reference = 'drawn'")
    if found == ("target",) and np.shape(own["waypoints"]) != (1, 2):
        raise ValueError(f"waypoints = {shown(given)}: must be one point, where the target rests at first")
    return found, own.get("waypoints") if own.keys() <= {"waypoints"} else own


def _as_table(name: str, given: Any, settings: Any) -> tuple[tuple[float, ...], ...]:
    if not callable(given):
        return tuple(given)
    try:
        period = min(max(settings.control_period, settings.lap_time / MOST), settings.lap_time)
        return tuple(map(tuple, sampled(given, settings.lap_time, period).tolist()))
    except Exception as error:  # a function of the user's may raise anything
        raise ValueError(f"{name} = {shown(given)}: must be a function from time [s] to x, y [m]: {error}") from error


def rows_of(settings: Any) -> int:
    """Return how many rows the table of an environment's own path has, other than moves."""
    if settings.paths:
        return max(len(path.table) for path in settings.paths)
    if settings.reference == ("drawn",):
        return 1 + max(SIDES, len(_drawn(settings, 0).table) - 1)
    _check_within("waypoints", np.array(settings.waypoints), settings)
    return _past(settings) + len(_horizons(settings)) + _FURTHER


def first_rows(settings: Any, key: int, rows: int, chosen: int = 0) -> Array:
    """Return the path with which an episode begins, by its key or the number of a named path. Shape (rows, 5).

    Raises:
        ValueError: for a drawn path that is out of reach, too fast, or has another lap time or too many way-points.
    """
    if settings.reference != ("target",):
        table = (_drawn(settings, key) if settings.reference == ("drawn",) else settings.path(chosen)).table
        if len(table) > rows:
            raise ValueError(f"waypoints: drew a path of {len(table) - 1} sides; must be at most {rows - 1}")
        return with_velocities(subdivided(table, rows - 1))
    still = np.array([(0.0, *settings.waypoints[0]), (settings.lap_time, *settings.waypoints[0])])
    return with_velocities(subdivided(still, rows - 1))


def _drawn(settings: Any, key: int) -> ReferencePath:
    draw = settings.waypoints
    try:
        path = way_points(SquareParameters(lap_time=settings.lap_time), draw(np.random.default_rng(key)))
        path.check_reach(settings.flexible_arm.parameters)
        _check_speed("side", path.rows[:, 3:], settings)
    except Exception as error:  # a function of the user's may raise anything
        raise ValueError(f"waypoints = {shown(draw)}: drew no path: {error}") from error
    if path.lap_time != settings.lap_time:
        raise ValueError(f"waypoints: drew a lap of {path.lap_time} s; must be lap_time = {settings.lap_time} s")
    return path


def largest_speed(settings: Any) -> float:
    """Return the speed of minimum-jerk moves of half a turn of each joint in a quarter of the lap [m/s]."""
    length_1, length_2 = settings.flexible_arm.parameters.link_lengths
    return float(1.875 * np.pi / (0.25 * settings.lap_time) * (length_1 + 2.0 * length_2))


def moved(settings: Any, table: Array, now: Array, given: tuple[Any, Any, Any]) -> Array:
    """Return the paths of targets that are set at the present instant; what was before stays as it was.

    Args:
        settings: of the environments.
        table: their paths. Shape (n, rows, 5).
        now: present time of the paths [s]. Shape (n,).
        given: position, velocity and previews; see `FlexArmEnvBase.set_reference`, also for the errors.
    """
    count, past, what = len(table), _kept(settings, table.shape[1]), "of the reference"
    position, velocity = (
        _each(f"position {what}", given[0], (count, 2)),
        _each(f"velocity {what}", given[1], (count, 2)),
    )
    _check_within(f"position {what}", position, settings)
    _check_speed(f"velocity {what}", velocity, settings)
    new = np.empty_like(table)
    known = np.count_nonzero(table[:, :-2, 0] < now[:, None], axis=1)
    before = np.maximum(known[:, None] - past + np.arange(past), 0)
    new[:, :past] = table[np.arange(count)[:, None], before]
    new[:, 0, 1:3] -= new[:, 0, 3:] * new[:, 0, :1]
    new[:, 0, 0] = 0.0
    new[:, past] = np.column_stack([now, position, velocity])
    new[:, past + 1 : -2] = _stop(new[:, past], settings)[:, None]
    if given[2] is not None:
        horizons, order = np.unique(_horizons(settings), return_index=True)
        points = _each(f"previews {what}", given[2], (count, len(_horizons(settings)), 2))[:, order]
        _check_within(f"previews {what}", points, settings)
        ways = np.diff(points, axis=1, prepend=position[:, None]) / np.diff(horizons, prepend=0.0)[:, None]
        _check_speed(f"previews {what}", ways, settings)
        ahead = new[:, past + 2 : past + 2 + len(order)]
        ahead[:, :, 0], ahead[:, :, 1:3] = now[:, None] + horizons, points
        ahead[:, :, 3:] = np.concatenate([ways[:, 1:], ways[:, -1:]], axis=1)
        new[:, past + 1] = ahead[:, 0]  # without length: the target may jump there, which kernels search for
        new[:, past + 2 + len(order) : -2] = _stop(ahead[:, -1], settings)[:, None]
    new[:, -2:] = new[:, :1]  # before time 0 is at the end of the lap
    new[:, -2:, 0], new[:, -2:, 3:] = (0.5 * FAR, FAR), 0.0
    return new


def _stop(sides: Array, settings: Any) -> Array:
    """Return the sides after the last ones, on which targets rest where these leave the reach. Shape (n, 5)."""
    arm, at, velocity = settings.flexible_arm.parameters, sides[:, 1:3], sides[:, 3:]
    speed, along, squared = np.sum(velocity**2, axis=1), np.sum(at * velocity, axis=1), np.sum(at**2, axis=1)
    room = np.maximum(arm.reach**2 - squared, 0.0)
    left = np.sqrt(along**2 + speed * room) - along
    inside = along**2 - speed * np.maximum(squared - arm.inner_reach**2, 0.0)  # positive: the line meets the hole
    enters = (along < 0.0) & (inside > 0.0)
    left = np.where(enters, -along - np.sqrt(np.maximum(inside, 0.0)), left) / np.maximum(speed, 1e-300)
    left = np.minimum(np.where(speed > 0.0, left, FAR), 0.25 * FAR)[:, None]
    return np.hstack([sides[:, :1] + left, at + left * velocity, np.zeros_like(at)])


def shown_rows(settings: Any, rows: int) -> slice:
    """Return the rows of a table's way-points that a picture shows: all, or where a target has just been."""
    past = _kept(settings, rows)
    return slice(past - 1, past + 1) if settings.reference == ("target",) else slice(None)


def _kept(settings: Any, rows: int) -> int:
    """Return how many sides of a target's past a table keeps: as many as any environment of a batch needs."""
    return rows - len(_horizons(settings)) - _FURTHER


def _past(settings: Any) -> int:
    """Return how many sides of a target's past an environment needs, for readings that are late."""
    return 2 * int(np.ceil(settings.history_slots / settings.substeps)) + len(_horizons(settings)) + 2


def _horizons(settings: Any) -> tuple[float, ...]:
    return settings.previews if "previews" in settings.observation else ()


def _each(label: str, value: Any, shape: tuple[int, ...]) -> Array:
    given = real_array(label, value)
    return np.broadcast_to(finite_array(label, given, shape[given.ndim < len(shape) :], FARTHEST), shape)


def _check_speed(label: str, velocities: Array, settings: Any) -> None:
    fastest, most = float(np.linalg.norm(velocities, axis=-1).max(initial=0.0)), largest_speed(settings)
    if fastest > most:
        raise ValueError(
            f"{label}: {fastest:.4g} m/s; must be at most {most:.4g} m/s, the bound of observations; a shorter "
            "lap_time allows more"
        )


def _check_within(label: str, points: Array, settings: Any) -> None:
    arm, distances = settings.flexible_arm.parameters, np.linalg.norm(points, axis=-1)
    if np.any(missed_by(arm, distances)):
        within = f"{arm.inner_reach:.4g} to {arm.reach:.4g} m"
        raise ValueError(f"{label}: must be {within} from the shoulder, got {shown(distances)}")
