"""The benchmark's command line, end to end; what it measures is not judged here."""

import json
import math
import os
from functools import partial
from importlib.util import find_spec

import pytest

from scripts.benchmarks.lap import LAP, lap
from tests.support.programs import help_of, refusal, run_study

GROUPS = {"torque_driven", "closed_loop", "jacobians", "iterations"}
GROUPS |= {"environment", "first_step", "lap", "batch", "learning"}
GROUPS |= {"chain"} if find_spec("mujoco") else set()


run = partial(run_study, "benchmarks")


@pytest.fixture(scope="module")
def trial(tmp_path_factory):
    """Collect what `--quick` writes and prints."""
    path = tmp_path_factory.mktemp("bench") / "new folder" / "bench.json"
    done = run("--quick", "--output", path)
    assert done.returncode == 0, done.stderr

    def refuse(constant):
        raise ValueError(f"not strict JSON: {constant}")

    assert [file.name for file in path.parent.iterdir()] == ["bench.json"]
    return json.loads(path.read_text(), parse_constant=refuse), done.stdout


def test_the_whole_lap_can_be_declared():
    """The trial runs a part of it, so that a limit that only the whole passes would not be met."""
    assert lap(LAP).subjects


def test_one_group_is_measured_alone(tmp_path):
    done = run("--quick", "--only", "closed loop", "--output", tmp_path / "bench.json")
    assert done.returncode == 0, done.stderr
    results = json.loads((tmp_path / "bench.json").read_text())
    assert set(results["groups"]) == {"closed_loop"}
    assert results["not_installed"] == []
    assert "only = 'laps': must be one of 'torque-driven arm'" in refusal("benchmarks", "--only", "laps")


@pytest.mark.slow
def test_structure(trial):
    results, _ = trial
    assert set(results) == {"machine", "quick", "not_installed", "groups"}
    assert ("EnvPool" in results["not_installed"]) == (find_spec("envpool") is None)
    assert results["quick"] is True
    assert {"cpu", "cores", "python", "numba", "numpy", "scipy", "gymnasium"} <= set(results["machine"])
    assert isinstance(results["machine"]["core"], int) == hasattr(os, "sched_setaffinity")
    assert set(results["groups"]) == GROUPS
    for group in results["groups"].values():
        assert set(group) == {"title", "unit", "clock", "times", "given", "facts", "ratios"}
        assert group["times"]
        assert group["ratios"]


@pytest.mark.slow
def test_ratios_are_positive_and_name_what_was_timed(trial):
    results, _ = trial
    for group in results["groups"].values():
        named = set(group["times"]) | set(group["given"])
        for ratio in group["ratios"]:
            assert {ratio["slow"], ratio["fast"]} <= named
            assert 0.0 < ratio["min"] <= ratio["median"] <= ratio["max"] < math.inf
            assert ratio["repeats"] >= 1


@pytest.mark.slow
def test_times_are_positive(trial):
    results, _ = trial
    for group in results["groups"].values():
        for values in group["times"].values():
            assert 0.0 < values["min"] <= values["median"] <= values["max"] < math.inf
            assert 0.0 < values["per_second"] < math.inf
            assert 0.0 < values["wall"] < math.inf


@pytest.mark.slow
def test_report_says_every_ratio_and_that_a_trial_means_little(trial):
    results, printed = trial
    assert "mean little" in printed
    for group in results["groups"].values():
        for ratio in group["ratios"]:
            assert ratio["says"] in printed


@pytest.mark.parametrize(
    ("arguments", "named"),
    [(("--repeats", 0), "repeats = 0"), (("--cold", -1), "cold = -1"), (("--modes", 1, 7), "modes = (1, 7)")],
)
def test_bad_options_are_refused_before_any_work(arguments, named, tmp_path):
    path = tmp_path / "bench.json"
    assert f"error: {named}: must be" in refusal("benchmarks", *arguments, "--output", path)
    assert not path.exists()


def test_help_explains_the_options():
    text = help_of("benchmarks")
    for option in ("--output", "--quick", "--repeats", "--cold", "--modes"):
        assert option in text
