"""Infos: flat, the same keys always, of one environment and of a batch; what describes an episode; how episodes end."""

from __future__ import annotations

import copy
import math
import pickle
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from hypothesis import given
from hypothesis import strategies as st

from flexarm_agents import FlexArmVecEnv
from flexarm_baselines import IFDC
from flexarm_env import ArmParameters, FlexibleArm, end_reason, run_policy
from flexarm_env.codegen.declarations import plain_python
from flexarm_env.envs.info import Episode, info_keys
from flexarm_env.envs.registration import IDS
from flexarm_env.envs.reset_options import DRAWN
from flexarm_env.envs.single import FlexArmEnv
from flexarm_env.envs.termination import END_CODES, ENDS
from flexarm_env.episode import observe, recorded
from flexarm_env.episode.step import PROGRAMS
from flexarm_env.kernels.entries import Setting, extent, setting
from flexarm_env.kernels.layout import row
from flexarm_env.kernels.variants import Variant
from flexarm_env.metrics import elbow_changes
from flexarm_env.physics.inverse_kinematics import STRAIGHT
from tests.support.envs import GAIN, SQUARE, bare, in_fresh_process, kinds_of, make, terms_of, vector
from tests.support.refusals import refuses

REACH = "FlexArm/Reach-v0"
RANDOM_EPISODES: dict[str, Any] = {
    "randomisation": {"payload_mass": (0.0, 0.5), "delay": (0.01, 0.05)},
    "reference": ("square", "circle", "line"),
    "start": "mix",
}


# --- structure ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", AutoresetMode)
@pytest.mark.parametrize("env_id", [SQUARE, REACH])
def test_infos_of_a_batch_never_change_their_structure(env_id: str, mode: AutoresetMode) -> None:
    """Libraries lay out their memory by the first info."""
    env = vector(env_id, 3, autoreset_mode=mode, error_limit=0.3, start="corner", max_episode_steps=30)
    infos = env.reset(seed=0)[1]
    begun = kinds_of(infos)
    keys = info_keys(env.settings)
    assert set(begun) == {*keys, *(f"_{name}" for name in keys)}
    ended = 0
    for action in np.random.default_rng(0).uniform(-1.0, 1.0, (70, 3, 2)).astype(np.float32):
        *_, terminated, truncated, infos = env.step(action)
        done = terminated | truncated
        final = infos.pop("final_info", None)
        present = infos.pop("_final_info", np.zeros(3, bool))
        assert ({"final_obs", "_final_obs"} <= set(infos)) == (final is not None)
        infos = {name: value for name, value in infos.items() if "final_obs" not in name}
        assert kinds_of(infos) == begun
        if mode is AutoresetMode.SAME_STEP:
            assert not infos["end_code"].any()
            np.testing.assert_array_equal(present, done)
            if done.any():
                assert kinds_of(final) == begun
                np.testing.assert_array_equal(final["end_code"] != 0.0, terminated)
                np.testing.assert_array_equal(final["_end_code"], done)
        else:
            np.testing.assert_array_equal(infos["end_code"] != 0.0, terminated)
        ended += done.sum()
        if mode is AutoresetMode.DISABLED and done.any():
            again = env.reset(options={"reset_mask": done})[1]
            assert kinds_of(again) == begun
            np.testing.assert_array_equal(again["_time"], done)
    assert ended > 3


@pytest.mark.parametrize("env_id", [SQUARE, REACH])
def test_an_info_holds_numbers_only(env_id: str) -> None:
    env = bare(env_id)
    for info in (env.reset(seed=0)[1], env.step(np.zeros(2, np.float32))[4]):
        for value in info.values():
            assert value.dtype == np.float64  # TorchRL asks each for it
            assert isinstance(value, np.float64 if value.ndim == 0 else np.ndarray)


def test_a_later_step_leaves_an_info_as_it_is() -> None:
    env = bare(REACH)
    infos = [env.reset(seed=0)[1], env.step(np.ones(2, np.float32))[4]]
    kept = copy.deepcopy(infos)
    for _ in range(20):
        env.step(np.ones(2, np.float32))
    for info, before in zip(infos, kept, strict=True):
        for name, value in info.items():
            np.testing.assert_array_equal(value, before[name], err_msg=name)
            assert not np.may_share_memory(value, env.simulator.single_result)


