"""Late readings of the sensor on link 2: at which instants the arm is read for one, and with which weights.

The sensor's delay line keeps readings after each integration step; one between two steps is interpolated
(`flexarm_env.kernels.delay_line`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexarm_env.envs.settings import Settings
from flexarm_env.kernels.delay_line import hermite


class Instant(NamedTuple):
    """An instant at which the arm's point is read.

    Attributes:
        periods: so many control periods before the one that begins when the reading arrives; 0: it begins then.
        substeps: integration steps from the beginning of that earlier period to the instant.
        position: weight of the point's position.
        rate: weight of its velocity [s].
    """

    periods: int
    substeps: int
    position: float
    rate: float

    @classmethod
    def before(cls, steps: int, substeps: int, position: float, rate: float) -> Instant:
        """Make the instant so many integration steps before the reading arrives.

        Args:
            steps: how many.
            substeps: integration steps of a control period.
            position: see the class.
            rate: see the class.
        """
        periods = -(-steps // substeps)
        return cls(periods, periods * substeps - steps, position, rate)


def instants(settings: Settings) -> tuple[Instant, ...]:
    """Return the instants of which a reading is the weighted sum.

    Args:
        settings: of the environment; its delay is neither drawn nor requested.
    """
    substeps = settings.substeps
    step = settings.control_period / substeps
    back = settings.sensor_delays[0] / step
    if back == 0.0:
        return (Instant(0, 0, 1.0, 0.0),)
    whole = int(back)
    at_first, at_last, rate_first, rate_last = (
        float(hermite(a, b, a_rate, b_rate, step, 1.0 - (back - whole))[0])
        for a, b, a_rate, b_rate in np.eye(4).tolist()
    )
    return (
        Instant.before(whole + 1, substeps, at_first, rate_first),
        Instant.before(whole, substeps, at_last, rate_last),
    )
