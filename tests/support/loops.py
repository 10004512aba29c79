"""Closed loops of the package, run on the problems that the oracle solves, and how far the two are apart."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexarm_env import ArmParameters, ClosedLoop, FlexibleArm, LawParameters, LoopCase, ReferencePath, SensorParameters
from tests.support.oracle import CORNER, PERIOD, Problem, oracle

Array = NDArray[np.float64]
END_EFFECTOR, NEAR_ELBOW = SensorParameters(), SensorParameters(position=0.5)
SHARED, PER_JOINT = LawParameters(compensation="shared"), LawParameters(compensation="per_joint")


def arm_of(modes: int) -> ArmParameters:
    return ArmParameters.linear(modes_per_link=modes)


def loop_of(problem: Problem, physics_step: float | None = None) -> ClosedLoop:
    corners = [problem.reference(CORNER * k, CORNER * k)[0] for k in range(4)]
    corners += corners[:1]
    path = ReferencePath(np.column_stack([CORNER * np.arange(5.0), np.real(corners), np.imag(corners)]))
    return ClosedLoop(FlexibleArm(problem.arm), [LoopCase(problem.sensor, problem.law)], path, PERIOD, physics_step)


def simulated(problem: Problem, physics_step: float | None = None) -> Array:
    """States at all control instants. Shape (periods + 1, 4 + 4 m)."""
    loop = loop_of(problem, physics_step)
    loop.reset(problem.start_state()[None])
    states = [loop.results().state[0]]
    for gain, noise in zip(problem.gains(), problem.noises(), strict=True):
        loop.advance([gain], noise[None])
        states.append(loop.results().state[0])
    return np.array(states)


def errors(problem: Problem, physics_step: float | None = None) -> tuple[float, float]:
    """Largest errors of coordinates and of rates, each component relative to its range over the run."""
    expected = oracle(problem)
    relative = np.abs(simulated(problem, physics_step) - expected) / np.ptp(expected, axis=0)
    n = expected.shape[1] // 2
    return float(relative[:, :n].max()), float(relative[:, n:].max())


def assert_accurate(problem: Problem, coordinates: float, rates: float, step: float | None = None) -> None:
    found = errors(problem, step)
    assert found[0] < coordinates, f"coordinates {found[0]:.1e}, rates {found[1]:.1e} of their range"
    assert found[1] < rates, f"coordinates {found[0]:.1e}, rates {found[1]:.1e} of their range"
