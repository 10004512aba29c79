"""What fuzzy sets, variables, systems and inputs must not be."""

from __future__ import annotations

import numpy as np
import pytest

from flexarm_baselines import MamdaniSystem, TriangularSet, paper_system
from tests.support.fuzzy_variables import PAPER, ROUNDING, variable


@pytest.mark.parametrize(
    ("corners", "message"),
    [
        (
            (0.5, 0.25, 1.0),
            r"TriangularSet\(left=0.5, peak=0.25, right=1.0\): must have left <= peak <= right",
        ),
        ((0.0, 1.5, 1.0), "left <= peak <= right"),
        ((1.0, 1.0, 1.0), "left < right"),
        ((0.0, np.nan, 1.0), "peak = nan: must be a finite number"),
        ((-np.inf, 0.0, 1.0), "left = -inf: must be a finite number"),
    ],
)
def test_impossible_triangles(corners: tuple[float, float, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        TriangularSet(*corners)


@pytest.mark.parametrize(
    ("corners", "universe", "message"),
    [
        ([], (0.0, 1.0), r"sets of x = \(\): must hold at least one"),
        ([(0, 0, 1)], (1.0, 0.0), r"universe of x = \(1.0, 0.0\): must be finite, low < high"),
        ([(0, 0, 1)], (0.0, np.inf), r"universe of x = \(0.0, inf\)"),
    ],
)
def test_impossible_variables(
    corners: list[tuple[float, float, float]], universe: tuple[float, float], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        variable(*corners, universe=universe)


@pytest.mark.parametrize(
    ("corners", "bare"),
    [
        ([(0, 0, 0.5), (0.5, 1, 1)], "0.5"),  # they touch: both are zero there
        ([(0, 0, 0.25), (0.75, 1, 1)], "0.25"),
        ([(0, 0.5, 1.5)], "0"),  # zero at the lower end
        ([(0, 0, 0.75), (0, 0.5, 1)], "1"),  # zero at the upper end
        ([(0.125, 0.5, 1.5)], "0"),
        ([(-1, 0.25, 0.25), (0.75, 0.75, 2)], "0.5"),  # full membership at both ends of the gap
    ],
)
def test_inputs_must_be_covered(corners: list[tuple[float, float, float]], bare: str) -> None:
    rules = np.zeros(len(corners), dtype=int)
    with pytest.raises(ValueError, match=rf"sets of x: must cover \[0.0, 1.0\], .* zero at {bare}$"):
        MamdaniSystem([variable(*corners)], variable((0, 0, 1)), rules)


def test_touching_at_a_vertical_edge_is_a_cover() -> None:
    halves = variable((0, 0, 0.5), (0.5, 0.5, 1.5))
    system = MamdaniSystem([halves], variable((0, 0, 1), (0, 1, 1)), [0, 1])
    assert system.evaluate([0.5]) == pytest.approx(2 / 3, abs=ROUNDING)


@pytest.mark.parametrize(
    ("rules", "error", "message"),
    [
        ([[0, 1]], ValueError, r"rules: must have shape \(2,\), one axis per input, got \(1, 2\)"),
        ([0, 1, 1], ValueError, r"must have shape \(2,\).* got \(3,\)"),
        ([0, 2], ValueError, "rules hold 2: must be indices of output sets, 0 to 1"),
        ([0, -1], ValueError, "rules hold -1: must be indices of output sets, 0 to 1"),
        ([0.0, 1.0], TypeError, "rules: must hold integers, got dtype float64"),
    ],
)
def test_impossible_rule_tables(rules: list[object], error: type[Exception], message: str) -> None:
    two = variable((0, 0, 1), (0, 1, 1))
    with pytest.raises(error, match=message):
        MamdaniSystem([two], two, rules)


@pytest.mark.parametrize(
    ("corners", "message"),
    [
        ([(0, 0.5, 1), (-0.1, 0.5, 1)], r"left of y's sets = \[0.0, -0.1\]: must not step back"),
        ([(0, 0.5, 1), (0.2, 0.4, 1)], r"peak of y's sets = \[0.5, 0.4\]: must not step back"),
    ],
)
def test_output_sets_run_from_left_to_right(corners: list[tuple[float, float, float]], message: str) -> None:
    disordered = variable(*corners, name="y")
    with pytest.raises(ValueError, match=message):
        MamdaniSystem([variable((0, 0, 1), (0, 1, 1))], disordered, [0, 1])


def test_impossible_systems() -> None:
    two = variable((0, 0, 1), (0, 1, 1))
    with pytest.raises(ValueError, match=r"inputs = \(\): must hold at least one"):
        MamdaniSystem([], two, 0)
    pointlike = variable((-1, 0, 0), (0, 1, 1), name="y")
    with pytest.raises(ValueError, match=r"sets of y: TriangularSet\(left=-1, .* must have an area inside"):
        MamdaniSystem([two], pointlike, [0, 1])


def test_the_callers_table_is_copied() -> None:
    two = variable((0, 0, 1), (0, 1, 1))
    table = np.array([0, 1])
    system = MamdaniSystem([two], two, table)
    before = system.evaluate([0.2])
    table[:] = 1
    assert system.evaluate([0.2]) == before
    assert MamdaniSystem([two], two, table).evaluate([0.2]) != before


@pytest.mark.parametrize(
    ("x", "message"),
    [
        ([0.0, 0.0, 0.0], r"inputs: must have shape \(..., 2\), got \(3,\)"),
        (0.0, r"inputs: must have shape \(..., 2\), got \(\)"),
        ([[0.0, np.nan]], "inputs hold nan: must be finite"),
        ([np.inf, 0.0], "inputs hold inf: must be finite"),
    ],
)
def test_impossible_inputs(x: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        PAPER.evaluate(x)


@pytest.mark.parametrize("width_scale", [0.5, 0.0, -1.0, np.nan, np.inf])
def test_impossible_width_scales(width_scale: float) -> None:
    with pytest.raises(ValueError, match=r"width_scale = \S+: must be a finite number and > 0.5"):
        paper_system(width_scale)
