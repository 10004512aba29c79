"""Mamdani inference with an exact centroid, and the fuzzy system of Green & Sasiadek (2008).

MIN composes the antecedents of a rule, MIN implies (clips the output set at the rule's strength), MAX
aggregates the clipped sets, CENTROID defuzzifies: the paper's four operators, in that order.

The compiled inference, with its exact centroid, is in `flexarm_baselines.paper_law.fuzzy_kernels`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from flexarm_baselines.arrays import Floats, Integers
from flexarm_baselines.paper_law.fuzzy_kernels import infer
from flexarm_baselines.paper_law.fuzzy_sets import FuzzyVariable, TriangularSet
from flexarm_env.validation import number

PAPER_GAIN_RANGE = (1.0 / 6.0, 5.0 / 6.0)
"""Range of lambda: the centroids of ZERO and PMAX. The paper's "lambda = 1" and "zero" cannot occur."""


class MamdaniSystem:
    """A Mamdani fuzzy system with one output.

    Args:
        inputs: one variable per input; each one's sets must cover its universe.
        output: the output variable, its sets listed from left to right: neither left nor peak steps back
            from one set to the next.
        rules: integer table with one axis per input; entry ``[i, j, ...]`` is the index of the output set in
            "IF input 0 is set i AND input 1 is set j ... THEN output is ...".

    Raises:
        ValueError: no input, an uncovered input value, a table of the wrong shape, an index that names no
            output set, output sets out of order or without an area in the output's universe.
    """

    def __init__(self, inputs: Sequence[FuzzyVariable], output: FuzzyVariable, rules: npt.ArrayLike) -> None:
        if not inputs:
            raise ValueError("inputs = (): must hold at least one FuzzyVariable")
        for variable in inputs:
            variable.check_cover()
        output.check_order()
        output.check_areas()
        self.inputs = tuple(inputs)
        self.output = output
        self.rules = _checked_rules(rules, tuple(len(v.sets) for v in inputs), len(output.sets))
        counts = [len(v.sets) for v in inputs]
        first = np.cumsum([0, *counts[:-1]])  # row of each input's first set among the sets of all inputs
        self._kernel_arguments = (
            np.array([v.universe for v in inputs], dtype=np.float64),
            np.concatenate([v.corners for v in inputs]),
            np.repeat(np.arange(len(counts)), counts),
            np.ascontiguousarray(np.indices(counts).reshape(len(counts), -1).T + first),
            self.rules.ravel(),
            output.corners,
            np.array(output.universe, dtype=np.float64),
            _crossing_levels(output),
        )

    def evaluate(self, inputs: npt.ArrayLike) -> Floats:
        """Infer the output for one or many input vectors.

        Args:
            inputs: shape ``(..., number of inputs)``, in the variables' units. Values outside an input's
                universe are clipped to it: that is what ending the universe there means.

        Returns:
            Centroids, shape ``(...)``, in the output's unit. A row's bits do not depend on the other rows.

        Raises:
            ValueError: another shape, or an input that is not finite.
        """
        x = np.asarray(inputs, dtype=np.float64)
        if x.ndim == 0 or x.shape[-1] != len(self.inputs):
            raise ValueError(f"inputs: must have shape (..., {len(self.inputs)}), got {x.shape}")
        if not np.isfinite(x).all():
            raise ValueError(f"inputs hold {x[~np.isfinite(x)][0]}: must be finite")
        rows = np.ascontiguousarray(x.reshape(-1, len(self.inputs)))
        return np.asarray(infer(rows, *self._kernel_arguments).reshape(x.shape[:-1]))


def _checked_rules(rules: npt.ArrayLike, shape: tuple[int, ...], outputs: int) -> Integers:
    """Copy the rule table into an array; refuse it unless it fits the sets."""
    table = np.asarray(rules)
    if not np.issubdtype(table.dtype, np.integer):
        raise TypeError(f"rules: must hold integers, got dtype {table.dtype}")
    if table.shape != shape:
        raise ValueError(f"rules: must have shape {shape}, one axis per input, got {table.shape}")
    if table.min() < 0 or table.max() >= outputs:
        bad = table[(table < 0) | (table >= outputs)][0]
        raise ValueError(f"rules hold {bad}: must be indices of output sets, 0 to {outputs - 1}")
    return table.astype(np.int64)


def _crossing_levels(output: FuzzyVariable) -> Floats:
    """Return level 0 and every level in (0, 1) at which two edges, or an edge and an end of the universe, cross."""
    left, peak, right = output.corners.T
    at_zero = np.concatenate([left, right, output.universe])  # z = at_zero + slope * y on each of these lines
    slope = np.concatenate([peak - left, peak - right, [0.0, 0.0]])
    with np.errstate(divide="ignore", invalid="ignore"):  # parallel lines
        y = (at_zero[:, None] - at_zero) / (slope - slope[:, None])
    return np.unique(np.append(y[(y > 0.0) & (y < 1.0)], 0.0))


def paper_system(width_scale: float = 1.0) -> MamdaniSystem:
    """Make the paper's 9 rules (Fig. 2 and Table 1): two normalised link deflections in, the gain lambda out.

    Args:
        width_scale: factor on the base widths of the input sets, the paper's "MF base widths are adjusted by
            K_s".

    Returns:
        A system with inputs delta1, delta2 in [-5, 5] and output lambda in [1/6, 5/6] (all dimensionless).

    Raises:
        ValueError: it is not finite, or not above 0.5, where neighbouring sets cease to overlap.
    """
    half = 5.0 * number("width_scale", width_scale, above=0.5)
    deflection = tuple(TriangularSet(peak - half, peak, peak + half) for peak in (-5.0, 0.0, 5.0))
    gain = tuple(TriangularSet(peak - 0.5, peak, peak + 0.5) for peak in (0.0, 0.5, 1.0))
    inputs = [FuzzyVariable(name, (-5.0, 5.0), deflection) for name in ("delta1", "delta2")]
    zero, pm, pmax = 0, 1, 2
    table_1 = [[pmax, pm, pmax], [pm, zero, pm], [pmax, pm, pmax]]
    return MamdaniSystem(inputs, FuzzyVariable("lambda", (0.0, 1.0), gain), table_1)
