"""The settings in rl-zoo3's format name real ids and real arguments; PPO's are those of `flexarm train`."""

from __future__ import annotations

import importlib
import inspect
from pathlib import Path
from typing import Any

import pytest
import yaml

import flexarm_agents
from flexarm_agents import TrainingConfig
from flexarm_agents.environments import check_id, make_one

FOLDER = Path(flexarm_agents.__file__).parent / "hyperparams"
CLASSES = {
    "ppo": ("stable_baselines3", "PPO"),
    "sac": ("stable_baselines3", "SAC"),
    "tqc": ("sb3_contrib", "TQC"),
    "recurrent_ppo": ("sb3_contrib", "RecurrentPPO"),
}
ZOOS = {"n_timesteps", "n_envs", "env_kwargs"}


def settings(algorithm: str) -> dict[str, Any]:
    found: dict[str, Any] = yaml.safe_load((FOLDER / f"{algorithm}.yml").read_text(encoding="utf-8"))
    return found


def test_every_file_is_of_an_algorithm() -> None:
    assert {path.stem for path in FOLDER.glob("*.yml")} == set(CLASSES)


@pytest.mark.parametrize("algorithm", CLASSES)
def test_settings_are_arguments_of_the_algorithm(algorithm: str) -> None:
    module, name = CLASSES[algorithm]
    pytest.importorskip(module, reason="the extra `recipes` brings it")
    known = inspect.signature(getattr(importlib.import_module(module), name)).parameters
    for environment, one in settings(algorithm).items():
        assert check_id(environment) == environment  # the zoo looks for the whole id
        assert set(one) - ZOOS <= set(known), environment
        assert one["learning_rate"].startswith("lin_")
        if "n_steps" in one:
            assert one["n_envs"] * one["n_steps"] % one["batch_size"] == 0


def test_ppo_is_that_of_flexarm_train() -> None:
    config, one = TrainingConfig(), settings("ppo")["FlexArm/Square-v0"]
    found = {
        "steps": one["n_timesteps"], "envs": one["n_envs"], "rollout": one["n_steps"], "batch": one["batch_size"],
        "epochs": one["n_epochs"], "episode_steps": one["env_kwargs"]["max_episode_steps"], "gamma": one["gamma"],
        "gae_lambda": one["gae_lambda"], "clip": one["clip_range"], "entropy": one["ent_coef"],
        "learning_rate": float(one["learning_rate"].removeprefix("lin_")),
    }  # fmt: skip
    assert found == {name: getattr(config, name) for name in found}
    assert one["policy_kwargs"] == (
        f"dict(net_arch={list(config.hidden)}, activation_fn=nn.{config.activation.upper()}, "
        f"log_std_init={config.log_std})"
    )


def test_the_environments_take_the_options() -> None:
    for algorithm in CLASSES:
        for environment, one in settings(algorithm).items():
            make_one(environment, one["env_kwargs"]).close()
