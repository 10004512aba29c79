"""Mamdani inference: worked by hand, against exact rational arithmetic, and against scikit-fuzzy."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from flexarm_baselines import PAPER_GAIN_RANGE, FuzzyVariable, MamdaniSystem, TriangularSet, paper_system
from flexarm_baselines.fuzzy_kernels import membership

PAPER = paper_system()
ROUNDING = 1e-14  # the universes have width 1 to 10 and a result takes some tens of operations
deltas = st.floats(-7.0, 7.0)  # past the ends of the universe


def variable(
    *corners: tuple[float, float, float], universe: tuple[float, float] = (0.0, 1.0), name: str = "x"
) -> FuzzyVariable:
    return FuzzyVariable(name, universe, tuple(TriangularSet(*c) for c in corners))


# --- worked by hand -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("delta", "expected"),
    [
        # Both ZERO: the triangle from 1 at 0 to 0 at 1/2, centroid at a third of its base.
        ((0.0, 0.0), 1 / 6),
        # Both extreme: PMAX alone, the mirror image.
        ((5.0, 5.0), 5 / 6),
        ((-5.0, 5.0), 5 / 6),
        # One extreme, one ZERO: PM alone, symmetric about 1/2.
        ((5.0, 0.0), 1 / 2),
        ((0.0, -5.0), 1 / 2),
        # delta1 is ZERO and P to 1/2 each, delta2 is ZERO: ZERO and PM are clipped at 1/2. Their union is 1/2
        # on [0, 3/4] and falls to 0 at 1. Area 3/8 + 1/16 = 7/16, moment 3/8 * 3/8 + 1/16 * 5/6 = 37/192.
        ((2.5, 0.0), 37 / 84),
        # Both are ZERO and P to 1/2: all three sets are clipped at 1/2, the union is 1/2 on all of [0, 1].
        ((2.5, 2.5), 1 / 2),
        # delta1 is ZERO to 4/5 and P to 1/5: ZERO clipped at 0.8, PM at 0.2. The union is 0.8 on [0, 0.1],
        # falls to 0.2 at 0.4, stays there to 0.9 and falls to 0 at 1. Area 0.08 + 0.15 + 0.1 + 0.01 = 0.34,
        # moment 0.08 * 0.05 + (0.06 * 0.25 + 0.09 * 0.2) + 0.1 * 0.65 + 0.01 * (0.9 + 1/30) = 167/1500.
        ((1.0, 0.0), 167 / 510),
    ],
)
def test_the_paper_system_by_hand(delta: tuple[float, float], expected: float) -> None:
    assert PAPER.evaluate(delta) == pytest.approx(expected, abs=ROUNDING)


def test_one_input_and_a_vertical_edge_inside_the_universe() -> None:
    # At 1/4 the input is low to 3/4 and high to 1/4. The output's low, clipped at 3/4, is 3/4 on [0, 1/16]
    # and falls to 0 at 1/4; its high, clipped at 1/4, jumps up at 1/2, stays to 7/8 and falls to 0 at 1.
    system = MamdaniSystem([variable((0, 0, 1), (0, 1, 1))], variable((0, 0, 0.25), (0.5, 0.5, 1), name="y"), [0, 1])
    # areas: 3/64 + 9/128 = 15/128; 3/32 + 1/64 = 7/64
    # moments: 3/64 * 1/32 + 9/128 * (1/16 + 1/16); 3/32 * 11/16 + 1/64 * (7/8 + 1/24)
    moment = 3 / 64 / 32 + 9 / 128 / 8 + 3 / 32 * 11 / 16 + 1 / 64 * (11 / 12)
    assert system.evaluate([0.25]) == pytest.approx(moment / (15 / 128 + 7 / 64), abs=ROUNDING)


def test_a_vertical_edge_belongs_to_its_set() -> None:
    assert [membership(x, 1.0, 1.0, 3.0) for x in (0.999, 1.0, 2.0, 3.0, 3.001)] == [0.0, 1.0, 0.5, 0.0, 0.0]
    assert [membership(x, -1.0, 1.0, 1.0) for x in (-1.0, 0.0, 1.0, 1.001)] == [0.0, 0.5, 1.0, 0.0]


# --- properties of the paper's system -----------------------------------------------------------------------


@given(deltas, deltas, st.floats(0.51, 20.0))
def test_the_gain_stays_between_the_outer_centroids(d1: float, d2: float, width_scale: float) -> None:
    low, high = PAPER_GAIN_RANGE
    assert (low, high) == (1 / 6, 5 / 6)
    assert low - ROUNDING <= paper_system(width_scale).evaluate([d1, d2]) <= high + ROUNDING


@given(deltas, deltas)
def test_signs_and_order_of_the_deflections_do_not_matter(d1: float, d2: float) -> None:
    equivalent = [(d1, d2), (-d1, d2), (d1, -d2), (-d1, -d2), (d2, d1), (-d2, d1)]
    np.testing.assert_allclose(PAPER.evaluate(equivalent), PAPER.evaluate([d1, d2]), atol=ROUNDING, rtol=0)


@given(deltas, deltas)
def test_inputs_are_clipped_to_the_universe(d1: float, d2: float) -> None:
    assert PAPER.evaluate([d1, d2]) == PAPER.evaluate(np.clip([d1, d2], -5.0, 5.0))


def test_the_gain_varies_continuously() -> None:
    x = np.linspace(-6.0, 6.0, 24_001)
    gain = PAPER.evaluate(np.column_stack([x, np.full_like(x, 1.3)]))
    assert np.abs(np.diff(gain)).max() < 5e-4 * 0.2  # a step is 5e-4, and in it a membership changes by 1e-4
    assert np.ptp(gain) > 0.1


def test_width_scale_widens_the_input_sets() -> None:
    # Twice as wide, N and P reach past the middle: at (0, 0) they are 1/2, ZERO is 1. So ZERO is unclipped,
    # PM and PMAX are clipped at 1/2: the union falls from 1 to 1/2 on [0, 1/4] and stays 1/2 up to 1.
    # Area 1/2 + 1/16 = 9/16, moment 1/4 + 1/16 * 1/12 = 49/192.
    assert paper_system(2.0).evaluate([0.0, 0.0]) == pytest.approx(49 / 108, abs=ROUNDING)
    # At 0.8 the sets have half width 4: delta1 = 4.5 is P alone, to 7/8, so PMAX is clipped at 7/8.
    # From the right: area 7/8 * 1/16 + 7/8 * 7/32, moment about 1: 7/128 * 1/32 + 49/256 * (1/16 + 7/48).
    narrow = 1 - (7 / 128 / 32 + 49 / 256 * (10 / 48)) / (7 / 128 + 49 / 256)
    assert paper_system(0.8).evaluate([4.5, 5.0]) == pytest.approx(narrow, abs=ROUNDING)


# --- shapes -------------------------------------------------------------------------------------------------


def test_a_batch_has_the_bits_of_its_rows() -> None:
    x = np.random.default_rng(1).uniform(-6.0, 6.0, (4, 5, 2))
    batch = PAPER.evaluate(x)
    assert batch.shape == (4, 5)
    assert batch.dtype == np.float64
    assert all(batch[i] == PAPER.evaluate(x[i]) for i in np.ndindex(4, 5))
    strided = np.asfortranarray(x.reshape(20, 2))[::-1]
    np.testing.assert_array_equal(PAPER.evaluate(strided), batch.ravel()[::-1])
    assert PAPER.evaluate(np.empty((0, 2))).shape == (0,)


def test_the_order_of_axes_in_the_rule_table() -> None:
    x, y = variable((0, 0, 1), (0, 1, 1)), variable((0, 0, 1), (0, 0.5, 1), (0, 1, 1))
    out = variable((0, 0, 1), (0, 0.5, 1), (0, 1, 1))
    system = MamdaniSystem([x, y], out, [[0, 1, 2], [2, 1, 0]])
    corners = system.evaluate([[0, 0], [0, 1], [1, 0], [1, 1]])  # one rule each, y's middle is 0 there
    np.testing.assert_allclose(corners, [1 / 3, 2 / 3, 2 / 3, 1 / 3], atol=ROUNDING)


# --- oracle 1: the same definition, integrated exactly in rational numbers ----------------------------------


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


# --- oracle 2: scikit-fuzzy ---------------------------------------------------------------------------------


SCIKIT_FUZZY_AND_NUMPY = pytest.mark.filterwarnings(  # scikit-fuzzy 0.5 calls np.maximum(a, b, out)
    "ignore:Passing more than 2 positional arguments:DeprecationWarning:skfuzzy"
)


def scikit_fuzzy(system: MamdaniSystem, points: Sequence[tuple[float, ...]], samples: int) -> list[float]:
    control = pytest.importorskip("skfuzzy.control")
    skfuzzy = pytest.importorskip("skfuzzy")
    antecedents = []
    for i, v in enumerate(system.inputs):
        antecedents.append(control.Antecedent(np.linspace(*v.universe, 41), f"input{i}"))
    consequent = control.Consequent(np.linspace(*system.output.universe, samples), "output", "centroid")
    for target, v in zip([*antecedents, consequent], [*system.inputs, system.output], strict=True):
        for k, s in enumerate(v.sets):
            target[str(k)] = skfuzzy.trimf(target.universe, [s.left, s.peak, s.right])
    consequent.accumulation_method = np.fmax
    rules = []
    for index in np.ndindex(system.rules.shape):
        condition = antecedents[0][str(index[0])]
        for antecedent, i in zip(antecedents[1:], index[1:], strict=True):
            condition = condition & antecedent[str(i)]  # fmin
        rules.append(control.Rule(condition, consequent[str(system.rules[index])]))
    simulation = control.ControlSystemSimulation(control.ControlSystem(rules), clip_to_bounds=True, cache=False)
    results = []
    for point in points:
        for i, value in enumerate(point):
            simulation.input[f"input{i}"] = value
        simulation.compute()
        results.append(float(simulation.output["output"]))
    return results


@SCIKIT_FUZZY_AND_NUMPY
@pytest.mark.parametrize("width_scale", [0.75, 1.0, 1.5])
def test_agrees_with_scikit_fuzzy(width_scale: float) -> None:
    """scikit-fuzzy integrates over its samples of the output's universe, and the clip points.

    Where two sets cross between samples it cuts the corner off, an area of the order of spacing^2: with 1001
    samples on [0, 1] the centroids differ by up to 2e-7, with half as many by four times that.
    """
    system = paper_system(width_scale)
    axis = [-6.0, -4.1, -2.5, -1.0, 0.0, 0.7, 3.3, 5.0]
    points = list(itertools.product(axis, axis))
    expected = scikit_fuzzy(system, points, samples=1001)
    np.testing.assert_allclose(system.evaluate(points), expected, atol=5e-7, rtol=0)


@SCIKIT_FUZZY_AND_NUMPY
def test_agrees_with_scikit_fuzzy_where_nothing_is_symmetric() -> None:
    a = variable((-1, 0, 0.5), (0, 0.5, 2), (0.25, 1, 1.5), name="a")
    b = variable((-3, -2, 2), (-1, 2, 3), universe=(-2.0, 2.0), name="b")
    c = variable((2.0, 2.5, 3.25), (2.25, 3.0, 4.0), (3.0, 3.5, 4.5), (3.25, 4.0, 4.0), universe=(2.0, 4.0))
    system = MamdaniSystem([a, b], c, [[3, 0], [1, 1], [0, 2]])
    points = list(itertools.product([0.0, 0.1, 0.3, 0.45, 0.8, 1.2], [-2.5, -1.1, 0.0, 0.3, 1.9]))
    expected = scikit_fuzzy(system, points, samples=2001)
    np.testing.assert_allclose(system.evaluate(points), expected, atol=5e-7, rtol=0)


# --- what is refused ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("corners", "message"),
    [
        (
            (0.5, 0.25, 1.0),
            r"TriangularSet\(left=0.5, peak=0.25, right=1.0\): must have left <= peak <= right",
        ),
        ((0.0, 1.5, 1.0), "left <= peak <= right"),
        ((1.0, 1.0, 1.0), "left < right"),
        ((0.0, np.nan, 1.0), "peak = nan: must be a finite number"),
        ((-np.inf, 0.0, 1.0), "left = -inf: must be a finite number"),
    ],
)
def test_impossible_triangles(corners: tuple[float, float, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        TriangularSet(*corners)


@pytest.mark.parametrize(
    ("corners", "universe", "message"),
    [
        ([], (0.0, 1.0), r"sets of x = \(\): must hold at least one"),
        ([(0, 0, 1)], (1.0, 0.0), r"universe of x = \(1.0, 0.0\): must be finite, low < high"),
        ([(0, 0, 1)], (0.0, np.inf), r"universe of x = \(0.0, inf\)"),
    ],
)
def test_impossible_variables(
    corners: list[tuple[float, float, float]], universe: tuple[float, float], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        variable(*corners, universe=universe)


@pytest.mark.parametrize(
    ("corners", "bare"),
    [
        ([(0, 0, 0.5), (0.5, 1, 1)], "0.5"),  # they touch: both are zero there
        ([(0, 0, 0.25), (0.75, 1, 1)], "0.25"),
        ([(0, 0.5, 1.5)], "0"),  # zero at the lower end
        ([(0, 0, 0.75), (0, 0.5, 1)], "1"),  # zero at the upper end
        ([(0.125, 0.5, 1.5)], "0"),
        ([(-1, 0.25, 0.25), (0.75, 0.75, 2)], "0.5"),  # full membership at both ends of the gap
    ],
)
def test_inputs_must_be_covered(corners: list[tuple[float, float, float]], bare: str) -> None:
    rules = np.zeros(len(corners), dtype=int)
    with pytest.raises(ValueError, match=rf"sets of x: must cover \[0.0, 1.0\], .* zero at {bare}$"):
        MamdaniSystem([variable(*corners)], variable((0, 0, 1)), rules)


def test_touching_at_a_vertical_edge_is_a_cover() -> None:
    halves = variable((0, 0, 0.5), (0.5, 0.5, 1.5))
    system = MamdaniSystem([halves], variable((0, 0, 1), (0, 1, 1)), [0, 1])
    assert system.evaluate([0.5]) == pytest.approx(2 / 3, abs=ROUNDING)


@pytest.mark.parametrize(
    ("rules", "error", "message"),
    [
        ([[0, 1]], ValueError, r"rules: must have shape \(2,\), one axis per input, got \(1, 2\)"),
        ([0, 1, 1], ValueError, r"must have shape \(2,\).* got \(3,\)"),
        ([0, 2], ValueError, "rules hold 2: must be indices of output sets, 0 to 1"),
        ([0, -1], ValueError, "rules hold -1: must be indices of output sets, 0 to 1"),
        ([0.0, 1.0], TypeError, "rules: must hold integers, got dtype float64"),
    ],
)
def test_impossible_rule_tables(rules: list[object], error: type[Exception], message: str) -> None:
    two = variable((0, 0, 1), (0, 1, 1))
    with pytest.raises(error, match=message):
        MamdaniSystem([two], two, rules)


@pytest.mark.parametrize(
    ("corners", "message"),
    [
        ([(0, 0.5, 1), (-0.1, 0.5, 1)], r"left of y's sets = \[0.0, -0.1\]: must not step back"),
        ([(0, 0.5, 1), (0.2, 0.4, 1)], r"peak of y's sets = \[0.5, 0.4\]: must not step back"),
    ],
)
def test_output_sets_run_from_left_to_right(corners: list[tuple[float, float, float]], message: str) -> None:
    disordered = variable(*corners, name="y")
    with pytest.raises(ValueError, match=message):
        MamdaniSystem([variable((0, 0, 1), (0, 1, 1))], disordered, [0, 1])


def test_impossible_systems() -> None:
    two = variable((0, 0, 1), (0, 1, 1))
    with pytest.raises(ValueError, match=r"inputs = \(\): must hold at least one"):
        MamdaniSystem([], two, 0)
    pointlike = variable((-1, 0, 0), (0, 1, 1), name="y")
    with pytest.raises(ValueError, match=r"sets of y: TriangularSet\(left=-1, .* must have an area inside"):
        MamdaniSystem([two], pointlike, [0, 1])


def test_the_callers_table_is_copied() -> None:
    two = variable((0, 0, 1), (0, 1, 1))
    table = np.array([0, 1])
    system = MamdaniSystem([two], two, table)
    before = system.evaluate([0.2])
    table[:] = 1
    assert system.evaluate([0.2]) == before
    assert MamdaniSystem([two], two, table).evaluate([0.2]) != before


@pytest.mark.parametrize(
    ("x", "message"),
    [
        ([0.0, 0.0, 0.0], r"inputs: must have shape \(..., 2\), got \(3,\)"),
        (0.0, r"inputs: must have shape \(..., 2\), got \(\)"),
        ([[0.0, np.nan]], "inputs hold nan: must be finite"),
        ([np.inf, 0.0], "inputs hold inf: must be finite"),
    ],
)
def test_impossible_inputs(x: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        PAPER.evaluate(x)


@pytest.mark.parametrize("width_scale", [0.5, 0.0, -1.0, np.nan, np.inf])
def test_impossible_width_scales(width_scale: float) -> None:
    with pytest.raises(ValueError, match=r"width_scale = \S+: must be a finite number and > 0.5"):
        paper_system(width_scale)
