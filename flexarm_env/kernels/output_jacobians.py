"""What sensors read of the arm and where its tips are, with derivatives by its state: recorded formula and driver.

`imex` explains lanes, blocks and arenas.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexarm_env.codegen.arrays import Arena
from flexarm_env.codegen.declarations import Program
from flexarm_env.codegen.rows import lane_rows
from flexarm_env.codegen.tangents import tangents, value, varied
from flexarm_env.kernels.layout import OUTPUTS, row
from flexarm_env.kernels.recorder import Recorder, recorded_kernel
from flexarm_env.kernels.states import States, load_rows
from flexarm_env.kernels.variants import variant
from flexarm_env.physics import dynamics as dyn
from flexarm_env.physics import sensing


@recorded_kernel
def output_kernel(r: Recorder, arena: Arena) -> None:
    """Compute the outputs of every lane, and their derivatives, from STATE."""
    k, ways = r.constants(), range(2 * r.variant.size)
    state = varied(r.read("STATE"), ways)
    y, v = (dyn.internal_coordinates(k, half) for half in (state[: r.variant.size], state[r.variant.size :]))
    parts = sensing.outputs(k, r.place("TIP"), r.place("SENSOR_POINT"), y, v)
    found = [x for part in parts for x in part]
    r.write("OUTPUTS", [value(x) for x in found])
    r.write("OUTPUT_SLOPES", [tangents(x).get(way, 0.0) for x in found for way in ways])


def run_outputs(arena: Arena, states: States, values: NDArray[np.float64], slopes: NDArray[np.float64]) -> None:
    """Compute the outputs of an arm in many states, and their derivatives.

    Args:
        arena: to work in; it holds the arm's constants and its points.
        states: public. Shape (n, 2 * size).
        values: receives the outputs (`sensing.outputs`). Shape (n, outputs).
        slopes: receives their derivatives by the states. Shape (n, outputs, 2 * size).
    """
    arena = lane_rows(arena, variant.lanes)
    length = 2 * variant.size
    for first in range(0, states.shape[0], variant.lanes):
        load_rows(arena, row.STATE, states, first)
        output_kernel(arena)
        for i in range(min(variant.lanes, states.shape[0] - first)):
            for r in range(OUTPUTS):
                values[first + i, r] = arena[row.OUTPUTS + r, i]
                for n in range(length):
                    slopes[first + i, r, n] = arena[row.OUTPUT_SLOPES + r * length + n, i]


OUTPUT_JACOBIANS = Program(
    "outputs",
    entry_points=(run_outputs,),
    groups=frozenset({"outputs"}),
    allocation_free=True,
    description="what an arm's sensors read, and its Jacobians",
)
