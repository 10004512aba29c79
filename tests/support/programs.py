"""The programs of this repository, run as a user runs them."""

import importlib
import io
import os
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any
from unittest.mock import patch

from scripts.common.command_line import run

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = {"flexarm_env": ROOT / "flexarm_env"}
PACKAGES |= {f"flexarm_{name}": ROOT / name for name in ("baselines", "agents")}


def run_study(module: str, *arguments: str | Path, **options: object) -> subprocess.CompletedProcess[str]:
    """Run a study (`python -m scripts.NAME`) in whatever folder; `options` are those of `subprocess.run`."""
    command = [sys.executable, "-m", f"scripts.{module}", *map(str, arguments)]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False, **options)  # type: ignore[call-overload, no-any-return]


def results_of(module: str, output: Path, *arguments: str) -> Path:
    """Run a study that must succeed, and return the folder of its results."""
    done = run_study(module, *arguments, "--output", output)
    assert done.returncode == 0, done.stderr
    return output


def run_bare(*command: str | Path, cwd: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run a command without what the caller's PYTHONPATH would add."""
    env = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"} | environment
    arguments = [str(part) for part in command]
    return subprocess.run(arguments, cwd=cwd, env=env, capture_output=True, text=True, timeout=900, check=False)


def run_here(module: str, *arguments: object) -> tuple[Any, str]:
    """Run a study in this process, which is faster than another one; return its exit status and all that it printed."""
    study = importlib.import_module(f"scripts.{module}")
    main = (study if hasattr(study, "main") else importlib.import_module(f"{study.__name__}.__main__")).main
    printed, status = io.StringIO(), None
    with patch.object(sys, "argv", [module, *map(str, arguments)]), redirect_stdout(printed), redirect_stderr(printed):
        try:
            run(main)
        except SystemExit as end:
            status = end.code
    return status, printed.getvalue()


def refusal(module: str, *arguments: object) -> str:
    """Return what a study says of bad input before it ends."""
    status, printed = run_here(module, *arguments)
    assert status not in (0, None)
    return f"{printed}{status}"
