"""Fuzzy variables as the tests write them, and the paper's system."""

from flexarm_baselines import FuzzyVariable, TriangularSet, paper_system

PAPER = paper_system()
ROUNDING = 1e-14  # the universes have width 1 to 10 and a result takes some tens of operations


def variable(
    *corners: tuple[float, float, float], universe: tuple[float, float] = (0.0, 1.0), name: str = "x"
) -> FuzzyVariable:
    return FuzzyVariable(name, universe, tuple(TriangularSet(*c) for c in corners))
