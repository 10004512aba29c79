"""Paths that no training had: a laboratory arm of the default arm's size, and what a new measurement leaves."""

import json
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from flexarm_env import ArmParameters, FlexibleArm
from flexarm_env.analysis import OperatingPoint, natural_modes
from flexarm_env.envs.registration import IDS
from flexarm_env.parameters import arm_parameters
from flexarm_env.rollout import run_policy
from scripts.learning import any_path
from tests.support.refusals import refuses


def test_a_scaled_arm_vibrates_as_its_original_does_in_other_units() -> None:
    options = any_path.scaled("quanser_measured")
    own, ours = ArmParameters.named("quanser_measured"), ArmParameters()
    scaled = arm_parameters(options["arm"])
    angles = 0.0, 0.5 * np.pi
    found, original, ordinary = (
        natural_modes(OperatingPoint.at_angles(FlexibleArm(one), angles), "locked") for one in (scaled, own, ours)
    )
    pace = found.frequencies[0] / original.frequencies[0]
    assert found.frequencies == pytest.approx(pace * original.frequencies, rel=1e-9)
    assert found.frequencies[0] == pytest.approx(ordinary.frequencies[0], rel=1e-9)
    poles, others = (
        np.linalg.eigvals(OperatingPoint.at_angles(FlexibleArm(one), angles).linearisation.A) for one in (scaled, own)
    )
    assert np.sort(np.abs(poles)) == pytest.approx(pace * np.sort(np.abs(others)), rel=1e-6, abs=1e-6)
    friction = IDS["Lab-v0"].options["torque_limit"][1] / own.coulomb_friction[1]
    assert options["torque_limit"][1] / scaled.coulomb_friction[1] == pytest.approx(friction)
    assert scaled.link_lengths == ours.link_lengths


def test_on_the_chain_an_agent_reads_what_it_does_elsewhere(monkeypatch: pytest.MonkeyPatch) -> None:
    """The chain's id has other blocks than `SquareUnknown-v0`; a controller is not run there."""
    chain = "square; the chain in MuJoCo, motors not late"
    monkeypatch.setattr(any_path, "run_policy", partial(run_policy, max_steps=2))
    found = any_path.measured("student_unknown", chain, 1)
    assert found is not None
    assert found["lost"] == 0
    assert 0.0 < found["errors"][0] < 0.1  # of two periods
    assert any_path.measured("lqg_adaptive", chain, 1) is None


def test_a_path_that_is_measured_anew_leaves_the_others(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    shown = {"lost": 1, "errors": [0.05, float("inf"), 0.02]}
    monkeypatch.setattr(any_path, "FILE", tmp_path / "any_path.json")
    monkeypatch.setattr(any_path, "measured", lambda name, path, episodes: shown if name == "universal" else None)
    before = {name: {path: {"refused": "no plan"} for path in any_path.PATHS} for name in any_path.ENTRIES}
    any_path.FILE.write_text(json.dumps(before))
    monkeypatch.setattr("sys.argv", ["any_path", "--paths", "circle"])
    any_path.main()
    rows = {row.split(" | ")[0].strip("| "): row for row in any_path.errors(any_path.results(tmp_path, 1)).splitlines()}
    assert rows["circle"] == "| circle | 1; 50 / lost / 20 | - | - |"
    assert rows["square"] == "| square | needs a plan | needs a plan | needs a plan |"
    monkeypatch.setattr("sys.argv", ["any_path", "--paths", "triangle"])
    with refuses(ValueError, "paths = 'triangle': must be one of 'square'"):
        any_path.main()
