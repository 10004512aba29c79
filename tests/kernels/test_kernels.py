"""Compiled kernels: the formulas as written, the same bits in any lane and thread, vectorised."""

import platform
import re
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from flexarm_env import FlexibleArm
from flexarm_env.codegen import cache, compiler
from flexarm_env.codegen.arrays import LaneRows
from flexarm_env.codegen.declarations import Program
from flexarm_env.codegen.elementary import sincos
from flexarm_env.codegen.plain import python_kernel
from flexarm_env.codegen.rows import lane_rows
from flexarm_env.episode.step import GAIN
from flexarm_env.kernels.entries import extent
from flexarm_env.kernels.layout import arm_rows
from flexarm_env.kernels.recorded import momentum_kernel, step_kernel
from flexarm_env.kernels.variants import Variant, variant
from flexarm_env.physics import dynamics as dyn
from flexarm_env.physics.constants import Constants
from flexarm_env.physics.modal_elimination import elimination
from tests.support.lagrange import loaded_arm, random_state
from tests.support.rounding import rounded_once

LANES = 8
# modes, complete velocity forces, kinematics
VARIANTS = [(1, True, "linear"), (2, True, "linear"), (2, False, "linear"), (3, True, "foreshortened")]


def run_steps(memory: LaneRows, h: float, steps: int) -> None:
    """Advance the arms of a block by so many steps of h [s]."""
    arena = lane_rows(memory, variant.lanes)
    momentum_kernel(arena)
    for _ in range(steps):
        step_kernel(arena, h)


STEPS = Program("steps", (run_steps,))


