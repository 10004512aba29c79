"""Observations do not tell what an episode draws of its late sensors; time stamps do, in a block of their own."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from flexarm_env.envs.blocks import BLOCKS, PRIVILEGED
from tests.support.plain import PlainEnvironment

STAMP = "reading_age"
# The arm rests while the reference leaves it and turns a corner after 0.25 s.
STILL: dict[str, Any] = {
    "arm": {"modes_per_link": 1},
    "action_mode": "torque_rate",
    "start": "corner",
    "lap_time": 1.0,
    "error_limit": None,
    "noise": 0.003,
    "delay": 0.03,
    "second_sensor_link": 1,
    "imu_link": 2,
    "observation": [
        name for name, block in BLOCKS.items() if block.reads not in PRIVILEGED and "torque_rate" in block.modes
    ],
}


def observed(**drawn: float) -> dict[str, NDArray[np.float32]]:
    """Return all blocks of an arm that rests, with some values drawn, one row for each period."""
    draws = {name: (value, np.nextafter(value, np.inf)) for name, value in drawn.items()}
    env = PlainEnvironment(7, **STILL, randomisation=draws)
    return dict(zip(STILL["observation"], env.follow([(0.0, 0.0)] * 28, *STILL["observation"]), strict=True))


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ({"delay": 0.004}, {"delay": 0.06}),
        ({"delay": 0.0271}, {"delay": 0.0333}),
        ({"jitter": 1e-4}, {"jitter": 4.9e-3}),  # readings still arrive in every period
        ({"second_sensor_delay": 0.004}, {"second_sensor_delay": 0.0333}),
    ],
    ids=str,
)
def test_equal_readings_give_equal_observations_whatever_is_drawn(
    one: dict[str, float], other: dict[str, float]
) -> None:
    """An arm at rest reads the same however late: only the time stamps may differ, in any block and to the bit."""
    first, second = (observed(**drawn) for drawn in (one, other))
    assert len(first) > 20
    assert np.abs(np.diff(first["sensor_error"], axis=0)).max() > 0.1  # the reference moves away
    for name in first:
        if name != STAMP:
            np.testing.assert_array_equal(first[name], second[name], err_msg=name)


@pytest.mark.parametrize(
    ("youngest", "oldest", "options"),
    [
        (0.02, 0.055, {"jitter": 0.03}),
        (0.02, 1.0, {"jitter": 0.02, "dropout": 0.3}),
        (0.02, 1.0, {"sensor_period": 0.025, "jitter": 0.03, "dropout": 0.2}),
        (0.0, 0.3, {"outage_time": 0.1, "outage_duration": 0.15, "randomisation": {"delay": (0.0, 0.05)}}),
    ],
    ids=str,
)
def test_a_reading_is_the_tip_of_its_age_ago(youngest: float, oldest: float, options: dict[str, Any]) -> None:
    """Held, lost and jittered readings: the true tip, by a spline through all periods, then; errors are held, too."""
    env = PlainEnvironment(
        3, arm={"modes_per_link": 1}, start="corner", delay=0.02, scaled=False, frame="world", control_period=5e-3,
        observation=["sensed_position", STAMP, "sensor_error", "reference_position"], **options,
    )  # fmt: skip
    seen = ("TRUE_TIP", "sensed_position", STAMP, "sensor_error", "reference_position")
    actions = [(0.4 * np.sin(0.2 * period), 0.2) for period in range(60)]
    tips, sensed, ages, errors, targets = (each[1:] for each in env.follow(actions, *seen))
    times, late = 5e-3 * np.arange(60), ages[:, 0]
    known, held = times - late > 0.01, np.r_[False, np.diff(late) > 0.00499]
    assert known.sum() > 30
    assert youngest - 1e-7 <= late.min() <= late[30:].max() <= oldest
    assert len(np.unique(np.round(late, 5))) > 5
    tip = CubicSpline(times, tips)(times - late)
    # vibrations of 20 Hz between points 5 ms apart leave the spline within 1e-4 of the tip; it moves by 1 mm a period
    np.testing.assert_allclose(sensed[known], tip[known], rtol=0.0, atol=2e-4)
    np.testing.assert_array_equal(errors[held], np.roll(errors, 1, axis=0)[held])
    if "sensor_period" not in options:  # else the target is that at a tick; here that of four periods ago
        expected, fresh = np.roll(targets, 4, axis=0) - sensed, known & ~held
        np.testing.assert_allclose(errors[fresh], expected[fresh], rtol=0.0, atol=2e-6)
