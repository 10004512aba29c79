"""Compiled kernels among processes: one compiles and the others load, an edit comes through, a fork does not hang."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import flexarm_env
from flexarm_env.codegen.compiler import Kernels
from flexarm_env.episode.step import TORQUE, step_only
from flexarm_env.kernels.variants import Variant

PACKAGE = Path(flexarm_env.__file__).parent

# Prints the kernel's identity, whether its code was on disk, and a state that it computes.
PROGRAM = """
import sys, numpy as np, flexarm_env
from flexarm_env import ArmParameters, FlexibleArm
from flexarm_env.codegen import compiler
from flexarm_env.kernels.rk4 import FEEDBACK
from flexarm_env.kernels.variants import Variant
assert flexarm_env.__file__.startswith(sys.argv[1]), flexarm_env.__file__
variant = Variant(FEEDBACK, 1, True, 1)
print(compiler.Kernels(variant).identity)
if sys.argv[2:] != ["identity"]:
    arm = FlexibleArm(ArmParameters.linear(modes_per_link=1))
    run = arm.simulate([0.1, 0.2, 0.3, -0.2, 1.0, -1.0, 0.5, 0.4], np.ones((10, 2)), 0.01)
    stats = compiler.load(variant).run_feedback.stats
    print(sum(stats.cache_hits.values()), *(x.hex() for x in run.state[-1]))
    if stats.cache_hits:  # what only a compilation requires is not imported
        assert "numba.np.arraymath" not in sys.modules
"""
LINE = r"compiled in \d+\.\d s, kept in .+: an arm driven by torques, one environment, 1 mode a link\n"


def start(folder: Path, *arguments: str, program: str = PROGRAM) -> subprocess.Popen[str]:
    """Run a program on the copy of the package in a folder, with a cache of its own."""
    environment = os.environ | {"PYTHONPATH": str(folder), "FLEXARM_CACHE_DIR": str(folder / "cache")}
    command, pipe = [sys.executable, "-c", program, str(folder), *arguments], subprocess.PIPE
    return subprocess.Popen(command, cwd=folder, env=environment, stdout=pipe, stderr=pipe, text=True)


def finish(process: subprocess.Popen[str]) -> tuple[str, int, list[str]]:
    """Identity, hits in the cache, last state; who compiles says so, though nobody has configured logging."""
    out, err = process.communicate(timeout=300)
    assert process.returncode == 0, err
    identity, hits, *state = out.split()
    assert re.fullmatch("" if int(hits) else LINE, err)
    return identity, int(hits), state


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("copy")
    shutil.copytree(PACKAGE, folder / "flexarm_env", ignore=shutil.ignore_patterns("__pycache__"))
    return folder


@pytest.fixture(scope="module")
def together(copy: Path) -> list[tuple[str, int, list[str]]]:
    """Collect what processes find that start together on an empty cache."""
    return [finish(process) for process in [start(copy) for _ in range(2)]]


def test_of_processes_that_start_together_one_compiles(copy: Path, together: list[tuple[str, int, list[str]]]) -> None:
    assert sorted(hits for _, hits, _ in together) == [0, 1]
    assert together[0][2] == together[1][2]
    assert together[0][0] == together[1][0]
    assert not list((copy / "cache").glob("*.tmp"))  # nothing is left lying about


EDITS = [
    ("physics/dynamics.py", "root = elbow_on_2[1] * link_e", "root = elbow_on_2[0] * link_e"),
    ("codegen/elementary.py", "p = p * z - 1.66666666666666307295e-1", "p = p * z - 1.5e-1"),
    ("codegen/memory.py", "CACHE_LINE = 64", "CACHE_LINE = 128"),
    ("kernels/rk4.py", "value = feedforward[j]", "value = 2.0 * feedforward[j]"),
]


def test_an_edited_formula_comes_through(copy: Path, together: list[tuple[str, int, list[str]]]) -> None:
    identities = {together[0][0]}
    for name, old, new in EDITS:
        file = copy / "flexarm_env" / name
        text = file.read_text(encoding="utf-8")
        assert text.count(old) == 1, f"{name} no longer holds {old!r}"
        stamp = file.stat()
        file.write_text(text.replace(old, new), encoding="utf-8")
        os.utime(file, ns=(stamp.st_atime_ns, stamp.st_mtime_ns + 10**9))  # for Python's own cache of bytecode
        if name == "kernels/rk4.py":
            edited, hits, state = finish(start(copy))
            assert hits == 0
            assert state != together[0][2]
        else:
            edited = start(copy, "identity").communicate(timeout=60)[0].strip()
        assert edited not in identities
        identities.add(edited)
        file.write_text(text, encoding="utf-8")
        os.utime(file, ns=(stamp.st_atime_ns, stamp.st_mtime_ns + 2 * 10**9))


# Prints where arms with so many modes come to.
ARMS = """
import sys, gymnasium, flexarm_env
for modes in map(int, sys.argv[2:]):
    env = gymnasium.make("FlexArm/Square-v0", arm={"preset": "linear", "modes_per_link": modes})
    env.reset(seed=0)
    print(*(x.hex() for x in env.step([0.5, -0.5])[4]["state"]))
