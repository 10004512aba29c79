"""`python -m scripts.train --seeds --sweep`: every setting with every seed, reused where finished."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest

from flexarm_agents import PPOConfig, train
from scripts import train as sweep
from tests.support.programs import ROOT
from tests.support.refusals import refuses
from tests.support.trainings import TINY, same_policy


class InProcess:
    def __init__(self, *given: Any) -> None:
        """Take what `executor` takes."""

    def run(
        self, function: Callable[[Any], Any], jobs: Sequence[Any], stoppable: bool = False
    ) -> Iterator[tuple[int, Any]]:
        for n, job in reversed(list(enumerate(jobs))):
            try:
                yield n, function(job)
            except ValueError as error:
                yield n, error


def test_seeds_are_numbers_and_ranges() -> None:
    assert sweep.seeds_of("7,0-2,1") == [0, 1, 2, 7]
    for text in ("", "a", "3-1", "1-", "-1", "1.5"):
        with refuses(ValueError, "seeds", "numbers and ranges"):
            sweep.seeds_of(text)


def test_a_sweep_has_all_combinations_and_each_its_folder() -> None:
    settings = sweep.settings_of({"learning_rate": [1e-3, 2e-3], "options": [{}, {"noise": 0.01}]}, PPOConfig())
    assert len(settings) == 4
    jobs = sweep.jobs_of(PPOConfig(), settings, [0, 1], Path("out"))
    assert len({folder for _, folder in jobs}) == 8
    assert {config.learning_rate for config, _ in jobs} == {1e-3, 2e-3}
    (one, folder), *_ = sweep.jobs_of(PPOConfig(), [{}], [0], Path("out"))
    assert (one, folder.parent) == (PPOConfig(), sweep.jobs_of(one, [{}], [5], Path("out"))[0][1].parent)
    with refuses(ValueError, "sweep['envs'] = 3", "a list"):
        sweep.settings_of({"envs": 3}, PPOConfig())
    for name in ("learning_rates", "seed"):
        with refuses(TypeError, name):
            sweep.settings_of({name: [1]}, PPOConfig())


def test_finished_trainings_are_taken_over_and_a_failed_one_hides_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "sweep.json").write_text(json.dumps({"learning_rate": [1e-3, 2e-3]}))
    monkeypatch.setattr(sweep, "executor", InProcess)
    base = PPOConfig(**TINY)
    options = sweep.Options("0-1", tmp_path / "sweep.json", tmp_path / "out")
    monkeypatch.setattr(sweep, "read", lambda: (base, options))
    sweep.main()
    rows = json.loads((tmp_path / "out" / "trainings.json").read_text())["settings"]
    assert [row["setting"] for row in rows] == [{"learning_rate": 1e-3}, {"learning_rate": 2e-3}]
    assert [one["seed"] for row in rows for one in row["trainings"]] == [0, 1, 0, 1]
    assert capsys.readouterr().out.count("| learning_rate = ") == 2
    folders = [Path(one["folder"]) for row in rows for one in row["trainings"]]
    before = [(folder / "checkpoint.zip").stat().st_mtime_ns for folder in folders]
    written = json.loads((folders[3] / "config.json").read_text())
    (folders[3] / "config.json").write_text(json.dumps(written | {"envs": 8}))  # another training is there
    with refuses(OSError, "1 failed", "the other trainings are kept"):
        sweep.main()
    assert [(folder / "checkpoint.zip").stat().st_mtime_ns for folder in folders] == before
    again = json.loads((tmp_path / "out" / "trainings.json").read_text())["settings"]
    assert again[0] == rows[0]
    assert [one["seed"] for one in again[1]["trainings"]] == [0]


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="POSIX signals")
@pytest.mark.usefixtures("signals")
def test_a_signal_keeps_what_all_trainings_have(tmp_path: Path) -> None:
    """Each finishes its rollout and keeps a checkpoint, though none is due; what goes on ends in the same bits."""
    config = {name: value for name, value in TINY.items() if name != "options"}
    config |= {"steps": 20_480, "evaluate_every": 5_120, "checkpoint_every": 10**6}
    command = [sys.executable, "-m", "scripts.train", "--seeds", "0-1", "--jobs", "2", "--output", str(tmp_path)]
    for name, value in config.items():
        command += [f"--{name.replace('_', '-')}", *map(str, value if isinstance(value, list) else [value])]
    with subprocess.Popen(command, cwd=ROOT, stderr=subprocess.PIPE, text=True) as process:
        limit = time.monotonic() + 300.0
        while len(list(tmp_path.glob("*/*/evaluations.csv"))) < 2 and time.monotonic() < limit:
            time.sleep(0.05)
        process.send_signal(signal.SIGTERM)
        _, errors = process.communicate(timeout=120)
    assert process.returncode == 128 + signal.SIGTERM, errors
    assert "stopped by SIGTERM" in errors
    folders = sorted(tmp_path.glob("*/seed-*"))
    assert [(folder / "checkpoint.zip").exists() for folder in folders] == [True, True]
    assert not list(tmp_path.glob("*/*/last_policy.npz"))
    again = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=600, check=False)
    assert again.returncode == 0, again.stderr
    train(PPOConfig(**config), tmp_path / "undisturbed")
    assert same_policy(folders[0] / "last_policy.npz", tmp_path / "undisturbed" / "last_policy.npz")
