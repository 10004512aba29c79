"""What sensors read of the arm and where its tip is, with derivatives by the state, by compiled kernels."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from flexarm_env.codegen import cache, compiler
from flexarm_env.codegen.compiler import Entries
from flexarm_env.codegen.memory import aligned_zeros
from flexarm_env.kernels.entries import extent
from flexarm_env.kernels.layout import OUTPUTS, arm_rows, place_rows
from flexarm_env.kernels.output_jacobians import OUTPUT_JACOBIANS
from flexarm_env.kernels.variants import Variant
from flexarm_env.physics.bent_link import PointShape
from flexarm_env.physics.constants import Constants
from flexarm_env.physics.sensing import OUTPUT_SIZES, Outputs

Array = NDArray[np.float64]
LANES = 8  # of a block
_ENDS = np.cumsum(OUTPUT_SIZES).tolist()
_PARTS = tuple(slice(end - size, end) for end, size in zip(_ENDS, OUTPUT_SIZES, strict=True))  # of the outputs


def output_jacobians(k: Constants, tip: PointShape, sensor: PointShape, state: Array) -> tuple[Outputs, Outputs]:
    """Compute the outputs and their derivatives.

    Args:
        k: constants of the arm.
        tip: tip of link 2.
        sensor: where the sensor is on link 2.
        state: public. Shape (..., 4 + 4 m).

    Returns:
        Outputs, and each with its derivatives by the state's entries along a new last axis.
    """
    module, known = _kernels(k, tip, sensor)
    arena = aligned_zeros(known.size)
    arena[:] = known
    states = np.array(state, order="C").reshape(-1, state.shape[-1])
    values, slopes = np.empty((len(states), OUTPUTS)), np.empty((len(states), OUTPUTS, states.shape[1]))
    cache.call(module.run_outputs, arena, states, values, slopes)
    values, slopes = (found.reshape(*state.shape[:-1], *found.shape[1:]) for found in (values, slopes))
    return Outputs(*(values[..., part] for part in _PARTS)), Outputs(*(slopes[..., part, :] for part in _PARTS))


@lru_cache(maxsize=64)
def _kernels(k: Constants, tip: PointShape, sensor: PointShape) -> tuple[Entries, Array]:
    """Return the kernels, and what their arena holds of the arm; arguments as in `output_jacobians`."""
    variant = Variant(OUTPUT_JACOBIANS, len(k.elbow_slopes), True, LANES, foreshortened=k.foreshortened, dry=k.dry)
    rows = variant.rows
    arena = np.zeros((extent(rows), LANES))
    for name, numbers in (arm_rows(k) | place_rows("TIP", tip) | place_rows("SENSOR_POINT", sensor)).items():
        first, count = rows[name]
        arena[first : first + count] = np.reshape(numbers, (count, 1))
    return compiler.load(variant), arena.ravel()
