"""The description of an episode, registered limits shorter than a lap, success, codes of ends."""

import pickle
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from flexarm_agents import FlexArmVecEnv
from flexarm_env import end_reason, run_policy
from flexarm_env.envs.info import Episode, info_keys
from flexarm_env.envs.registration import IDS
from flexarm_env.envs.reset_options import DRAWN
from flexarm_env.envs.settings import Settings
from flexarm_env.envs.single import FlexArmEnv
from flexarm_env.envs.termination import END_CODES, ENDS
from tests.support.envs import CALM, FREE, REACH, SQUARE, make, vector
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
