"""FlexArm: a planar, very flexible two-link arm that tracks a square, after Green & Sasiadek (IFAC 2008).

Importing this package registers its environments with Gymnasium; `gymnasium.make("flexarm_env:FlexArm/Paper-v0")`
imports it by itself.
"""

from flexarm_env.arm import DivergenceError, Energy, FlexibleArm
from flexarm_env.linearisation import Linearisation
from flexarm_env.parameters import ArmParameters, LawParameters, SensorParameters, SquareParameters
from flexarm_env.reference import Path, inverse_kinematics, square
from flexarm_env.registration import register_environments
from flexarm_env.simulation import ClosedLoop, LoopCase
from flexarm_env.trajectory import Trajectory

__version__ = "0.1.0"

__all__ = [
    "ArmParameters",
    "ClosedLoop",
    "DivergenceError",
    "Energy",
    "FlexibleArm",
    "LawParameters",
    "Linearisation",
    "LoopCase",
    "Path",
    "SensorParameters",
    "SquareParameters",
    "Trajectory",
    "inverse_kinematics",
    "register_environments",
    "square",
]

register_environments()
