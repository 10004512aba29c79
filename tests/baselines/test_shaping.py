"""Shapers and shaped references, and the joint angles of a moving point."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flexarm_baselines.joint_space.reference import joint_motion, nearest_turn
from flexarm_baselines.joint_space.shaping import SHAPERS, TOLERATED, ShapedReference, impulses, residual
from flexarm_env import ArmParameters, FlexibleArm, SquareParameters, square
from tests.support.refusals import refused

PATH = square(SquareParameters())


@given(st.sampled_from(SHAPERS), st.floats(0.5, 50.0), st.floats(0.0, 0.5))
def test_amplitudes_add_up_to_one(shaper: str, frequency: float, damping: float) -> None:
    train = impulses(shaper, frequency, damping)
    assert train.amplitudes.sum() == pytest.approx(1.0, rel=1e-14)
    assert np.all(train.amplitudes > 0.0)
    assert train.times[0] == 0.0
    assert 0.0 <= train.delay <= train.times[-1]


@given(st.floats(0.5, 50.0), st.floats(0.0, 0.3))
def test_what_is_left_of_the_vibration(frequency: float, damping: float) -> None:
    """ZV and ZVD leave nothing at their frequency; EI leaves what it tolerates, undamped. ZVD is flat there."""
    for shaper in ("ZV", "ZVD"):
        assert residual(impulses(shaper, frequency, damping), frequency, damping) < 1e-12
    assert residual(impulses("none", frequency, damping), frequency, damping) == pytest.approx(1.0)
    assert residual(impulses("EI", frequency), frequency) == pytest.approx(TOLERATED, rel=1e-9)
    near = frequency * np.array([0.9, 1.1])
    assert np.all(residual(impulses("ZVD", frequency), near) < 0.3 * residual(impulses("ZV", frequency), near))


def windowed(path: Any, time: np.ndarray) -> np.ndarray:
    """Sum a path finely over a triangle of 0.6 s; the error is of second order in the sum's step."""
    shift = np.linspace(0.0, 0.6, 6001)
    weight = np.minimum(shift, 0.6 - shift)
    return np.einsum("k,nki->ni", weight / weight.sum(), path.position(time[:, None] - shift))


def test_a_windowed_reference_is_the_convolution() -> None:
    shaped = ShapedReference(PATH, impulses("none", 1.0), window=0.3)
    time = np.array([0.0, 0.1, 0.45, 3.9, 4.1, 4.5, 15.9])
    assert shaped.position(time) == pytest.approx(windowed(PATH, time), abs=1e-6)


def test_a_window_that_is_applied_four_times() -> None:
    """As twice the window of the doubly windowed reference; centred, it is symmetric about a corner's instant."""
    once = ShapedReference(PATH, impulses("none", 1.0), window=0.3, times=4)
    twice = ShapedReference(PATH, impulses("none", 1.0), window=0.3)
    time = np.array([0.2, 4.3, 8.9, 15.5])
    assert once.position(time) == pytest.approx(windowed(twice, time), abs=1e-6)
    assert once.centre == pytest.approx(0.6)
    centred = replace(once, lead=once.centre)
    before, after = (centred.position(time) - PATH.position(4.0) for time in (3.8, 4.2))
    assert before == pytest.approx(-after[::-1], abs=1e-7)


def test_later_laps_are_alike() -> None:
    shaped = ShapedReference(PATH, impulses("ZV", 5.0), window=0.3, lead=0.4)
    time = np.linspace(16.0, 32.0, 50)
    assert shaped.position(time + 32.0) == pytest.approx(shaped.position(time), abs=1e-9)


@pytest.mark.parametrize("window", [0.2, 0.5])
def test_velocity_and_acceleration_are_derivatives(window: float) -> None:
    shaped = ShapedReference(PATH, impulses("ZVD", 5.0), window, lead=0.2)
    time, h = np.linspace(0.05, 15.0, 301) + 1e-3, 1e-4
    # the acceleration is piecewise linear in time, so that second differences are exact but for its kinks
    assert shaped.velocity(time) == pytest.approx(
        (shaped.position(time + h) - shaped.position(time - h)) / (2.0 * h), abs=1e-4
    )
    assert shaped.acceleration(time) == pytest.approx(
        (shaped.velocity(time + h) - shaped.velocity(time - h)) / (2.0 * h), abs=2e-2
    )


