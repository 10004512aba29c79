"""The reference: the square as a pure function of time, what of it the arm can reach, and the pose it starts from."""

import math
from typing import get_args

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from flexarm_env import ArmParameters, FlexibleArm, ReferencePath, SquareParameters, inverse_kinematics, square
from flexarm_env.kernels.imex import chord_at
from flexarm_env.parameters import Corner, Direction, ElbowBranch
from flexarm_env.physics.paths import rounded, way_points
from tests.support.refusals import refused

CLOCKWISE: list[Corner] = ["lower left", "upper left", "upper right", "lower right"]
CORNERS = np.array([(-6.3, -6.3), (-6.3, 6.3), (6.3, 6.3), (6.3, -6.3)])  # in this order
PAPER = square(SquareParameters())
# Positions are sums and products of two or three numbers of size 10: a few units in the last place.
ROUNDING = 1e-14


@pytest.mark.parametrize("direction", get_args(Direction))
@pytest.mark.parametrize("start", get_args(Corner))
def test_start_corner_and_direction(start: Corner, direction: Direction) -> None:
    turn = 1 if direction == "clockwise" else -1
    expected = CORNERS[(CLOCKWISE.index(start) + turn * np.arange(5)) % 4]
    path = square(SquareParameters(start_corner=start, direction=direction))
    np.testing.assert_array_equal(path.position(4.0 * np.arange(4).reshape(2, 2)), expected[:4].reshape(2, 2, 2))
    np.testing.assert_allclose(path.velocity(4.0 * np.arange(4) + 1.0), np.diff(expected, axis=0) / 4.0)


@given(st.floats(0.5, 12.0), st.floats(0.5, 60.0), st.floats(0.0, 1.0), st.integers(0, 3))
def test_every_point_is_on_its_side_at_constant_speed(side: float, lap_time: float, along: float, k: int) -> None:
    path = square(SquareParameters(side=side, lap_time=lap_time))
    time = 0.25 * lap_time * (k + min(along, 0.999))
    position, velocity = path.position(time), path.velocity(time)
    assert np.abs(position).max() == pytest.approx(0.5 * side, rel=ROUNDING)
    assert np.linalg.norm(velocity) == pytest.approx(4.0 * side / lap_time, rel=ROUNDING)
    travelled = np.linalg.norm(position - CORNERS[k] * side / 12.6)
    assert travelled == pytest.approx(side * min(along, 0.999), abs=1e-14 * side)
    # and it is the derivative: a difference over 1e-3 of a side has only rounding error on a straight line
    step = 0.25e-3 * lap_time * (1.0 if along < 0.5 else -1.0)
    difference = (path.position(time + step) - position) / step
    np.testing.assert_allclose(difference, velocity, atol=1e-10 * side / lap_time)