def test_numbers_are_those_of_their_names() -> None:
    env = bare(start="moving")
    begun = env.reset(seed=3)[1]
    assert not any(terms_of(begun).values())
    for _ in range(30):
        _, reward, *_, info = env.step(env.action_space.sample())
        assert info["tip_error"] == pytest.approx(math.dist(info["true_tip"], info["reference"]), rel=1e-13)
        assert sum(terms_of(info).values()) == pytest.approx(reward, rel=1e-13)
        assert info["elbow_side"] == (1.0 if math.sin(info["state"][1]) >= 0.0 else -1.0)  # bent all the time


# --- the elbow ----------------------------------------------------------------------------------------------


def test_changes_of_the_elbows_side_are_counted() -> None:
    """IFDC takes the elbow through the straight arm: metrics and infos count alike; a new episode counts from 0."""
    env = make(GAIN)
    inner = env.unwrapped
    policy = IFDC.for_env(env)
    observation, info = env.reset(seed=0, options={"start": "corner"})
    states, sides, changes = [info["state"]], [info["elbow_side"]], [info["elbow_changes"]]
    for _ in range(900):
        observation, *_, info = env.step(policy.predict(observation)[0])
        states.append(info["state"])
        sides.append(info["elbow_side"])
        changes.append(info["elbow_changes"])
    np.testing.assert_array_equal(changes, np.cumsum([0.0, *(np.diff(sides) != 0.0)]))
    none, time = np.zeros((901, 2)), 0.01 * np.arange(901.0)
    run = inner.arm.record(time, np.array(states), none, reference=none)
    assert changes[-1] == len(elbow_changes(run)) >= 1
    bent = [abs(math.sin(state[1])) > math.sin(1.001 * STRAIGHT) for state in states]
    expected = np.sign(np.sin(np.array(states)[bent, 1]))
    np.testing.assert_array_equal(np.array(sides)[bent], expected)
    assert isinstance(inner, FlexArmEnv)
    state = inner.reset(options={"start": "corner"})[1]["state"]
    state[1] *= -1.0
    begun = inner.reset(options={"state": state})[1]
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
    arm = FlexibleArm(ArmParameters(modes_per_link=1))
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


def test_a_wound_elbow_is_on_the_side_that_it_looks() -> None:
    env = bare()
    for theta2, side in ((0.5, 1.0), (-0.5, -1.0), (0.5 - 2.0 * np.pi, 1.0), (1.5 * np.pi, -1.0)):
        state = np.zeros(2 * env.arm.size)
        state[1] = theta2
        assert env.reset(options={"state": state})[1]["elbow_side"] == side


# --- success ------------------------------------------------------------------------------------------------


def test_success_is_a_lap_with_a_quiet_final_rest() -> None:
    """`Reach`: 1 at the end of the lap only, if the tip was within 2 cm from 12 s to 16 s; no other id has it."""
    assert [name for name in IDS if "is_success" in bare(f"FlexArm/{name}").reset()[1]] == ["Reach-v0"]
    env = make(REACH, error_limit=None, deflection_limit=None)
    inner = env.unwrapped
    assert isinstance(inner, FlexArmEnv)
    still = np.zeros(2, np.float32)
    for late, wanted in ((12.0, 1.0), (12.01, 0.0)):
        # at rest on the resting reference no torque keeps the tip where it is
        env.reset(seed=0, options={"time": late, "start": "corner"})
        seen = []
        truncated = False
        for _ in range(round((16.0 - late) / 0.01)):
            *_, truncated, info = env.step(still)
            seen.append(info["is_success"])
            assert info["tip_error"] < 1e-9
        assert not any(seen[:-1])
        assert seen[-1] == wanted
        assert not truncated
    state = env.reset(seed=0, options={"time": 12.0})[1]["state"]
    env.reset(seed=0, options={"time": 12.0, "state": state + np.eye(len(state))[0] * 0.01})  # 2 cm or more off
    for _ in range(400):
        *_, info = env.step(still)
    assert info["tip_error"] > 0.02
    assert info["is_success"] == 0.0


