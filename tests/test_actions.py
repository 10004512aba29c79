"""The map between actions and gains: by hand, its inverse, what it refuses."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flexarm_env.actions import action_from_gain, gain_from_action
from tests.support.refusals import label, refuses


def test_the_action_map_by_hand() -> None:
    np.testing.assert_array_equal(gain_from_action([[-1.0, 0.0], [0.5, 1.0]], 4.0), [[0.0, 2.0], [3.0, 4.0]])
    np.testing.assert_array_equal(action_from_gain([[0.0, 2.0], [3.0, 4.0]], 4.0), [[-1.0, 0.0], [0.5, 1.0]])
    assert gain_from_action(np.float32([0.25]), 2.0).dtype == np.float64


@given(st.floats(1e-6, 1e6), st.floats(0.0, 1.0))
def test_the_action_map_inverts(gain_limit: float, share: float) -> None:
    gain = share * gain_limit
    assert gain_from_action(action_from_gain(gain, gain_limit), gain_limit) == pytest.approx(
        gain, abs=1e-15 * gain_limit
    )
    assert action_from_gain(gain_limit, gain_limit) == 1.0
    assert gain_from_action(1.0, gain_limit) == gain_limit


BEYOND = (-1.0000001, 2.0000001, np.nan, np.inf, -np.inf)
IMPOSSIBLE = [
    *((gain_from_action, [0.0, bad], 2.0, f"action = {bad!r}: must be finite and in [-1.0, 1.0]") for bad in BEYOND),
    *((action_from_gain, [0.0, bad], 2.0, f"gain = {bad!r}: must be finite and in [0.0, 2.0]") for bad in BEYOND),
    *(
        (function, 0.0, bad, f"gain_limit = {bad!r}: must be a finite number > 0")
        for function in (gain_from_action, action_from_gain)
        for bad in (0.0, -1.0, np.nan, np.inf)
    ),
]


@pytest.mark.parametrize(("function", "value", "gain_limit", "message"), IMPOSSIBLE, ids=label)
def test_impossible_numbers(function: Any, value: Any, gain_limit: float, message: str) -> None:
    with refuses(ValueError, message):
        function(value, gain_limit)
