"""Files from strangers: whatever is wrong with one ends in a `ValueError` that names it, and nothing large is read."""

import copy
import io
import json
import os
import re
import tracemalloc
import zipfile
from collections.abc import Callable
from dataclasses import fields
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest

from flexarm_agents import NetworkPolicy, load_policy
from flexarm_baselines.optimal.plan import PLANS, Plan
from flexarm_env import ArmParameters, FlexibleArm, Trajectory
from flexarm_env.simulation import archive
from tests.codegen.conftest import Trap
from tests.support.lagrange import loaded_arm, random_state
from tests.support.refusals import refused, refuses

CONFIG = {"environment": "FlexArm/Square-v0", "options": {}}
POLICY_HEAD: dict[str, Any] = {"format": 1, "activation": "elu", "layers": 1, "notes": {"config": CONFIG}}
POLICY = {"weight_0": np.ones((2, 3), "f"), "bias_0": np.zeros(2, "f"), "log_std": np.zeros(2, "f")}


def saved(path: Path, **arrays: Any) -> Path:
    np.savez(path, **arrays)
    return path


def policy_file(path: Path, head: Any = None, **arrays: Any) -> Path:
    """Write a policy's file with another head, or other arrays."""
    return saved(path, head=json.dumps(POLICY_HEAD | (head or {})), **(POLICY | arrays))


def run() -> Trajectory:
    """Three instants of the default arm."""
    return FlexibleArm(ArmParameters.linear()).record(0.1 * np.arange(3), np.zeros((3, 12)), np.zeros((3, 2)))


def run_file(path: Path, head: Any = None, **arrays: Any) -> Path:
    """Write a trajectory's file with another head, or other arrays."""
    run().save(path)
    with np.load(path) as file:
        own = dict(file)
    return saved(path, head=json.dumps(json.loads(str(own.pop("head"))) | (head or {})), **(own | arrays))


def raw_entry(shape: tuple[int, ...], dtype: str, content: bytes = b"") -> bytes:
    """Make an npy file that says it has this shape, and holds these bytes."""
    stream = io.BytesIO()
    np.lib.format.write_array_header_1_0(stream, {"descr": dtype, "fortran_order": False, "shape": shape})
    return stream.getvalue() + content


def with_entry(path: Path, name: str, content: bytes) -> Path:
    """Write a policy's file with an entry of any bytes in place of its own."""
    policy_file(path)
    with zipfile.ZipFile(path) as file:
        entries = {one: file.read(one) for one in file.namelist()}
    with zipfile.ZipFile(path, "w") as file:
        for one, own in (entries | {name: content}).items():
            file.writestr(one, own)
    return path


def configured(path: Path, **changes: Any) -> Path:
    return policy_file(path, {"notes": {"config": CONFIG | changes}})


def remembering(path: Path, lags: list[float], remembered: int = 0) -> Path:
    """Write a policy's file of which the network sees one earlier reading, by its place."""
    return policy_file(path, {"history": {"lags": lags, "remembered": [remembered]}})


def deflated(path: Path) -> Path:
    """Write a file anew, compressed, with 32 MiB of zeros more, which take a thousandth."""
    with np.load(path) as file:
        np.savez_compressed(path, **(dict(file) | {"weight_0": np.zeros((2**21, 4), np.float32)}))
    return path


def overlapping(path: Path) -> Path:
    """Have a good file list its entries ten times."""
    with zipfile.ZipFile(path, "a") as file:
        file.writestr("more.npy", b"")  # else the list would not be written
        for n, info in [(n, info) for n in range(9) for info in file.filelist]:
            again = copy.copy(info)
            again.filename = f"{n}-{info.filename}"
            file.filelist.append(again)
    return path