class Batch:
    """Random arms of one variant at random states, as the kernels and as numpy want them."""

    count = LANES

    def __init__(self, modes: int, complete: bool, kinematics: str = "linear") -> None:
        rng = np.random.default_rng(modes)
        self.modes, self.complete = modes, complete
        self.foreshortened = kinematics == "foreshortened"
        self.size = 2 * modes + 2
        self.constants, internal = [], []
        for seed in range(self.count):
            loads = {"payload_mass": rng.uniform(0.0, 2.0), "elbow_hub_inertia": rng.uniform(0.0, 1.0)}
            parameters = loaded_arm(modes, kinematics=kinematics, **loads)
            arm = FlexibleArm(parameters)
            self.constants.append(arm.constants.flat())
            internal.append(arm.internal_state(random_state(parameters, seed, deflection=0.05, rate=0.5)))
        self.y, self.v = np.split(np.array(internal).T.copy(), 2)  # Shape (size, count)
        self.tau = rng.normal(size=(2, self.count)) * 10.0

    def module(self, lanes: int) -> SimpleNamespace:
        return compiler.load(self.variant(lanes))

    def variant(self, lanes: int) -> Variant:
        return Variant(STEPS, self.modes, self.complete, lanes, foreshortened=self.foreshortened)

    def arenas(self, lanes: int) -> np.ndarray:
        """Shape (blocks, rows * lanes)."""
        rows = np.zeros((extent(self.rows), self.count))
        known = {name: np.array(numbers) for name, numbers in arm_rows(self.known).items()}
        values = {"Y": self.y, "V": self.v, "TAU": self.tau} | known
        for name, value in values.items():
            first, n = self.rows[name]
            rows[first : first + n] = np.reshape(value, (n, self.count))
        return np.array([block.ravel() for block in np.split(rows, self.count // lanes, axis=1)])

    @property
    def known(self) -> Constants:
        """Constants of all arms; each an array."""
        return Constants.unflat(list(np.array(self.constants).T), self.modes, self.foreshortened)

    @property
    def rows(self) -> dict[str, tuple[int, int]]:
        return self.variant(1).rows

    def part(self, arenas: np.ndarray, lanes: int, name: str) -> np.ndarray:
        """Shape (n, count)."""
        first, n = self.rows[name]
        return np.concatenate([block.reshape(-1, lanes)[first : first + n] for block in arenas], axis=1)

    def angles(self, y: np.ndarray) -> tuple[Any, Any, Any]:
        """Return what the formulas need beside coordinates."""
        sin, cos = sincos(y[self.modes + 1] - y[0])
        return cos, sin, sincos(dyn.joint_angles(self.known, list(y))[1])[0]

    def rates_by_numpy(self, y: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Compute the rates of positions and momenta by the package's formulas on arrays."""
        force = dyn.momentum_rate(self.known, self.complete, list(y), list(v), (0.0, 0.0), self.angles(y))
        motors = dyn.generalised_torque(self.known, self.tau)
        return np.array([v, [a + b for a, b in zip(force, motors, strict=True)]])

    def velocity_by_numpy(self, y: np.ndarray, p: np.ndarray) -> np.ndarray:
        k, e, (cos, sin, _) = self.known, elimination(self.known), self.angles(y)
        return np.array(dyn.solve(k, e, dyn.inertia(k, e, list(y), cos, sin), list(p)))

    def momenta_by_numpy(self) -> np.ndarray:
        return np.array(dyn.momentum(self.known, list(self.y), list(self.v), *self.angles(self.y)[:2]))


@pytest.fixture(scope="module", params=VARIANTS, ids=str)
def batch(request: pytest.FixtureRequest) -> Batch:
    return Batch(*request.param)


@pytest.mark.parametrize("lanes", [1, LANES])
def test_a_compiled_step_is_its_recording_to_the_last_bit(batch: Batch, lanes: int) -> None:
    """The compiler reorders, contracts and replaces nothing; what the recording fuses is rounded once."""
    arenas, expected = batch.arenas(lanes), batch.arenas(1)
    for arena in arenas:
        batch.module(lanes).run_steps(arena, 1e-3, 1)
    kernels = (kernel.recording(batch.variant(1)) for kernel in (momentum_kernel, step_kernel))
    begin, step = (python_kernel(kernel, 1, rounded_once) for kernel in kernels)
    for arena in expected:
        begin(arena[:, None])
        step(arena[:, None], 1e-3)
    for name in ("Y", "V", "P", "FORCE"):
        np.testing.assert_array_equal(batch.part(arenas, lanes, name), batch.part(expected, 1, name))


def test_the_recording_of_a_step_is_the_formulas_on_arrays_to_the_last_bit(batch: Batch) -> None:
    """The recorder reorders and replaces nothing; here what it fuses is rounded twice, as in the formulas."""
    h, arenas = 1e-3, batch.arenas(1)
    begin, step = (python_kernel(kernel.recording(batch.variant(1)), 1) for kernel in (momentum_kernel, step_kernel))
    for arena in arenas:
        begin(arena[:, None])
        step(arena[:, None], h)
    start = np.array([batch.y, batch.momenta_by_numpy()])
    y, v, slopes = batch.y, batch.v, []
    for ahead in (0.5 * h, 0.5 * h, h, None):  # the way to the next stage of the classical Runge-Kutta method
        slopes.append(batch.rates_by_numpy(y, v))
        if ahead is not None:
            y, p = start + ahead * slopes[-1]
            v = batch.velocity_by_numpy(y, p)
    a, b, c, d = slopes
    y, p = start + h / 6.0 * (a + (b + b) + (c + c) + d)
    for name, end in (("Y", y), ("P", p), ("V", batch.velocity_by_numpy(y, p))):
        np.testing.assert_array_equal(batch.part(arenas, 1, name), end)


def test_threads_run_as_one_does(batch: Batch) -> None:
    def run(_: int) -> np.ndarray:
        arenas = batch.arenas(LANES)
        for _ in range(200):
            batch.module(LANES).run_steps(arenas[0], 2e-4, 1)
        return arenas

    expected = run(0)
    with ThreadPoolExecutor(4) as pool:
        for result in pool.map(run, range(8)):
            np.testing.assert_array_equal(result, expected)


def test_kernels_release_the_interpreter() -> None:
    """While a kernel runs in another thread, this one goes on counting."""
    batch = Batch(1, True)
    arenas, run = batch.arenas(LANES), batch.module(LANES).run_steps
    run(arenas[0].copy(), 1e-4, 1)  # compiles
    with ThreadPoolExecutor(1) as pool:
        started = time.perf_counter()
        running = pool.submit(run, arenas[0], 1e-4, 300_000)
        longest, last = 0.0, started
        while not running.done():
            now = time.perf_counter()
            longest, last = max(longest, now - last), now
        took = time.perf_counter() - started
    # a kernel that held the interpreter would stop this loop for nearly all of its time
    assert max(longest, started + took - last) < 0.5 * took


# packed and scalar double-precision arithmetic, and jumps to a library's sine or cosine
MACHINES = {
    "x86_64": (
        r"\bv?(?:mul|add|sub|div|fn?m(?:add|sub)\d+)pd\b",
        r"\bv?(?:mul|add|sub|div|fn?m(?:add|sub)\d+)sd\b",
        r"\b(?:callq?|jmpq?)\b",
    ),
    "aarch64": (
        r"\bf(?:mul|add|sub|div|ml[as])\s+v\d+\.2d|\bf(?:mul|add|sub|div|ml[as])\.2d",
        r"\bf(?:mul|add|sub|div|n?madd|n?msub)\s+d\d",
        r"\bbl\b",
    ),
}


@pytest.mark.slow  # compiles what the cache holds already
@pytest.mark.parametrize("of", [Variant(STEPS, 1, True, 4 * LANES), Variant(GAIN, 1, True, 4 * LANES)], ids=str)
def test_batch_kernels_work_on_several_lanes_at_once(
    of: Variant, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    machine = {"AMD64": "x86_64", "arm64": "aarch64"}.get(platform.machine(), platform.machine())
    if machine not in MACHINES:
        pytest.skip(f"no pattern of vector instructions for {machine}")
    monkeypatch.setenv("FLEXARM_CACHE_DIR", str(tmp_path))  # what comes from a cache has no assembly to show
    module = compiler.load.__wrapped__(of)
    entry = getattr(module, of.program.entries(of.lanes)[0].__name__)
    assert not entry.targetoptions.get("fastmath")
    memory = np.zeros(1)
    cache.compiled_entry(entry, *((memory, 1e-3, 1) if of.program is STEPS else (memory, 0, 1, memory[None])))
    (machine_code,) = entry.inspect_asm().values()
    name = "step_kernel" if of.program is STEPS else "law_kernel"
    code = re.search(rf"^{name}:.*?\.size\s+{name}", machine_code, re.MULTILINE | re.DOTALL)
    assert code is not None
    pack, scalar, _ = (len(re.findall(pattern, code[0])) for pattern in MACHINES[machine])
    assert pack > 200  # hundreds of operations
    assert scalar < 0.05 * pack
    assert not re.search(rf"(?:{MACHINES[machine][2]}).*\b_*(?:sin|cos|sincos|fma)", code[0])
    if machine == "x86_64":
        assert re.search(r"\$-64, %rsp", code[0])  # the stack is aligned
