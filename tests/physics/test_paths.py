"""The reference: the square as a pure function of time, what of it the arm can reach, and the pose it starts from."""

import math
import re
from collections.abc import Sequence
from typing import get_args

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flexarm_env import ArmParameters, FlexibleArm, ReferencePath, SquareParameters, inverse_kinematics, square
from flexarm_env.kernels.imex import chord_at
from flexarm_env.parameters import Corner, Direction, ElbowBranch
from flexarm_env.physics.paths import rounded

CORNERS: dict[str, tuple[float, float]] = {
    "lower left": (-6.3, -6.3),
    "upper left": (-6.3, 6.3),
    "upper right": (6.3, 6.3),
    "lower right": (6.3, -6.3),
}
CLOCKWISE = list(CORNERS)
PAPER = square(SquareParameters())
# Positions are sums and products of two or three numbers of size 10: a few units in the last place.
ROUNDING = 1e-14


@pytest.mark.parametrize("direction", get_args(Direction))
@pytest.mark.parametrize("start", get_args(Corner))
def test_start_corner_and_direction(start: Corner, direction: Direction) -> None:
    order = CLOCKWISE if direction == "clockwise" else CLOCKWISE[::-1]
    first = order.index(start)
    expected = [CORNERS[order[(first + k) % 4]] for k in range(5)]
    path = square(SquareParameters(start_corner=start, direction=direction))
    np.testing.assert_array_equal(path.position(4.0 * np.arange(5)), expected)
    turn = np.cross(np.append(path.velocity(1.0), 0.0), np.append(path.velocity(5.0), 0.0))[2]
    assert (turn < 0.0) == (direction == "clockwise")


@given(st.floats(0.5, 12.0), st.floats(0.5, 60.0), st.floats(0.0, 1.0), st.integers(0, 3))
def test_every_point_is_on_its_side_at_constant_speed(side: float, lap_time: float, along: float, k: int) -> None:
    path = square(SquareParameters(side=side, lap_time=lap_time))
    time = 0.25 * lap_time * (k + min(along, 0.999))
    position, velocity = path.position(time), path.velocity(time)
    assert np.abs(position).max() == pytest.approx(0.5 * side, rel=ROUNDING)
    assert np.linalg.norm(velocity) == pytest.approx(4.0 * side / lap_time, rel=ROUNDING)
    corners = np.array(list(CORNERS.values())) * side / 12.6
    travelled = np.linalg.norm(position - corners[k])
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


def test_evaluating_leaves_no_trace() -> None:
    times = np.linspace(-1.0, 40.0, 1001)
    first = PAPER.position(times)
    shuffled = np.random.default_rng(0).permutation(len(times))
    np.testing.assert_array_equal(PAPER.position(times[shuffled]), first[shuffled])
    first[:] = 0.0
    assert np.abs(PAPER.position(times)).max() == 6.3
    assert PAPER.position(times.reshape(7, 11, 13)).shape == (7, 11, 13, 2)


@given(st.floats(-1.0, 33.0), st.floats(1e-5, 1e-2))
def test_a_step_over_a_corner_takes_the_chord(time: float, step: float) -> None:
    """What the integrator commands: the position where the step begins, and the mean velocity over it."""
    x, y, vx, vy = chord_at(PAPER.rows[None], 0, time, step, 0.0)
    np.testing.assert_array_equal((x, y), PAPER.position(time))
    end = (x + vx * step, y + vy * step)
    np.testing.assert_allclose(end, PAPER.position(time + step), atol=ROUNDING)


def test_an_unreachable_corner_says_by_how_much() -> None:
    arm = ArmParameters.linear(link_lengths=(4.0, 4.0))
    miss = math.hypot(6.3, 6.3) - 8.0  # 0.9095 m
    with pytest.raises(ValueError, match=re.escape(f"misses it by {miss:.4g} m")) as caught:
        PAPER.check_reach(arm)
    assert "(-6.3, -6.3)" in str(caught.value)


def test_the_farthest_way_point_is_the_one_named() -> None:
    path = ReferencePath([(0.0, 1.0, 0.0), (1.0, 9.5, 0.0), (2.0, 0.0, 9.2), (3.0, 1.0, 0.0)])
    with pytest.raises(ValueError, match=r"\(9\.5, 0\.0\) m is 9\.5 m .* misses it by 0\.5 m"):
        path.check_reach(ArmParameters.linear())


def test_a_side_through_the_hole_of_unequal_links_says_by_how_much() -> None:
    """Its corners are all within reach: only the side's nearest point, 3 m from the shoulder, is not."""
    arm = ArmParameters.linear(link_lengths=(8.0, 4.5))
    path = square(SquareParameters(side=6.0))
    assert all(3.5 < np.linalg.norm(corner) < 12.5 for corner in path.table[:, 1:])
    with pytest.raises(ValueError, match=r"passes the shoulder at 3 m.* 3\.5 m away, which misses it by 0\.5 m"):
        path.check_reach(arm)
    square(SquareParameters(side=7.1)).check_reach(arm)


def test_reach_is_decided_at_its_edge() -> None:
    """A quadrilateral that touches the reach is reachable, one that is longer by a part in 10^12 is not."""
    corner = math.hypot(6.3, 6.3)
    PAPER.check_reach(ArmParameters.linear(link_lengths=(corner / 2 * (1 + 1e-12), corner / 2)))
    with pytest.raises(ValueError, match="misses it"):
        PAPER.check_reach(ArmParameters.linear(link_lengths=(corner / 2 * (1 - 1e-12), corner / 2)))