def test_success_of_a_batch_survives_the_end_of_the_lap() -> None:
    env = vector(REACH, 2, error_limit=None, max_episode_steps=420)
    env.reset(seed=0, options={"time": [12.0, 13.0], "start": "corner"})
    still = np.zeros((2, 2), np.float32)
    for k in range(1, 411):
        infos = env.step(still)[4]
        expected = [1.0, 0.0] if k >= 400 else [0.0, 0.0]
        if k < 401 or infos["is_success"][1] == 0.0:
            np.testing.assert_array_equal(infos["is_success"], expected, f"step {k}")


# --- the end ------------------------------------------------------------------------------------------------


def test_codes_and_reasons() -> None:
    assert [end_reason(code) for code in END_CODES.values()] == list(END_CODES)
    assert list(END_CODES.items())[:6] == [
        ("none", 0),
        ("error", 1),
        ("deflection", 2),
        ("angle", 3),
        ("rate", 4),
        ("diverged", 5),
    ]
    assert set(END_CODES) == {"none", *ENDS}
    assert end_reason(np.float64(2.0)) == "deflection"
    for bad in (6, -1, 1.5, float("nan")):
        with refuses((TypeError, ValueError), "code = "):
            end_reason(bad)


def test_a_truncated_episode_has_the_code_of_none_single_and_batch() -> None:
    """What `Monitor(info_keywords=("end_code",))` asks for is there, however the episode ends."""
    env, batch = make(max_episode_steps=3), vector(SQUARE, 1, max_episode_steps=3)
    env.reset(seed=0)
    batch.reset(seed=0)
    for _ in range(3):
        *_, truncated, info = env.step(np.zeros(2, np.float32))
        *_, ended, infos = batch.step(np.zeros((1, 2), np.float32))
    assert truncated
    assert ended.all()
    assert info["end_code"] == infos["end_code"][0] == 0.0


def test_stable_baselines3s_monitor_keeps_the_code() -> None:
    monitor = pytest.importorskip("stable_baselines3.common.monitor")
    for limits, code in (({"max_episode_steps": 5}, 0.0), ({"error_limit": 1e-6}, END_CODES["error"])):
        env = monitor.Monitor(make(**limits), info_keywords=("end_code",))
        env.reset(seed=0)
        done = False
        while not done:
            *_, terminated, truncated, info = env.step(np.ones(2, np.float32))
            done = terminated or truncated
        assert info["episode"]["end_code"] == code


# --- the episode --------------------------------------------------------------------------------------------


def test_the_episode_is_described_single_and_batch() -> None:
    batch = vector(SQUARE, 4, autoreset_mode="SameStep", max_episode_steps=4, **RANDOM_EPISODES)
    singles = [make(max_episode_steps=4, **RANDOM_EPISODES) for _ in range(4)]
    batch.reset(seed=5)
    for i, env in enumerate(singles):
        env.reset(seed=5 + i)
    for k in range(1, 10):
        described = batch.episode
        assert isinstance(described, Episode)
        assert set(described.parameters) == set(DRAWN)
        assert all(np.shape(each) == (4,) for each in (*described.parameters.values(), *described[1:]))
        for i, env in enumerate(singles):
            assert described.one(i) == env.unwrapped.episode  # type: ignore[attr-defined]
        before = pickle.dumps(described)
        batch.step(np.zeros((4, 2), np.float32))
        for env in singles:
            if env.step(np.zeros(2, np.float32))[3]:
                env.reset()
        assert pickle.dumps(described) == before, k  # it is a copy


def test_before_the_first_reset_there_is_no_episode() -> None:
    for env in (FlexArmEnv(), gym.make_vec(SQUARE, num_envs=2)):
        assert not hasattr(env, "episode")
        with refuses(AttributeError, "episode", "reset()"):
            _ = env.episode  # type: ignore[union-attr]


def test_stable_baselines3_reads_each_environments_own() -> None:
    batch = FlexArmVecEnv.make(SQUARE, 3, **RANDOM_EPISODES)
    batch.seed(1)
    batch.reset()
    found = batch.get_attr("episode", [0, 2])
    assert found == [batch.env.episode.one(0), batch.env.episode.one(2)]
    assert found[0] != found[1]


