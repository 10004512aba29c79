"""`python -m scripts.off_policy`: its picture, and what it refuses; tests/recipes trains."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tests.support.programs import run_here

off_policy = pytest.importorskip("scripts.off_policy", reason="the extra `train` brings torch", exc_type=ImportError)


def test_no_training_is_left_out_of_the_picture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import matplotlib.pyplot as plt

    shown: list[Any] = []
    monkeypatch.setattr(plt, "close", shown.append)
    lap = {"rms": 0.1, "ended": "truncated", "duration": 16.0}
    rows = [{"steps": n, "return": 1.0, "laps": {"swing": lap, "plain": lap}} for n in (0, 1)]
    curves = [
        {"algorithm": "sac", "environment": "FlexArm/Square-v0", "seed": seed, "rows": rows} for seed in range(20)
    ]
    off_policy.draw(curves, tmp_path / "curves.png")
    monkeypatch.undo()
    axes = shown[0].axes
    looks = {(line.get_color(), line.get_marker()) for line in axes[0].lines}
    plt.close(shown[0])
    assert (len(axes[0].lines), len(axes[1].lines), len(looks)) == (20, 40, 20)
    assert [path.name for path in tmp_path.iterdir()] == ["curves.png"]


def test_a_bad_seed_is_refused_before_anything_is_made(tmp_path: Path) -> None:
    status, printed = run_here("off_policy", "--seed", "-1", "--output", tmp_path / "made")
    assert status == 1
    assert "seed = -1: must be an integer >= 0" in printed
    assert not (tmp_path / "made").exists()
