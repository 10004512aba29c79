"""The programs of this repository, run as a user runs them."""

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def run_study(module: str, *arguments: str | Path, **options: object) -> subprocess.CompletedProcess[str]:
    """Run a study (`python -m scripts.NAME`) in whatever folder; `options` are those of `subprocess.run`."""
    command = [sys.executable, "-m", f"scripts.{module}", *map(str, arguments)]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False, **options)  # type: ignore[call-overload, no-any-return]
