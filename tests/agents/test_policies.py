"""Policies as numpy runs them: the actions of torch, encoders and their memory, files."""

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from flexarm_agents import NetworkPolicy, config_of, export_onnx, load_policy, network_policy, shipped_policies, train
from flexarm_agents.policies.encoders import PastReadings
from flexarm_agents.policies.lstm import Lstm
from flexarm_agents.sb3.vec_env import FlexArmVecEnv
from flexarm_agents.training.models import new_model
from tests.support.refusals import refuses
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


@pytest.mark.parametrize("name", ["square", "scheduler", "student_unknown", "sac", "recurrent_ppo"])
def test_onnx_predicts_what_numpy_predicts(name: str, tmp_path: Path) -> None:
    """Over several steps; memories as when an episode begins, then handed on. To 1e-6: sums in another order."""
    pytest.importorskip("onnx")
    run_time = pytest.importorskip("onnxruntime")
    policy = network_policy(new_model(config_of(**TINIES[name]))) if name in TINIES else load_policy(name).policy
    export_onnx(policy, tmp_path / "policy.onnx")
    session = run_time.InferenceSession(tmp_path / "policy.onnx", providers=["CPUExecutionProvider"])
    state, memory, rng = None, {}, np.random.default_rng(0)
    for _ in range(5):
        observations = rng.normal(size=(3, policy.observation_size)).astype(np.float32)
        if isinstance(policy.encoder, PastReadings) and not memory:
            now = observations[:, None, list(policy.encoder.remembered)]
            memory["memory_0"] = np.repeat(now, policy.encoder.lags[-1], axis=1)
        elif isinstance(policy.encoder, Lstm) and not memory:
            memory = {f"memory_{n}": np.zeros((3, policy.encoder.inputs), np.float32) for n in (0, 1)}
        expected, state = policy.predict(observations, state)
        action, *after = session.run(None, {"observation": observations, **memory})
        memory = dict(zip(memory, after, strict=True))
        np.testing.assert_allclose(action, expected, atol=1e-6)


def test_a_policy_behind_a_filter_is_no_graph(tmp_path: Path) -> None:
    with refuses(TypeError, "policy = NetworkPolicy(34 -> Observer", "no encoder, a history or an LSTM"):
        export_onnx(load_policy("filtered").policy, tmp_path / "policy.onnx")


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


def test_a_policys_own_randomness() -> None:
    policy = NetworkPolicy([np.zeros((2, 3), np.float32)], [np.zeros(2, np.float32)], np.log(np.float32([0.1, 0.3])))
    policy.seed(1)
    assert not policy.predict(np.zeros((4000, 3)))[0].any()  # the mean, unless asked for more
    first = policy.predict(np.zeros((4000, 3)), deterministic=False)[0]
    np.testing.assert_allclose(first.std(axis=0), [0.1, 0.3], rtol=0.05)
    policy.seed(1)
    np.testing.assert_array_equal(policy.predict(np.zeros((4000, 3)), deterministic=False)[0], first)


def test_a_policy_of_wider_numbers_survives_a_file(tmp_path: Path) -> None:
    head, lstm = np.full((2, 3), 0.1), Lstm(np.full((12, 4), 0.1), np.full((12, 3), 0.1), np.full(12, 0.1))
    wide = NetworkPolicy([head], [np.zeros(2)], np.zeros(2), encoder=lstm, log_std_weights=head)
    wide.save(tmp_path / "wide.npz")
    found, observation = NetworkPolicy.load(tmp_path / "wide.npz"), np.array([0.3, 0.2, 0.7, 0.1])
    np.testing.assert_array_equal(found.predict(observation)[0], wide.predict(observation)[0])
    with refuses(ValueError, "weights[0]: must be finite"):
        NetworkPolicy([np.full((2, 3), 1e300)], [np.zeros(2)], np.zeros(2))


def test_arms_of_ids_count_as_policies_own() -> None:
    own = {name: load_policy(name).has_own_arm for name in shipped_policies()}
    assert [name for name in own if own[name]] == ["scheduler_paper"]  # `carry` has the arm of its task
    for environment, options in (("Lab-v0", {}), ("Square-v0", {"arm": "linear"}), ("Carry-v0", {"arm": "linear"})):
        assert replace(load_policy("square"), environment=f"FlexArm/{environment}", options=options).has_own_arm
    assert not replace(load_policy("square"), options={"arm": "default"}).has_own_arm


@pytest.mark.parametrize("name", ["observer", "privileged"])
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
        inputs = shown[:, : head.observation_size]  # behind them, what the value alone sees
        np.testing.assert_allclose(found, head.predict(inputs, deterministic=True)[0], atol=1e-6)
        action = rng.uniform(-0.2, 0.2, size=(config.envs, 2)).astype(np.float32)
        seen, _, starts, infos = plain.step(action)
        shown, _, _, theirs = monitor.step(action)
        for one, other in zip(infos, theirs, strict=True):
            if "terminal_observation" in one:
                assert len(other["terminal_observation"]) == shown.shape[1] > len(one["terminal_observation"]) - 4
                np.testing.assert_array_equal(one["TimeLimit.truncated"], other["TimeLimit.truncated"])


