"""Whether an arm's equations can be solved in double precision."""

from __future__ import annotations

import numpy as np

from flexarm_env.parameters import ArmParameters
from flexarm_env.physics import dynamics as dyn
from flexarm_env.physics.constants import Constants
from flexarm_env.physics.coordinates import stack_matrix

# The largest condition number of the mass matrix, scaled to a diagonal of ones. Accelerations lose as many of double
# precision's 16 digits as it has; three must be left.
WORST_CONDITION = 1e13
_MASSES = (
    "link_lengths",
    "masses_per_length",
    "shoulder_hub_inertia",
    "elbow_hub_inertia",
    "elbow_mass",
    "elbow_housing_inertia",
    "payload_mass",
    "payload_inertia",
)


def refuse_singular(parameters: ArmParameters, constants: Constants) -> None:
    """Refuse an arm whose masses lie so far apart that the smaller are lost in rounding the larger.

    Raises:
        ValueError: with the parameters that decide it.
    """
    elbows = np.linspace(0.0, np.pi, 5)
    size = 2 * len(constants.elbow_slopes) + 2
    straight = list(np.zeros((size, len(elbows))))
    matrices = np.asarray(stack_matrix(dyn.mass_matrix(constants, straight, np.cos(elbows), np.sin(elbows))))
    scale = np.sqrt(np.diagonal(matrices, axis1=-2, axis2=-1))
    eigenvalues = np.linalg.eigvalsh(matrices / (scale[:, :, None] * scale[:, None, :]))
    smallest = float(eigenvalues.min())
    condition = size / smallest if smallest > np.finfo(float).eps else np.inf  # the largest is at most the size
    if condition > WORST_CONDITION:
        given = ", ".join(f"{name} = {getattr(parameters, name)}" for name in _MASSES)
        raise ValueError(
            f"arm: its masses and inertias lie too far apart for double precision (condition of the mass matrix "
            f"{condition:.1e}, at most {WORST_CONDITION:.0e} is allowed): {given}"
        )
