"""Mamdani inference: against exact rational arithmetic, the paper's rules by hand, and what is refused."""

import itertools
from collections.abc import Callable, Sequence
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from flexarm_baselines import PAPER_GAIN_RANGE, FuzzyVariable, MamdaniSystem, TriangularSet, paper_system
from tests.support.refusals import refused

Triangle = tuple[Fraction, Fraction, Fraction]
PAPER = paper_system()
ROUNDING = 1e-14  # the universes have width 1 to 10 and a result takes some tens of operations


def variable(
    *corners: tuple[float, float, float], universe: tuple[float, float] = (0.0, 1.0), name: str = "x"
) -> FuzzyVariable:
    return FuzzyVariable(name, universe, tuple(TriangularSet(*c) for c in corners))


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


# Where one rule alone acts: ZERO, PMAX and PM have their centroids at 1/6, 5/6 and 1/2.
@pytest.mark.parametrize(
    ("delta", "expected"), [((0.0, 0.0), 1 / 6), ((-5.0, 5.0), 5 / 6), ((5.0, 0.0), 1 / 2), ((0.0, -5.0), 1 / 2)]
)
def test_the_paper_system_by_hand(delta: tuple[float, float], expected: float) -> None:
    assert PAPER.evaluate(delta) == pytest.approx(expected, abs=ROUNDING)
    assert PAPER_GAIN_RANGE == (1 / 6, 5 / 6)


def test_a_batch_has_the_bits_of_its_rows() -> None:
    x = np.random.default_rng(1).uniform(-6.0, 6.0, (4, 5, 2))
    batch = PAPER.evaluate(x)
    assert batch.shape == (4, 5)
    assert batch.dtype == np.float64
    assert all(batch[i] == PAPER.evaluate(x[i]) for i in np.ndindex(4, 5))
    strided = np.asfortranarray(x.reshape(20, 2))[::-1]
    np.testing.assert_array_equal(PAPER.evaluate(strided), batch.ravel()[::-1])
    assert PAPER.evaluate(np.empty((0, 2))).shape == (0,)


TWO = variable((0, 0, 1), (0, 1, 1))
BARE = r"sets of x: must cover \[0.0, 1.0\], .* zero at "


def of_inputs(*corners: tuple[float, float, float]) -> Callable[[], object]:
    """Return what makes a system with such sets of its input."""
    return lambda: MamdaniSystem([variable(*corners)], variable((0, 0, 1)), np.zeros(len(corners), dtype=int))


def of_output(*corners: tuple[float, float, float]) -> Callable[[], object]:
    """Return what makes a system with such sets of its output."""
    return lambda: MamdaniSystem([TWO], variable(*corners, name="y"), [0, 1])


test_impossible_values = refused(
    # triangles
    (lambda: TriangularSet(0.5, 0.25, 1.0), r"left=0.5, peak=0.25, .*: must have left <= peak <= right"),
    (lambda: TriangularSet(0.0, 1.5, 1.0), "left <= peak <= right"),
    (lambda: TriangularSet(1.0, 1.0, 1.0), "left < right"),
    (lambda: TriangularSet(0.0, np.nan, 1.0), "peak = nan: must be a finite number"),
    (lambda: TriangularSet(-np.inf, 0.0, 1.0), "left = -inf: must be a finite number"),
    # variables
    (lambda: variable(), r"sets of x = \(\): must hold at least one"),
    (lambda: variable((0, 0, 1), universe=(1.0, 0.0)), r"universe of x = \(1.0, 0.0\): must be finite, low < high"),
    (lambda: variable((0, 0, 1), universe=(0.0, np.inf)), r"universe of x = \(0.0, inf\)"),
    # inputs that are not covered
    (of_inputs((0, 0, 0.5), (0.5, 1, 1)), BARE + "0.5$"),  # both are zero
    (of_inputs((0, 0, 0.25), (0.75, 1, 1)), BARE + "0.25$"),
    (of_inputs((0, 0.5, 1.5)), BARE + "0$"),  # zero at the lower end
    (of_inputs((0, 0, 0.75), (0, 0.5, 1)), BARE + "1$"),  # zero at the upper end
    (of_inputs((0.125, 0.5, 1.5)), BARE + "0$"),
    (of_inputs((-1, 0.25, 0.25), (0.75, 0.75, 2)), BARE + "0.5$"),  # full at both ends of the gap
    # outputs
    (of_output((0, 0.5, 1), (-0.1, 0.5, 1)), r"left of y's sets = \[0.0, -0.1\]: must not step back"),
    (of_output((0, 0.5, 1), (0.2, 0.4, 1)), r"peak of y's sets = \[0.5, 0.4\]: must not step back"),
    (of_output((-1, 0, 0), (0, 1, 1)), r"sets of y: TriangularSet\(left=-1, .* must have an area inside"),
    # rules
    (lambda: MamdaniSystem([], TWO, 0), r"inputs = \(\): must hold at least one"),
    (lambda: MamdaniSystem([TWO], TWO, [[0, 1]]), r"rules: must have shape \(2,\).* got \(1, 2\)"),
    (lambda: MamdaniSystem([TWO], TWO, [0, 1, 1]), r"must have shape \(2,\).* got \(3,\)"),
    (lambda: MamdaniSystem([TWO], TWO, [0, 2]), "rules hold 2: must be indices of output sets, 0 to 1"),
    (lambda: MamdaniSystem([TWO], TWO, [0, -1]), "rules hold -1: must be indices of output sets, 0 to 1"),
    (lambda: MamdaniSystem([TWO], TWO, [0.0, 1.0]), "TypeError: rules: must hold integers, got dtype float64"),
    # what is inferred from
    (lambda: PAPER.evaluate([0.0, 0.0, 0.0]), r"inputs: must have shape \(..., 2\), got \(3,\)"),
    (lambda: PAPER.evaluate(0.0), r"inputs: must have shape \(..., 2\), got \(\)"),
    (lambda: PAPER.evaluate([[0.0, np.nan]]), "inputs hold nan: must be finite"),
    (lambda: PAPER.evaluate([np.inf, 0.0]), "inputs hold inf: must be finite"),
)
test_impossible_width_scales = refused(
    *((scale, r"width_scale = \S+: must be a finite number and > 0.5") for scale in (0.5, 0.0, -1.0, np.nan, np.inf)),
    by=paper_system,
)


def test_touching_at_a_vertical_edge_is_a_cover() -> None:
    halves = variable((0, 0, 0.5), (0.5, 0.5, 1.5))
    assert MamdaniSystem([halves], TWO, [0, 1]).evaluate([0.5]) == pytest.approx(2 / 3, abs=ROUNDING)


def test_the_callers_table_is_copied() -> None:
    table = np.array([0, 1])
    system = MamdaniSystem([TWO], TWO, table)
    before = system.evaluate([0.2])
    table[:] = 1
    assert system.evaluate([0.2]) == before
    assert MamdaniSystem([TWO], TWO, table).evaluate([0.2]) != before
