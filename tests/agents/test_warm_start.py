"""Warm starts: the network of a policy, and a curriculum that ends."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import flexarm_agents.training.reward
from flexarm_agents import NetworkPolicy, PPOConfig, config_of, load_policy, network_policy, train
from flexarm_agents.sb3.vec_env import FlexArmVecEnv
from flexarm_agents.training.models import end_curriculum, new_model
from flexarm_agents.training.reward import TrainingCallback
from flexarm_agents.training.run_folder import RunFolder
from tests.support.trainings import TINIES, TINY, Interrupted

INITIAL = TINIES["initial"]


def same_network(one: NetworkPolicy, other: NetworkPolicy) -> bool:
    pairs = zip([*one.weights, *one.biases], [*other.weights, *other.biases], strict=True)
    return all(np.array_equal(a, b) for a, b in pairs)


def test_a_training_begins_with_the_policy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The actions' deviation is the configuration's; the folder keeps the policy, from which it resumes."""
    student = load_policy("student_gauges").policy
    student.save(tmp_path / "mine.npz")
    begun: list[NetworkPolicy] = []

    class Begun(TrainingCallback):
        def _on_training_start(self) -> None:
            begun.append(network_policy(self.model))
            if len(begun) == 1:
                raise Interrupted

    monkeypatch.setattr(flexarm_agents.training.reward, "TrainingCallback", Begun)
    config = config_of(**{**INITIAL, "initial_policy": str(tmp_path / "mine.npz"), "log_std": -2.0})
    with pytest.raises(Interrupted):
        train(config, tmp_path / "run")
    (tmp_path / "mine.npz").unlink()
    train(config, tmp_path / "run", resume=True)
    for policy in begun:
        assert same_network(policy, student)
        np.testing.assert_allclose(policy.log_std, -2.0)
    assert not same_network(load_policy(tmp_path / "run", last=True).policy, student)
    assert same_network(NetworkPolicy.load(RunFolder(tmp_path / "run").initial), student)
    assert RunFolder(tmp_path / "run").read_config(PPOConfig) == config


def test_the_value_learns_alone_at_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In two of four rollouts, at its own rate; then the policy's rate falls from its beginning to its end."""
    student, found = load_policy("student_gauges").policy, []

    class Watched(TrainingCallback):
        def _on_rollout_start(self) -> None:
            super()._on_rollout_start()
            (rate,) = [group["lr"] for group in self.model.policy.optimizer.param_groups]  # type: ignore[union-attr]
            value = self.model.policy.value_net.weight.detach().numpy().copy()  # type: ignore[union-attr,operator]
            found.append((rate, network_policy(self.model), value))

    monkeypatch.setattr(flexarm_agents.training.reward, "TrainingCallback", Watched)
    train(config_of(**{**INITIAL, "steps": 512, "value_steps": 256}), tmp_path / "run")
    rates, policies, values = zip(*found, strict=True)
    last = load_policy(tmp_path / "run", last=True).policy
    assert [same_network(policy, student) for policy in (*policies, last)] == [True, True, True, False, False]
    for one, other in zip(values, values[1:], strict=False):
        assert not np.array_equal(one, other)
    assert rates[1:3] == (3e-3, 3e-3)
    assert rates[3] == pytest.approx((1.5e-3 + 2e-5) / 2)
    np.testing.assert_array_equal(policies[2].log_std, policies[0].log_std)


def test_a_policy_of_another_kind(tmp_path: Path) -> None:
    train(config_of(**{**TINIES["sac"], "steps": 80, "evaluate_every": 80}), tmp_path / "sac")
    with pytest.raises(ValueError, match=r"must be a fully connected network, as PPO and teaching make it"):
        train(config_of(**{**TINY, "initial_policy": str(tmp_path / "sac")}), tmp_path / "run")


def test_a_curriculum_ends() -> None:
    """Episodes begin anew, without the curriculum's options; the observation space stays."""
    config = config_of(**TINIES["curriculum"])
    model = new_model(config)
    before = model.get_env()
    assert before is not None
    batch = before.unwrapped
    assert isinstance(batch, FlexArmVecEnv)
    assert (batch.env.settings.lap_time, batch.env.settings.deflection_limit) == (32.0, None)
    model.learn(128)
    end_curriculum(config, model)
    after = model.get_env()
    assert after is not None
    judged = after.unwrapped
    assert isinstance(judged, FlexArmVecEnv)
    assert (judged.env.settings.lap_time, judged.env.settings.deflection_limit) == (16.0, 1.5)
    assert after.observation_space == before.observation_space == judged.env.single_observation_space
    model.learn(256, reset_num_timesteps=False)
