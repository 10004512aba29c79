"""Batches of closed loops that differ in all that may differ, how they are driven, and how runs are compared."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flexarm_env import (
    ArmParameters,
    ClosedLoop,
    FlexibleArm,
    LawParameters,
    LoopCase,
    SensorParameters,
    SquareParameters,
    inverse_kinematics,
    square,
)
from flexarm_env.simulation.closed_loop import Results

Array = NDArray[np.float64]
ARM = FlexibleArm(ArmParameters.paper())
PATH = square(SquareParameters(lap_time=0.2))  # all four corners in a short run

# Whatever may differ inside a batch: delays, sensor positions, command delays, gains of the law, torque limits.
CASES = [
    LoopCase(SensorParameters("collocated"), LawParameters()),
    LoopCase(SensorParameters(), LawParameters()),
    LoopCase(SensorParameters(position=0.5), LawParameters(compensation="per_joint")),
    LoopCase(SensorParameters(), LawParameters(compensation="shared")),
    LoopCase(SensorParameters(position=2.0, delay=0.0), LawParameters(torque_limit=(80.0, 40.0))),
    LoopCase(SensorParameters(position=3.0, delay=(0.031, 0.0002)), LawParameters(compensation="shared")),
    LoopCase(SensorParameters(delay=1e-4), LawParameters(120.0, 20.0)),
    LoopCase(SensorParameters("collocated", 0.5), LawParameters()),
    LoopCase(SensorParameters(wave_speed=1000.0), LawParameters(compensation="per_joint")),
    LoopCase(SensorParameters(delayed="position+rate"), LawParameters()),  # unstable, among stable ones
    LoopCase(SensorParameters(noise=0.01), LawParameters(proportional_gain=0.0)),
    LoopCase(SensorParameters("collocated"), LawParameters(derivative_gain=0.0)),
]
PERIODS = 120


def start_states(count: int) -> Array:
    """Return a different start for each: at a corner, displaced, moving."""
    states = np.zeros((count, 2 * ARM.size))
    states[:, :2] = inverse_kinematics(ARM.parameters, (-6.3, -6.3), "positive")
    return states + 0.02 * np.random.default_rng(5).normal(size=(len(CASES), 2 * ARM.size))[:count]


def drive(loop: ClosedLoop, states: Array, gains: Array, noise: Array, periods: int = PERIODS) -> list[Results]:
    loop.reset(states, noise[0])
    results = [loop.results()]
    for k in range(periods):
        loop.advance(gains[k], noise[k])
        results.append(loop.results())
    return results


def inputs(count: int) -> tuple[Array, Array, Array]:
    rng = np.random.default_rng(8)
    gains = rng.uniform(0.0, 2.0, (PERIODS, len(CASES)))[:, :count]
    noise = 0.05 * rng.normal(size=(PERIODS, len(CASES), 2))[:, :count]
    return start_states(count), gains, noise


def assert_same_bits(one: Sequence[Results], other: Sequence[Results]) -> None:
    for k, (a, b) in enumerate(zip(one, other, strict=True)):
        for name, x, y in zip(Results._fields, a, b, strict=True):
            assert np.array_equal(x, y, equal_nan=True), f"{name} differs after {k} periods"


def part(results: Sequence[Results], i: int) -> list[Results]:
    return [Results(*(array[i : i + 1] for array in result)) for result in results]
