"""What fuzzy sets, variables, systems and inputs must not be."""

from collections.abc import Callable

import numpy as np
import pytest

from flexarm_baselines import MamdaniSystem, TriangularSet, paper_system
from tests.support.fuzzy_variables import PAPER, ROUNDING, variable

TWO = variable((0, 0, 1), (0, 1, 1))
BARE = r"sets of x: must cover \[0.0, 1.0\], .* zero at "


def of_inputs(*corners: tuple[float, float, float]) -> Callable[[], object]:
    """Return what makes a system with such sets of its input."""
    return lambda: MamdaniSystem([variable(*corners)], variable((0, 0, 1)), np.zeros(len(corners), dtype=int))


def of_output(*corners: tuple[float, float, float]) -> Callable[[], object]:
    """Return what makes a system with such sets of its output."""
    return lambda: MamdaniSystem([TWO], variable(*corners, name="y"), [0, 1])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        # triangles
        (
            lambda: TriangularSet(0.5, 0.25, 1.0),
            r"TriangularSet\(left=0.5, peak=0.25, right=1.0\): must have left <= peak <= right",
        ),
        (lambda: TriangularSet(0.0, 1.5, 1.0), "left <= peak <= right"),
        (lambda: TriangularSet(1.0, 1.0, 1.0), "left < right"),
        (lambda: TriangularSet(0.0, np.nan, 1.0), "peak = nan: must be a finite number"),
        (lambda: TriangularSet(-np.inf, 0.0, 1.0), "left = -inf: must be a finite number"),
        # variables
        (lambda: variable(), r"sets of x = \(\): must hold at least one"),
        (lambda: variable((0, 0, 1), universe=(1.0, 0.0)), r"universe of x = \(1.0, 0.0\): must be finite, low < high"),
        (lambda: variable((0, 0, 1), universe=(0.0, np.inf)), r"universe of x = \(0.0, inf\)"),
        # inputs that are not covered
        (of_inputs((0, 0, 0.5), (0.5, 1, 1)), BARE + "0.5$"),  # both are zero
        (of_inputs((0, 0, 0.25), (0.75, 1, 1)), BARE + "0.25$"),
        (of_inputs((0, 0.5, 1.5)), BARE + "0$"),  # zero at the lower end
        (of_inputs((0, 0, 0.75), (0, 0.5, 1)), BARE + "1$"),  # zero at the upper end
        (of_inputs((0.125, 0.5, 1.5)), BARE + "0$"),
        (of_inputs((-1, 0.25, 0.25), (0.75, 0.75, 2)), BARE + "0.5$"),  # full at both ends of the gap
        # outputs
        (of_output((0, 0.5, 1), (-0.1, 0.5, 1)), r"left of y's sets = \[0.0, -0.1\]: must not step back"),
        (of_output((0, 0.5, 1), (0.2, 0.4, 1)), r"peak of y's sets = \[0.5, 0.4\]: must not step back"),
        (of_output((-1, 0, 0), (0, 1, 1)), r"sets of y: TriangularSet\(left=-1, .* must have an area inside"),
        # rules
        (lambda: MamdaniSystem([], TWO, 0), r"inputs = \(\): must hold at least one"),
        (
            lambda: MamdaniSystem([TWO], TWO, [[0, 1]]),
            r"rules: must have shape \(2,\), one axis per input, got \(1, 2\)",
        ),
        (lambda: MamdaniSystem([TWO], TWO, [0, 1, 1]), r"must have shape \(2,\).* got \(3,\)"),
        (lambda: MamdaniSystem([TWO], TWO, [0, 2]), "rules hold 2: must be indices of output sets, 0 to 1"),
        (lambda: MamdaniSystem([TWO], TWO, [0, -1]), "rules hold -1: must be indices of output sets, 0 to 1"),
        # what is inferred from
        (lambda: PAPER.evaluate([0.0, 0.0, 0.0]), r"inputs: must have shape \(..., 2\), got \(3,\)"),
        (lambda: PAPER.evaluate(0.0), r"inputs: must have shape \(..., 2\), got \(\)"),
        (lambda: PAPER.evaluate([[0.0, np.nan]]), "inputs hold nan: must be finite"),
        (lambda: PAPER.evaluate([np.inf, 0.0]), "inputs hold inf: must be finite"),
    ],
)
def test_impossible_values(make: Callable[[], object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()


@pytest.mark.parametrize("width_scale", [0.5, 0.0, -1.0, np.nan, np.inf])
def test_impossible_width_scales(width_scale: float) -> None:
    with pytest.raises(ValueError, match=r"width_scale = \S+: must be a finite number and > 0.5"):
        paper_system(width_scale)


def test_rules_are_integers() -> None:
    with pytest.raises(TypeError, match="rules: must hold integers, got dtype float64"):
        MamdaniSystem([TWO], TWO, [0.0, 1.0])


def test_touching_at_a_vertical_edge_is_a_cover() -> None:
    halves = variable((0, 0, 0.5), (0.5, 0.5, 1.5))
    assert MamdaniSystem([halves], TWO, [0, 1]).evaluate([0.5]) == pytest.approx(2 / 3, abs=ROUNDING)


def test_the_callers_table_is_copied() -> None:
    table = np.array([0, 1])
    system = MamdaniSystem([TWO], TWO, table)
    before = system.evaluate([0.2])
    table[:] = 1
    assert system.evaluate([0.2]) == before
    assert MamdaniSystem([TWO], TWO, table).evaluate([0.2]) != before