@given(st.floats(0.0, 16.0, exclude_max=True), st.integers(1, 50))
def test_laps_follow_each_other(time: float, laps: int) -> None:
    # adding whole laps rounds the time to 1e-13 s at 800 s: that much times the speed
    later = time + 16.0 * laps
    if later - 16.0 * laps < 16.0 and int(time // 4.0) == int((later - 16.0 * laps) // 4.0):
        np.testing.assert_allclose(PAPER.position(later), PAPER.position(time), atol=1e-12)
        np.testing.assert_array_equal(PAPER.velocity(later), PAPER.velocity(time))


def test_velocity_switches_abruptly_at_a_corner() -> None:
    before, at = np.nextafter(4.0, 0.0), 4.0
    np.testing.assert_array_equal(PAPER.velocity([before, at]), [(0.0, 3.15), (3.15, 0.0)])
    np.testing.assert_allclose(PAPER.position([before, at]), [(-6.3, 6.3)] * 2, atol=ROUNDING)
    before, at = np.nextafter(16.0, 0.0), 16.0  # into the next lap
    np.testing.assert_array_equal(PAPER.velocity([before, at]), [(-3.15, 0.0), (0.0, 3.15)])


def test_before_the_start_it_rests_on_the_corner() -> None:
    """What a delayed command reads."""
    np.testing.assert_array_equal(PAPER.position([-1e-9, -0.03, -100.0]), [(-6.3, -6.3)] * 3)
    np.testing.assert_array_equal(PAPER.velocity([-1e-9, -0.03, -100.0]), np.zeros((3, 2)))


@given(st.floats(-1.0, 33.0), st.floats(1e-5, 1e-2))
def test_a_step_over_a_corner_takes_the_chord(time: float, step: float) -> None:
    """What the integrator commands: the position where the step begins, and the mean velocity over it."""
    x, y, vx, vy = chord_at(PAPER.rows[None], 0, time, step, 0.0)
    np.testing.assert_array_equal((x, y), PAPER.position(time))
    end = (x + vx * step, y + vy * step)
    np.testing.assert_allclose(end, PAPER.position(time + step), atol=ROUNDING)


def arm(*lengths: float) -> ArmParameters:
    return ArmParameters.linear(link_lengths=lengths)


FAR = ReferencePath([(0.0, 1.0, 0.0), (1.0, 9.5, 0.0), (2.0, 0.0, 9.2), (3.0, 1.0, 0.0)])
# Its corners are all within reach of unequal links: only a side's nearest point, 3 m from the shoulder, is not.
AROUND_A_HOLE = square(SquareParameters(side=6.0))
test_what_cannot_be_reached_is_refused = refused(
    (lambda: PAPER.check_reach(arm(4.0, 4.0)), r"\(-6\.3, -6\.3\).* misses it by 0\.9095 m"),
    (lambda: FAR.check_reach(arm(4.5, 4.5)), r"\(9\.5, 0\.0\) m is 9\.5 m .* misses it by 0\.5 m"),
    (lambda: AROUND_A_HOLE.check_reach(arm(8.0, 4.5)), r"at 3 m.* 3\.5 m away, which misses it by 0\.5 m"),
    (lambda: AROUND_A_HOLE.check_reach(arm(8.0, 1.0)), r"is 4\.243 m .* no nearer than 7 m and misses it by 2\.757 m"),
    (lambda: inverse_kinematics(arm(5.0, 3.0), (9.0, 0.0)), r"point = \(9\.0, 0\.0\) m: out of .* reach by 1 m"),
    (lambda: inverse_kinematics(arm(5.0, 3.0), (0.0, 1.5)), r"point = \(0\.0, 1\.5\) m: out of .* reach by 0\.5 m"),
    (lambda: inverse_kinematics(arm(5.0, 3.0), (np.nan, 0.0)), "point"),
    (lambda: inverse_kinematics(arm(5.0, 3.0), (1.0, 2.0, 3.0)), "point"),
)


def test_reach_is_decided_at_its_edge() -> None:
    """A quadrilateral that touches the reach is reachable to rounding, one longer by 10^-11 of it is not."""
    square(SquareParameters(side=7.1)).check_reach(arm(8.0, 4.5))
    half = math.hypot(6.3, 6.3) / 2
    PAPER.check_reach(arm(half, half))
    with pytest.raises(ValueError, match="misses it"):
        PAPER.check_reach(arm(half * (1 - 2e-11), half))


@given(
    lengths=st.tuples(st.floats(0.5, 10.0), st.floats(0.5, 10.0)),
    share=st.floats(0.0, 1.0),
    bearing=st.floats(-math.pi, math.pi),
    branch=st.sampled_from(get_args(ElbowBranch)),
)
def test_inverse_kinematics_round_trip(
    lengths: tuple[float, float], share: float, bearing: float, branch: ElbowBranch
) -> None:
    nearest = abs(lengths[0] - lengths[1])
    distance = nearest + share * (sum(lengths) - nearest)
    target = distance * np.array([math.cos(bearing), math.sin(bearing)])
    angles = inverse_kinematics(arm(*lengths), target, branch)
    assert angles.shape == (2,)
    # the half-angle formula keeps its digits at both edges of the reach, where the cosine rule loses half of them
    np.testing.assert_allclose(
        FlexibleArm(arm(*lengths)).tip(np.append(angles, np.zeros(4))), target, atol=1e-14 * sum(lengths)
    )
    assert angles[1] * (1.0 if branch == "positive" else -1.0) >= 0.0
    if branch == "positive":  # as everywhere else unless told otherwise
        np.testing.assert_array_equal(inverse_kinematics(arm(*lengths), target), angles)


test_a_wrong_table_is_refused = refused(
    ([(0.0, 1.0, 1.0)], "times must increase from 0, two at least"),
    ([(0.5, 1.0, 1.0), (1.0, 2.0, 2.0), (2.0, 1.0, 1.0)], "times must increase from 0"),
    ([(0.0, 1.0, 1.0), (1.0, 2.0, 2.0), (1.0, 3.0, 2.0), (2.0, 1.0, 1.0)], "times must increase from 0"),
    ([(0.0, 1.0, 1.0), (2.0, 2.0, 2.0), (1.0, 1.0, 1.0)], "times must increase from 0"),
    ([(0.0, 1.0, 1.0), (1.0, np.nan, 2.0), (2.0, 1.0, 1.0)], r"table\[1, 1\] = nan: must be finite"),
    ([(0.0, 1.0, 1.0), (1.0, 2.0, -2e6)], r"table\[1, 2\] = -2000000\.0: must be at most 1e\+06 .*\[m\]"),
    ([(0.0, 1.0), (1.0, 1.0)], r"table: must have shape \(n, 3\), got \(2, 2\)"),
    ([], r"table: must have shape \(n, 3\)"),
    ("square", "table = .square.: must be an array of real numbers"),
    by=ReferencePath,
)


def test_a_path_keeps_its_own_table() -> None:
    table = np.array([(0.0, 1.0, 1.0), (1.0, 2.0, 1.0), (3.0, 1.0, 1.0)])
    path = ReferencePath(table)
    table[:] = 0.0
    np.testing.assert_array_equal(path.position([0.5, 2.0]), [(1.5, 1.0), (1.5, 1.0)])
    np.testing.assert_array_equal(path.velocity([0.5, 2.0]), [(1.0, 0.0), (-0.5, 0.0)])


@settings(max_examples=10)
@given(st.floats(0.05, 1.0), st.floats(0.0, 1.0))
@example(1.0, 0.0)  # a corner
@example(0.05, 0.25)
def test_a_path_with_blended_corners_is_its_running_mean(corner_time: float, share: float) -> None:
    sharp = square(SquareParameters(lap_time=4.0))
    smooth, count = rounded(sharp, corner_time), 4000
    place = round(share * (len(smooth.table) - 1))
    window = corner_time * ((np.arange(count) + 0.5) / count - 0.5)
    mean = sharp.position(np.mod(smooth.table[place, 0] + window, 4.0)).mean(axis=0)
    # the midpoint rule errs in the cell with the corner alone, by less than its turn of the velocity times its width
    np.testing.assert_allclose(smooth.table[place, 1:], mean, atol=12.6 * 2**0.5 * corner_time / count**2 + 1e-12)


test_wrong_way_points_are_refused = refused(
    ([(1.0, 2.0, 3.0, 4.0)] * 4, r"waypoints: must have shape \(n, 2\) or \(n, 3\), got \(4, 4\)"),
    ([(0.0, 0.0), (1.0, 0.0), (1.0, 1e-20)], r"waypoints\[1\]: must be more than 1e-20 m from the next"),
    ([(0.0, 1.0, 1.0), (1.0, 2e6, 2.0)], r"waypoints\[1, 1\] = 2000000\.0: must be at most 1e\+06"),
    by=lambda points: way_points(SquareParameters(), points),
)


def test_a_blended_corner_has_80_sides_and_a_lap_16000_at_most() -> None:
    assert [len(rounded(PAPER, corner_time).table) for corner_time in (0.4, 0.02)] == [3201, 16_001]


def test_no_time_leaves_the_path_as_it_is_and_too_long_a_one_is_refused() -> None:
    assert rounded(PAPER, 0.0) is PAPER
    with pytest.raises(ValueError, match=r"corner_time = 4\.1 s: must be at most 4 s, that of the shortest side"):
        rounded(PAPER, 4.1)
