"""The status of a state, in plain Python: valid, beyond a limit, not finite."""

import numpy as np
import pytest

from flexarm_env.codegen.declarations import plain_python
from flexarm_env.episode.observe import failures, state_status
from flexarm_env.episode.step import GAIN
from flexarm_env.kernels.entries import extent
from flexarm_env.kernels.layout import row
from flexarm_env.kernels.variants import Variant


@pytest.mark.parametrize(
    ("entry", "value", "reason"),
    [
        (0, 0.5, None),
        (1, -1.5, "angle"),
        (2, 1.5, "deflection"),
        (5, 1.5, "rate"),
        (3, np.nan, "diverged"),
        (7, np.inf, "diverged"),
        (0, -np.inf, "diverged"),
    ],
)
def test_each_lane_has_the_status_of_its_state(entry: int, value: float, reason: str | None) -> None:
    of = Variant(GAIN, 1, True, 2)
    arena = np.zeros((extent(of.rows), 2))
    with plain_python(of), np.errstate(invalid="ignore"):  # infinite minus infinite is how it is found
        arena[row.LIMITS : row.LIMITS + 2 * of.size] = 1.0
        arena[row.STATE + entry, 1] = value
        state_status(arena)
        found = arena[row.STATUS]
    assert [failures(of.size)[status] for status in found] == [None, reason]