def loaded(make: Callable[[Path], Any], load: Callable[[Path], Any] = load_policy) -> None:
    """Load a file: an error names it, and little of it was read."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "file.npz"
        make(path)
        tracemalloc.start()
        with pytest.raises(ValueError, match=re.escape(f"{path}: ")) as caught:
            load(path)
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert most < 24 * 2**20
        raise caught.value


test_policies_of_strangers = refused(
    (lambda p: deflated(policy_file(p)), r"' is compressed; must be as `numpy\.savez` stores it"),
    (lambda p: overlapping(policy_file(p)), " bytes, and the file has "),
    (lambda p: policy_file(p, weight_9=np.ones(9)), "'weight_9': no such array in a policy of 1 layers"),
    (lambda p: with_entry(p, "weight_0.npy", raw_entry((2**40, 4), "<f4")), "should have 17592186044"),
    (lambda p: with_entry(p, "weight_0.npy", raw_entry((2, 3), "<f4", bytes(99))), "bytes, not 227"),
    (lambda p: with_entry(p, "bias_0.npy", raw_entry((-2,), "<f4")), "should have"),
    (lambda p: with_entry(p, "bias_0.npy", raw_entry((1,), "|O", b"x" * 8)), "must hold float32, got object"),
    (lambda p: saved(p, head="[" * 100_000), r"not a saved policy \("),
    (lambda p: saved(p, head="x" * 1_000_001), "not a text of at most 1000000 char"),
    (lambda p: with_entry(p, "head.npy", raw_entry((), "|S2", b"{}")), "not a text of at most"),
    (lambda p: with_entry(p, "weight_0.npy", b"1 2 3"), r"not a saved policy \("),
    (lambda p: policy_file(p, weight_0=np.float32(1.0)), r"biases\[0\]: must have shapes \(n, k\) and \(n,\), got"),
    (lambda p: policy_file(p, bias_0=np.zeros(2)), "bias_0: must hold float32, got float64"),
    (lambda p: policy_file(p, log_std=np.full(2, np.nan, np.float32)), "log_std: must be finite"),
    (lambda p: policy_file(p, log_std=np.full(2, 99.0, np.float32)), r"log_std = array\(\[99\., 99\."),
    (lambda p: policy_file(p, {"layers": 10**9}), "layers = 1000000000: must be an integer from 1 to 100"),
    (lambda p: policy_file(p, {"layers": 0.5}), r"layers = 0\.5: must be an integer"),
    (lambda p: policy_file(p, {"history": "text"}), "not a saved policy"),
    (lambda p: policy_file(p, {"history": {"lags": [1], "remembered": []}}), r"remembered = \(\): must have an entry"),
    (lambda p: remembering(p, [1], 9), r"remembered = \(9,\): must be indices in an observation of"),
    (lambda p: remembering(p, [3, 1]), r"lags = \(3, 1\): must increase"),
    (lambda p: remembering(p, [1.5]), r"lags\[0\] = 1\.5: must be an integer"),
    (lambda p: remembering(p, [10**9]), r"lags\[0\] = 1000000000: must be an integer from 1 to 1000"),
    (lambda p: remembering(p, [1, 2, 3]), "size = 0: must be an integer from 1"),
    (lambda p: policy_file(p, {"notes": None}), "notes = None: must be a mapping"),
    (lambda p: policy_file(p, {"format": True}), "format True; this version reads 1"),
    (lambda p: policy_file(p, {"activation": ["elu"]}), r"activation = \['elu'\]: must be one of 'elu'"),
    (lambda p: configured(p, options=1), "options = 1: must be a mapp"),
    (lambda p: configured(p, options={"render_mode": "human"}), "'render_mode'"),
    (lambda p: configured(p, options={"max_episode_steps": 5}), "'max_episode_steps'"),
    (lambda p: policy_file(p, {"notes": {"config": [1]}}), r"config = \[1\]: must be a mapping"),
    (lambda p: configured(p, environment="os:x"), "must be one of 'Flex"),
    by=loaded,
)
test_runs_of_strangers = refused(
    (lambda p: run_file(p, state=np.full(3, "x")), "state: must hold float64, got <U1"),
    (lambda p: run_file(p, state=np.zeros((3, 7))), r"state: must have shape \(3, 12\), got \(3, 7\)"),
    (lambda p: run_file(p, state=np.float64(0.0)), r"state: has shape \(\), time has 3 instants"),
    (lambda p: run_file(p, time=np.float64(0.0)), "time: must hold an instant"),
    (lambda p: run_file(p, time=np.zeros(0)), "time: must hold an instant"),
    (lambda p: run_file(p, gain=np.zeros((3, 2))), r"gain: must have shape \(3,\), got \(3, 2\)"),
    (lambda p: run_file(p, more=np.zeros(3)), "'more': no such array; a Trajectory has time, "),
    (lambda p: run_file(p, {"notes": None}), "notes = None: must be a mapping"),
    (lambda p: run_file(p, {"parameters": [1]}), r"parameters = \[1\]: must be a mapping"),
    (lambda p: run_file(p, {"parameters": {"modes_per_link": 99}}), "modes_per_link = 99: must be an integer"),
    (lambda p: p.write_bytes(b"\x93NUMPY" + bytes(200)), r"not a saved Trajectory \(File is not a zip file\)"),
    (lambda p: saved(p, time=np.zeros(3)), r"not a saved Trajectory \(no entry 'head'\)"),
    (lambda p: saved(p, head='{"format": 99}'), "format 99; this version reads 1"),
    (lambda p: saved(p, head="[1]"), r"not a saved Trajectory \(the entry 'head' is not a JSON object\)"),
    (lambda p: saved(p, head='{"format": 1}'), r"not a saved Trajectory \(no entry 'parameters'\)"),
    (lambda p: saved(p, head='{"format": 1, "parameters": {}, "notes": {}}'), "time: must be an array, and is missing"),
    by=partial(loaded, load=Trajectory.load),
)
test_plans_of_strangers = refused(
    (lambda p: saved(p, **np.load(PLANS / "linear_swing.npz"), junk=np.zeros(3)), "'junk': no such array; a Plan has"),
    by=partial(loaded, load=Plan.load),
)


@pytest.mark.parametrize("load", [load_policy, NetworkPolicy.load, Plan.load, Trajectory.load])
@pytest.mark.parametrize("name", ["head", "weight_0", "states", "state", "time"])
def test_no_code_in_a_file_is_run(tmp_path: Path, name: str, load: Callable[[Path], Any]) -> None:
    """An array of objects is a pickle; whichever entry it stands in, it is refused unread."""
    path, mark = tmp_path / "trap.npz", tmp_path / "mark"
    trap = np.array([Trap(mark)], dtype=object)
    entries = {"head": np.array(json.dumps(POLICY_HEAD)), **POLICY} | {name: trap}
    np.savez(path, allow_pickle=True, **entries)
    with refuses(ValueError, f"{path}: "):
        load(path)
    assert not mark.exists()
    np.load(path, allow_pickle=True)[name]  # the trap works
    assert mark.exists()


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="a system without pipes that have names")
@pytest.mark.parametrize("load", [load_policy, Plan.load, Trajectory.load])
def test_what_is_no_file_is_refused_at_once(tmp_path: Path, load: Callable[[Path], Any]) -> None:
    """Reading would fill the memory, or wait for ever."""
    os.mkfifo(tmp_path / "pipe")
    for path in (Path("/dev/zero"), tmp_path / "pipe"):
        with refuses(FileNotFoundError if load is load_policy else ValueError, str(path)):
            load(path)


def test_names_that_no_file_can_have(tmp_path: Path) -> None:
    with refuses(FileNotFoundError, "source = 'xxx", "neither a folder or file nor a shipped policy"):
        load_policy("x" * 5000)
    with refuses(TypeError, "source = 5: must be a folder, a file or the name of a shipped policy"):
        load_policy(5)  # type: ignore[arg-type]
    for name in ("x" * 5000, "x\x00y"):
        with refuses(ValueError, "path = '"):
            Trajectory.load(name)
    with pytest.raises(IsADirectoryError):
        Trajectory.load(tmp_path)
    with pytest.raises(FileNotFoundError):
        Trajectory.load(tmp_path / "none.npz")


def test_models_of_stable_baselines_are_recognised(tmp_path: Path) -> None:
    path = tmp_path / "model.zip"
    with zipfile.ZipFile(path, "w") as file:
        for name in ("data", "policy.pth", "_stable_baselines3_version"):
            file.writestr(name, b"never read")
    with refuses(ValueError, f"{path}: a stable-baselines3 model", "evaluate --stable-baselines3 CLASS` scores it"):
        load_policy(path)


def test_what_could_not_be_loaded_is_not_written(tmp_path: Path) -> None:
    noted = run()
    noted.notes["text"] = "x" * archive.LARGEST_HEAD
    with refuses(ValueError, "notes: take 1000", "at most 1000000"):
        noted.save(tmp_path / "run.npz")
    assert not any(tmp_path.iterdir())
    with refuses(ValueError, "weights: 25000000 numbers; at most 20000000 are allowed"):
        NetworkPolicy([np.zeros((5000, 4999), np.float32)], [np.zeros(5000, np.float32)], np.zeros(5000, np.float32))


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
