"""Training: the folder that it leaves, resuming, the same bits from the same seed."""

from __future__ import annotations

import csv
import errno
import json
import logging
import os
import re
import shutil
import signal
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback

import flexarm_agents.training.reward
from flexarm_agents import DAggerConfig, FlexArmVecEnv, PPOConfig, TrainingStopped, evaluate, load_policy, train
from flexarm_agents.environments import make_batch
from flexarm_agents.files import put
from flexarm_agents.jobs.stopping import StopSignals
from flexarm_agents.training.checkpoint import read_checkpoint
from flexarm_agents.training.models import new_model
from flexarm_agents.training.reward import TrainingCallback
from flexarm_agents.training.run_folder import RunFolder
from flexarm_env.kernels.layout import Row
from flexarm_env.laps import LAPS
from tests.support.refusals import refuses
from tests.support.trainings import ID, TAUGHT, TINY, Interrupted, finished, same_policy


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Run the tiny training once; its folder must not be changed."""
    return finished(tmp_path_factory.mktemp("runs"))


def files(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


def test_what_a_training_leaves(run: Path) -> None:
    names = {path.name for path in run.iterdir()}
    assert names == {
        "best_model.zip", "best_policy.npz", "checkpoint.zip", "config.json", "evaluations.csv", "evaluations.json",
        "last_policy.npz", "tensorboard", "versions.json",
    }  # fmt: skip
    assert list((run / "tensorboard").glob("events.out.tfevents.*"))
    rows = json.loads((run / "evaluations.json").read_text())
    assert [row["steps"] for row in rows] == [256, 512]
    assert [rows[0][lap]["ended"] for lap in LAPS] == ["error", "error"]
    assert not rows[0]["swing"]["complete"]
    with (run / "evaluations.csv").open(newline="") as file:
        table = list(csv.DictReader(file))
    for lap in LAPS:
        assert [row[f"{lap}_rms"] for row in table] == ["", ""]  # errors of laps that ended early
        assert [row[lap]["rms"] for row in rows] == [None, None]
        assert [float(row[f"{lap}_duration"]) for row in table] == [row[lap]["duration"] for row in rows]
        assert [float(row[f"{lap}_peak_torque_2"]) for row in table] == [row[lap]["peak_torque"][1] for row in rows]


def test_the_best_policy_is_the_one_that_was_evaluated(run: Path) -> None:
    trained = load_policy(run)
    assert (trained.name, trained.environment) == ("tiny", ID)
    assert trained.options == TINY["options"]
    row = trained.notes["evaluation"]
    again = evaluate(trained.make_env(), trained.policy, seed=1_000_003)
    assert again.as_mapping() == {lap: row[lap] for lap in LAPS}
    model = PPO.load(run / "best_model.zip", device="cpu")
    observations = np.random.default_rng(0).normal(size=(20, trained.policy.observation_size)).astype(np.float32)
    expected, _ = model.predict(observations, deterministic=True)
    np.testing.assert_allclose(trained.policy.predict(observations, deterministic=True)[0], expected, atol=2e-6)


def test_the_same_seed_gives_the_same_numbers(run: Path, tmp_path: Path) -> None:
    train(PPOConfig(**TINY), tmp_path / "again")
    assert same_policy(run / "last_policy.npz", tmp_path / "again" / "last_policy.npz")
    train(PPOConfig(**TINY, seed=1), tmp_path / "other")
    assert not same_policy(run / "last_policy.npz", tmp_path / "other" / "last_policy.npz")


def interrupted(monkeypatch: pytest.MonkeyPatch, folder: Path, steps: int) -> None:
    """Begin the tiny training and break it off in the middle of a rollout."""

    class Breaking(TrainingCallback):
        def _on_step(self) -> bool:
            if self.num_timesteps >= steps:
                raise Interrupted
            return True

    with monkeypatch.context() as patch:
        patch.setattr(flexarm_agents.training.reward, "TrainingCallback", Breaking)
        with pytest.raises(Interrupted):
            train(PPOConfig(**TINY), folder)


@pytest.mark.parametrize("steps", [60, 400])
def test_an_interrupted_training_ends_in_the_same_bits(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, steps: int
) -> None:
    interrupted(monkeypatch, tmp_path / "run", steps)
    assert (tmp_path / "run" / "checkpoint.zip").exists() == (steps == 400)
    np.random.seed(5)  # noqa: NPY002
    torch.manual_seed(5)  # what the generators did meanwhile has no influence
    outcome = train(PPOConfig(**TINY), tmp_path / "run", resume=True)
    assert same_policy(run / "last_policy.npz", tmp_path / "run" / "last_policy.npz")
    mine, theirs = (json.loads((folder / "evaluations.json").read_text()) for folder in (tmp_path / "run", run))
    for rows in (mine, theirs):
        assert [row.pop("seconds") for row in rows]
    assert mine == theirs
    durations = [sum(row[lap]["duration"] for lap in LAPS) for row in mine]
    assert sum(outcome.best[lap]["duration"] for lap in LAPS) == max(durations)


def signalled(monkeypatch: pytest.MonkeyPatch, folder: Path, number: int, steps: int) -> TrainingStopped:
    """Begin the tiny training and send this process a signal in the middle of a rollout."""

    class Signalling(TrainingCallback):
        sent = False

        def _on_step(self) -> bool:
            if self.num_timesteps >= steps and not self.sent:
                self.sent = True
                os.kill(os.getpid(), number)
            return True

    with monkeypatch.context() as patch:
        patch.setattr(flexarm_agents.training.reward, "TrainingCallback", Signalling)
        with pytest.raises(TrainingStopped) as caught:
            train(PPOConfig(**{**TINY, "checkpoint_every": 10_000}), folder)
    return caught.value


@pytest.mark.parametrize(("number", "steps", "kept"), [(signal.SIGINT, 60, 128), (signal.SIGTERM, 300, 384)])
def test_a_signal_keeps_every_step(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int, steps: int, kept: int
) -> None:
    """The rollout is finished and a checkpoint written, though none is due; what resumes ends in the same bits."""
    before = [signal.getsignal(each) for each in (signal.SIGINT, signal.SIGTERM)]
    stopped = signalled(monkeypatch, tmp_path / "run", number, steps)
    assert (stopped.signal, stopped.steps) == (number, kept)
    assert isinstance(stopped, KeyboardInterrupt)
    assert read_checkpoint(tmp_path / "run" / "checkpoint.zip", PPOConfig(**{**TINY, "checkpoint_every": 10_000}))
    assert [signal.getsignal(each) for each in (signal.SIGINT, signal.SIGTERM)] == before
    train(PPOConfig(**{**TINY, "checkpoint_every": 10_000}), tmp_path / "run", resume=True)
    assert same_policy(run / "last_policy.npz", tmp_path / "run" / "last_policy.npz")


@pytest.mark.usefixtures("signals")
def test_a_second_signal_ends_at_once() -> None:
    with pytest.raises(KeyboardInterrupt) as caught, StopSignals() as stop:  # noqa: PT012
        os.kill(os.getpid(), signal.SIGINT)
        assert stop.received == signal.SIGINT
        os.kill(os.getpid(), signal.SIGINT)
    assert not isinstance(caught.value, TrainingStopped)


def test_other_threads_train_without_handlers(tmp_path: Path) -> None:
    outcomes: list[object] = []
    thread = threading.Thread(
        target=lambda: outcomes.append(train(PPOConfig(**{**TINY, "steps": 128}), tmp_path / "run"))
    )
    thread.start()
    thread.join()
    assert outcomes


def test_each_evaluation_is_logged_where_there_is_no_bar(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    assert not sys.stderr.isatty()
    with caplog.at_level(logging.INFO, "flexarm_agents"):
        train(PPOConfig(**TINY), tmp_path / "run", progress=True)
    lines = [record.getMessage() for record in caplog.records]
    assert len(lines) == 2
    early = r"lost after \d\.\d\d s: \w+"
    ended = rf"swing lap: {early}; plain lap: {early}; none with complete laps yet"
    assert re.fullmatch(rf" +256 steps +\d+ s  {ended}", lines[0])
    assert re.fullmatch(rf" +512 steps +\d+ s  {ended}", lines[1])


def test_resuming_what_is_complete_changes_nothing(run: Path, tmp_path: Path) -> None:
    shutil.copytree(run, tmp_path / "run")
    before = files(tmp_path / "run")
    outcome = train(PPOConfig(**TINY), tmp_path / "run", resume=True)
    assert files(tmp_path / "run") == before
    assert outcome.last["steps"] == 512


def test_what_a_killed_process_left_of_a_file_does_not_count(tmp_path: Path) -> None:
    """Killed while it wrote the first file, a training can be begun again."""
    (tmp_path / ".new-config.json").write_text("{")
    config = PPOConfig(**TINY)
    folder = RunFolder(tmp_path)
    folder.begin(config, {})
    assert folder.read_config(PPOConfig) == config


def test_two_that_write_a_file_do_not_meet_and_leftovers_go_after_a_day(tmp_path: Path) -> None:
    path = tmp_path / "file.txt"
    for name, age in (("old", 2.0), ("new", 0.5)):
        left = tmp_path / f".new-{name}-file.txt"
        left.write_text("half")
        os.utime(left, (time.time() - age * 86400.0,) * 2)

    def write(aside: Path) -> None:
        aside.write_text("outer")
        put(path, lambda own: own.write_text("inner"))
        assert path.read_text() == "inner"

    put(path, write)
    assert path.read_text() == "outer"
    assert sorted(one.name for one in tmp_path.iterdir()) == [".new-new-file.txt", "file.txt"]


def test_a_folder_is_never_overwritten(run: Path, tmp_path: Path) -> None:
    before = files(run)
    with pytest.raises(FileExistsError, match=rf"folder = {re.escape(str(run))}: exists and is not empty; resume"):
        train(PPOConfig(**TINY), run)
    with pytest.raises(ValueError, match=r"seed = 4: the training in .* has 0; only the same .*: seed, gamma\)"):
        train(PPOConfig(**{**TINY, "gamma": 0.9, "seed": 4}), run, resume=True)
    with pytest.raises(FileNotFoundError, match=r"folder = .*nothing: holds no config.json"):
        train(PPOConfig(**TINY), tmp_path / "nothing", resume=True)
    assert files(run) == before
    assert not (tmp_path / "nothing").exists()
    (tmp_path / "file").touch()
    with pytest.raises(FileExistsError, match="file: exists"):
        train(PPOConfig(**TINY), tmp_path / "file")


def test_the_checkpoint_of_another_training_is_refused(run: Path, tmp_path: Path) -> None:
    """Its weights would end under this one's name."""
    other = PPOConfig(**{**TINY, "gamma": 0.9, "seed": 4})
    checkpoint = shutil.copytree(run, tmp_path / "run") / "checkpoint.zip"
    RunFolder(tmp_path / "other").begin(other, json.loads((run / "versions.json").read_text()))
    shutil.copy(checkpoint, tmp_path / "other")
    before = files(tmp_path / "other")
    with refuses(
        ValueError, f"seed = 4: the training in {tmp_path / 'other' / 'checkpoint.zip'} has 0", "seed, gamma)"
    ):
        train(other, tmp_path / "other", resume=True)
    assert files(tmp_path / "other") == before
    shutil.copy(checkpoint, taught := tmp_path / "taught.zip")
    with refuses(ValueError, "taught.zip: not a checkpoint", "algorithm = 'ppo': must be one of 'dagger'"):
        read_checkpoint(taught, DAggerConfig(**TAUGHT))


