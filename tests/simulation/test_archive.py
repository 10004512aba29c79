"""Files from strangers: whatever is wrong with one ends in a `ValueError` that names it, and nothing large is read."""

import copy
import io
import json
import os
import tracemalloc
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flexarm_agents import NetworkPolicy, load_policy
from flexarm_baselines.optimal.plan import Plan, load_plan
from flexarm_env import ArmParameters, FlexibleArm, Trajectory
from flexarm_env.simulation import archive
from tests.codegen.conftest import Trap
from tests.support.refusals import refuses

CONFIG = {"environment": "FlexArm/Square-v0", "options": {}}
POLICY_HEAD: dict[str, Any] = {"format": 1, "activation": "elu", "layers": 1, "notes": {"config": CONFIG}}
POLICY: dict[str, Any] = {
    "weight_0": np.ones((2, 3), np.float32),
    "bias_0": np.zeros(2, np.float32),
    "log_std": np.zeros(2, np.float32),
}


def policy_file(path: Path, head: Any = None, **arrays: Any) -> Path:
    """Write a policy's file with another head, or other arrays."""
    text = json.dumps(POLICY_HEAD | (head or {}))
    np.savez(path, head=np.array(text), **(POLICY | arrays))
    return path


def run() -> Trajectory:
    """Three instants of the default arm."""
    return FlexibleArm(ArmParameters.linear()).record(0.1 * np.arange(3), np.zeros((3, 12)), np.zeros((3, 2)))


def run_file(path: Path, head: Any = None, **arrays: Any) -> Path:
    """Write a trajectory's file with another head, or other arrays."""
    run().save(path)
    with np.load(path) as file:
        own = dict(file)
    text = json.dumps(json.loads(str(own.pop("head"))) | (head or {}))
    np.savez(path, head=np.array(text), **(own | arrays))
    return path


def raw_entry(shape: tuple[int, ...], dtype: str, content: bytes = b"") -> bytes:
    """Make an npy file that says it has this shape, and holds these bytes."""
    stream = io.BytesIO()
    np.lib.format.write_array_header_1_0(stream, {"descr": dtype, "fortran_order": False, "shape": shape})
    return stream.getvalue() + content


def with_entry(path: Path, name: str, content: bytes, **options: Any) -> Path:
    """Write a policy's file with an entry of any bytes in place of its own."""
    policy_file(path)
    with zipfile.ZipFile(path) as file:
        entries = {one: file.read(one) for one in file.namelist()}
    with zipfile.ZipFile(path, "w", **options) as file:
        for one, own in (entries | {name: content}).items():
            file.writestr(one, own)
    return path


def head_of(text: str) -> bytes:
    stream = io.BytesIO()
    np.save(stream, np.array(text))
    return stream.getvalue()


HARM: list[tuple[str, Callable[[Path], Path], str]] = [
    ("bomb", lambda p: deflated(policy_file(p)), "' is compressed; must be as `numpy.savez` stores it"),
    ("overlap", lambda p: overlapping(policy_file(p)), " bytes, and the file has "),
    ("more", lambda p: policy_file(p, weight_9=np.ones(9)), "'weight_9': no such array in a policy of 1 layers"),
    ("wide", lambda p: with_entry(p, "weight_0.npy", raw_entry((2**40, 4), "<f4")), "should have 17592186044"),
    ("long", lambda p: with_entry(p, "weight_0.npy", raw_entry((2, 3), "<f4", bytes(99))), "bytes, not 227"),
    ("negative", lambda p: with_entry(p, "bias_0.npy", raw_entry((-2,), "<f4")), "should have"),
    ("pickle", lambda p: with_entry(p, "bias_0.npy", raw_entry((1,), "|O", b"x" * 8)), "must hold float32, got object"),
    ("deep", lambda p: with_entry(p, "head.npy", head_of("[" * 100_000)), "not a saved policy ("),
    ("wordy", lambda p: with_entry(p, "head.npy", head_of("x" * 1_000_001)), "not a text of at most 1000000 char"),
    ("bytes", lambda p: with_entry(p, "head.npy", raw_entry((), "|S2", b"{}")), "not a text of at most"),
    ("bzip2", lambda p: with_entry(p, "x.npy", b"", compression=zipfile.ZIP_BZIP2), "' is compressed; must be"),
    ("plain", lambda p: with_entry(p, "weight_0.npy", b"1 2 3"), "not a saved policy ("),
    ("scalar", lambda p: policy_file(p, weight_0=np.float32(1.0)), "biases[0]: must have shapes (n, k) and (n,), got"),
    ("wider", lambda p: policy_file(p, bias_0=np.zeros(2)), "bias_0: must hold float32, got float64"),
    ("nan", lambda p: policy_file(p, log_std=np.full(2, np.nan, np.float32)), "log_std: must be finite"),
    ("loud", lambda p: policy_file(p, log_std=np.full(2, 99.0, np.float32)), "log_std = array([99., 99."),
    ("layers", lambda p: policy_file(p, {"layers": 10**9}), "layers = 1000000000: must be an integer from 1 to 100"),
    ("half", lambda p: policy_file(p, {"layers": 0.5}), "layers = 0.5: must be an integer"),
    ("silent", lambda p: policy_file(p, {"notes": None}), "notes = None: must be a mapping"),
    ("version", lambda p: policy_file(p, {"format": True}), "format True; this version reads 1"),
    ("list", lambda p: policy_file(p, {"activation": ["elu"]}), "activation = ['elu']: must be one of 'elu'"),
    ("options", lambda p: configured(p, options=1), "options = 1: must be a mapp"),
    ("render_mode", lambda p: configured(p, options={"render_mode": "human"}), "'render_mode'"),
    ("steps", lambda p: configured(p, options={"max_episode_steps": 5}), "'max_episode_steps'"),
    ("config", lambda p: policy_file(p, {"notes": {"config": [1]}}), "config = [1]: must be a mapping"),
    ("import", lambda p: configured(p, environment="os:x"), "must be one of 'Flex"),
]


