"""The driver that judges states, and what its findings mean."""

from __future__ import annotations

from flexarm_env.codegen.arrays import Arena
from flexarm_env.kernels.layout import row
from flexarm_env.kernels.variants import variant


def state_status(arena: Arena) -> None:
    """Status of every lane: 0 for a valid state; -1 if it is not finite; n if its entry n - 1 is beyond its limit."""
    for i in range(variant.lanes):
        status = 0.0
        for r in range(2 * variant.size - 1, -1, -1):
            beyond = not abs(arena[row.STATE + r, i]) <= arena[row.LIMITS + r, i]
            status = r + 1.0 if beyond else status
        for r in range(2 * variant.size):
            value = arena[row.STATE + r, i]
            status = status if value - value == 0.0 else -1.0
        arena[row.STATUS, i] = status


def failures(size: int) -> dict[float, str | None]:
    """Return the reason for which a state is not valid, by its status (`state_status`); 0 is that of a valid one.

    Args:
        size: number of internal coordinates.
    """
    entries = ("angle", "angle", *["deflection"] * (size - 2), *["rate"] * size)
    return {0.0: None, -1.0: "diverged"} | {1.0 + n: reason for n, reason in enumerate(entries)}
