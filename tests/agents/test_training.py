"""Training: the folder that it leaves, resuming, the same bits from the same seed; warm starts and curricula."""

import errno
import logging
import os
import re
import signal
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.vec_env import VecMonitor

import flexarm_agents.training.reward
from flexarm_agents import (
    FlexArmVecEnv,
    NetworkPolicy,
    PPOConfig,
    TrainingStopped,
    config_of,
    load_policy,
    network_policy,
    train,
)
from flexarm_agents.environments import settings_of
from flexarm_agents.files import put
from flexarm_agents.jobs.stopping import StopSignals
from flexarm_agents.policies.constant import ConstantPolicy
from flexarm_agents.training.models import end_curriculum, new_model
from flexarm_agents.training.randomisation import EPISODES, FIRST, STEP, Width
from flexarm_agents.training.reward import TrainingCallback, widen
from flexarm_agents.training.run_folder import RunFolder
from tests.support.trainings import ID, TINIES, TINY, Interrupted, same_network


@pytest.mark.usefixtures("signals")
def test_a_second_signal_ends_at_once() -> None:
    with pytest.raises(KeyboardInterrupt) as caught, StopSignals() as stop:  # noqa: PT012
        os.kill(os.getpid(), signal.SIGINT)
        assert stop.received == signal.SIGINT
        os.kill(os.getpid(), signal.SIGINT)
    assert not isinstance(caught.value, TrainingStopped)


def test_another_thread_trains_without_handlers(tmp_path: Path) -> None:
    with ThreadPoolExecutor(1) as pool:
        assert pool.submit(train, PPOConfig(**{**TINY, "steps": 128}), tmp_path / "run").result()


def test_each_evaluation_is_logged_where_there_is_no_bar(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """The number of torch's threads is left as it was."""
    assert not sys.stderr.isatty()
    before = torch.get_num_threads()
    torch.set_num_threads(2)
    try:
        with caplog.at_level(logging.INFO, "flexarm_agents"):
            train(PPOConfig(**TINY), tmp_path / "run", progress=True)
        assert torch.get_num_threads() == 2
    finally:
        torch.set_num_threads(before)
    first, second = (record.getMessage() for record in caplog.records)
    early = r"lost after \d\.\d\d s: \w+"
    ended = rf"swing lap: {early}; plain lap: {early}; none with complete laps yet"
    assert re.fullmatch(rf" +256 steps +\d+ s  {ended}", first)
    assert re.fullmatch(rf" +512 steps +\d+ s  {ended}", second)


def test_what_a_killed_process_left_of_a_file_does_not_count(tmp_path: Path) -> None:
    """Killed while it wrote the first file, a training can be begun again."""
    (tmp_path / ".new-config.json").write_text("{")
    config = PPOConfig(**TINY)
    folder = RunFolder(tmp_path)
    folder.enter(config, {}, resume=False)
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


def mean_return(policy: Any) -> float:
    """Return what episodes earn in a second and a half, or until they end."""
    env = VecMonitor(FlexArmVecEnv.make(ID, 8, max_episode_steps=150, start="corners"))
    env.seed(7)
    found = float(evaluate_policy(policy, env, 8)[0])  # type: ignore[arg-type]
    env.close()
    return found


def test_a_small_agent_learns(tmp_path: Path) -> None:
    """Three seeds earned 2.3 to 3.7 times what motors at rest earn; another processor's rounding is another draw."""
    sizes: dict[str, Any] = {"envs": 8, "rollout": 256, "batch": 512, "hidden": (64, 64), "episode_steps": 150}
    train(PPOConfig(seed=1, steps=50_000, evaluate_every=50_000, learning_rate=2e-3, **sizes), tmp_path / "run")
    last = load_policy(tmp_path / "run", last=True).policy
    assert mean_return(last) > 1.5 * mean_return(ConstantPolicy(2))


INITIAL = TINIES["initial"]


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
    notes = {"config": {"environment": ID, "options": TINY["options"]}}
    network_policy(new_model(config_of(**TINIES["sac"])), notes).save(tmp_path / "sac.npz")
    with pytest.raises(ValueError, match=r"must be a fully connected network, as PPO and teaching make it"):
        train(config_of(**{**TINY, "initial_policy": str(tmp_path / "sac.npz")}), tmp_path / "run")


def test_a_curriculum_ends() -> None:
    """Episodes begin anew, without the curriculum's options; the observation space stays."""
    config = config_of(**TINIES["curriculum"])
    model, settings, spaces = new_model(config), [], []

    def look() -> None:
        envs: Any = model.get_env()
        own = envs.unwrapped.env.settings
        settings.append((own.lap_time, own.deflection_limit))
        spaces.extend((envs.observation_space, envs.unwrapped.env.single_observation_space))

    look()
    model.learn(128)
    end_curriculum(config, model)
    look()
    assert settings == [(32.0, None), (16.0, 1.5)]
    assert spaces[0] == spaces[2] == spaces[3]
    model.learn(256, reset_num_timesteps=False)


def test_ranges_widen_while_few_are_lost() -> None:
    """They begin at the arm as published, and never leave the options' own."""
    config = config_of(**TINIES["widening"], curriculum_options={"randomisation": {"delay": [0.05, 0.09]}})
    settings = settings_of(config.environment, config.options | config.curriculum_options)
    width = Width()
    assert width.ranges(settings) == {"delay": pytest.approx((0.05, 0.054))}  # the published 31 ms are outside
    kept, lost = ({"TimeLimit.truncated": cut, "end_code": code} for cut, code in ((True, 0.0), (False, 1.0)))
    over = [True, False, True]
    for _ in range(EPISODES // 2):
        assert width.decided() is width
        width = width.after(over, [kept, {}, kept | {"end_code": 7.0, "TimeLimit.truncated": False}])
    assert width.decided() == Width(pytest.approx(FIRST + STEP))
    assert Width(1.0, EPISODES, 0).decided().ranges(settings) == {"delay": (0.05, 0.09)}
    for share, of_hundred, then in ((0.5, 10, 0.5), (0.5, 30, 0.5 - STEP), (FIRST, 30, FIRST)):
        assert Width(share, 99, of_hundred - 1).after([True], [lost]).decided() == Width(then)
    model = new_model(config)
    widen(config, model, Width(0.5))
    env = model.get_env()
    assert env is not None
    env.reset()
    delays = [episode.parameters["delay"] for episode in env.get_attr("episode")]
    assert 0.05 <= min(delays) <= max(delays) <= 0.07
    env.close()
