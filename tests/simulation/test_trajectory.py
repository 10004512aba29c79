"""`Trajectory`: checked when made, the same after saving and loading."""

import io
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flexarm_env import FlexibleArm, Trajectory
from tests.support.lagrange import loaded_arm, random_state
from tests.support.refusals import refuses

EXTRA = {"reference": np.ones((6, 2)), "sensed": np.zeros((6, 2)), "gain": np.arange(6.0), "reward": np.ones(6)}


@pytest.mark.parametrize("extra", [{}, EXTRA], ids=["simulated", "a policy's"])
def test_a_run_survives_saving(tmp_path: Path, extra: dict[str, Any]) -> None:
    arm = FlexibleArm(loaded_arm(2))
    run = arm.simulate(random_state(arm.parameters, 2, 0.1, 0.5), np.ones((5, 2)), 0.05, step=0.01, substeps="auto")
    if extra:
        run = arm.record(run.time, run.state, run.torque, **extra)
        assert set(run.arrays()) == {f.name for f in fields(Trajectory)} - {"parameters", "notes"}
    run.notes["case"] = {"name": "doublet", "gains": [1, 2.5], "ended": None}
    run.save(tmp_path / "run.npz")
    again = Trajectory.load(tmp_path / "run.npz")
    assert again.parameters == run.parameters
    assert again.notes == run.notes
    assert set(again.arrays()) == set(run.arrays())
    for name, array in run.arrays().items():
        np.testing.assert_array_equal(again.arrays()[name], array, strict=True)
    FlexibleArm(again.parameters)  # of the right types, down to the tuples


def npz(**arrays: Any) -> bytes:
    stream = io.BytesIO()
    np.savez(stream, **arrays)
    return stream.getvalue()


def headed(head: str) -> bytes:
    return npz(head=np.array(head))


OTHER: dict[str, tuple[bytes, str]] = {
    "text": (b"time, x, y", "not a saved Trajectory ("),
    "empty": (b"", "not a saved Trajectory ("),
    "array": (b"\x93NUMPY" + bytes(200), "not a saved Trajectory (File is not a zip file)"),
    "arrays": (npz(time=np.zeros(3)), "not a saved Trajectory (no entry 'head')"),
    "cut": (npz(time=np.zeros(3))[:100], "not a saved Trajectory ("),
    "future": (headed('{"format": 99}'), "format 99; this version reads 1"),
    "list": (headed("[1]"), "not a saved Trajectory (the entry 'head' is not a JSON object)"),
    "torn": (headed("{"), "not a saved Trajectory ("),
    "bare": (headed('{"format": 1}'), "not a saved Trajectory (no entry 'parameters')"),
    "few": (headed('{"format": 1, "parameters": {}, "notes": {}}'), "(time: must be an array, and is missing)"),
}


@pytest.mark.parametrize(("content", "reason"), OTHER.values(), ids=OTHER)
def test_other_files_are_refused(tmp_path: Path, content: bytes, reason: str) -> None:
    path = tmp_path / "run.npz"
    path.write_bytes(content)
    with refuses(ValueError, f"{path}: ", reason):
        Trajectory.load(path)


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        Trajectory.load(tmp_path / "none.npz")
