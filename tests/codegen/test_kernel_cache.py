"""Assembled and compiled kernels on disk: never stale, safe to share, in a folder that can be written."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from flexarm_env.codegen import assembly

PACKAGE = Path(assembly.__file__).parent

PROGRAM = """
import sys, numpy as np, flexarm_env
from flexarm_env import ArmParameters, FlexibleArm, kernels
from flexarm_env.kernels.recorded import Variant
assert flexarm_env.__file__.startswith(sys.argv[1]), flexarm_env.__file__
arm = FlexibleArm(ArmParameters(modes_per_link=1))
run = arm.simulate([0.1, 0.2, 0.3, -0.2, 1.0, -1.0, 0.5, 0.4], np.ones((10, 2)), 0.01)
stats = kernels.load(Variant("open", 1, True, 1)).run_open.stats
print(sum(stats.cache_hits.values()), *(x.hex() for x in run.state[-1]))
"""


def start(folder: Path) -> subprocess.Popen[str]:
    """Run the program on the copy of the package in a folder, with a cache of its own."""
    environment = os.environ | {"PYTHONPATH": str(folder), "FLEXARM_CACHE_DIR": str(folder / "cache")}
    command = [sys.executable, "-c", PROGRAM, str(folder)]
    return subprocess.Popen(
        command, cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def finish(process: subprocess.Popen[str]) -> tuple[int, list[float]]:
    """Hits in the cache, and the last state."""
    out, err = process.communicate(timeout=300)
    assert process.returncode == 0, err
    hits, *state = out.split()
    return int(hits), [float.fromhex(x) for x in state]


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    shutil.copytree(PACKAGE, tmp_path / "flexarm_env", ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path


EDITS = [
    ("dynamics.py", "elbow_n = elbow.across * (w1 * w1)", "elbow_n = elbow.across * (w1 * w2)"),
    ("elementary.py", "p = p * z - 1.66666666666666307295e-1", "p = p * z - 1.5e-1"),
    ("torque_stepping.py", "= torques[step, block, i + r * LANES]", "= 2.0 * torques[step, block, i + r * LANES]"),
]


def test_an_edited_formula_comes_through_and_an_unedited_one_comes_from_the_cache(copy: Path) -> None:
    hits, original = finish(start(copy))
    assert hits == 0
    hits, again = finish(start(copy))
    assert hits == 1  # the cache is at work: it could be stale
    assert again == original
    seen = [original]
    for name, old, new in EDITS:
        file = copy / "flexarm_env" / name
        text = file.read_text(encoding="utf-8")
        assert text.count(old) == 1, f"{name} no longer holds {old!r}"
        stamp = file.stat()
        file.write_text(text.replace(old, new), encoding="utf-8")
        os.utime(file, ns=(stamp.st_atime_ns, stamp.st_mtime_ns + 10**9))  # for Python's own cache of bytecode
        hits, state = finish(start(copy))
        assert hits == 0
        assert state not in seen
        seen.append(state)
        file.write_text(text, encoding="utf-8")
        os.utime(file, ns=(stamp.st_atime_ns, stamp.st_mtime_ns + 2 * 10**9))


def test_processes_may_start_together_on_an_empty_cache(copy: Path) -> None:
    results = [finish(process) for process in [start(copy), start(copy)]]
    assert results[0][1] == results[1][1]
    assert not list((copy / "cache").glob("*.tmp"))  # nothing is left lying about
    assert finish(start(copy)) == (1, results[0][1])  # and the cache that they leave is a good one


def test_a_folder_that_cannot_be_written_is_an_error_if_the_user_chose_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    blocker = tmp_path / "file"
    blocker.write_text("")
    monkeypatch.setenv("FLEXARM_CACHE_DIR", str(blocker / "cache"))
    with pytest.raises(OSError, match="cache"):
        assembly.cache_folder()


def test_a_home_that_cannot_be_written_falls_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    blocker = tmp_path / "file"
    blocker.write_text("")
    monkeypatch.delenv("FLEXARM_CACHE_DIR", raising=False)
    monkeypatch.setattr(assembly.platformdirs, "user_cache_dir", lambda name: str(blocker / name))
    monkeypatch.setattr(assembly.tempfile, "gettempdir", lambda: str(tmp_path))
    folder = assembly.cache_folder()
    assert folder.is_dir()
    assert folder.parent == tmp_path
