"""The adapter for stable-baselines3: step by step what `DummyVecEnv` gives over single environments."""

import warnings
from collections.abc import Iterator
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.vector import AutoresetMode
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor

from flexarm_agents import FlexArmVecEnv
from flexarm_env.envs.termination import END_CODES
from flexarm_env.envs.vector import FlexArmVectorEnv
from tests.support.envs import assert_same

ID = "flexarm_env:FlexArm/Square-v0"
COUNT, LIMIT = 5, 23
# Errors of 0.4 m end an episode soon under random torque: every kind of end comes within some hundred steps.
OPTIONS: dict[str, Any] = {"error_limit": 0.4, "randomisation": {"payload_mass": (0.0, 0.5)}, "noise": 1e-3}


def pair(environment: str = ID) -> tuple[FlexArmVecEnv, DummyVecEnv]:
    def make() -> gymnasium.Env[Any, Any]:
        return gymnasium.make(environment, max_episode_steps=LIMIT, **OPTIONS)

    ours = FlexArmVecEnv.make(environment, COUNT, "all", max_episode_steps=LIMIT, **OPTIONS)
    return ours, DummyVecEnv([make] * COUNT)


@pytest.fixture
def env() -> Iterator[FlexArmVecEnv]:
    made = FlexArmVecEnv.make(ID, COUNT, max_episode_steps=LIMIT, **OPTIONS)
    yield made
    made.close()


# Kernels with noise that no other test compiles.
OTHERS = [pytest.param(f"{name}-v0", marks=pytest.mark.slow) for name in ("SquareGain", "SquareResidual", "Reach")]


@pytest.mark.parametrize("name", ["Square-v0", *OTHERS])
def test_step_by_step_as_dummy_vec_env(name: str) -> None:
    ours, theirs = pair(f"flexarm_env:FlexArm/{name}")
    assert ours.observation_space == theirs.observation_space
    assert ours.action_space == theirs.action_space
    rng, ends = np.random.default_rng(3), set()
    for start in (None, "corner"):  # seeds and options go to the next reset only
        for env in (ours, theirs):
            env.seed(11)
            env.set_options({"start": start} if start else None)
        assert_same(ours.reset(), theirs.reset())
        for _ in range(3 * LIMIT):
            torque = np.clip(rng.normal(size=(COUNT, *ours.action_space.shape)), -1, 1).astype(np.float32)
            mine, other = ours.step(torque), theirs.step(torque)
            assert_same(mine, other)
            assert_same(ours.reset_infos, theirs.reset_infos)
            ends |= {info["TimeLimit.truncated"] for info, done in zip(mine[3], mine[2], strict=True) if done}
    assert True in ends
    if name.startswith("Square") and name != "SquareGain-v0":
        assert False in ends  # ended by the error limit, too


def test_a_limit_reached_in_the_step_that_ends_an_episode_is_no_truncation() -> None:
    """Truncated and terminated at once: the end is real, nothing may be bootstrapped."""
    options: dict[str, Any] = {"error_limit": 1e-6, "max_episode_steps": 1}
    env = FlexArmVecEnv.make(ID, COUNT, **options)
    env.seed(0)
    env.reset()
    _, _, dones, infos = env.step(np.ones((COUNT, 2), dtype=np.float32))
    assert dones.all()
    assert all(info["TimeLimit.truncated"] is False and info["end_code"] == END_CODES["error"] for info in infos)


def test_only_what_ended_carries_an_info() -> None:
    some, every = FlexArmVecEnv.make(ID, COUNT, max_episode_steps=LIMIT, **OPTIONS), pair()[0]
    rng = np.random.default_rng(0)
    for env in (some, every):
        env.seed(1)
        env.reset()
    for _ in range(2 * LIMIT):
        torque = rng.uniform(-1.0, 1.0, (COUNT, 2)).astype(np.float32)
        mine, all_infos = some.step(torque), every.step(torque)
        for done, info, full in zip(mine[2], mine[3], all_infos[3], strict=True):
            assert_same(info, full if done else {})


def test_options_of_single_environments() -> None:
    ours, theirs = pair()
    state = np.zeros(16)
    wanted = [{"start": "corner"}, {}, {"time": 3.0}, {"start": "corner"}, {"state": state}]
    for options in (wanted, wanted, None, {"state": state}, [{}] * COUNT):
        for env in (ours, theirs):
            if options is wanted:
                env.seed(5)
            env.set_options(options)
        np.testing.assert_array_equal(ours.reset(), theirs.reset())
        assert_same(ours.reset_infos, theirs.reset_infos)
    for env in (ours, theirs):
        env.set_options(wanted)  # no new seeds: the generators go on
    np.testing.assert_array_equal(ours.reset(), theirs.reset())


