"""Mamdani inference worked by hand, and properties of the paper's system."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flexarm_baselines import PAPER_GAIN_RANGE, paper_system
from flexarm_baselines.paper_law.fuzzy_kernels import membership
from tests.support.fuzzy_variables import PAPER, ROUNDING

deltas = st.floats(-7.0, 7.0)  # past the ends of the universe


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


def test_a_vertical_edge_belongs_to_its_set() -> None:
    assert [membership(x, 1.0, 1.0, 3.0) for x in (0.999, 1.0, 2.0, 3.0, 3.001)] == [0.0, 1.0, 0.5, 0.0, 0.0]
    assert [membership(x, -1.0, 1.0, 1.0) for x in (-1.0, 0.0, 1.0, 1.001)] == [0.0, 0.5, 1.0, 0.0]


@given(deltas, deltas, st.floats(0.51, 20.0))
def test_the_gain_stays_between_the_outer_centroids(d1: float, d2: float, width_scale: float) -> None:
    low, high = PAPER_GAIN_RANGE
    assert (low, high) == (1 / 6, 5 / 6)
    assert low - ROUNDING <= paper_system(width_scale).evaluate([d1, d2]) <= high + ROUNDING


def test_width_scale_widens_the_input_sets() -> None:
    # Twice as wide, N and P reach past the middle: at (0, 0) they are 1/2, ZERO is 1. So ZERO is unclipped,
    # PM and PMAX are clipped at 1/2: the union falls from 1 to 1/2 on [0, 1/4] and stays 1/2 up to 1.
    # Area 1/2 + 1/16 = 9/16, moment 1/4 + 1/16 * 1/12 = 49/192.
    assert paper_system(2.0).evaluate([0.0, 0.0]) == pytest.approx(49 / 108, abs=ROUNDING)
    # At 0.8 the sets have half width 4: delta1 = 4.5 is P alone, to 7/8, so PMAX is clipped at 7/8.
    # From the right: area 7/8 * 1/16 + 7/8 * 7/32, moment about 1: 7/128 * 1/32 + 49/256 * (1/16 + 7/48).
    narrow = 1 - (7 / 128 / 32 + 49 / 256 * (10 / 48)) / (7 / 128 + 49 / 256)
    assert paper_system(0.8).evaluate([4.5, 5.0]) == pytest.approx(narrow, abs=ROUNDING)


def test_a_batch_has_the_bits_of_its_rows() -> None:
    x = np.random.default_rng(1).uniform(-6.0, 6.0, (4, 5, 2))
    batch = PAPER.evaluate(x)
    assert batch.shape == (4, 5)
    assert batch.dtype == np.float64
    assert all(batch[i] == PAPER.evaluate(x[i]) for i in np.ndindex(4, 5))
    strided = np.asfortranarray(x.reshape(20, 2))[::-1]
    np.testing.assert_array_equal(PAPER.evaluate(strided), batch.ravel()[::-1])
    assert PAPER.evaluate(np.empty((0, 2))).shape == (0,)