def test_without_window_it_is_the_shaped_polyline() -> None:
    train = impulses("ZV", 6.0)
    shaped, time = ShapedReference(PATH, train), np.linspace(0.0, 16.0, 50)
    expected = sum(a * PATH.position(time - t) for t, a in zip(train.times, train.amplitudes, strict=True))
    assert shaped.position(time) == pytest.approx(expected, abs=1e-12)
    assert ShapedReference(PATH, impulses("none", 1.0)).acceleration(time) == pytest.approx(np.zeros((50, 2)))


test_refusals = refused(
    (lambda: impulses("UM", 1.0), "shaper = 'UM'"),
    (lambda: impulses("ZV", 1.0, "much"), "TypeError: damping = 'much': must be"),  # type: ignore[arg-type]
    (lambda: impulses("ZV", 0.0), r"frequency = 0\.0"),
    (lambda: ShapedReference(PATH, impulses("ZV", 1.0), window=-1.0), r"window = -1\.0"),
)


ARM = ArmParameters.linear()


def along(time: np.ndarray, side: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return angles, rates and accelerations of the arm whose tip is on an ellipse well within reach."""
    position = np.stack([3.0 + 2.0 * np.cos(time), 3.5 * np.sin(time)], axis=-1)
    velocity = np.stack([-2.0 * np.sin(time), 3.5 * np.cos(time)], axis=-1)
    acceleration = np.stack([-2.0 * np.cos(time), -3.5 * np.sin(time)], axis=-1)
    return tuple(joint_motion(ARM, position, velocity, acceleration, np.full(len(time), side)))


@given(st.floats(-3.0, 3.0), st.sampled_from([-1.0, 1.0]))
def test_the_tip_is_at_the_point_with_its_elbow_on_the_side(moment: float, side: float) -> None:
    angles, *_ = along(np.array([moment]), side)
    q = np.zeros((1, 6))
    q[:, :2] = angles
    expected = [[3.0 + 2.0 * np.cos(moment), 3.5 * np.sin(moment)]]
    assert FlexibleArm(ArmParameters.linear()).rigid_tip(q) == pytest.approx(np.array(expected), abs=1e-12)
    assert np.sign(angles[0, 1]) == side


@given(st.floats(-3.0, 3.0), st.sampled_from([-1.0, 1.0]))
def test_rates_and_accelerations_are_derivatives(moment: float, side: float) -> None:
    """But for the damping of the inverse, 1e-4 relative on a well bent arm."""
    h = 1e-4
    angles, rates, accelerations = along(moment + h * np.array([-1.0, 0.0, 1.0]), side)
    angles = nearest_turn(angles, angles[1])
    assert rates[1] == pytest.approx((angles[2] - angles[0]) / (2.0 * h), rel=3e-3, abs=3e-3)
    assert accelerations[1] == pytest.approx((rates[2] - rates[0]) / (2.0 * h), rel=2e-2, abs=2e-2)


def test_beyond_the_reach_the_arm_points_at_the_point() -> None:
    far = np.array([[20.0, 20.0]])
    motion = joint_motion(ARM, far, np.ones((1, 2)), np.zeros((1, 2)), np.ones(1))
    assert motion.angles == pytest.approx(np.array([[np.pi / 4.0, 0.0]]))
    assert np.isfinite(motion.rates).all()
    assert np.isfinite(motion.accelerations).all()


@given(st.floats(-100.0, 100.0), st.floats(-100.0, 100.0))
def test_nearest_turn(angle: float, other: float) -> None:
    found = nearest_turn(np.array(angle), np.array(other))
    assert abs(found - other) <= np.pi + 1e-9
    assert np.cos(found) == pytest.approx(np.cos(angle), abs=1e-9)