def test_what_the_environments_are_asked(env: FlexArmVecEnv) -> None:
    single = gymnasium.make(ID, **OPTIONS).unwrapped
    assert env.get_attr("observation_space") == [single.observation_space] * COUNT
    assert env.get_attr("action_space", [1, 3]) == [single.action_space] * 2
    assert env.get_attr("observation_blocks", 2) == [single.observation_blocks]
    assert env.has_attr("settings")
    assert not env.has_attr("gain_limit")  # the action is no gain
    assert env.env_method("get_wrapper_attr", "lap_steps", indices=0) == [1600]
    assert env.env_method("has_wrapper_attr", "lap_steps") == [True] * COUNT
    assert env.env_is_wrapped(Monitor) == [False] * COUNT
    assert env.env_is_wrapped(Monitor, indices=[0, 2]) == [False] * 2
    env.set_attr("note", "kept")
    assert env.get_attr("note", 0) == ["kept"]
    with pytest.raises(AttributeError, match=r"method_name = 'compute_reward': must be one of 'render', 'reset'"):
        env.env_method("compute_reward")


def test_options_are_not_set_in_vain(env: FlexArmVecEnv) -> None:
    with pytest.raises(AttributeError, match=r"attr_name = 'reward_weights': an option.*set_env.*set_options"):
        VecMonitor(env).set_attr("reward_weights", {"effort": 1.0})
    with pytest.raises(AttributeError, match=r"'randomization': no such attribute; did you mean 'randomisation'\?"):
        env.set_attr("randomization", {"payload_mass": (0.0, 0.0)})
    env.set_attr("randomisation", {"payload_mass": (0.0, 0.0)})
    env.set_options({"parameters": {"delay": 0.02}})
    env.reset()
    assert [episode.parameters["payload_mass"] for episode in env.get_attr("episode")] == [0.0] * COUNT
    assert [episode.parameters["delay"] for episode in env.get_attr("episode")] == [0.02] * COUNT


def test_options_of_later_episodes_are_set_through_a_wrapper(env: FlexArmVecEnv) -> None:
    VecMonitor(env).env_method("set_options", {"start": "corner"})
    for _ in range(3):
        env.reset()
        assert [episode.start_time for episode in env.get_attr("episode")] == [0.0] * COUNT
    for method, value in ((env.env_method, "set_options"), (env.set_attr, "note")):
        with pytest.raises(ValueError, match=r"indices = 1: must be None"):
            method(value, {}, indices=1)


@pytest.mark.parametrize(("threads", "chosen", "warns"), [(2, None, 1), (2, "2", 0), (1, None, 0)])
def test_threads_that_wait_for_each_other(
    env: FlexArmVecEnv, monkeypatch: pytest.MonkeyPatch, threads: int, chosen: str | None, warns: int
) -> None:
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    if chosen is not None:
        monkeypatch.setenv("OMP_NUM_THREADS", chosen)
    monkeypatch.setattr(torch, "get_num_threads", lambda: threads)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        for _ in range(2):
            env.reset()
    assert ["set_num_threads(1)" in str(one.message) for one in caught] == [True] * warns


def test_reset_as_a_method_of_some(env: FlexArmVecEnv) -> None:
    single = gymnasium.make(ID, max_episode_steps=LIMIT, **OPTIONS)
    env.seed(0)
    before = env.reset()
    (first, second) = env.env_method("reset", indices=[1, 4], seed=9, options={"start": "corner"})
    expected, info = single.reset(seed=9, options={"start": "corner"})
    for observation, own in (first, second):
        np.testing.assert_array_equal(observation, expected)
        assert_same(own, info)
    after, *_ = env.step(np.zeros((COUNT, 2), dtype=np.float32))
    assert after.shape == before.shape


def test_pictures() -> None:
    pytest.importorskip("pygame")
    env = FlexArmVecEnv.make(ID, 2, render_mode="rgb_array")
    env.reset()
    images = env.get_images()
    assert len(images) == 2
    one, tiled = np.array(images[0]), np.array(env.render())
    assert one.dtype == np.uint8
    assert tiled.shape == (2 * one.shape[0], one.shape[1], 3)
    np.testing.assert_array_equal(env.env_method("render", indices=1)[0], images[1])
    env.close()
    assert list(FlexArmVecEnv.make(ID, 2).get_images()) == [None, None]


def test_what_is_refused(env: FlexArmVecEnv) -> None:
    with pytest.raises(TypeError, match=r"env = .*: must be a FlexArmVectorEnv"):
        FlexArmVecEnv(gymnasium.make(ID))  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"autoreset_mode = 'NextStep': must be 'SameStep'"):
        FlexArmVecEnv(FlexArmVectorEnv(2))
    with pytest.raises(ValueError, match=r"infos = 'some': must be one of 'final', 'all'"):
        FlexArmVecEnv(FlexArmVectorEnv(2, autoreset_mode=AutoresetMode.SAME_STEP), infos="some")  # type: ignore[arg-type]
    env.set_options([{}])
    with pytest.raises(ValueError, match=r"options: must be one mapping or 5, one for each, got 1"):
        env.reset()
    with pytest.raises(RuntimeError, match="step_async"):
        env.step_wait()
    with pytest.raises(RuntimeError, match="before reset"):
        env.step(np.zeros((COUNT, 2)))
    with pytest.raises(ValueError, match=r"environment = 'CartPole-v1': must be one of 'FlexArm/Carry-v0', "):
        FlexArmVecEnv.make("CartPole-v1", 2)
