"""Figures of merit against cases whose answer is known in closed form."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flexarm_env import ArmParameters, FlexibleArm, Trajectory, metrics
from flexarm_env.metrics import elbow_changes, path_difference, summary, tracking_error, vibration
from tests.support.refusals import refused

TIME = np.linspace(0.0, 2.0, 2001)
ARM = FlexibleArm(ArmParameters.paper())
STILL, NOWHERE = np.zeros((len(TIME), 8)), np.zeros((len(TIME), 2))
ON_THE_TIP = np.tile([9.0, 0.0], (len(TIME), 1))  # of the straight arm


def run_with(reference: np.ndarray, q1: np.ndarray | float = 0.0, **signals: np.ndarray) -> Trajectory:
    """Make a straight arm lying along x, its first link's mode given, beside a reference."""
    state = STILL.copy()
    state[:, 2] = q1
    state[:, 6] = np.gradient(state[:, 2], TIME)
    return ARM.record(TIME, state, NOWHERE, reference=reference, **signals)


def test_tracking_error_since() -> None:
    run = run_with(ON_THE_TIP + np.outer(TIME < 1.0, [0.0, 1.0]))  # only the first second is off, by 1 m
    assert tracking_error(run, since=1.0)[:2] == pytest.approx((0.0, 0.0), abs=1e-12)
    # 1000 of 2001 instants are off by 1 m
    assert tracking_error(run)[:2] == pytest.approx((np.sqrt(1000 / 2001), 1.0), rel=1e-9)


def test_true_and_rigid_tip_differ_by_the_deflection() -> None:
    """A modal coordinate of 0.1 turns link 1's tip slope and lifts both links; the rigid tip does not see it."""
    run = run_with(ON_THE_TIP, q1=0.1)
    assert tracking_error(run, "rigid").maximum == pytest.approx(0.0, abs=1e-12)
    deflection, slope = (0.1 * float(of[0]) for of in (ARM.modes[0].tip_values, ARM.modes[0].tip_slopes))
    lifted = np.array([4.5 + 4.5 * np.cos(slope), deflection + 4.5 * np.sin(slope)])
    assert tracking_error(run).maximum == pytest.approx(np.linalg.norm(lifted - [9.0, 0.0]), rel=1e-12)


def test_vibration_of_a_sine() -> None:
    """q = a sin(w t) over whole periods: r.m.s. rate of the tip deflection 2 A a w / sqrt(2)."""
    a, w = 0.5, 2.0 * np.pi * 3.0
    run = run_with(NOWHERE, q1=a * np.sin(w * TIME))
    # second differences at 1 ms: (w h)^2 / 6 = 6e-5 relative
    assert vibration(run) == pytest.approx(0.2 * a * w / np.sqrt(2.0), rel=1e-3)
    assert vibration(run, since=1.0, until=2.0) == pytest.approx(vibration(run), rel=1e-2)


def test_path_difference_ignores_time() -> None:
    one = np.column_stack([np.linspace(0, 1, 101), np.zeros(101)])
    assert path_difference(one, one[::-1]).max() == 0.0
    assert path_difference(one, one + np.array([0.0, 0.25])) == pytest.approx(0.25)
    between = one[:-1] + 0.5 * (one[1] - one[0])  # samples between samples: still the same line
    assert path_difference(between, one).max() == pytest.approx(0.0, abs=1e-15)


def test_tip_acceleration_of_a_turning_arm() -> None:
    """A straight arm turning at w: w^2 R towards the shoulder; second differences at 1 ms: (w h)^2 / 12 relative."""
    run = ARM.record(TIME, np.outer(3.0 * TIME, np.eye(8)[0]), NOWHERE)
    assert metrics.tip_acceleration(run) == pytest.approx(9.0 * 9.0, rel=1e-5)


def test_circle_fit_recovers_a_circle() -> None:
    angle = np.linspace(0.0, 1.5, 200)  # an arc is enough
    path = np.array([2.0, -1.0]) + 3.0 * np.column_stack([np.cos(angle), np.sin(angle)])
    fit = metrics.circle_fit(path)
    assert [*fit.centre, fit.radius, fit.deviation] == pytest.approx([2.0, -1.0, 3.0, 0.0], abs=1e-9)


