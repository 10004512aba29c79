"""Mamdani inference worked by hand, and properties of the paper's system."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flexarm_baselines import PAPER_GAIN_RANGE, MamdaniSystem, paper_system
from flexarm_baselines.paper_law.fuzzy_kernels import membership
from tests.support.fuzzy_variables import PAPER, ROUNDING, variable

deltas = st.floats(-7.0, 7.0)  # past the ends of the universe

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