"""


@pytest.mark.slow  # compiles two kernels
def test_kernels_that_different_processes_compiled_run_side_by_side(copy: Path) -> None:
    """numba numbers functions within a process: without names of their own both would have the same symbols."""
    one, two = (start(copy, modes, program=ARMS).communicate(timeout=300)[0] for modes in ("1", "2"))
    both, _ = start(copy, "1", "2", program=ARMS).communicate(timeout=300)
    assert one != two
    assert both == one + two


def test_the_functions_of_each_variant_have_names_of_their_own() -> None:
    one, two = (Kernels(Variant(TORQUE, modes, True, 1)).compiled(step_only).py_func for modes in (1, 2))
    assert one.__qualname__ != two.__qualname__


FORK_WHILE_COMPILING = """
import os, signal, threading, time
import numba
from flexarm_env.codegen import cache

inside = threading.Event()
save = cache._KernelCache.save_overload

def slow(self, signature, compiled):
    inside.set()
    time.sleep(0.5)
    save(self, signature, compiled)

cache._KernelCache.save_overload = slow
kernels = []

def compile_one(name):
    kernels.append(numba.njit(lambda x: x + 1.0))  # they stay, as those of the package do
    cache.keep(kernels[-1], cache.KernelFolder(name, ""))
    return cache.call(kernels[-1], 1.0)

thread = threading.Thread(target=compile_one, args=["flexarm_tiny_1_1_0123456789abcdef"])
thread.start()
inside.wait()
child = os.fork()
if child == 0:
    signal.alarm(30)
    os._exit(int(compile_one("flexarm_tiny_1_1_0123456789abcdee")))
print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
thread.join()
"""

FORK_WHILE_MAKING = """
import os, signal, threading
from flexarm_env.envs import settings

inside, resume = threading.Event(), threading.Event()
arm_parameters = settings.arm_parameters

def slow(arm):
    if threading.current_thread() is not threading.main_thread():
        inside.set()
        resume.wait()
    return arm_parameters(arm)

settings.arm_parameters = slow
thread = threading.Thread(target=settings.Settings)
thread.start()
inside.wait()
child = os.fork()
if child == 0:
    signal.alarm(30)
    settings.Settings()
    os._exit(2)
resume.set()
print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
thread.join()
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork on this system")
def test_a_fork_while_another_thread_works_leaves_a_child_that_works(tmp_path: Path) -> None:
    """While it compiles a kernel, and while it makes settings."""
    out, err = start(tmp_path, program=FORK_WHILE_COMPILING + FORK_WHILE_MAKING).communicate(timeout=100)
    assert out == "2\n2\n", err
