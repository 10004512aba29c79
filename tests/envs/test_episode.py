"""The description of an episode, registered limits shorter than a lap, success, the elbow's side, codes of ends."""

import pickle
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flexarm_agents import FlexArmVecEnv
from flexarm_env import ArmParameters, FlexibleArm, end_reason, run_policy
from flexarm_env.codegen.declarations import plain_python
from flexarm_env.envs.info import Episode, info_keys
from flexarm_env.envs.registration import IDS
from flexarm_env.envs.reset_options import DRAWN
from flexarm_env.envs.settings import Settings
from flexarm_env.envs.single import FlexArmEnv
from flexarm_env.envs.termination import END_CODES, ENDS
from flexarm_env.episode import observe, recorded
from flexarm_env.episode.step import PROGRAMS
from flexarm_env.kernels.entries import Setting, extent, setting
from flexarm_env.kernels.layout import row
from flexarm_env.kernels.variants import Variant
from flexarm_env.metrics import elbow_changes
from flexarm_env.physics.inverse_kinematics import STRAIGHT
from tests.support.envs import CALM, FREE, REACH, SQUARE, bare, make, played, vector
from tests.support.refusals import refuses

RANDOM_EPISODES = CALM | {"reference": ("square", "circle", "line")}


def test_stable_baselines3_reads_each_environments_own() -> None:
    batch = FlexArmVecEnv.make(SQUARE, 3, **RANDOM_EPISODES)
    batch.reset()
    first, last = batch.get_attr("episode", [0, 2])
    assert first == batch.env.episode.one(0) != last == batch.env.episode.one(2)


def test_the_episode_is_described_by_a_copy() -> None:
    batch = vector(SQUARE, 4, seed=5, autoreset_mode="SameStep", max_episode_steps=4, **RANDOM_EPISODES)
    described = batch.episode
    assert isinstance(described, Episode)
    assert set(described.parameters) == set(DRAWN)
    assert all(np.shape(each) == (4,) for each in (*described.parameters.values(), *described[1:]))
    before = pickle.dumps(described)
    for _ in range(5):
        batch.step(np.zeros((4, 2), np.float32))
    assert pickle.dumps(described) == before
    assert (batch.episode.parameters["payload_mass"] != described.parameters["payload_mass"]).all()


@pytest.mark.parametrize("options", [{"control_period": 0.001}, {"lap_time": 20.0}])
def test_a_registered_limit_below_a_lap_is_told(options: dict[str, Any]) -> None:
    """Where the user gave none; in the batch when it is made, else when the limit has struck."""
    lap = FlexArmEnv(**options).lap_steps
    message = rf"limit of 1600 control periods is shorter than a lap of {lap} .* max_episode_steps={lap}"
    with pytest.warns(UserWarning, match=message):
        gym.make_vec(SQUARE, num_envs=2, **options)
    gym.make_vec(SQUARE, num_envs=2, max_episode_steps=400, **options)
    free = FREE | {"start": "corner"} | options
    for limit, warns in ((None, True), (400, False)):
        env = make(**free) if limit is None else make(max_episode_steps=limit, **free)
        env.reset(seed=0)
        while not env.step(np.zeros(2, np.float32))[3]:
            pass
        if warns:
            with pytest.warns(UserWarning, match=message):
                env.reset()
        env.reset()  # once
    with pytest.warns(UserWarning, match=message):
        run_policy(make(error_limit=1e-6, **options), lambda observation: np.zeros(2))
    run_policy(make(error_limit=1e-6, max_episode_steps=lap, **options), lambda observation: np.zeros(2))


def test_success_is_a_lap_with_a_quiet_final_rest() -> None:
    """`Reach`: 1 at the end of the lap only, with the tip within 2 cm in its last quarter; `Carry` has another one."""
    keys = {name: info_keys(Settings.of(gym.spec(f"FlexArm/{name}").kwargs)) for name in IDS}
    assert [name for name, own in keys.items() if "is_success" in own] == ["Reach-v0", "Carry-v0"]
    env = make(REACH, lap_time=2.0, **FREE)
    still = np.zeros(2, np.float32)
    for late, wanted in ((1.5, 1.0), (1.51, 0.0)):
        # at rest on the resting reference no torque keeps the tip where it is
        env.reset(seed=0, options={"time": late, "start": "corner"})
        infos = [env.step(still)[4] for _ in range(round((2.0 - late) / 0.01))]
        assert max(info["tip_error"] for info in infos) < 1e-9
        assert [info["is_success"] for info in infos] == [0.0] * (len(infos) - 1) + [wanted]
    state = env.reset(seed=0, options={"time": 1.5})[1]["state"]
    env.reset(seed=0, options={"time": 1.5, "state": state + np.eye(len(state))[0] * 0.01})  # 2 cm or more off
    for _ in range(50):
        *_, info = env.step(still)
    assert info["tip_error"] > 0.02
    assert info["is_success"] == 0.0


def test_success_of_a_batch_survives_the_end_of_the_lap() -> None:
    env = vector(REACH, 2, error_limit=None, max_episode_steps=60, lap_time=2.0)
    env.reset(seed=0, options={"time": [1.5, 1.625], "start": "corner"})
    still = np.zeros((2, 2), np.float32)
    for k in range(1, 56):
        infos = env.step(still)[4]
        expected = [1.0, 0.0] if k >= 50 else [0.0, 0.0]
        if k < 51 or infos["is_success"][1] == 0.0:
            np.testing.assert_array_equal(infos["is_success"], expected, f"step {k}")


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
        settings = np.zeros(extent(Setting.layout(of.shape)))
        settings[setting.LENGTHS : setting.LENGTHS + 2], arena[row.BRANCH] = lengths, branch
        arena[row.REFERENCE : row.REFERENCE + 4] = np.array([*point, *velocity])[:, None]
        arena[row.MEASURED_SIDE] = branch, -branch, 0.0
        recorded.joint_kernel(arena, *lengths)
        observe.aim_on_present_side(arena, settings)
        joint, present = (arena[first : first + 4] for first in (row.REFERENCE_JOINTS, row.PRESENT_JOINT))
    np.testing.assert_array_equal(present[:, [0, 2]], joint[:, [0, 2]])
    theta1, theta2, rate_1, rate_2 = present[:, 1]
    assert theta2 == pytest.approx(-joint[1, 1], rel=1e-14)
    tip = lengths[0] * np.exp(1j * theta1) + lengths[1] * np.exp(1j * (theta1 + theta2))
    assert (tip.real, tip.imag) == pytest.approx(point, abs=1e-12)
    moved = 1j * (tip * rate_1 + lengths[1] * np.exp(1j * (theta1 + theta2)) * rate_2)
    assert (moved.real, moved.imag) == pytest.approx(velocity, abs=1e-12)


def test_codes_and_reasons() -> None:
    assert [end_reason(code) for code in END_CODES.values()] == list(END_CODES)
    assert [
        END_CODES[name] for name in ("none", "error", "deflection", "angle", "rate", "diverged", "own", "finished")
    ] == [*range(8)]
    assert set(END_CODES) == {"none", *ENDS}
    assert end_reason(np.float64(2.0)) == "deflection"
    for bad in (8, -1, 1.5, float("nan")):
        with refuses((TypeError, ValueError), "code = "):
            end_reason(bad)
