"""Steps of the bare arm and of the closed loop."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np

from flexarm_env import ArmParameters, FlexibleArm
from flexarm_env.codegen import compiler
from flexarm_env.codegen.memory import aligned_zeros
from flexarm_env.codegen.tracing import Recording
from flexarm_env.kernels.entries import extent
from flexarm_env.kernels.layout import arm_rows
from flexarm_env.kernels.recorded import step_kernel
from flexarm_env.kernels.rk4 import OPEN
from flexarm_env.kernels.variants import Variant
from flexarm_env.parameters import Kinematics
from scripts.benchmarks import peers
from scripts.benchmarks.timing import Group, Ratio, Subject
from scripts.paper.cases import CONTROL_PERIOD, PAPER

LANES = (8, 32)  # arms that the compiler may work on together
ARMS = 1024
LOOPS = 64
LONG_PERIOD = 0.1  # [s]


def torque_driven(modes: Sequence[int], effort: float) -> Group:
    """Declare the group of the torque-driven arm's kernel (complete velocity forces), scalar and batch."""
    subjects, ratios = [], []
    for m in modes:
        label = f"{m} mode{'s' if m > 1 else ''}"
        subjects.append(bare_kernel(f"{label}, 1 arm", m, 1, 1, round(100_000 * effort)))
        for lanes in LANES:
            name = f"{label}, {ARMS} arms, {lanes} lanes"
            subjects.append(bare_kernel(name, m, lanes, ARMS, round(400 * effort)))
            ratios.append(Ratio(f"{label}, 1 arm", name, f"batch of {lanes} lanes over scalar, {label}"))
        bent = f"{label}, foreshortened"
        subjects += [
            bare_kernel(f"{bent}, 1 arm", m, 1, 1, round(100_000 * effort), "foreshortened"),
            bare_kernel(f"{bent}, {ARMS} arms", m, LANES[-1], ARMS, round(400 * effort), "foreshortened"),
        ]
        ratios += [
            Ratio(f"{bent}, 1 arm", f"{label}, 1 arm", f"linear over foreshortened, 1 arm, {label}"),
            Ratio(f"{bent}, {ARMS} arms", name, f"linear over foreshortened, batch, {label}"),
        ]
        peak = peers.multiply_adds(effort)
        name = f"{label}, its operations at the peak of multiply-adds"
        subjects.append(Subject(name, peak.work, peak.amount / operations(m)))
        ratios.append(
            Ratio(name, f"{label}, {ARMS} arms, {LANES[-1]} lanes", f"share of the peak of one core, {label}")
        )
    return Group("torque_driven", "Physics of the torque-driven arm (RK4)", "ns", "step and arm", subjects, ratios)


def operations(modes: int) -> int:
    """Additions, subtractions, multiplications and divisions of a Runge-Kutta step, as written; fused ones are two."""
    kernel = step_kernel.recording(Variant(OPEN, modes, True, 1))
    each = dict.fromkeys(("add", "subtract", "multiply", "divide"), 1)
    each |= dict.fromkeys(("multiply_add", "multiply_subtract", "multiply_subtract_from"), 2)

    def count(recording: Recording) -> int:
        """Count the operations of a recording and of the functions that it calls."""
        own = sum(each.get(operation.name, 0) for operation in recording.operations)
        calls = [operation.what[0] for operation in recording.operations if operation.name == "call"]
        return own + sum(count(kernel.functions[name]) for name in calls if name in kernel.functions)

    return count(kernel)


def bare_kernel(name: str, modes: int, lanes: int, arms: int, steps: int, kinematics: Kinematics = "linear") -> Subject:
    """Declare the torque-driven arm's kernel alone: modes a link, lanes of a block, arms, steps of a call."""
    arm = FlexibleArm(ArmParameters.linear(modes_per_link=modes, kinematics=kinematics))
    variant = Variant(OPEN, modes, True, lanes, foreshortened=arm.constants.foreshortened)
    rows = variant.rows
    blocks = arms // lanes
    arenas = aligned_zeros(blocks * extent(rows) * lanes).reshape(blocks, extent(rows), lanes)
    state = np.zeros((arms, 2 * arm.size))
    state[:, 1] = np.linspace(0.5, 2.5, arms)  # theta2, and rates: every arm swings in its own way
    state[:, arm.size : arm.size + 2] = 0.3, -0.5
    internal = arm.internal_state(state)
    for part, values in (
        *((name, np.tile(numbers, (arms, 1))) for name, numbers in arm_rows(arm.constants).items()),
        ("Y", internal[:, : arm.size]),
        ("V", internal[:, arm.size :]),
    ):
        first, count = rows[part]
        arenas[:, first : first + count] = values.reshape(blocks, lanes, count).transpose(0, 2, 1)
    flat = arenas.reshape(blocks, -1)
    torques = np.zeros((steps, blocks, 2 * lanes))
    states = np.zeros((1, blocks, 2 * arm.size * lanes))
    run = compiler.load(variant).run_open
    step = min(1e-3, 0.5 * arm.longest_step())

    def work() -> None:
        if run(flat, torques, states, step, steps) != steps:
            raise RuntimeError(f"{name}: the state stopped being finite")

    return Subject(name, work, steps * arms)


def closed_loop(effort: float) -> Group:
    """Declare the group of the paper's arm under the law with a late sensor, one and many."""
    one, many = "1 arm", f"{LOOPS} arms"
    drivers = ", gain held 0.1 s"
    subjects = [
        _loop(one, 1, CONTROL_PERIOD, round(1000 * effort)),
        _loop(many, LOOPS, CONTROL_PERIOD, round(200 * effort)),
        _loop(one + drivers, 1, LONG_PERIOD, round(20 * effort)),
        _loop(many + drivers, LOOPS, LONG_PERIOD, max(1, round(3 * effort))),
    ]
    ratios = [
        Ratio(one, many, f"batch of {LOOPS} over one arm, gain set every ms"),
        Ratio(one + drivers, many + drivers, f"batch of {LOOPS} over one arm, compiled part alone"),
        Ratio(one, one + drivers, "one arm: gain set every ms over compiled part alone"),
    ]
    return Group("closed_loop", "The paper's closed loop (FlexArm/Paper-v0)", "ns", "step and arm", subjects, ratios)


def _loop(name: str, arms: int, period: float, calls: int) -> Subject:
    options: dict[str, Any] = {"control_period": period, "max_episode_steps": -1}
    env: Any = gymnasium.make_vec(PAPER, arms, **options) if arms > 1 else gymnasium.make(PAPER, **options)
    action = np.ones(env.action_space.shape, dtype=np.float32)

    def work() -> None:
        for _ in range(calls):
            env.step(action)

    return Subject(name, work, calls * env.unwrapped.settings.substeps * arms, prepare=env.reset)
