"""Figures of merit against cases whose answer is known in closed form."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flexarm_env import ArmParameters, FlexibleArm, Trajectory
from flexarm_env.metrics import (
    circle_fit,
    elbow_changes,
    ended_early,
    overshoot,
    path_difference,
    summary,
    tip_acceleration,
    tracking_error,
    vibration,
)

TIME = np.linspace(0.0, 2.0, 2001)


def run_with(reference: np.ndarray, q1: np.ndarray | float = 0.0, **signals: np.ndarray) -> Trajectory:
    """Make a straight arm lying along x, its first link's mode given, beside a reference."""
    arm = FlexibleArm(ArmParameters.paper())
    state = np.zeros((len(TIME), 8))
    state[:, 2] = q1
    state[:, 6] = np.gradient(state[:, 2], TIME)
    return arm.record(TIME, state, np.zeros((len(TIME), 2)), reference=reference, **signals)


def test_tracking_error_of_a_constant_offset() -> None:
    run = run_with(np.tile([9.0, -0.3], (len(TIME), 1)))  # the straight arm's tip is at (9, 0)
    assert tracking_error(run)[:2] == pytest.approx((0.3, 0.3), rel=1e-12)
    assert tracking_error(run, "rigid")[:2] == pytest.approx((0.3, 0.3), rel=1e-12)


def test_tracking_error_since() -> None:
    reference = np.tile([9.0, 0.0], (len(TIME), 1))
    reference[TIME < 1.0, 1] = 1.0  # only the first second is off, by 1 m
    run = run_with(reference)
    assert tracking_error(run, since=1.0)[:2] == pytest.approx((0.0, 0.0), abs=1e-12)
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


def elbow_run(theta2: np.ndarray, time: np.ndarray = TIME) -> Trajectory:
    state = np.zeros((len(time), 8))
    state[:, 1] = theta2
    return FlexibleArm(ArmParameters.paper()).record(
        time, state, np.zeros((len(time), 2)), reference=np.zeros((len(time), 2)), notes={"ended": "truncated"}
    )


def test_elbow_changes_of_a_sine() -> None:
    """theta2 = -0.5 cos(2 pi t) is 0 at 0.25, 0.75, 1.25 and 1.75 s, none of which need be an instant."""
    run = elbow_run(-0.5 * np.cos(2.0 * np.pi * (TIME + 0.3e-3)))
    assert elbow_changes(run) == pytest.approx(np.array([0.25, 0.75, 1.25, 1.75]) - 0.3e-3, abs=1e-6)
    assert summary(run)["elbow_changes"] == elbow_changes(run).tolist()


@pytest.mark.parametrize(
    ("theta2", "times"),
    [
        (np.zeros_like(TIME), []),  # straight all the time: on no side
        (0.04 * np.sin(40.0 * TIME), []),  # flutters about the straight arm
        (1.0 - TIME + 0.01, [1.01]),
        (np.abs(1.0 - TIME) - 0.04, []),  # passes the straight arm a little and comes back
        (np.where(TIME < 1.0, 0.5, -0.04), []),  # not bent enough on the other side
        (np.where(TIME < 0.5, 0.5, np.where(TIME < 1.0, 0.0, -0.5)), [0.999]),  # leaves the straight arm at 1 s
        (np.pi - 1.0 + TIME, [1.0]),  # through the folded arm
        (0.5 + 2.0 * np.pi * np.round(TIME), []),  # whole turns are the same pose
    ],
)
def test_what_is_a_change_of_the_elbow(theta2: np.ndarray, times: list[float]) -> None:
    assert elbow_changes(elbow_run(theta2)) == pytest.approx(times, abs=1e-9)


@given(st.lists(st.sampled_from([-2.0, -0.3, -0.02, 0.0, 0.03, 0.4, 1.5]), min_size=2, max_size=20))
def test_elbow_changes_are_the_changes_of_sign_among_bent_arms(angles: list[float]) -> None:
    """Also that mirroring the arm changes nothing, and that times increase and lie within the run."""
    time = np.arange(float(len(angles)))
    found = elbow_changes(elbow_run(np.array(angles), time))
    signs = [angle > 0.0 for angle in angles if abs(angle) > 0.05]
    assert len(found) == sum(one != two for one, two in zip(signs, signs[1:], strict=False))
    assert np.all(np.diff(found) > 0.0)
    assert all(0.0 <= t <= time[-1] for t in found)
    assert elbow_changes(elbow_run(-np.array(angles), time)) == pytest.approx(found, abs=0.0)


def test_a_run_that_ended_early_has_no_figures_that_compare() -> None:
    """It would have a better r.m.s. than the whole run, whose error comes later."""
    reference = np.tile([9.0, 0.0], (len(TIME), 1))
    reference[TIME > 0.5] += 1.0
    whole = run_with(reference, gain=np.ones(len(TIME)))
    part = {name: array[:400] for name, array in whole.arrays().items()}
    died = Trajectory(parameters=whole.parameters, notes={"ended": "deflection"}, **part)
    assert tracking_error(died).rms < tracking_error(whole).rms
    assert (tracking_error(died).early_end, tracking_error(whole).early_end) == ("deflection", None)
    assert ended_early(died)
    assert not ended_early(whole)
    found = summary(died)
    assert set(found) == set(summary(whole))
    assert found["ended_early"] is True
    compared = set(found) - {"ended", "ended_early", "duration", "elbow_changes"}
    assert {found[name] for name in compared} == {None}
    assert None not in {summary(whole)["true_tip_rms"], summary(whole)["mean_gain"]}


def test_summary_of_a_short_run_says_none() -> None:
    run = run_with(np.zeros((len(TIME), 2)))
    short = FlexibleArm(run.parameters).record(
        run.time[:100], run.state[:100], run.torque[:100], reference=np.zeros((100, 2))
    )
    assert summary(short)["true_tip_rms_after_2s"] is None
    assert summary(run)["true_tip_rms_after_2s"] is not None
