"""`Trajectory`: checked when made, the same after saving and loading."""

from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from flexarm_env import ArmParameters, FlexibleArm, Trajectory
from tests.support.lagrange import loaded_arm, random_state
from tests.support.refusals import refuses


@pytest.fixture(scope="module")
def default() -> FlexibleArm:
    return FlexibleArm(ArmParameters.linear())


def test_a_run_survives_saving(tmp_path: Path) -> None:
    arm = FlexibleArm(loaded_arm(2))
    run = arm.simulate(random_state(arm.parameters, 2, 0.1, 0.5), np.ones((5, 2)), 0.05, step=0.01, substeps="auto")
    run.notes["case"] = {"name": "doublet", "gains": [1, 2.5], "ended": None}
    run.save(tmp_path / "run.npz")
    again = Trajectory.load(tmp_path / "run.npz")
    assert again.parameters == run.parameters
    assert again.notes == run.notes
    assert set(again.arrays()) == set(run.arrays())
    for name, array in run.arrays().items():
        np.testing.assert_array_equal(again.arrays()[name], array, strict=True)
    FlexibleArm(again.parameters)  # of the right types, down to the tuples


def test_a_policys_run_survives_saving(default: FlexibleArm, tmp_path: Path) -> None:
    extra = {"reference": np.ones((3, 2)), "sensed": np.zeros((3, 2)), "gain": np.arange(3.0), "reward": np.ones(3)}
    run = default.record(0.1 * np.arange(3), np.zeros((3, 12)), np.zeros((3, 2)), **extra)
    run.save(tmp_path / "run.npz")
    again = Trajectory.load(tmp_path / "run.npz")
    for name, array in extra.items():
        np.testing.assert_array_equal(getattr(again, name), array)
    assert set(run.arrays()) == {f.name for f in fields(Trajectory)} - {"parameters", "notes"}


def test_other_files_are_refused(tmp_path: Path) -> None:
    reasons = {
        "text": "not a saved Trajectory (",
        "empty": "not a saved Trajectory (",
        "array": "not a saved Trajectory (File is not a zip file)",
        "arrays": "not a saved Trajectory (no entry 'head')",
        "cut": "not a saved Trajectory (",
        "future": "format 99; this version reads 1",
        "list": "not a saved Trajectory (the entry 'head' is not a JSON object)",
        "torn": "not a saved Trajectory (",
        "bare": "not a saved Trajectory (no entry 'parameters')",
        "few": "not a saved Trajectory (time: must be an array, and is missing)",
    }
    paths = {name: tmp_path / f"{name}.npz" for name in reasons}
    paths["text"].write_text("time, x, y")
    paths["empty"].write_bytes(b"")
    with paths["array"].open("wb") as file:
        np.save(file, np.zeros(3))
    np.savez(paths["arrays"], time=np.zeros(3))
    paths["cut"].write_bytes(paths["arrays"].read_bytes()[:100])
    heads = {"future": '{"format": 99}', "list": "[1]", "torn": "{", "bare": '{"format": 1}'}
    heads["few"] = '{"format": 1, "parameters": {}, "notes": {}}'
    for name, head in heads.items():
        np.savez(paths[name], head=np.array(head))
    for name, path in paths.items():
        with refuses(ValueError, f"{path}: {reasons[name]}"):
            Trajectory.load(path)
    with pytest.raises(FileNotFoundError):
        Trajectory.load(tmp_path / "none.npz")
