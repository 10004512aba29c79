"""`Trajectory`: checked when made, the same after saving and loading."""

from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flexarm_env import FlexibleArm, Trajectory
from tests.support.lagrange import loaded_arm, random_state

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


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        Trajectory.load(tmp_path / "none.npz")