def test_a_spoilt_checkpoint(run: Path, tmp_path: Path) -> None:
    shutil.copytree(run, tmp_path / "run")
    checkpoint = tmp_path / "run" / "checkpoint.zip"
    moved = bytearray(checkpoint.read_bytes())
    moved[-3] ^= 1  # the zip's list of contents is elsewhere, which the system refuses to look up
    checkpoint.write_bytes(moved)
    with pytest.raises(ValueError, match=r"checkpoint.zip: not a checkpoint"):
        read_checkpoint(checkpoint, PPOConfig(**TINY))
    checkpoint.write_bytes(b"no zip")
    with pytest.raises(ValueError, match=r"checkpoint.zip: not a checkpoint"):
        train(PPOConfig(**TINY), tmp_path / "run", resume=True)


@pytest.mark.parametrize("changed", ["layout", "name"])
def test_a_checkpoint_of_another_version_is_refused(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, changed: str
) -> None:
    """Its memory has another layout, or it needs a class that this version does not have."""
    shutil.copytree(run, tmp_path / "run")
    if changed == "layout":
        monkeypatch.setattr(Row, "entries", (*Row.entries[1:], Row.entries[0]))
    else:
        monkeypatch.delattr("flexarm_env.envs.batch.BatchSimulator")
    before = files(tmp_path / "run")
    with pytest.raises(ValueError, match=r"checkpoint.zip: a checkpoint of another version \(.*\); resume it with"):
        train(PPOConfig(**TINY), tmp_path / "run", resume=True)
    assert files(tmp_path / "run") == before


