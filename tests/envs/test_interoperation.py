"""Libraries that lay out their memory by an environment's first info."""

from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from tests.support.envs import SQUARE, make

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("default")]  # the libraries' own warnings


@pytest.mark.parametrize("read_infos", [False, True])
def test_torchrl_runs_one_environment(read_infos: bool) -> None:
    envs = pytest.importorskip("torchrl.envs", reason="the extra `recipes` brings it")
    env = envs.GymEnv(f"flexarm_env:{SQUARE}")
    if read_infos:
        env.auto_register_info_dict()
    envs.check_env_specs(env)
    found = env.rollout(5)
    assert ("tip_error" in found["next"].keys()) == read_infos  # noqa: SIM118  (a TensorDict)


def test_torchrl_runs_a_batch() -> None:
    envs = pytest.importorskip("torchrl.envs", reason="the extra `recipes` brings it")
    env = envs.GymWrapper(gym.make_vec(SQUARE, num_envs=3, autoreset_mode="SameStep", max_episode_steps=4))
    envs.check_env_specs(env)
    found = env.rollout(12, break_when_any_done=False)
    assert found.batch_size == (3, 12)
    assert found["next", "truncated"].sum() >= 6


def test_minari_records_infos(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    minari = pytest.importorskip("minari", reason="the extra `recipes` brings it")
    pytest.importorskip("jax", reason="needs minari[create], which no extra brings")
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    env: Any = minari.DataCollector(make(max_episode_steps=20), record_infos=True)
    env.reset(seed=0)
    done = False
    while not done:
        *_, terminated, truncated, _ = env.step(np.zeros(2, np.float32))
        done = terminated or truncated
    dataset = env.create_dataset("flexarm/test-v0", algorithm_name="none")
    assert next(iter(dataset)).infos["tip_error"].shape == (dataset.total_steps + 1,)
