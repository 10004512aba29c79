"""Figures of merit against cases whose answer is known in closed form."""

import numpy as np
import pytest

from flexarm_env import ArmParameters, FlexibleArm, Trajectory
from flexarm_env.metrics import (
    circle_fit,
    overshoot,
    path_difference,
    summary,
    tip_acceleration,
    tracking_error,
    vibration,
)

TIME = np.linspace(0.0, 2.0, 2001)


def run_with(reference: np.ndarray, q1: np.ndarray | float = 0.0, **signals: np.ndarray) -> Trajectory:
    """A straight arm lying along x, its first link's mode given, beside a reference."""
    arm = FlexibleArm(ArmParameters.paper())
    state = np.zeros((len(TIME), 8))
    state[:, 2] = q1
    state[:, 6] = np.gradient(state[:, 2], TIME)
    return arm.record(TIME, state, np.zeros((len(TIME), 2)), reference=reference, **signals)


def test_tracking_error_of_a_constant_offset() -> None:
    run = run_with(np.tile([9.0, -0.3], (len(TIME), 1)))  # the straight arm's tip is at (9, 0)
    assert tracking_error(run) == pytest.approx((0.3, 0.3), rel=1e-12)
    assert tracking_error(run, "rigid") == pytest.approx((0.3, 0.3), rel=1e-12)


def test_tracking_error_since() -> None:
    reference = np.tile([9.0, 0.0], (len(TIME), 1))
    reference[TIME < 1.0, 1] = 1.0  # only the first second is off, by 1 m
    run = run_with(reference)
    assert tracking_error(run, since=1.0) == pytest.approx((0.0, 0.0), abs=1e-12)
    # 1000 of 2001 instants are off by 1 m
    assert tracking_error(run).rms == pytest.approx(np.sqrt(1000 / 2001), rel=1e-9)


def test_true_and_rigid_tip_differ_by_the_deflection() -> None:
    """A modal coordinate of 0.1 turns link 1's tip slope and lifts both links; the rigid tip does not see it."""
    run = run_with(np.tile([9.0, 0.0], (len(TIME), 1)), q1=0.1)
    assert tracking_error(run, "rigid").maximum == pytest.approx(0.0, abs=1e-12)
    arm = FlexibleArm(ArmParameters.paper())
    deflection = 0.1 * float(arm.modes[0].tip_values[0])
    slope = 0.1 * float(arm.modes[0].tip_slopes[0])
    lifted = np.array([4.5 + 4.5 * np.cos(slope), deflection + 4.5 * np.sin(slope)])
    assert tracking_error(run).maximum == pytest.approx(np.linalg.norm(lifted - [9.0, 0.0]), rel=1e-12)


def test_vibration_of_a_sine() -> None:
    """q = a sin(w t) over whole periods: r.m.s. rate of the tip deflection 2 A a w / sqrt(2)."""
    a, w = 0.5, 2.0 * np.pi * 3.0
    run = run_with(np.zeros((len(TIME), 2)), q1=a * np.sin(w * TIME))
    # second differences at 1 ms: (w h)^2 / 6 = 6e-5 relative
    assert vibration(run) == pytest.approx(0.2 * a * w / np.sqrt(2.0), rel=1e-3)
    assert vibration(run, since=1.0, until=2.0) == pytest.approx(vibration(run), rel=1e-2)


def test_overshoot_in_the_incoming_direction() -> None:
    corner, incoming = np.array([-6.3, 6.3]), np.array([0.0, 12.6])
    path = np.column_stack([np.linspace(-7.0, 0.0, 5), [6.0, 6.5, 6.9, 6.4, 6.3]])
    time = np.arange(5.0)
    assert overshoot(path, time, corner, incoming, (0.0, 4.0)) == pytest.approx(0.6)
    assert overshoot(path, time, corner, incoming, (3.0, 4.0)) == pytest.approx(0.1)
    assert overshoot(path, time, corner, incoming, (0.0, 0.0)) == pytest.approx(-0.3)
    with pytest.raises(ValueError, match="window"):
        overshoot(path, time, corner, incoming, (9.0, 10.0))
    with pytest.raises(ValueError, match="incoming"):
        overshoot(path, time, corner, 0.0 * incoming, (0.0, 4.0))


def test_path_difference_ignores_time() -> None:
    one = np.column_stack([np.linspace(0, 1, 101), np.zeros(101)])
    assert path_difference(one, one[::-1]).max() == 0.0
    assert path_difference(one, one + np.array([0.0, 0.25])) == pytest.approx(0.25)
    between = one[:-1] + 0.5 * (one[1] - one[0])  # samples between samples: still the same line
    assert path_difference(between, one).max() == pytest.approx(0.0, abs=1e-15)


def test_tip_acceleration_of_a_turning_arm() -> None:
    """A straight arm turning at w: w^2 R towards the shoulder; second differences at 1 ms: (w h)^2 / 12 relative."""
    arm = FlexibleArm(ArmParameters.paper())
    state = np.zeros((len(TIME), 8))
    state[:, 0] = 3.0 * TIME
    run = arm.record(TIME, state, np.zeros((len(TIME), 2)))
    assert tip_acceleration(run) == pytest.approx(9.0 * 9.0, rel=1e-5)


def test_circle_fit_recovers_a_circle() -> None:
    angle = np.linspace(0.0, 1.5, 200)  # an arc is enough
    path = np.array([2.0, -1.0]) + 3.0 * np.column_stack([np.cos(angle), np.sin(angle)])
    fit = circle_fit(path)
    assert fit.centre == pytest.approx([2.0, -1.0], abs=1e-9)
    assert fit.radius == pytest.approx(3.0, abs=1e-9)
    assert fit.deviation == pytest.approx(0.0, abs=1e-9)


def test_errors_name_what_is_wrong() -> None:
    arm = FlexibleArm(ArmParameters.paper())
    open_loop = arm.record(TIME, np.zeros((len(TIME), 8)), np.zeros((len(TIME), 2)))
    with pytest.raises(ValueError, match="reference"):
        tracking_error(open_loop)
    run = run_with(np.zeros((len(TIME), 2)))
    with pytest.raises(ValueError, match="tip = 'elbow'"):
        tracking_error(run, "elbow")
    with pytest.raises(ValueError, match=r"window = 5\.0 to inf s"):
        tracking_error(run, since=5.0)


def test_summary_of_a_short_run_says_none() -> None:
    run = run_with(np.zeros((len(TIME), 2)))
    short = FlexibleArm(run.parameters).record(
        run.time[:100], run.state[:100], run.torque[:100], reference=np.zeros((100, 2))
    )
    assert summary(short)["true_tip_rms_after_2s"] is None
    assert summary(run)["true_tip_rms_after_2s"] is not None
