"""Reasons for which an episode terminates, and their codes in infos."""

from __future__ import annotations

import numpy as np

from flexarm_env.simulation.limits import ANGLE_LIMITS, RATE_LIMIT
from flexarm_env.validation import integer

# Each reason with its condition. The codes count from 1 in this order; they are public: a new reason goes to the end.
ENDS = {
    "error": "the true tip is farther from the target than `error_limit`",
    "deflection": "a link's tip deflection is beyond `deflection_limit`, or that of one of its modes beyond its length",
    "angle": "theta1 is beyond {:g} turns, or theta2 beyond {:g}".format(*(x / (2.0 * np.pi) for x in ANGLE_LIMITS)),
    "rate": f"a joint is faster than {RATE_LIMIT:g} rad/s",
    "diverged": "a number of the state is not finite",
    "own": "the function `termination` says so",
    "finished": "the laps of a race are done",
}
NOT_TERMINATED = "none"
END_CODES = {NOT_TERMINATED: 0} | {reason: code for code, reason in enumerate(ENDS, 1)}


def end_reason(code: float) -> str:
    """Return the reason of an info's `end_code`.

    Args:
        code: the code, a whole number.

    Returns:
        A key of `END_CODES`; "none" for 0: the episode goes on, or a time limit truncated it.
    """
    whole = int(code) if isinstance(code, float | np.floating) and float(code).is_integer() else code
    return list(END_CODES)[integer("code", whole, 0, len(ENDS))]
