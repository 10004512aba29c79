"""FlexArm: a planar, very flexible two-link arm that tracks a square, after Green & Sasiadek (IFAC 2008).

Importing this package registers its environments with Gymnasium; `gymnasium.make("flexarm_env:FlexArm/Paper-v0")`
imports it by itself. Bad input raises a `TypeError` or a `ValueError` that names the argument, its value and what is
allowed; docstrings list what else can go wrong.
"""

from typing import TYPE_CHECKING

from flexarm_env.envs.option_types import EnvOptions
from flexarm_env.envs.registration import register_environments
from flexarm_env.envs.settings import Settings
from flexarm_env.envs.termination import end_reason
from flexarm_env.envs.warm_up import warm_up
from flexarm_env.parameters import ArmParameters, LawParameters, SensorParameters, SquareParameters
from flexarm_env.physics.linearisation import Linearisation
from flexarm_env.physics.paths import ReferencePath, inverse_kinematics, square
from flexarm_env.physics.sensing import Outputs
from flexarm_env.rollout import run_batch, run_policy
from flexarm_env.simulation.arm import Energy, FlexibleArm
from flexarm_env.simulation.held_torque import StepJacobians
from flexarm_env.simulation.limits import rest_state, state_limits
from flexarm_env.simulation.trajectory import DivergenceError, Trajectory

__version__ = "0.2.0"

__all__ = [
    "ArmParameters",
    "DivergenceError",
    "Energy",
    "EnvOptions",
    "FlexibleArm",
    "LawParameters",
    "Linearisation",
    "Outputs",
    "ReferencePath",
    "SensorParameters",
    "Settings",
    "SquareParameters",
    "StepJacobians",
    "Trajectory",
    "end_reason",
    "inverse_kinematics",
    "register_environments",
    "rest_state",
    "run_batch",
    "run_policy",
    "square",
    "state_limits",
    "warm_up",
]

_BATCH = 'gymnasium.make_vec("FlexArm/Paper-v0", num_envs=n, per_env={"sensor": [...], "gain_limit": [...]})'
_REMOVED = {  # until the next release
    "ClosedLoop": f"a batch of arms under the paper's law is {_BATCH}",
    "LoopCase": f"sensor and law of each arm are options: {_BATCH}",
    "square_loop": f"the paper's arm on the square is {_BATCH}",
}


if not TYPE_CHECKING:  # a type checker would take every wrong name for one of these

    def __getattr__(name: str) -> None:
        """Say what is there in the place of a removed name."""
        if name in _REMOVED:
            raise ImportError(f"flexarm_env.{name} is removed: {_REMOVED[name]}")
        raise AttributeError(f"module 'flexarm_env' has no attribute {name!r}")


register_environments()
