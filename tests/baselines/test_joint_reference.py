"""The rigid arm's way along a moving point, against forward kinematics and differences."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flexarm_baselines.joint_space.reference import joint_motion, nearest_turn
from flexarm_env import ArmParameters, FlexibleArm

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
