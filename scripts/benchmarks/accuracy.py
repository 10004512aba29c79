"""How long a step of the chain in MuJoCo may be if its error in time is to be no larger than that of FlexArm's step.

Both move by the benchmark's torques, which are the same for both, and each is measured against its own converged
solution: what is compared is the step, not the models. A largest *stable* step says nothing of accuracy.
"""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from flexarm_env import ArmParameters, FlexibleArm
from flexarm_env.envs.settings import Settings

Array = NDArray[np.float64]
SECONDS, TORQUE, HELD = 2.0, 20.0, 0.01  # [s], up to [N m], constant for [s]
CONVERGED = 32  # steps of ours in one of the environments' for the solution that counts as exact
FINEST = 512  # steps of the chain in `HELD`, the same
COUNTS = tuple(round(2.0 ** (k / 3)) for k in range(6, 29))  # steps in `HELD` that are tried, by thirds of an octave
STAGES = {"implicitfast": 1, "RK4": 4}  # evaluations of the dynamics in a step
RK4_LIMIT = 2.5  # step times the fastest rate; 2.78 for small motions


@dataclass(frozen=True)
class EqualStep:
    """A step of the chain."""

    integrator: str  # MuJoCo's name of it
    step: float  # [s]
    error: float  # largest distance of the tip from the converged chain's [m]
    ours: float  # the same of FlexArm's arm, at the environments' step, from its own


def torques() -> Array:
    """Simulate the motion: random torques from rest, straight. Shape (n, 2)."""
    return np.random.default_rng(0).uniform(-TORQUE, TORQUE, (round(SECONDS / HELD), 2))


def our_error(modes: int) -> float:
    """Largest tip error of FlexArm's arm at the environments' step [m]."""
    arm = FlexibleArm(ArmParameters.linear(modes_per_link=modes))
    own = Settings.of({"arm": {"preset": "linear", "modes_per_link": modes}, "control_period": HELD}).substeps
    start = np.zeros(2 * arm.size)
    return _farthest(*(arm.simulate(start, torques(), SECONDS, HELD, count).tip for count in (own, CONVERGED * own)))


def equal_step(segments: int, modes: int) -> EqualStep:
    """Find the chain's step that is as accurate in time as ours with the fewest evaluations a second."""
    ours, found = our_error(modes), []
    for integrator, stages in STAGES.items():
        count = _fewest(segments, integrator, ours)
        if count is not None:
            error = chain_error(segments, integrator, count)
            found.append((stages * count, EqualStep(integrator, HELD / count, error, ours)))
    if not found:
        raise ValueError(f"segments = {segments}: with no step tried is the tip within {ours} m")
    return min(found, key=lambda each: each[0])[1]


def _fewest(segments: int, integrator: str, error: float) -> int | None:
    """Find the least of `COUNTS` with which the chain's error is at most this [m]."""
    counts = _counts(segments, integrator)
    place = bisect_left(counts, -error, key=lambda count: -chain_error(segments, integrator, count))
    return counts[place] if place < len(counts) else None


def _counts(segments: int, integrator: str) -> tuple[int, ...]:
    """Those of `COUNTS` that are stable."""
    from flexarm_env.chain import model as chain

    if integrator != "RK4":
        return COUNTS
    fastest = chain.fastest_rate(chain.chain_model(segments, ArmParameters.linear()))
    return tuple(count for count in COUNTS if HELD / count * fastest <= RK4_LIMIT)


@cache
def chain_error(segments: int, integrator: str, count: int) -> float:
    """Largest tip error of a chain [m]; arguments as of `chain_tips`."""
    return _farthest(chain_tips(segments, integrator, count), chain_tips(segments, "RK4", FINEST))


@cache
def chain_tips(segments: int, integrator: str, count: int) -> Array:
    """Simulate the chain; return its tip every `HELD` [m]. Shape (n, 2)."""
    import mujoco

    from flexarm_env.chain import model as chain

    model = chain.chain_model(segments, ArmParameters.linear(), HELD / count)
    model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    data, held = mujoco.MjData(model), torques()
    tips = []
    for torque in held:
        data.ctrl[:] = torque
        mujoco.mj_step(model, data, count)
        tips.append(chain.tip_position(model, data))
    return np.array(tips)


def _farthest(tips: Array, exact: Array) -> float:
    return float(np.linalg.norm(tips - exact, axis=1).max())
