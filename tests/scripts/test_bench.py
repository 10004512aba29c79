"""The benchmark: it runs from end to end, and its peers do the work for which they are timed; no time is judged."""

import json
import math
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from scripts.benchmarks import peers
from tests.support.programs import run_here, run_study

GROUPS = {"jacobians", "environment", "first_step", "batch", "learning", "sensors", "threads"}
GROUPS |= {"chain"} if find_spec("mujoco") else set()


@pytest.mark.slow
def test_a_trial_measures_every_group(tmp_path: Path) -> None:
    done = run_study("benchmarks", "--quick", "--output", tmp_path / "new folder" / "bench.json")
    assert done.returncode == 0, done.stderr
    results = json.loads((tmp_path / "new folder" / "bench.json").read_text())
    assert set(results["groups"]) == GROUPS
    assert ("EnvPool" in results["not_installed"]) == (find_spec("envpool") is None)
    assert "mean little" in done.stdout
    for group in results["groups"].values():
        assert all(0.0 < one["min"] <= one["median"] <= one["max"] < math.inf for one in group["times"].values())
        for ratio in group["ratios"]:
            assert {ratio["slow"], ratio["fast"]} <= {*group["times"]}
            assert 0.0 < ratio["min"] <= ratio["median"] <= ratio["max"] < math.inf
            assert ratio["says"] in done.stdout


def test_one_group_is_measured_alone(tmp_path: Path) -> None:
    status, printed = run_here("benchmarks", "--quick", "--only", "Jacobians", "--output", tmp_path / "bench.json")
    assert not status, printed
    results = json.loads((tmp_path / "bench.json").read_text())
    assert set(results["groups"]) == {"jacobians"}
    assert results["not_installed"] == []


def test_chain_simulates_the_seconds_it_is_timed_for(monkeypatch: pytest.MonkeyPatch) -> None:
    mujoco = pytest.importorskip("mujoco", reason="MuJoCo is in the extra `bench`")
    made = []
    make = mujoco.MjData
    monkeypatch.setattr(mujoco, "MjData", lambda model: made.append(make(model)) or made[-1])
    subject = peers.mujoco_chain(4, 0.05)
    for _ in range(2):
        assert subject.prepare is not None
        subject.prepare()
        subject.work()
        assert made[-1].time == pytest.approx(subject.amount)
        assert abs(made[-1].qpos[0]) > 1e-3


def test_envpool_makes_the_steps_it_is_timed_for(monkeypatch: pytest.MonkeyPatch) -> None:
    envpool = pytest.importorskip("envpool", reason="EnvPool is in the extra `bench`")
    made = []
    make = envpool.make_gymnasium
    monkeypatch.setattr(envpool, "make_gymnasium", lambda *a, **k: made.append(make(*a, **k)) or made[-1])
    subject = peers.envpool_acrobot(16, 0.01)
    assert subject.amount == 992  # 62 calls
    subject.work()
    *_, info = made[0].step(np.zeros(16, dtype=np.int32))
    assert np.all(info["elapsed_step"] == 63)
