"""The paper's controllers as policies: the constant gain (IFDC) and the fuzzy gain (FLSAC).

Imported by their own names are `controller` (the base of controllers that command torques), `observers`, `shaping` and
`optimal` (best known laps and regulators along them).
"""

from flexarm_baselines.flsac import FLSAC
from flexarm_baselines.fuzzy import PAPER_GAIN_RANGE, MamdaniSystem, paper_system
from flexarm_baselines.fuzzy_sets import FuzzyVariable, TriangularSet
from flexarm_baselines.ifdc import IFDC
from flexarm_baselines.policy import GainPolicy, Policy

__all__ = [
    "FLSAC",
    "IFDC",
    "PAPER_GAIN_RANGE",
    "FuzzyVariable",
    "GainPolicy",
    "MamdaniSystem",
    "Policy",
    "TriangularSet",
    "paper_system",
]
