"""Algorithms beside plain PPO, and encoders: folders, resuming, the same actions by numpy."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

import flexarm_agents.training.models
import flexarm_agents.training.reward
from flexarm_agents import NetworkPolicy, config_of, load_policy, network_policy, train
from flexarm_agents.policies.lstm import Lstm
from flexarm_agents.sb3.vec_env import FlexArmVecEnv
from flexarm_agents.training.models import new_model
from tests.support.trainings import ID, TINIES, TINY


@pytest.mark.parametrize("name", ["sac", "tqc", "recurrent_ppo", "elu", "tanh", "relu"])
def test_numpy_predicts_what_torch_predicts(name: str, tmp_path: Path) -> None:
    """Over several steps, with episodes that begin among them; from a file, with its notes."""
    model = new_model(config_of(**TINIES.get(name, TINY | {"activation": name})))
    with torch.no_grad():  # away from the small weights of the start
        for parameter in model.policy.parameters():
            parameter.add_(0.3 * torch.randn_like(parameter))
    notes = {"config": {"environment": ID, "options": {}}}
    network_policy(model, notes).save(tmp_path / "policy.npz")
    trained = load_policy(tmp_path / "policy.npz")
    assert (trained.name, trained.environment, trained.options) == ("policy", ID, {})
    policy, rng, theirs, ours, largest = trained.policy, np.random.default_rng(0), None, None, 0.0
    assert policy.notes == notes
    for step in range(5):
        observations = rng.normal(size=(5, policy.observation_size)).astype(np.float32)
        starts = np.arange(5) == step
        expected, theirs = model.predict(observations, theirs, starts, deterministic=True)
        found, ours = policy.predict(observations, ours, starts, deterministic=True)
        np.testing.assert_allclose(found, expected, atol=1e-5)
        assert found.dtype == np.float32
        largest = max(largest, np.abs(expected).max())
    assert largest == 1.0 or name in TINIES  # limits were met
    assert policy.predict(observations[0], deterministic=True)[0].shape == (2,)


def test_the_noise_of_a_squashed_policy_is_torchs() -> None:
    """Mean and spread of the actions before tanh."""
    model = new_model(config_of(**TINIES["sac"]))
    with torch.no_grad():
        model.policy.actor.log_std.bias.fill_(-1.0)
    policy = network_policy(model)
    policy.seed(1)
    observation = np.random.default_rng(0).normal(size=policy.observation_size).astype(np.float32)
    mean, log_std, _ = model.policy.actor.get_action_dist_params(torch.from_numpy(observation[None]))
    drawn = np.arctanh(policy.predict(np.tile(observation, (20_000, 1)), deterministic=False)[0].astype(np.float64))
    np.testing.assert_allclose(drawn.mean(axis=0), mean.detach().numpy()[0], atol=0.01)
    np.testing.assert_allclose(drawn.std(axis=0), log_std.exp().detach().numpy()[0], rtol=0.03)


@pytest.mark.parametrize("name", ["lags", "observer"])
def test_what_a_network_learns_on_is_what_its_policy_sees(name: str) -> None:
    """Also where episodes end: the batch shows the inputs that the exported policy makes of plain observations."""
    config = config_of(**{**TINIES[name], "episode_steps": 6})
    model = new_model(config)
    policy = network_policy(model)
    options = {**config.options, **config.curriculum_options, "max_episode_steps": 6}
    plain, monitor = FlexArmVecEnv.make(config.environment, config.envs, **options), model.get_env()
    assert monitor is not None
    for env in (plain, monitor):
        env.seed(3)
    seen, shown, state = plain.reset(), monitor.reset(), None
    starts, rng = np.ones(config.envs, dtype=bool), np.random.default_rng(0)
    for _ in range(15):
        head = NetworkPolicy(policy.weights, policy.biases, policy.log_std, policy.activation)
        found, state = policy.predict(seen, state, starts, deterministic=True)
        np.testing.assert_allclose(found, head.predict(shown, deterministic=True)[0], atol=1e-6)
        action = rng.uniform(-0.2, 0.2, size=(config.envs, 2)).astype(np.float32)
        seen, _, starts, infos = plain.step(action)
        shown, _, _, theirs = monitor.step(action)
        for one, other in zip(infos, theirs, strict=True):
            if "terminal_observation" in one:
                assert len(other["terminal_observation"]) == shown.shape[1] > len(one["terminal_observation"]) - 4
                np.testing.assert_array_equal(one["TimeLimit.truncated"], other["TimeLimit.truncated"])


def test_a_missing_package_is_named_before_anything_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(name: str) -> None:
        raise ModuleNotFoundError(f"No module named {name!r}", name=name)

    monkeypatch.setattr(flexarm_agents.training.models, "import_module", fail)
    with pytest.raises(ModuleNotFoundError, match=r"algorithm = 'tqc': sb3_contrib is not installed; .*\[train\]"):
        train(config_of(**TINIES["tqc"]), tmp_path / "run")
    assert not (tmp_path / "run").exists()


def saved(path: Path, name: str) -> dict[str, Any]:
    network_policy(new_model(config_of(**TINIES[name])), {"config": {"environment": ID, "options": {}}}).save(path)
    with np.load(path) as file:
        return dict(file)


@pytest.mark.parametrize(
    ("name", "changes", "message"),
    [
        ("recurrent_ppo", {"lstm_bias": np.zeros(3, np.float32)}, r"must have shapes \(4 h, k\)"),
        ("recurrent_ppo", {"lstm_input": np.zeros((32, 4))}, "lstm_input: must hold float32"),
        ("recurrent_ppo", {"lstm_memory": None}, "no entry 'lstm_memory'"),
        ("sac", {"spread": np.zeros((1, 8), np.float32)}, r"log_std_weights: must have shape \(2, 8\)"),
        ("recurrent_ppo", {"observer_scale": np.ones(5, np.float32)}, "Lstm and Observer: at most one encoder"),
        ("sac", {"other": np.zeros(1, np.float32)}, "'other': no such array"),
        ("observer", {"observer_scale": np.ones(5, np.float32)}, "observer_scale: must be that of"),
    ],
)
def test_files_that_do_not_fit_are_refused(tmp_path: Path, name: str, changes: dict[str, Any], message: str) -> None:
    path = tmp_path / "policy.npz"
    arrays = {key: value for key, value in (saved(path, name) | changes).items() if value is not None}
    np.savez(path, **arrays)
    with pytest.raises(ValueError, match=message):
        load_policy(path)


def test_an_encoder_and_its_network_fit_together() -> None:
    lstm = Lstm(np.zeros((8, 3), np.float32), np.zeros((8, 2), np.float32), np.zeros(8, np.float32))
    weights, biases = [np.zeros((2, 2), np.float32)], [np.zeros(2, np.float32)]
    policy = NetworkPolicy(weights, biases, np.zeros(2, np.float32), encoder=lstm)
    _, state = policy.predict(np.zeros((3, 3), np.float32))
    with pytest.raises(ValueError, match=r"state: must be what predict returned for as many observations, .*\(2, 2\)"):
        policy.predict(np.zeros((2, 3), np.float32), state)
    with pytest.raises(ValueError, match=r"encoder: gives 2 numbers, and the network takes 5"):
        NetworkPolicy([np.zeros((2, 5), np.float32)], biases, np.zeros(2, np.float32), encoder=lstm)
    with pytest.raises(TypeError, match=r"encoder = 'lstm': must be None or one of PastReadings, Lstm, Observer"):
        NetworkPolicy(weights, biases, np.zeros(2, np.float32), encoder="lstm")  # type: ignore[arg-type]
