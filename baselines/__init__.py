"""The paper's controllers as policies: the constant gain (IFDC) and the fuzzy gain (FLSAC).

The other modules are imported by their own names: `controller` (the base of controllers that command torques),
`joint_space` (joint tracking and command shaping), `observers`, `optimal` (best known laps and regulators along them),
`lqg` and `predictive`. `registry` has all controllers by name.
"""

from flexarm_baselines.paper_law.flsac import FLSAC
from flexarm_baselines.paper_law.fuzzy import PAPER_GAIN_RANGE, MamdaniSystem, paper_system
from flexarm_baselines.paper_law.fuzzy_sets import FuzzyVariable, TriangularSet
from flexarm_baselines.paper_law.ifdc import IFDC
from flexarm_baselines.policy import GainPolicy, Policy
from flexarm_env.renamed import keep_old_names

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

keep_old_names(
    "flexarm_baselines",
    {
        "flexible_motion": "joint_space.flexible_motion",
        "flsac": "paper_law.flsac",
        "fuzzy": "paper_law.fuzzy",
        "fuzzy_kernels": "paper_law.fuzzy_kernels",
        "fuzzy_sets": "paper_law.fuzzy_sets",
        "ifdc": "paper_law.ifdc",
        "joint_reference": "joint_space.reference",
        "joint_tracking": "joint_space.tracking",
        "predictive.guide": "predictive.reference_run",
        "shaping": "joint_space.shaping",
    },
)
