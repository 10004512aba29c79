"""train.py and evaluate.py as they are run: train, go on, evaluate."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"
TINY = ["--envs", "4", "--rollout", "32", "--batch", "64", "--epochs", "2", "--hidden", "16", "8"]
TINY += ["--episode-steps", "50", "--evaluate-every", "200", "--checkpoint-every", "200"]


def script(name: str, *arguments: str | Path, cwd: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-W", "error", SCRIPTS / name, *arguments]
    return subprocess.run([str(part) for part in command], cwd=cwd, capture_output=True, text=True, timeout=300)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where a tiny training was run, in the folder that it takes by itself."""
    place = tmp_path_factory.mktemp("place")
    options = json.dumps({"noise": 0.001})
    result = script("train.py", *TINY, "--steps", "256", "--seed", "3", "--options", options, cwd=place)
    assert result.returncode == 0, result.stderr
    assert "best: r.m.s. " in result.stdout
    assert "ended early: error after " in result.stdout
    return place


def test_train_and_resume(folder: Path) -> None:
    run = folder / "runs" / "Square-v0-3"
    assert json.loads((run / "config.json").read_text())["options"] == {"noise": 0.001}
    again = (*TINY, "--steps", "256", "--seed", "3", "--options", '{"noise": 0.001}')
    result = script("train.py", *again, cwd=folder)
    assert result.returncode == 1
    assert result.stderr.startswith("error: folder = runs/Square-v0-3: exists and is not empty; resume")
    result = script("train.py", *again, "--resume", cwd=folder)
    assert result.returncode == 0, result.stderr
    result = script("train.py", *again, "--resume", "--gamma", "0.9", cwd=folder)
    assert result.returncode == 1
    assert result.stderr.startswith("error: gamma = 0.9: the training in runs/Square-v0-3 has 0.985")


def test_evaluate(folder: Path) -> None:
    result = script("evaluate.py", "runs/Square-v0-3", cwd=folder)
    assert result.returncode == 0, result.stderr
    for name in ("IFDC", "FLSAC", "no torque", "random torque", "Square-v0-3"):
        assert name in result.stdout
    (line,) = [line for line in result.stdout.splitlines() if line.startswith("runs/Square-v0-3")]
    assert "ENDED at " in line
    assert " Square-v0* " in line  # its options are not the id's
    assert line.count("(") == 2  # its scores are no lap's
    laps = {
        lap["name"]: lap
        for lap in json.loads((folder / "results" / "evaluation" / "evaluation.json").read_text())["laps"]
    }
    assert laps["IFDC"]["complete"]
    assert laps["IFDC"]["rms"] == pytest.approx(0.84, abs=0.1)  # one mode a link
    assert not laps["no torque"]["complete"]
    assert laps["no torque"]["rms_after_2s"] is None
    result = script("evaluate.py", "nobody", "--no-baselines", "--no-shipped", cwd=folder)
    assert result.returncode == 1
    assert result.stderr.splitlines()[-1].startswith("error: source = 'nobody': neither")
    result = script("evaluate.py", "--no-baselines", "--no-shipped", cwd=folder)
    assert result.returncode == 1
    assert "nothing to score" in result.stderr


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--options", '{"noize": 1}'), "noize: no such option; did you mean 'noise'"),
        (("--batch", "1000", "--options", '{"noise": 0.1}'), "batch = 1000: must divide rollout * envs"),
    ],
)
def test_bad_input(tmp_path: Path, arguments: tuple[str, ...], message: str) -> None:
    result = script("train.py", *arguments, cwd=tmp_path)
    assert result.returncode in (1, 2)  # 2: from the command line's reader
    assert message in " ".join(result.stderr.replace("│", " ").split())
    assert "Traceback" not in result.stderr
    assert not list(tmp_path.iterdir())  # nothing was begun
