"""The settings in rl-zoo3's format name real ids and real arguments, and are those of `flexarm train`."""

from __future__ import annotations

import importlib
import inspect
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch
import yaml

import flexarm_agents
from flexarm_agents import PPOConfig, config_of
from flexarm_agents.environments import check_id, make_one
from flexarm_agents.training.config import read_config
from flexarm_agents.training.hyperparameters import settings_of
from flexarm_agents.training.models import arguments

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
    known = inspect.signature(getattr(importlib.import_module(module), name)).parameters
    for environment, one in settings(algorithm).items():
        assert check_id(environment) == environment  # the zoo looks for the whole id
        assert set(one) - ZOOS <= set(known), environment
        assert one["learning_rate"].startswith("lin_")
        if "n_steps" in one:
            assert one["n_envs"] * one["n_steps"] % one["batch_size"] == 0


def test_the_files_are_the_only_source() -> None:
    """`flexarm train` has what the file has; an id that the file lacks has those of the first id, no curriculum."""
    config = config_of()
    assert (config.steps, config.envs, config.rollout, config.batch) == (2_000_000, 64, 64, 512)
    assert (config.learning_rate, config.hidden, config.activation) == (1.5e-3, (128, 128), "elu")
    assert (config.log_std, config.episode_steps) == (-0.7, 600)
    other = replace(config, environment="FlexArm/Track-v0", curriculum_options={})
    assert other == config_of(environment="Track-v0")
    assert config_of(algorithm="sac", environment="SquareResidual-v0").steps == 200_000
    assert config_of(algorithm="sac", environment="SquareEncoders-v0").steps == 500_000


def test_a_curriculum_leaves_what_the_options_say() -> None:
    """Tuned starts hold unless the options speak of starts; a file from before there were curricula has none."""
    assert config_of().curriculum_options == {"start": "corners"}
    assert config_of(options={"noise": 0.001}).curriculum_options == {"start": "corners"}
    for options in ({"start": "moving"}, {"start_spread": [0.2, 0.2]}):
        assert config_of(options=options).curriculum_options == {}
    before = config_of().plain()
    del before["curriculum_options"]
    assert read_config(before) == config_of(curriculum_options={})


@pytest.mark.parametrize("algorithm", CLASSES)
def test_every_setting_reaches_the_model(algorithm: str) -> None:
    """What the model is made with is what the file says, by the names of the library."""
    for environment, one in settings(algorithm).items():
        found = arguments(config_of(algorithm=algorithm, environment=environment))
        assert found.pop("learning_rate")(1.0) == float(one["learning_rate"].removeprefix("lin_"))
        policy = eval(one["policy_kwargs"], {"nn": torch.nn})
        assert {**found, "policy_kwargs": dict(found["policy_kwargs"])} == {
            name: value for name, value in one.items() if name not in {*ZOOS, "policy", "learning_rate"}
        } | {"policy_kwargs": policy}


def test_settings_that_are_not_the_algorithms_are_refused() -> None:
    one = settings("ppo")["FlexArm/Square-v0"]
    with pytest.raises(ValueError, match=r"hyperparams/ppo.yml: has no use for tau"):
        settings_of(PPOConfig, one | {"tau": 0.1})
    with pytest.raises(ValueError, match=r"hyperparams/ppo.yml: lacks gamma"):
        settings_of(PPOConfig, {name: value for name, value in one.items() if name != "gamma"})
    with pytest.raises(ValueError, match=r"policy_kwargs = '__import__\(\"os\"\)': must be dict"):
        settings_of(PPOConfig, one | {"policy_kwargs": '__import__("os")'})


def test_the_environments_take_the_options() -> None:
    for algorithm in CLASSES:
        for environment, one in settings(algorithm).items():
            make_one(environment, one["env_kwargs"]).close()
