"""The elbow's side in infos, metrics and observations."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from flexarm_env import ArmParameters, FlexibleArm
from flexarm_env.codegen.declarations import plain_python
from flexarm_env.episode import observe
from flexarm_env.episode.step import PROGRAMS
from flexarm_env.kernels.entries import extent
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