class NoTorque:
    """No torque."""

    def predict(self, observation: Any, state: Any, start: Any, deterministic: bool) -> Any:
        return np.zeros(2, np.float32), None


# --- reset and time limit -----------------------------------------------------------------------------------


@pytest.mark.parametrize("bad", [{"options": {"bad": 1}}, {"options": {"time": -1.0}}, {"seed": -1}])
def test_a_refused_reset_changes_nothing(bad: dict[str, Any]) -> None:
    env, batch = bare(seed=1, start="moving"), vector(SQUARE, 2, start="moving")
    batch.reset(seed=1)
    twins = bare(seed=1, start="moving"), vector(SQUARE, 2, start="moving")
    twins[1].reset(seed=1)
    for each, twin in zip((env, batch), twins, strict=True):
        with pytest.raises((TypeError, ValueError, gym.error.Error)):
            each.reset(**({"seed": 99} | bad))
        np.testing.assert_array_equal(each.reset()[0], twin.reset()[0])


def test_one_bad_seed_of_several_changes_nothing() -> None:
    batch, twin = vector(SQUARE, 2, start="moving"), vector(SQUARE, 2, start="moving")
    batch.reset(seed=1)
    twin.reset(seed=1)
    with pytest.raises(gym.error.Error):
        batch.reset(seed=[7, -1])
    np.testing.assert_array_equal(batch.reset()[0], twin.reset()[0])


@pytest.mark.parametrize("options", [{"control_period": 0.001}, {"lap_time": 20.0}])
def test_a_registered_limit_below_a_lap_is_told(options: dict[str, Any]) -> None:
    """Where the user gave none; in the batch when it is made, else when the limit has struck."""
    lap = FlexArmEnv(**options).lap_steps
    message = rf"limit of 1600 control periods is shorter than a lap of {lap} .* max_episode_steps={lap}"
    with pytest.warns(UserWarning, match=message):
        gym.make_vec(SQUARE, num_envs=2, **options)
    gym.make_vec(SQUARE, num_envs=2, max_episode_steps=400, **options)
    free = {"error_limit": None, "deflection_limit": None, "start": "corner"} | options
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
        run_policy(make(error_limit=1e-6, **options), NoTorque())
    run_policy(make(error_limit=1e-6, max_episode_steps=lap, **options), NoTorque())


# --- interoperation -----------------------------------------------------------------------------------------


def test_a_batch_says_when_its_episodes_begin() -> None:
    for mode in AutoresetMode:
        env = vector(SQUARE, 1, autoreset_mode=mode)
        assert env.autoreset_mode is mode
        assert env.metadata["autoreset_mode"] is mode


@pytest.mark.parametrize(
    ("option", "near"),
    [
        ("frameskip", "'frame'"),
        ("sensor_delay", "'delay' or 'sensor' or 'second_sensor_delay'"),
        ("gan_limit", "'gain_limit'"),
    ],
)
def test_an_unknown_option_is_refused_in_pythons_words(option: str, near: str) -> None:
    """TorchRL looks for these."""
    expected = rf"__init__\(\) got an unexpected keyword argument '{option}'; did you mean {near}\?"
    for made in (lambda: make(**{option: 1}), lambda: gym.make_vec(SQUARE, num_envs=2, **{option: 1})):
        with pytest.raises(TypeError, match=expected) as caught:
            made()
        assert len(str(caught.value)) < 250


def test_a_very_long_value_is_shortened() -> None:
    with pytest.raises(ValueError, match=r"frame = 'xx.*x\.\.\.x.*: must be one of 'link', 'world'") as caught:
        make(frame="x" * 100_000)
    assert len(str(caught.value)) < 600


HINT = """
import sys
sys.modules["stable_baselines3"] = None
try:
    from flexarm_agents import FlexArmVecEnv
except ModuleNotFoundError as error:
    print(error.name, error)
"""


def test_without_stable_baselines3_the_extra_is_named() -> None:
    told = in_fresh_process(HINT)
    assert told.startswith("stable_baselines3 FlexArmVecEnv: stable_baselines3 is not installed")
    assert 'pip install "flexarm[train]"' in told
    assert 'pip install -e ".[train]"' in told
