"""Agents: configuration, training and its folder, policies as files."""

from __future__ import annotations

import csv
import json
import re
import shutil
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback

import flexarm_agents.training
from flexarm_agents import (
    FlexArmVecEnv,
    NetworkPolicy,
    TrainingConfig,
    evaluate,
    load_policy,
    network_policy,
    shipped_policies,
    train,
)
from flexarm_agents.environments import make_batch, make_one
from flexarm_agents.follow import Follow
from flexarm_agents.run_folder import RunFolder
from flexarm_agents.training import new_model

ID = "FlexArm/Square-v0"
TINY: dict[str, Any] = {
    "envs": 4,
    "rollout": 32,
    "batch": 64,
    "epochs": 2,
    "steps": 512,
    "hidden": [16, 8],
    "evaluate_every": 200,
    "checkpoint_every": 200,
    "episode_steps": 50,
    "options": {"noise": 0.001, "randomisation": {"payload_mass": [0.0, 0.2]}},
}


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished tiny training; not to be changed."""
    folder = tmp_path_factory.mktemp("runs") / "tiny"
    train(TrainingConfig(**TINY), folder)
    return folder


def files(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


def same_policy(one: Path, other: Path) -> bool:
    first, second = NetworkPolicy.load(one), NetworkPolicy.load(other)
    pairs = zip(
        [*first.weights, *first.biases, first.log_std], [*second.weights, *second.biases, second.log_std], strict=True
    )
    return all(np.array_equal(a, b) for a, b in pairs)


# --- configuration ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        (
            {"environment": "CartPole-v1"},
            ValueError,
            r"environment = 'CartPole-v1': must be one of 'FlexArm/Paper-v0', ",
        ),
        ({"environment": 3}, ValueError, r"environment = 3: must be one of"),
        ({"options": {"noize": 1.0}}, TypeError, r"noize: no such option; did you mean 'noise'"),
        ({"options": {"noise": -1.0}}, ValueError, r"noise = -1.0: must be"),
        ({"options": {"arm": object()}}, TypeError, r"options = .*: must be plain values \(JSON\)"),
        ({"options": [1]}, TypeError, r"options = \[1\]: must be a mapping"),
        ({"steps": 0}, ValueError, r"steps = 0: must be an integer >= 1"),
        ({"envs": 1.5}, TypeError, r"envs = 1.5: must be an integer >= 1"),
        ({"batch": 1000}, ValueError, r"batch = 1000: must divide rollout \* envs = 128 \* 64 = 8192"),
        ({"gamma": 1.5}, ValueError, r"gamma = 1.5: must be .* <= 1.0"),
        ({"learning_rate": 0.0}, ValueError, r"learning_rate = 0.0: must be .* > 0.0"),
        ({"learning_rate": 1e-6}, ValueError, r"final_learning_rate = .*: must be <= learning_rate = 1e-06"),
        ({"seed": -1}, ValueError, r"seed = -1: must be an integer from 0 to"),
        ({"hidden": ()}, TypeError, r"hidden = \(\): must be a list of sizes"),
        ({"hidden": (8, 0)}, ValueError, r"hidden\[1\] = 0: must be an integer >= 1"),
        ({"activation": "selu"}, ValueError, r"activation = 'selu': must be one of 'elu', 'tanh', 'relu'"),
    ],
)
def test_impossible_configurations(options: dict[str, Any], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        TrainingConfig(**options)


def test_a_configuration_survives_a_file() -> None:
    config = TrainingConfig(**{**TINY, "environment": "flexarm_env:FlexArm/Square-v0", "seed": 3})
    assert config.environment == ID
    assert config.folder == Path("runs/Square-v0-3")
    again = TrainingConfig.of(json.loads(json.dumps(config.plain())))
    assert again == config
    assert config.differences(again) == []
    with pytest.raises(TypeError, match=r"gama: no such parameter; did you mean 'gamma'"):
        TrainingConfig.of({"gama": 0.9})


# --- training ---------------------------------------------------------------------------------------------------------


def test_what_a_training_leaves(run: Path) -> None:
    names = {path.name for path in run.iterdir()}
    assert names == {
        "best_model.zip", "best_policy.npz", "checkpoint.zip", "config.json", "evaluations.csv", "evaluations.json",
        "last_policy.npz", "tensorboard",
    }  # fmt: skip
    assert list((run / "tensorboard").glob("events.out.tfevents.*"))
    rows = json.loads((run / "evaluations.json").read_text())
    assert [row["steps"] for row in rows] == [256, 512]
    assert rows[0]["ended"] == "error"
    assert not rows[0]["complete"]
    with (run / "evaluations.csv").open(newline="") as file:
        table = list(csv.DictReader(file))
    assert [float(row["rms"]) for row in table] == [row["rms"] for row in rows]
    assert [float(row["peak_torque_2"]) for row in table] == [row["peak_torque"][1] for row in rows]


def test_the_best_policy_is_the_one_that_was_evaluated(run: Path) -> None:
    trained = load_policy(run)
    assert (trained.name, trained.environment) == ("tiny", ID)
    assert trained.options == TINY["options"]
    row = trained.notes["evaluation"]
    again = evaluate(trained.make_env(), trained.policy, seed=1_000_003)
    assert again.plain() == {name: value for name, value in row.items() if name not in ("steps", "seconds")}
    model = PPO.load(run / "best_model.zip", device="cpu")
    observations = np.random.default_rng(0).normal(size=(20, trained.policy.observation_size)).astype(np.float32)
    expected, _ = model.predict(observations, deterministic=True)
    np.testing.assert_allclose(trained.policy.predict(observations, deterministic=True)[0], expected, atol=2e-6)


def test_the_same_seed_gives_the_same_numbers(run: Path, tmp_path: Path) -> None:
    train(TrainingConfig(**TINY), tmp_path / "again")
    assert same_policy(run / "last_policy.npz", tmp_path / "again" / "last_policy.npz")
    train(TrainingConfig(**TINY, seed=1), tmp_path / "other")
    assert not same_policy(run / "last_policy.npz", tmp_path / "other" / "last_policy.npz")


class Interrupted(Exception):  # noqa: N818
    pass


def interrupted(monkeypatch: pytest.MonkeyPatch, folder: Path, steps: int) -> None:
    """Begin the tiny training and break it off in the middle of a rollout."""

    class Breaking(Follow):
        def _on_step(self) -> bool:
            if self.num_timesteps >= steps:
                raise Interrupted
            return True

    with monkeypatch.context() as patch:
        patch.setattr(flexarm_agents.training, "Follow", Breaking)
        with pytest.raises(Interrupted):
            train(TrainingConfig(**TINY), folder)


@pytest.mark.parametrize("steps", [60, 400])
def test_an_interrupted_training_ends_in_the_same_bits(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, steps: int
) -> None:
    interrupted(monkeypatch, tmp_path / "run", steps)
    assert (tmp_path / "run" / "checkpoint.zip").exists() == (steps == 400)
    np.random.seed(5)  # noqa: NPY002
    torch.manual_seed(5)  # what the generators did meanwhile has no influence
    outcome = train(TrainingConfig(**TINY), tmp_path / "run", resume=True)
    assert same_policy(run / "last_policy.npz", tmp_path / "run" / "last_policy.npz")
    mine, theirs = (json.loads((folder / "evaluations.json").read_text()) for folder in (tmp_path / "run", run))
    for rows in (mine, theirs):
        assert [row.pop("seconds") for row in rows]
    assert mine == theirs
    assert outcome.best["rms"] == min(mine, key=lambda row: -row["duration"])["rms"]


def test_resuming_what_is_complete_changes_nothing(run: Path, tmp_path: Path) -> None:
    shutil.copytree(run, tmp_path / "run")
    before = files(tmp_path / "run")
    outcome = train(TrainingConfig(**TINY), tmp_path / "run", resume=True)
    assert files(tmp_path / "run") == before
    assert outcome.last["steps"] == 512


def test_a_folder_is_never_overwritten(run: Path, tmp_path: Path) -> None:
    before = files(run)
    with pytest.raises(FileExistsError, match=rf"folder = {re.escape(str(run))}: exists and is not empty; resume"):
        train(TrainingConfig(**TINY), run)
    with pytest.raises(ValueError, match=r"seed = 4: the training in .* has 0; only the same .*: seed, gamma\)"):
        train(TrainingConfig(**{**TINY, "gamma": 0.9, "seed": 4}), run, resume=True)
    with pytest.raises(FileNotFoundError, match=r"folder = .*nothing: holds no config.json"):
        train(TrainingConfig(**TINY), tmp_path / "nothing", resume=True)
    assert files(run) == before
    assert not (tmp_path / "nothing").exists()
    (tmp_path / "file").touch()
    with pytest.raises(FileExistsError, match="file: exists"):
        train(TrainingConfig(**TINY), tmp_path / "file")


@pytest.mark.parametrize("text", ["{", "[]", "{}", '{"format": 99}', '{"format": 1, "gama": 1}'])
def test_a_spoilt_configuration(tmp_path: Path, text: str) -> None:
    (tmp_path / "config.json").write_text(text)
    with pytest.raises(ValueError, match=r"config.json: not a training's configuration"):
        RunFolder(tmp_path).read_config()


def test_a_spoilt_checkpoint(run: Path, tmp_path: Path) -> None:
    shutil.copytree(run, tmp_path / "run")
    (tmp_path / "run" / "checkpoint.zip").write_bytes(b"no zip")
    with pytest.raises(ValueError, match=r"checkpoint.zip: not a checkpoint"):
        train(TrainingConfig(**TINY), tmp_path / "run", resume=True)


def test_threads_are_left_as_they_were(tmp_path: Path) -> None:
    before = torch.get_num_threads()
    torch.set_num_threads(2)
    try:
        train(TrainingConfig(**{**TINY, "steps": 128}), tmp_path / "run")
        assert torch.get_num_threads() == 2
    finally:
        torch.set_num_threads(before)


def test_a_time_limit_is_bootstrapped() -> None:
    """With rewards of the value's own scale the buffer's last reward must hold the value of what comes after."""
    config = TrainingConfig(**{**TINY, "options": {"start": "moving"}, "episode_steps": 5, "rollout": 5, "batch": 20})
    model = new_model(config)
    plain = FlexArmVecEnv(make_batch(ID, 4, {"start": "moving", "max_episode_steps": 5}))
    rewards: list[np.ndarray] = []

    class Record(BaseCallback):
        def _on_step(self) -> bool:
            rewards.append(self.locals["rewards"].copy())
            return True

    model.learn(20, Record())
    kept = model.rollout_buffer.rewards
    np.testing.assert_array_equal(kept[:4], np.array(rewards[:4]))
    assert np.all(kept[4] != rewards[4])
    plain.close()


@pytest.mark.parametrize("name", ["Reach-v0", "SquareEncoders-v0", "SquareGain-v0", "SquareResidual-v0", "Track-v0"])
def test_other_environments_are_trained_alike(tmp_path: Path, name: str) -> None:
    config = TrainingConfig(**{**TINY, "environment": f"FlexArm/{name}", "steps": 128, "evaluation_laps": 2})
    train(config, tmp_path / "run")
    trained = load_policy(tmp_path / "run")
    env = trained.make_env()
    assert trained.policy.log_std.shape == env.action_space.shape
    assert trained.environment == f"FlexArm/{name}"


# --- policies as files ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("activation", ["elu", "tanh", "relu"])
def test_numpy_predicts_what_torch_predicts(activation: Any) -> None:
    model = new_model(TrainingConfig(**{**TINY, "activation": activation}))
    with torch.no_grad():  # away from the small weights of the start
        for parameter in model.policy.parameters():
            parameter.add_(0.3 * torch.randn_like(parameter))
    policy = network_policy(model)
    observations = np.random.default_rng(0).normal(size=(50, policy.observation_size)).astype(np.float32)
    expected, _ = model.predict(observations, deterministic=True)
    found, state = policy.predict(observations, deterministic=True)
    assert state is None
    assert found.dtype == np.float32
    np.testing.assert_allclose(found, expected, atol=1e-5)
    assert np.abs(expected).max() == 1.0  # limits were met
    np.testing.assert_allclose(policy.predict(observations[7], deterministic=True)[0], expected[7], atol=1e-5)


def test_a_policys_own_randomness() -> None:
    policy = NetworkPolicy([np.zeros((2, 3), np.float32)], [np.zeros(2, np.float32)], np.log(np.float32([0.1, 0.3])))
    policy.seed(1)
    first = policy.predict(np.zeros((4000, 3)))[0]
    np.testing.assert_allclose(first.std(axis=0), [0.1, 0.3], rtol=0.05)
    policy.seed(1)
    np.testing.assert_array_equal(policy.predict(np.zeros((4000, 3)))[0], first)


def test_a_policy_survives_a_file(tmp_path: Path) -> None:
    model = new_model(TrainingConfig(**TINY))
    policy = network_policy(model, {"config": {"environment": ID, "options": {}}})
    policy.save(tmp_path / "policy.npz")
    again = NetworkPolicy.load(tmp_path / "policy.npz")
    assert again.notes == policy.notes
    observations = np.random.default_rng(0).normal(size=(5, policy.observation_size))
    np.testing.assert_array_equal(
        again.predict(observations, deterministic=True)[0], policy.predict(observations, deterministic=True)[0]
    )
    trained = load_policy(tmp_path / "policy.npz")
    assert (trained.name, trained.environment, trained.options) == ("policy", ID, {})


def test_bad_policies(tmp_path: Path, run: Path) -> None:
    (tmp_path / "text.npz").write_text("text")
    np.savez(tmp_path / "other.npz", x=np.zeros(3))
    np.savez(tmp_path / "future.npz", head=np.array('{"format": 99}'))
    np.savez(tmp_path / "few.npz", head=np.array('{"format": 1, "layers": 1}'))
    network_policy(new_model(TrainingConfig(**TINY))).save(tmp_path / "bare.npz")
    for name, message in [
        ("text.npz", "text.npz: not a saved policy"),
        ("other.npz", "no entry 'head'"),
        ("future.npz", "future.npz: format 99; this version reads 1"),
        ("few.npz", r"few.npz: not a saved policy \(no entry 'weight_0'\)"),
        ("bare.npz", "does not say what it was trained on"),
    ]:
        with pytest.raises(ValueError, match=message):
            load_policy(tmp_path / name)
    with pytest.raises(FileNotFoundError, match=r"the folder holds no best_policy.npz"):
        load_policy(tmp_path)
    with pytest.raises(FileNotFoundError, match=r"source = 'nobody': neither a folder or file nor a shipped policy"):
        load_policy("nobody")
    trained = load_policy(run, last=True)
    with pytest.raises(ValueError, match=r"policy 'tiny': was trained with observation of shape"):
        trained.make_env(last_actions=2)
    with pytest.raises(ValueError, match=r"observation must have shape \(\d+,\) or \(n, \d+\), got \(3,\)"):
        trained.policy.predict(np.zeros(3))
    with pytest.raises(TypeError, match=r"observation must be an array, got a dict"):
        trained.policy.predict({"a": np.zeros(3)})
    with pytest.raises(ValueError, match=r"weights\[1\]: must have shape \(1, 2\), got \(1, 3\)"):
        NetworkPolicy([np.zeros((2, 4)), np.zeros((1, 3))], [np.zeros(2), np.zeros(1)], np.zeros(1))
    with pytest.raises(ValueError, match=r"log_std: must have shape \(2,\)"):
        NetworkPolicy([np.zeros((2, 4))], [np.zeros(2)], np.zeros(1))


# --- shipped policies -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", shipped_policies())
def test_a_shipped_policy_scores_what_it_says(name: str) -> None:
    trained = load_policy(name)
    path = Path(flexarm_agents.load.POLICIES) / f"{name}.npz"
    assert path.stat().st_size < 300_000
    beside = json.loads(path.with_suffix(".json").read_text())
    assert set(beside) == {"command", "config", "evaluation"}
    assert beside["config"] == trained.notes["config"]
    assert beside["evaluation"] == trained.notes["evaluation"]
    again = evaluate(trained.make_env(), trained.policy, seed=1_000_003)
    assert again.complete
    # another processor's matrix products may round otherwise, which a lap amplifies a little
    assert again.rms == pytest.approx(beside["evaluation"]["rms"], rel=1e-3)
    assert again.rms <= 0.13
    assert again.rms_after_2s is not None
    assert again.rms_after_2s <= 0.05


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_defaults_reach_the_goal(tmp_path: Path, seed: int) -> None:
    best = train(TrainingConfig(seed=seed), tmp_path / "run").best
    assert best["complete"]
    assert best["rms"] <= 0.13
    assert best["rms_after_2s"] <= 0.05


def test_environments_are_made_with_their_limits() -> None:
    assert make_one(ID).spec.max_episode_steps == 1600  # type: ignore[union-attr]
    assert isinstance(make_one(ID), gymnasium.Env)
