"""The contract of all trainings: what one leaves, that it resumes to the same bits, and what it refuses."""

import csv
import json
import os
import re
import shutil
import signal
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from stable_baselines3 import PPO

from flexarm_agents import StandardScore, TrainingStopped, config_of, evaluate, load_policy, train
from flexarm_agents.evaluation.scoring import rank
from flexarm_agents.policies.encoders import PastReadings
from flexarm_agents.policies.lstm import Lstm
from flexarm_agents.policies.observer import Observer
from flexarm_agents.training.config import RunConfig, read_config
from flexarm_agents.training.pictures import draw_curve
from flexarm_agents.training.run_folder import RunFolder, read_checkpoint
from flexarm_env.kernels.layout import Row
from flexarm_env.laps import LAPS
from tests.support.refusals import refuses
from tests.support.trainings import DESCENDED, TAUGHT, TINIES, TINY, at_step, broken_off, same_policy, short_rollouts

CONTAINED = ("recurrent_ppo", "sac")  # others have each of these, and more
TRIED = {name: values for name, values in TINIES.items() if name not in CONTAINED}
CASES = {"ppo": TINY, **TRIED, "dagger": TAUGHT, "fopg": DESCENDED}
# Steps of the batch at which each is broken off: before its first checkpoint, between two, in the last part (a teaching
# there alone; `SIGNALS` has its second); of TQC also while its actions are still drawn at random.
BREAKS = {"ppo": (15, 100), "tqc": (70, 100), "dagger": (450,), "fopg": (100, 160, 175)}
SIGNALS = [  # sent at a step of the batch, after which so many steps of the environments are kept
    ("ppo", signal.SIGINT, 15, 128),
    ("ppo", signal.SIGTERM, 75, 384),
    ("tqc", signal.SIGTERM, 75, 304),
    ("dagger", signal.SIGTERM, 250, 1600),
    ("fopg", signal.SIGTERM, 50, 64),
]
STEPS = {"dagger": [800, 1600, 2400], "fopg": [64, 128, 192, 256]}
ENCODERS = {"recurrent curriculum": Lstm, "observer": Observer, "dagger": PastReadings, "privileged": PastReadings}
LEFT = {
    "best_policy.npz", "checkpoint.zip", "config.json", "evaluations.csv", "evaluations.json", "laps.png",
    "last_policy.npz", "learning_curve.png", "tensorboard", "versions.json",
}  # fmt: skip
PICTURES = ("laps.png", "learning_curve.png")
MORE = {"dagger": {"plans"}, "fopg": set(), "initial": {"best_model.zip", "initial_policy.npz"}}


class Runs:
    """Each training once, undisturbed; their folders must not be changed."""

    def __init__(self, folder: Path, taught: Path) -> None:
        self.folder, self.taught = folder, taught

    def config(self, name: str, **changes: Any) -> Any:
        plans = {"plans": str(self.taught / "plans")} if name == "dagger" else {}
        return config_of(**CASES[name] | plans | changes)

    def __call__(self, name: str) -> Path:
        folder = self.taught if name == "dagger" else self.folder / name
        if not folder.exists():
            train(self.config(name), folder)
        return folder


@pytest.fixture(scope="module", autouse=True)
def tiny() -> Iterator[None]:
    """Teach for the first seconds of a lap."""
    with short_rollouts():
        yield


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory, taught: Path) -> Runs:
    return Runs(tmp_path_factory.mktemp("runs"), taught)