def configured(path: Path, **changes: Any) -> Path:
    return policy_file(path, {"notes": {"config": CONFIG | changes}})


def deflated(path: Path) -> Path:
    """Write a good file anew, in which long runs of zeros take a thousandth."""
    with np.load(path) as file:
        np.savez_compressed(path, **file)
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


@pytest.mark.parametrize(("name", "make", "message"), HARM, ids=[name for name, *_ in HARM])
def test_policies_of_strangers(tmp_path: Path, name: str, make: Callable[[Path], Path], message: str) -> None:
    path = make(tmp_path / "policy.npz")
    tracemalloc.start()
    try:
        with refuses(ValueError, f"{path}: ", message):
            load_policy(path)
        assert tracemalloc.get_traced_memory()[1] < 32 * 2**20
    finally:
        tracemalloc.stop()


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


@pytest.mark.parametrize("load", [Plan.load, Trajectory.load])
def test_no_file_takes_more_memory_than_it_has_bytes(tmp_path: Path, load: Callable[[Path], Any]) -> None:
    """Zeros, compressed, in an array that the reader knows."""
    path = tmp_path / "file.npz"
    kept, name = (run(), "time") if load == Trajectory.load else (load_plan("linear_swing"), "torques")
    kept.save(path)
    with zipfile.ZipFile(path) as file:
        head = file.read("head.npy")
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("head.npy", head)
        file.writestr(f"{name}.npy", raw_entry((2**21, 2), "<f8", bytes(2**25)))
    assert path.stat().st_size < 2**20
    tracemalloc.start()
    try:
        with refuses(ValueError, f"{path}: ", " is compressed; must be"):
            load(path)
        assert tracemalloc.get_traced_memory()[1] < 8 * 2**20
    finally:
        tracemalloc.stop()


def test_plans_of_strangers(tmp_path: Path) -> None:
    plan = load_plan("linear_swing")
    plan.save(tmp_path / "plan.npz")
    with np.load(tmp_path / "plan.npz") as file:
        np.savez(tmp_path / "plan.npz", **file, junk=np.zeros(3))
    with refuses(ValueError, f"{tmp_path / 'plan.npz'}: ", "'junk': no such array; a Plan has states, torques, refer"):
        Plan.load(tmp_path / "plan.npz")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="a system without pipes that have names")
@pytest.mark.parametrize("load", [load_policy, Plan.load, Trajectory.load])
def test_what_is_no_file_is_refused_at_once(tmp_path: Path, load: Callable[[Path], Any]) -> None:
    """Reading would fill the memory, or wait for ever."""
    os.mkfifo(tmp_path / "pipe")
    for path in (Path("/dev/zero"), tmp_path / "pipe"):
        with refuses(FileNotFoundError if load is load_policy else ValueError, str(path)):
            load(path)


RUNS: list[tuple[dict[str, Any], dict[str, Any], str]] = [
    ({}, {"state": np.full(3, "x")}, "state: must hold float64, got <U1"),
    ({}, {"state": np.zeros((3, 12), bool)}, "state: must hold float64, got bool"),
    ({}, {"state": np.zeros((3, 12), "datetime64[s]")}, "state: must hold float64, got datetime64"),
    ({}, {"state": np.zeros((3, 7))}, "state: must have shape (3, 12), got (3, 7)"),
    ({}, {"state": np.float64(0.0)}, "state: has shape (), time has 3 instants"),
    ({}, {"time": np.float64(0.0)}, "time: must hold an instant"),
    ({}, {"time": np.zeros(0)}, "time: must hold an instant"),
    ({}, {"gain": np.zeros((3, 2))}, "gain: must have shape (3,), got (3, 2)"),
    ({}, {"more": np.zeros(3)}, "'more': no such array; a Trajectory has time, "),
    ({"notes": None}, {}, "notes = None: must be a mapping"),
    ({"format": True}, {}, "format True; this version reads 1"),
    ({"parameters": [1]}, {}, "parameters = [1]: must be a mapping"),
    ({"parameters": {"modes_per_link": 99}}, {}, "modes_per_link = 99: must be an integer from 1 to 4"),
]


@pytest.mark.parametrize(("head", "arrays", "message"), RUNS, ids=[message[:30] for *_, message in RUNS])
def test_runs_of_strangers(tmp_path: Path, head: dict[str, Any], arrays: dict[str, Any], message: str) -> None:
    path = run_file(tmp_path / "run.npz", head, **arrays)
    with refuses(ValueError, f"{path}: ", message):
        Trajectory.load(path)


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
