"""`drawn_path`: random paths of several kinds, speeds and corners, on which a student of arbitrary paths is taught."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

Array = NDArray[np.float64]
PERIOD = 0.01  # [s], between two rows: a control period
LAP, TAUGHT = 12.0, 10.0  # [s]: duration of a path, and of its part that is taught: previews do not reach its end
RING = (2.2, 8.95)  # [m]: distances from the shoulder
LAP_TIMES = (8.0, 20.0)  # [s], for once round a path
FASTEST = 6.5  # [m/s]
SIDES = 720  # of a curve
BLENDS = (0.1, 0.8)  # [s]: over which corners that are not sharp are blended


def drawn_path(random: np.random.Generator) -> Array:
    """Draw a path, for the option `waypoints` of the reference "drawn".

    It is a polygon, a curve of a few harmonics, or a spline. The reference moves along it at constant speed from the
    first instant on, from rest, or with rests on the way. Corners are sharp or blended.

    Args:
        random: what decides it.

    Returns:
        Time [s], x, y [m]. Shape (1201, 3).
    """
    while True:
        ends = (_polygon, _harmonics, _spline)[random.choice(3, p=[0.55, 0.25, 0.2])](random)
        arcs = _distances(ends)
        distance = np.linalg.norm(_at(arcs, ends, np.linspace(0.0, arcs[-1], SIDES)), axis=1)
        if RING[0] <= distance.min() and distance.max() <= RING[1]:
            break
    window = random.choice([0.0, random.uniform(*BLENDS)], p=[0.4, 0.6])
    more, count = round(0.5 * window / PERIOD), round(LAP / PERIOD) + 1
    speed = min(arcs[-1] / random.uniform(*LAP_TIMES), FASTEST)
    stops = arcs if len(arcs) <= SIDES else arcs[:: SIDES // 4]
    times = PERIOD * np.arange(-more, count + more, dtype=np.float64)
    along = _progress(random, times, speed, stops)
    sums = np.cumsum(np.vstack([np.zeros((1, 2)), _at(arcs, ends, along)]), axis=0)
    width = 2 * more + 1
    return np.column_stack([PERIOD * np.arange(count), (sums[width:] - sums[:-width]) / width])


def _polygon(random: np.random.Generator) -> Array:
    count = int(random.integers(2, 7))
    if random.random() < 0.6:  # regular, about the shoulder; its corners are often near the end of the reach
        count = max(count, 3)
        radius = np.full(count, random.uniform(*((8.6, RING[1]) if random.random() < 0.6 else (4.5, RING[1]))))
        angle = random.uniform(0.0, 2.0 * np.pi) + 2.0 * np.pi * np.arange(count) / count
    else:
        angle, radius = random.uniform(0.0, 2.0 * np.pi, count), random.uniform(*RING, count)
    corners = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])[:: random.choice([-1, 1])]
    return np.vstack([corners, corners[:1]])


def _harmonics(random: np.random.Generator) -> Array:
    sizes = random.choice([0.0, 1.0], 4) * random.uniform(0.0, [6.0, 3.0, 2.5, 2.0])  # [m]
    sizes[random.integers(1, 3)] += random.uniform(1.0, 7.0)
    order = np.array([0, 1, 2, -1]) * random.choice([-1, 1])
    phase = order[:, None] * np.linspace(0.0, 2.0 * np.pi, SIDES + 1) + random.uniform(0.0, 2.0 * np.pi, (4, 1))
    return np.column_stack([sizes @ np.cos(phase), sizes @ np.sin(phase)])


def _spline(random: np.random.Generator) -> Array:
    corners = _polygon(random)
    arcs = _distances(corners)
    return np.asarray(CubicSpline(arcs, corners, bc_type="periodic")(np.linspace(0.0, arcs[-1], SIDES + 1)))


def _distances(ends: Array) -> Array:
    """Return the distance of each way-point along a polyline [m]. Shape (n,)."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(ends, axis=0), axis=1))])


def _at(arcs: Array, ends: Array, along: Array) -> Array:
    """Return points of a closed polyline by their distances along it. Shape (n, 2)."""
    place = np.mod(along, arcs[-1])
    return np.column_stack([np.interp(place, arcs, ends[:, axis]) for axis in range(2)])


def _progress(random: np.random.Generator, times: Array, speed: float, stops: Array) -> Array:
    """Return distances along a path [m]; a motion without a start has moved before time 0, too. Shape (n,)."""
    first, kind = random.choice([0.0, random.uniform(0.0, stops[-1])], p=[0.7, 0.3]), random.random()
    if kind < 0.45:
        return np.asarray(first + speed * times)
    if kind < 0.7:
        ramp = random.uniform(0.5, 2.0)
        share = np.clip(times / ramp, 0.0, 1.0)
        return np.asarray(first + speed * (ramp * share**3 * (1.0 - 0.5 * share) + np.maximum(times - ramp, 0.0)))
    found, begin, rest, lengths = np.zeros(len(times)), 0.0, random.uniform(0.0, 1.5), np.diff(stops)
    for length in np.tile(lengths, 100):
        lasts = 1.5 * length / speed
        share = np.clip((times - begin) / lasts, 0.0, 1.0)
        found += length * share**3 * (10.0 + share * (6.0 * share - 15.0))  # minimum jerk
        begin += lasts + rest
        if begin > times[-1]:
            break
    return found