def test_the_value_alone_sees_what_is_privileged() -> None:
    """The true state, 16 numbers, and six of the episode; their scales are the environment's."""
    model = new_model(config_of(**TINIES["privileged"]))
    env, policy = model.get_env(), model.policy
    assert env is not None
    seen = env.reset()
    infos = env.unwrapped.reset_infos
    (scale,), (episode, *_) = env.get_attr("observation_scale", 0), env.get_attr("episode")
    np.testing.assert_allclose(seen[0, -22:-6] * scale[-22:-6], infos[0]["state"], atol=1e-6)
    np.testing.assert_allclose(seen[0, -6:] * scale[-6:], [*episode.parameters.values()], atol=1e-6)
    changed = seen.copy()
    changed[:, -22:] += 1.0
    one, other = torch.from_numpy(seen), torch.from_numpy(changed)
    assert torch.equal(policy.get_distribution(one).mode(), policy.get_distribution(other).mode())
    assert (policy.predict_values(one) != policy.predict_values(other)).all()


def test_a_missing_package_is_named_before_anything_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "sb3_contrib", None)
    with pytest.raises(ModuleNotFoundError, match=r"algorithm = 'tqc': sb3_contrib is not installed; .*\[train\]"):
        train(config_of(**TINIES["tqc"]), tmp_path / "run")
    assert not (tmp_path / "run").exists()


FLOATS = np.zeros((1, 8), np.float32)


@pytest.mark.parametrize(
    ("name", "changes", "message"),
    [
        ("recurrent_ppo", {"lstm_bias": np.zeros(3, np.float32)}, r"must have shapes \(4 h, k\)"),
        ("recurrent_ppo", {"lstm_input": np.zeros((32, 4))}, "lstm_input: must hold float32"),
        ("recurrent_ppo", {"lstm_memory": None}, "no entry 'lstm_memory'"),
        ("recurrent_ppo", {"observer_scale": FLOATS}, "Lstm and Observer: at most one encoder"),
        ("observer", {"observer_scale": FLOATS[0]}, "observer_scale: must be that of"),
        ("sac", {"spread": FLOATS}, r"log_std_weights: must have shape \(2, 8\)"),
        ("sac", {"other": FLOATS}, "'other': no such array"),
        ("sac", {"weight_1": np.zeros((1, 3), np.float32)}, r"weights\[1\]: must have shape \(8, 16\), got \(1, 3\)"),
        ("sac", {"log_std": FLOATS[0]}, r"log_std: must have shape \(2,\)"),
        ("sac", {"weight_0": None}, r"policy.npz: not a saved policy \(no entry 'weight_0'\)"),
    ],
)
def test_files_that_do_not_fit_are_refused(tmp_path: Path, name: str, changes: dict[str, Any], message: str) -> None:
    path = tmp_path / "policy.npz"
    network_policy(new_model(config_of(**TINIES[name]))).save(path)
    with pytest.raises(ValueError, match="does not say what it was trained on"):
        load_policy(path)
    with np.load(path) as file:
        arrays = dict(file) | changes
    np.savez(path, **{key: value for key, value in arrays.items() if value is not None})
    with pytest.raises(ValueError, match=message):
        load_policy(path)


def test_what_does_not_fit_a_policy_is_refused(tmp_path: Path) -> None:
    with refuses(FileNotFoundError, "the folder holds no best_policy.npz"):
        load_policy(tmp_path)
    trained = load_policy("square")
    with refuses(ValueError, "policy 'square': was trained with observation of shape"):
        trained.make_env(last_actions=2)
    with pytest.raises(ValueError, match=r"observation must have shape \(\d+,\) or \(n, \d+\), got \(3,\)"):
        trained.policy.predict(np.zeros(3))
    with refuses(TypeError, "observation must be an array, got a dict"):
        trained.policy.predict({"a": np.zeros(3)})


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


@given(
    lags=st.sets(st.integers(1, 9), min_size=1, max_size=4), starts=st.lists(st.booleans(), min_size=12, max_size=12)
)
def test_the_network_sees_what_was_observed_at_each_lag(lags: set[int], starts: list[bool]) -> None:
    """Before an episode's first observation it was always that one."""
    encoder = PastReadings(3, tuple(sorted(lags)), (0, 2))
    weight = 0.1 * np.random.default_rng(0).normal(size=(2, encoder.inputs)).astype(np.float32)
    one, state = NetworkPolicy([weight], [np.zeros(2, np.float32)], np.zeros(2, np.float32), encoder=encoder), None
    observations = np.random.default_rng(1).normal(size=(len(starts), 3)).astype(np.float32)
    first = 0
    for k, start in enumerate(starts):
        first = k if start else first
        past = [observations[max(k - lag, first)][[0, 2]] for lag in encoder.lags]
        expected = weight @ np.concatenate([observations[k], *past])
        found, state = one.predict(observations[k], state, np.array([start]), deterministic=True)
        np.testing.assert_allclose(found, np.clip(expected, -1.0, 1.0), atol=1e-6)


def test_a_policy_of_a_task_that_is_not_here_says_so(tmp_path: Path) -> None:
    notes = {"config": {"environment": "no_such_module:Mine/Task-v0", "options": {}}}
    network_policy(new_model(config_of(**TINIES["sac"])), notes).save(tmp_path / "policy.npz")
    with pytest.raises(ValueError, match=r"trained on is not there .*cannot be imported: No module named"):
        load_policy(tmp_path / "policy.npz")