PAST_A_CORNER = np.column_stack([np.linspace(-7.0, 0.0, 5), [6.0, 6.5, 6.9, 6.4, 6.3]])
UP = np.array([0.0, 12.6])


def overshoot(incoming: np.ndarray, *window: float) -> float:
    return metrics.overshoot(PAST_A_CORNER, np.arange(5.0), np.array([-6.3, 6.3]), incoming, window)


def test_overshoot_in_the_incoming_direction() -> None:
    assert overshoot(UP, 0.0, 4.0) == pytest.approx(0.6)
    assert overshoot(UP, 3.0, 4.0) == pytest.approx(0.1)
    assert overshoot(UP, 0.0, 0.0) == pytest.approx(-0.3)


test_refusals = refused(
    (lambda: overshoot(UP, 9.0, 10.0), "window"),
    (lambda: overshoot(0.0 * UP, 0.0, 4.0), "incoming"),
    (lambda: tracking_error(replace(run_with(NOWHERE), reference=None)), "reference"),
    (lambda: tracking_error(run_with(NOWHERE), "elbow"), "tip = 'elbow'"),
    (lambda: tracking_error(run_with(NOWHERE), since=5.0), r"window = 5\.0 to inf s"),
    (lambda: metrics.tip_acceleration(elbow_run(TIME[:1], TIME[:1])), "run: must have at least 3 instants, got 1"),
)


def elbow_run(theta2: np.ndarray, time: np.ndarray = TIME) -> Trajectory:
    state, nowhere = np.outer(theta2, np.eye(8)[1]), np.zeros((len(time), 2))
    return ARM.record(time, state, nowhere, reference=nowhere, notes={"ended": "truncated"})


@pytest.mark.parametrize(
    ("theta2", "times"),
    [
        (np.zeros_like(TIME), []),  # straight all the time: on no side
        (0.04 * np.sin(40.0 * TIME), []),  # flutters about the straight arm
        (np.abs(TIME - 1.0003) - 0.5, [0.5003, 1.5003]),  # not at instants
        (np.abs(1.0 - TIME) - 0.04, []),  # passes the straight arm a little and comes back
        (np.where(TIME < 1.0, 0.5, -0.04), []),  # not bent enough on the other side
        (np.where(TIME < 0.5, 0.5, np.where(TIME < 1.0, 0.0, -0.5)), [0.999]),  # leaves the straight arm at 1 s
        (np.pi - 1.0 + TIME, [1.0]),  # through the folded arm
        (0.5 + 2.0 * np.pi * np.round(TIME), []),  # whole turns are the same pose
    ],
)
def test_what_is_a_change_of_the_elbow(theta2: np.ndarray, times: list[float]) -> None:
    run = elbow_run(theta2)
    assert elbow_changes(run) == pytest.approx(times, abs=1e-9)
    assert summary(run)["elbow_changes"] == elbow_changes(run).tolist()


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
    whole = run_with(ON_THE_TIP + (TIME > 0.5)[:, None], gain=np.ones(len(TIME)))
    part = {name: array[:400] for name, array in whole.arrays().items()}
    died = Trajectory(parameters=whole.parameters, notes={"ended": "deflection"}, **part)
    assert tracking_error(died).rms < tracking_error(whole).rms
    assert (tracking_error(died).early_end, tracking_error(whole).early_end) == ("deflection", None)
    assert (metrics.ended_early(died), metrics.ended_early(whole)) == (True, False)
    found = summary(died)
    assert set(found) == set(summary(whole))
    assert found["ended_early"] is True
    compared = set(found) - {"ended", "ended_early", "duration", "elbow_changes"}
    assert {found[name] for name in compared} == {None}
    assert None not in {summary(whole)["true_tip_rms"], summary(whole)["mean_gain"]}


def test_summary_of_a_short_run_says_none() -> None:
    short = ARM.record(TIME[:100], STILL[:100], NOWHERE[:100], reference=NOWHERE[:100])
    assert summary(short)["true_tip_rms_after_2s"] is None
    assert summary(run_with(NOWHERE))["true_tip_rms_after_2s"] is not None
    instant = ARM.record(TIME[:1], STILL[:1], NOWHERE[:1], reference=NOWHERE[:1], gain=np.ones(1))
    assert summary(instant)["mean_gain"] is None