@pytest.mark.parametrize("number", [0, 1, 5])
def test_a_full_disk_names_the_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int) -> None:
    """At the first file, at the second, and in the middle of the training; what is there stays complete."""
    written: list[Path] = []

    def full(old: Path, new: Path) -> None:
        if len(written) == number:
            raise OSError(errno.ENOSPC, "No space left on device")
        written.append(new)
        old.rename(new)

    monkeypatch.setattr(os, "replace", full)
    folder = tmp_path / "run"
    with pytest.raises(OSError, match=rf"No space left on device: {re.escape(repr(str(folder)))}"):
        train(PPOConfig(**TINY), folder)
    assert {one.name for one in folder.iterdir()} - {"tensorboard"} == {one.name for one in written}


def test_threads_are_left_as_they_were(tmp_path: Path) -> None:
    before = torch.get_num_threads()
    torch.set_num_threads(2)
    try:
        train(PPOConfig(**{**TINY, "steps": 128}), tmp_path / "run")
        assert torch.get_num_threads() == 2
    finally:
        torch.set_num_threads(before)


def test_a_time_limit_is_bootstrapped() -> None:
    """With rewards of the value's own scale the buffer's last reward must hold the value of what comes after."""
    config = PPOConfig(**{**TINY, "options": {"start": "moving"}, "episode_steps": 5, "rollout": 5, "batch": 20})
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


# Kernels with noise that no other test compiles.
OTHERS = [pytest.param(f"{name}-v0", marks=pytest.mark.slow) for name in ("Reach", "SquareGain", "SquareResidual")]


@pytest.mark.parametrize("name", ["SquareEncoders-v0", "Track-v0", *OTHERS])
def test_other_environments_are_trained_alike(tmp_path: Path, name: str) -> None:
    config = PPOConfig(**{**TINY, "environment": f"FlexArm/{name}", "steps": 128, "evaluation_laps": 2})
    train(config, tmp_path / "run")
    trained = load_policy(tmp_path / "run")
    env = trained.make_env()
    assert trained.policy.log_std.shape == env.action_space.shape
    assert trained.environment == f"FlexArm/{name}"
