"""Mamdani inference against exact rational arithmetic."""

import itertools
from collections.abc import Sequence
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from flexarm_baselines import FuzzyVariable, MamdaniSystem, paper_system
from tests.support.fuzzy_variables import variable

Triangle = tuple[Fraction, Fraction, Fraction]


def rational_membership(x: Fraction, triangle: Triangle) -> Fraction:
    left, peak, right = triangle
    if not left <= x <= right:
        return Fraction(0)
    rising = (x - left) / (peak - left) if x < peak else Fraction(1)
    falling = (right - x) / (right - peak) if x > peak else Fraction(1)
    return min(rising, falling)


def rational_centroid(clipped: Sequence[tuple[Triangle, Fraction]], universe: tuple[Fraction, Fraction]) -> Fraction:
    """Integrate over x, between all points at which two of the lines that bound the union can cross."""
    low, high = universe
    lines = {(Fraction(0), Fraction(0))}
    knots = {low, high}
    for (left, peak, right), height in clipped:
        knots |= {left, peak, right}
        lines.add((height, Fraction(0)))
        if left < peak:
            lines.add((-left / (peak - left), 1 / (peak - left)))
        if peak < right:
            lines.add((right / (right - peak), -1 / (right - peak)))
    for (a, b), (c, d) in itertools.combinations(lines, 2):
        if b != d:
            knots.add((c - a) / (b - d))
    area = moment = Fraction(0)
    for start, stop in itertools.pairwise(sorted(x for x in knots if low <= x <= high)):
        width, middle = stop - start, (start + stop) / 2
        thirds = (start + width / 3, stop - width / 3)  # inside, where vertical edges leave no doubt
        at = [max(min(height, rational_membership(x, t)) for t, height in clipped) for x in thirds]
        mean, slope = (at[0] + at[1]) / 2, 3 * (at[1] - at[0]) / width
        area += mean * width
        moment += mean * width * middle + slope * width**3 / 12
    return moment / area


def rational_evaluate(system: MamdaniSystem, inputs: Sequence[float]) -> Fraction:
    def triangles(v: FuzzyVariable) -> list[Triangle]:
        return [(Fraction(s.left), Fraction(s.peak), Fraction(s.right)) for s in v.sets]

    mu = []
    for v, value in zip(system.inputs, inputs, strict=True):
        low, high = map(Fraction, v.universe)
        x = min(max(Fraction(value), low), high)
        mu.append([rational_membership(x, t) for t in triangles(v)])
    heights = [Fraction(0)] * len(system.output.sets)
    for rule in np.ndindex(system.rules.shape):
        k = system.rules[rule]
        heights[k] = max(heights[k], min(m[i] for m, i in zip(mu, rule, strict=True)))
    low, high = map(Fraction, system.output.universe)
    return rational_centroid(list(zip(triangles(system.output), heights, strict=True)), (low, high))


eighths = st.integers(-16, 16).map(lambda i: i / 8)


@st.composite
def input_variables(draw: st.DrawFn) -> FuzzyVariable:
    peaks = sorted(draw(st.sets(eighths, min_size=2, max_size=4)))
    reach = draw(st.sampled_from([0.0, 0.125, 1.0]))  # how far each set reaches past its neighbours' peaks
    outer = draw(st.sampled_from([0.0, 1.0]))  # 0: shoulders at the ends of the universe
    feet = [peaks[0] - outer - reach * (outer > 0), *peaks, peaks[-1] + outer + reach * (outer > 0)]
    sets = []
    for left, peak, right in zip(feet, peaks, feet[2:], strict=False):
        sets.append((left - reach * (left in peaks and left < peak), peak, right + reach * (right > peak)))
    return variable(*sets, universe=(peaks[0], peaks[-1]))


@st.composite
def output_variables(draw: st.DrawFn) -> FuzzyVariable:
    count = draw(st.integers(1, 4))
    rows = [sorted(draw(st.lists(eighths, min_size=count, max_size=count))) for _ in range(2)]
    feet, peaks = np.min(rows, axis=0).tolist(), np.max(rows, axis=0).tolist()  # neither steps back
    corners = [(foot, peak, peak + abs(draw(eighths))) for foot, peak in zip(feet, peaks, strict=True)]
    low = peaks[0] - draw(st.integers(-4, 8)) / 8  # the universe may cut off feet, and peaks
    high = peaks[-1] + draw(st.integers(-4, 8)) / 8
    assume(all(left < right and max(left, low) < min(right, high) for left, _, right in corners))
    return variable(*corners, universe=(low, high), name="y")


@st.composite
def systems(draw: st.DrawFn) -> MamdaniSystem:
    inputs = draw(st.lists(input_variables(), min_size=1, max_size=3))
    output = draw(output_variables())
    shape = tuple(len(v.sets) for v in inputs)
    index = st.integers(0, len(output.sets) - 1)
    size = int(np.prod(shape))
    rules = np.array(draw(st.lists(index, min_size=size, max_size=size))).reshape(shape)
    return MamdaniSystem(inputs, output, rules)


@given(systems(), st.data())
def test_any_system_agrees_with_rational_arithmetic(system: MamdaniSystem, data: st.DataObject) -> None:
    count = len(system.inputs)
    x = [data.draw(st.integers(-40, 40)) / 16 for _ in range(count)]
    low, high = system.output.universe
    result = system.evaluate(x)
    assert result == pytest.approx(float(rational_evaluate(system, x)), abs=1e-13 * (high - low + 2.0))


@pytest.mark.parametrize("width_scale", [0.75, 1.0, 1.5])
def test_the_papers_system_agrees_with_rational_arithmetic(width_scale: float) -> None:
    system = paper_system(width_scale)
    axis = [-6.0, -4.1, -2.5, -1.0, 0.0, 0.7, 3.3, 5.0]
    points = list(itertools.product(axis, axis))
    expected = [float(rational_evaluate(system, point)) for point in points]
    np.testing.assert_allclose(system.evaluate(points), expected, atol=1e-13, rtol=0)