@given(
    lengths=st.tuples(st.floats(0.5, 10.0), st.floats(0.5, 10.0)),
    share=st.floats(0.0, 1.0),
    bearing=st.floats(-math.pi, math.pi),
    branch=st.sampled_from(get_args(ElbowBranch)),
)
def test_inverse_kinematics_round_trip(
    lengths: tuple[float, float], share: float, bearing: float, branch: ElbowBranch
) -> None:
    arm = ArmParameters.linear(link_lengths=lengths, modes_per_link=1)
    nearest = abs(lengths[0] - lengths[1])
    distance = nearest + share * (sum(lengths) - nearest)
    target = distance * np.array([math.cos(bearing), math.sin(bearing)])
    angles = inverse_kinematics(arm, target, branch)
    assert angles.shape == (2,)
    q = np.concatenate([angles, np.zeros(2)])
    # the half-angle formula keeps its digits at both edges of the reach, where the cosine rule loses half of them
    np.testing.assert_allclose(FlexibleArm(arm).tip(q), target, atol=1e-14 * sum(lengths))
    assert angles[1] * (1.0 if branch == "positive" else -1.0) >= 0.0
    if branch == "positive":  # as everywhere else unless told otherwise
        np.testing.assert_array_equal(inverse_kinematics(arm, target), angles)


def test_inverse_kinematics_refuses_what_is_out_of_reach() -> None:
    arm = ArmParameters.linear(link_lengths=(5.0, 3.0))
    with pytest.raises(ValueError, match=r"point = \(9\.0, 0\.0\) m: out of the tip's reach by 1 m"):
        inverse_kinematics(arm, (9.0, 0.0), "positive")
    with pytest.raises(ValueError, match=r"point = \(0\.0, 1\.5\) m: out of the tip's reach by 0\.5 m"):
        inverse_kinematics(arm, (0.0, 1.5), "positive")
    for point in [(np.nan, 0.0), (1.0, 2.0, 3.0)]:
        with pytest.raises(ValueError, match="point"):
            inverse_kinematics(arm, point, "positive")


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ([(0.0, 1.0, 1.0)], "times must increase from 0, two at least"),
        ([(0.5, 1.0, 1.0), (1.0, 2.0, 2.0), (2.0, 1.0, 1.0)], "times must increase from 0"),
        ([(0.0, 1.0, 1.0), (1.0, 2.0, 2.0), (1.0, 3.0, 2.0), (2.0, 1.0, 1.0)], "times must increase from 0"),
        ([(0.0, 1.0, 1.0), (2.0, 2.0, 2.0), (1.0, 1.0, 1.0)], "times must increase from 0"),
        ([(0.0, 1.0, 1.0), (1.0, np.nan, 2.0), (2.0, 1.0, 1.0)], r"table\[1, 1\] = nan: must be finite"),
        ([(0.0, 1.0), (1.0, 1.0)], r"table: must have shape \(n, 3\), got \(2, 2\)"),
        ([], r"table: must have shape \(n, 3\)"),
        ("square", "table = .square.: must be an array of real numbers"),
    ],
)
def test_a_wrong_table_is_refused(table: Sequence[tuple[float, ...]], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        ReferencePath(table)


def test_a_path_keeps_its_own_table() -> None:
    table = np.array([(0.0, 1.0, 1.0), (1.0, 2.0, 1.0), (3.0, 1.0, 1.0)])
    path = ReferencePath(table)
    table[:] = 0.0
    np.testing.assert_array_equal(path.position([0.5, 2.0]), [(1.5, 1.0), (1.5, 1.0)])
    np.testing.assert_array_equal(path.velocity([0.5, 2.0]), [(1.0, 0.0), (-0.5, 0.0)])


@given(st.floats(0.05, 1.0), st.floats(0.0, 1.0))
def test_a_path_with_blended_corners_is_its_running_mean(corner_time: float, share: float) -> None:
    sharp = square(SquareParameters(lap_time=4.0))
    smooth, count = rounded(sharp, corner_time), 4000
    place = round(share * (len(smooth.table) - 1))
    window = corner_time * ((np.arange(count) + 0.5) / count - 0.5)
    mean = sharp.position(np.mod(smooth.table[place, 0] + window, 4.0)).mean(axis=0)
    # the midpoint rule errs in the cell with the corner alone, by less than its turn of the velocity times its width
    np.testing.assert_allclose(smooth.table[place, 1:], mean, atol=12.6 * 2**0.5 * corner_time / count**2 + 1e-12)


@given(st.floats(0.02, 3.5))
def test_the_velocity_turns_at_a_constant_rate(corner_time: float) -> None:
    """The turn of 90 degrees at 3.15 m/s, over the blend; between two rows the velocity jumps by so much."""
    rows = rounded(PAPER, corner_time).rows
    jumps = np.linalg.norm(np.diff(rows[:, 3:], axis=0), axis=1)
    turn = 3.15 * 2**0.5
    assert jumps.max() / np.diff(rows[:2, 0])[0] == pytest.approx(turn / corner_time, rel=1e-6)
    assert jumps.sum() == pytest.approx(4.0 * turn, rel=1e-3)  # the sides in between are straight
    away = np.linalg.norm(rounded(PAPER, corner_time).position(4.0) - PAPER.position(4.0))
    # goes to the sharp corner with the time; a chord is off the curve by an eighth of its time squared times the rate
    assert away == pytest.approx(turn * corner_time / 8.0, abs=turn * corner_time / (8.0 * 80.0**2))


def test_no_time_leaves_the_path_as_it_is_and_too_long_a_one_is_refused() -> None:
    assert rounded(PAPER, 0.0) is PAPER
    with pytest.raises(ValueError, match=r"corner_time = 4\.1 s: must be at most 4 s, that of the shortest side"):
        rounded(PAPER, 4.1)
