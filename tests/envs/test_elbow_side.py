"""The elbow's side in infos, metrics and observations."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flexarm_env import ArmParameters, FlexibleArm
from flexarm_env.codegen.declarations import plain_python
from flexarm_env.episode import features, observe
from flexarm_env.episode.step import PROGRAMS
from flexarm_env.kernels.entries import Setting, extent, setting
from flexarm_env.kernels.layout import row
from flexarm_env.kernels.variants import Variant
from flexarm_env.metrics import elbow_changes
from flexarm_env.physics.inverse_kinematics import STRAIGHT
from tests.support.envs import FREE, bare, played


def test_changes_of_the_elbows_side_are_counted() -> None:
    """An elbow swings through the straight arm; a new episode counts from 0."""
    env = bare(**FREE)
    state = np.zeros(12)
    state[[1, 7]] = 0.5, -10.0
    _, infos = played(env, np.zeros((20, 2)), state=state)
    angles, sides, changes = infos["state"][:, 1], infos["elbow_side"], infos["elbow_changes"]
    np.testing.assert_array_equal(changes, np.cumsum([0.0, *(np.diff(sides) != 0.0)]))
    assert changes[-1] == 1.0
    bent = np.abs(angles) > 1.001 * STRAIGHT
    np.testing.assert_array_equal(sides[bent], np.sign(angles[bent]))
    begun = env.reset(options={"state": -state})[1]
    assert (begun["elbow_side"], begun["elbow_changes"]) == (-1.0, 0.0)


@given(st.lists(st.sampled_from([-2.0, -0.3, -0.04, 0.0, 0.03, 0.4, 1.5, 3.12, 3.3, 6.1, np.nan]), max_size=20))
def test_infos_and_metrics_count_the_elbows_sides_alike(angles: list[float]) -> None:
    """The driver in plain Python; an elbow that is nearly straight or folded stays on the side where it was."""
    of = Variant(PROGRAMS["torque"], 1, True, 2)
    arena = np.zeros((extent(of.rows), 2))
    with plain_python(of):
        for angle in angles:
            arena[row.STATE + 1] = angle, -angle
            observe.note_elbow(arena)
        changes, sides = arena[row.ELBOW_CHANGES], arena[row.ELBOW_SIDE]
    finite = [angle for angle in angles if np.isfinite(angle)]
    state = np.zeros((len(finite), 8))
    state[:, 1] = finite
    none, time = np.zeros((len(finite), 2)), np.arange(float(len(finite)))
    arm = FlexibleArm(ArmParameters.linear(modes_per_link=1))
    counted = len(elbow_changes(arm.record(time, state, none, reference=none))) if len(finite) > 1 else 0
    np.testing.assert_array_equal(changes, [counted, counted])
    told = [np.sign(np.sin(angle)) for angle in finite if abs(np.sin(angle)) > np.sin(STRAIGHT)]
    np.testing.assert_array_equal(sides, np.array([1.0, -1.0]) * (told[-1] if told else 0.0))


@pytest.mark.parametrize("branch", [1.0, -1.0])
def test_the_present_side_is_aimed_at(branch: float) -> None:
    """One lane is on the side of inverse kinematics, one has swung to the other, one has not been bent yet."""
    of = Variant(PROGRAMS["torque"], 1, True, 3)
    arena = np.zeros((extent(of.rows), 3))
    lengths, point, velocity = (4.5, 4.0), (-3.0, 5.0), (1.0, -0.5)
    with plain_python(of):
        settings = np.zeros(extent(Setting.layout(of)))
        settings[setting.LENGTHS : setting.LENGTHS + 2], arena[row.BRANCH] = lengths, branch
        arena[row.REFERENCE : row.REFERENCE + 4] = np.array([*point, *velocity])[:, None]
        arena[row.MEASURED_SIDE] = branch, -branch, 0.0
        features.joint_kernel(arena, *lengths)
        observe.aim_on_present_side(arena, settings)
        joint, present = (arena[first : first + 4] for first in (row.REFERENCE_JOINTS, row.PRESENT_JOINT))
    np.testing.assert_array_equal(present[:, [0, 2]], joint[:, [0, 2]])
    theta1, theta2, rate_1, rate_2 = present[:, 1]
    assert theta2 == pytest.approx(-joint[1, 1], rel=1e-14)
    tip = lengths[0] * np.exp(1j * theta1) + lengths[1] * np.exp(1j * (theta1 + theta2))
    assert (tip.real, tip.imag) == pytest.approx(point, abs=1e-12)
    moved = 1j * (tip * rate_1 + lengths[1] * np.exp(1j * (theta1 + theta2)) * rate_2)
    assert (moved.real, moved.imag) == pytest.approx(velocity, abs=1e-12)
