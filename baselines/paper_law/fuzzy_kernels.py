"""Compiled Mamdani inference: MIN composition, MIN implication, MAX aggregation, exact CENTROID.

The centroid is integrated over levels ``y`` of membership instead of over the output ``z``. At level ``y`` a
triangle clipped at height ``h > y`` is one interval ``[left(y), right(y)]`` whose ends are linear in ``y``,
and MAX is the union of these intervals. The union changes its make-up only at the heights and at a few levels
known beforehand, where edges of different sets cross. In the slab between two such levels its length is
linear and its first moment quadratic in ``y``, so two Gauss points a slab are exact up to rounding; nothing
is sampled.

Flat functions over arrays, no classes and no checks: `flexarm_baselines.paper_law.fuzzy` is the checked way in. The
functions call nothing outside this file (`kept_on_disk`).
"""

from __future__ import annotations

import math

import numpy as np

from flexarm_baselines.arrays import Floats, Integers
from flexarm_env.codegen.cache import kept_on_disk

compiled = kept_on_disk(__file__, "fuzzy inference")
GAUSS_POINTS = (0.5 - 0.5 / math.sqrt(3.0), 0.5 + 0.5 / math.sqrt(3.0))
"""The two Gauss-Legendre points of [0, 1], exact up to the third power."""


@compiled
def membership(x: float, left: float, peak: float, right: float) -> float:
    """Return the degree of membership in [0, 1] of ``x`` in a triangle; a vertical edge belongs to its set."""
    if x < left or x > right:
        return 0.0
    if x < peak:
        return (x - left) / (peak - left)
    if x > peak:
        return (right - x) / (right - peak)
    return 1.0


@compiled
def centroid(heights: Floats, corners: Floats, low: float, high: float, levels: Floats) -> float:
    """Return the abscissa of the centroid of the union of clipped triangles.

    Args:
        heights: height at which each set is clipped, shape ``(m,)``, at least one positive.
        corners: rows (left, peak, right), listed from left to right, shape ``(m, 3)``.
        low: lower end of the universe; nothing outside the universe counts.
        high: upper end of the universe.
        levels: all levels at which the union changes its make-up, 0 and the heights among them, ascending.

    Returns:
        The centroid, in the unit of ``corners``.
    """
    area = 0.0
    moment = 0.0
    for slab in range(levels.size - 1):
        thickness = levels[slab + 1] - levels[slab]
        for point in GAUSS_POINTS:
            y = levels[slab] + point * thickness
            reach = low  # end of the union so far; left ends run to the right: a set adds what lies beyond
            for k in range(heights.size):
                if heights[k] > y:
                    left, peak, right = corners[k, 0], corners[k, 1], corners[k, 2]
                    start = max(left + (peak - left) * y, reach)
                    stop = min(right + (peak - right) * y, high)
                    if stop > start:
                        piece = (stop - start) * thickness  # Gauss weight 1/2 cancels in the quotient
                        area += piece
                        moment += piece * 0.5 * (start + stop)
                        reach = stop
    return moment / area


@compiled
def infer(
    inputs: Floats,
    universes: Floats,
    input_corners: Floats,
    owners: Integers,
    antecedents: Integers,
    consequents: Integers,
    output_corners: Floats,
    output_universe: Floats,
    crossing_levels: Floats,
) -> Floats:
    """Return the crisp output of every row of inputs.

    Args:
        inputs: shape ``(n, k)``, clipped to the universes.
        universes: rows (low, high), shape ``(k, 2)``.
        input_corners: rows (left, peak, right) of the s sets of all inputs, shape ``(s, 3)``.
        owners: the input that each of these sets describes, shape ``(s,)``.
        antecedents: for each of r rules and each input the row of ``input_corners``, shape ``(r, k)``.
        consequents: for each rule the row of ``output_corners``, shape ``(r,)``.
        output_corners: rows (left, peak, right), from left to right, shape ``(m, 3)``.
        output_universe: (low, high), shape ``(2,)``.
        crossing_levels: levels at which edges of the output sets cross, 0 among them, shape ``(c,)``.

    Returns:
        Centroids, shape ``(n,)``. A row's bits do not depend on the other rows.
    """
    mu = np.empty(owners.size)
    heights = np.empty(len(output_corners))
    levels = np.empty(crossing_levels.size + heights.size)
    outputs = np.empty(len(inputs))
    for row in range(len(inputs)):
        for s in range(owners.size):
            x = min(max(inputs[row, owners[s]], universes[owners[s], 0]), universes[owners[s], 1])
            mu[s] = membership(x, input_corners[s, 0], input_corners[s, 1], input_corners[s, 2])
        heights.fill(0.0)
        for rule in range(consequents.size):
            strength = 1.0
            for i in range(antecedents.shape[1]):
                strength = min(strength, mu[antecedents[rule, i]])  # MIN composes
            k = consequents[rule]
            heights[k] = max(heights[k], strength)  # MIN clips set k; MAX of its clipped copies
        for i in range(crossing_levels.size):
            levels[i] = crossing_levels[i]
        for k in range(heights.size):  # sort the heights in
            i = crossing_levels.size + k
            while levels[i - 1] > heights[k]:  # ends at level 0, the first
                levels[i] = levels[i - 1]
                i -= 1
            levels[i] = heights[k]
        outputs[row] = centroid(heights, output_corners, output_universe[0], output_universe[1], levels)
    return outputs