def files(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


def evaluations(folder: Path) -> Any:
    rows = json.loads((folder / "evaluations.json").read_text())
    assert all(row.pop("seconds") for row in rows)
    return rows


@pytest.mark.parametrize("name", CASES)
def test_what_a_training_leaves(runs: Runs, name: str) -> None:
    run, rows = runs(name), evaluations(runs(name))
    assert {path.name for path in run.iterdir()} == LEFT | MORE.get(name, {"best_model.zip"})
    assert list((run / "tensorboard").glob("events.out.tfevents.*"))
    assert all(((run / picture).stat().st_size > 1000) == (name == "ppo") for picture in PICTURES)
    if name in ("ppo", *STEPS):
        assert [row["steps"] for row in rows] == STEPS.get(name, [256, 512])
    with (run / "evaluations.csv").open(newline="") as file:
        table = list(csv.DictReader(file))
    for lap in LAPS:
        errors = [str(row[lap]["rms"] or "") for row in rows]  # of a lap that ended early: none
        assert [row[f"{lap}_rms"] for row in table] == errors
        assert [float(row[f"{lap}_duration"]) for row in table] == [row[lap]["duration"] for row in rows]
        assert [float(row[f"{lap}_peak_torque_2"]) for row in table] == [row[lap]["peak_torque"][1] for row in rows]
    best = load_policy(run)
    assert (best.environment, best.options, best.name) == ("FlexArm/Square-v0", CASES[name].get("options", {}), name)
    assert type(best.policy.encoder) is ENCODERS.get(name, type(None))
    assert (best.policy.log_std_weights is not None) == (name in ("sac curriculum", "tqc"))
    again = evaluate(best.make_env(), best.policy, seed=1_000_003)
    assert again.as_mapping() == {lap: best.notes["evaluation"][lap] for lap in LAPS}
    ranks = [rank([StandardScore.of(row)]) for row in rows]
    assert {**best.notes["evaluation"], "seconds": 0.0} == {**rows[ranks.index(min(ranks))], "seconds": 0.0}
    assert read_config(best.notes["config"]) == runs.config(name, **({"plans": None} if name == "dagger" else {}))
    versions = json.loads((run / "versions.json").read_text())
    assert best.notes["versions"] == versions
    assert set(versions) >= {"python", "code", "torch", "numpy", "sb3_contrib"}


def test_the_best_model_is_the_best_policy_and_another_seed_gives_another(runs: Runs, tmp_path: Path) -> None:
    policy, model = load_policy(runs("ppo")).policy, PPO.load(runs("ppo") / "best_model.zip", device="cpu")
    observations = np.random.default_rng(0).normal(size=(20, policy.observation_size)).astype(np.float32)
    expected, _ = model.predict(observations, deterministic=True)
    np.testing.assert_allclose(policy.predict(observations, deterministic=True)[0], expected, atol=2e-6)
    train(runs.config("ppo", seed=1), tmp_path / "other")
    assert not same_policy(runs("ppo") / "last_policy.npz", tmp_path / "other" / "last_policy.npz")


@pytest.mark.parametrize(("name", "step"), [(name, n) for name in CASES for n in BREAKS.get(name, (100,))])
def test_an_interrupted_training_ends_in_the_same_bits(runs: Runs, tmp_path: Path, name: str, step: int) -> None:
    """Replay buffers, memories of encoders, candidates and plans go on as they were; what is complete is left alone."""
    whole, run, config = runs(name), tmp_path / "run", runs.config(name)
    broken_off(config, run, step)
    assert (run / "checkpoint.zip").exists() == (step != 15)
    np.random.seed(5)  # noqa: NPY002
    torch.manual_seed(5)  # what the generators did meanwhile has no influence
    train(config, run, resume=True)
    assert same_policy(whole / "last_policy.npz", run / "last_policy.npz")
    assert evaluations(whole) == evaluations(run)
    before = files(run)
    assert train(config, run, resume=True).last["steps"] == evaluations(run)[-1]["steps"]
    assert files(run) == before


@pytest.mark.parametrize(("name", "number", "step", "kept"), SIGNALS)
def test_a_signal_keeps_every_step(
    runs: Runs, tmp_path: Path, name: str, number: signal.Signals, step: int, kept: int
) -> None:
    """The part is finished and a checkpoint written, though none is due; what resumes ends in the same bits."""
    before = [signal.getsignal(each) for each in (signal.SIGINT, signal.SIGTERM)]
    whole, run = runs(name), tmp_path / "run"
    config = runs.config(name, **({} if name in STEPS else {"checkpoint_every": 10_000}))
    with at_step(step, lambda: os.kill(os.getpid(), number)), pytest.raises(TrainingStopped) as caught:
        train(config, run)
    assert (caught.value.signal, caught.value.steps) == (number, kept)
    assert isinstance(caught.value, KeyboardInterrupt)
    assert read_checkpoint(run / "checkpoint.zip", config)
    assert [signal.getsignal(each) for each in (signal.SIGINT, signal.SIGTERM)] == before
    train(config, run, resume=True)
    assert same_policy(whole / "last_policy.npz", run / "last_policy.npz")


@pytest.mark.parametrize("name", CASES)
def test_another_training_and_a_spoilt_one_are_refused(runs: Runs, tmp_path: Path, name: str) -> None:
    """Neither is a folder overwritten, nor do weights end under another configuration's name."""
    run, config, other = runs(name), runs.config(name), runs.config(name, seed=4, learning_rate=0.02)
    before = files(run)
    with pytest.raises(FileExistsError, match=rf"folder = {re.escape(str(run))}: exists and is not empty; resume"):
        train(config, run)
    refused = f"has {config.seed}; only the same configuration resumes (different: seed, learning_rate)"
    with refuses(ValueError, f"seed = 4: the training in {run} {refused}"):
        train(other, run, resume=True)
    assert files(run) == before
    theirs = RunFolder(tmp_path / "other")
    theirs.enter(other, json.loads((run / "versions.json").read_text()), resume=False)
    shutil.copy(run / "checkpoint.zip", theirs.checkpoint)
    left = files(theirs.path)
    with refuses(ValueError, f"seed = 4: the training in {theirs.checkpoint} {refused}"):
        train(other, theirs.path, resume=True)
    assert files(theirs.path) == left
    spoilt = shutil.copytree(run, tmp_path / "spoilt")
    (spoilt / "checkpoint.zip").write_bytes(b"no zip")
    with refuses(ValueError, "checkpoint.zip: not a checkpoint"):
        train(config, spoilt, resume=True)


def moved(path: Path) -> None:
    """Say that the zip's list of contents is elsewhere, which the system refuses to look up."""
    content = bytearray(path.read_bytes())
    content[-3] ^= 1
    path.write_bytes(content)


def without_configuration(path: Path) -> None:
    with zipfile.ZipFile(path) as file:
        parts = {name: file.read(name) for name in file.namelist() if name != "config.json"}
    with zipfile.ZipFile(path, "w") as file:
        for name, content in parts.items():
            file.writestr(name, content)


@pytest.mark.parametrize("spoil", [moved, without_configuration])
def test_a_checkpoint_is_whole(runs: Runs, tmp_path: Path, spoil: Any) -> None:
    path = Path(shutil.copy(runs("ppo") / "checkpoint.zip", tmp_path))
    taught: RunConfig = config_of(**TAUGHT)
    with refuses(ValueError, "checkpoint.zip: not a checkpoint", "algorithm = 'ppo': must be one of 'dagger'"):
        read_checkpoint(path, taught)
    spoil(path)
    with refuses(ValueError, "checkpoint.zip: not a checkpoint of this version"):
        read_checkpoint(path, config_of(**TINY))


@pytest.mark.parametrize("changed", ["layout", "name"])
def test_other_versions_are_refused(runs: Runs, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, changed: str) -> None:
    """A checkpoint's memory has another layout, or it needs a class that this version does not have."""
    run = shutil.copytree(runs("ppo"), tmp_path / "run")
    if changed == "layout":
        monkeypatch.setattr(Row, "entries", (*Row.entries[1:], Row.entries[0]))
    else:
        monkeypatch.delattr("flexarm_env.envs.batch.BatchSimulator")
    before = files(run)
    with pytest.raises(ValueError, match=r"checkpoint.zip: a checkpoint of another version \(.*\); resume it with"):
        train(config_of(**TINY), run, resume=True)
    assert files(run) == before


def test_a_folder_without_a_training(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"folder = .*nothing: holds no config.json"):
        train(config_of(**TINY), tmp_path / "nothing", resume=True)
    assert not (tmp_path / "nothing").exists()
    (tmp_path / "file").touch()
    with pytest.raises(FileExistsError, match="file: exists"):
        train(config_of(**TINY), tmp_path / "file")


@pytest.mark.parametrize("complete", [("swing",), ("plain",), ()])
def test_the_curve_is_drawn_while_some_laps_are_lost(complete: tuple[str, ...], tmp_path: Path) -> None:
    row = {lap: {"duration": 2.0, "rms": 0.1 if lap in complete else None, "complete": lap in complete} for lap in LAPS}
    draw_curve([{"steps": 1000, **row}, {"steps": 2000, **row}], {lap: lap for lap in LAPS}, tmp_path / "curve.png")
    assert (tmp_path / "curve.png").stat().st_size > 1000
