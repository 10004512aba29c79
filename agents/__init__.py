"""Agents that learn: an adapter for stable-baselines3, training, and policies that were trained.

What needs torch is imported at its first use: trained policies run without it.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from flexarm_agents.config import TrainingConfig
from flexarm_agents.load import Trained, load_policy, shipped_policies
from flexarm_agents.network import NetworkPolicy
from flexarm_agents.score import Score, StandardScore, evaluate, score
from flexarm_agents.spread import Spread
from flexarm_agents.stopping import TrainingStopped
from flexarm_agents.teaching.config import TeachingConfig
from flexarm_env.extras import needs_extra

if TYPE_CHECKING:
    from flexarm_agents.export import network_policy
    from flexarm_agents.teaching.training import teach
    from flexarm_agents.training import Outcome, train
    from flexarm_agents.vec_env import FlexArmVecEnv

_LATE = {
    "FlexArmVecEnv": "flexarm_agents.vec_env",
    "Outcome": "flexarm_agents.training",
    "network_policy": "flexarm_agents.export",
    "teach": "flexarm_agents.teaching.training",
    "train": "flexarm_agents.training",
}

__all__ = [
    "FlexArmVecEnv",
    "NetworkPolicy",
    "Outcome",
    "Score",
    "Spread",
    "StandardScore",
    "TeachingConfig",
    "Trained",
    "TrainingConfig",
    "TrainingStopped",
    "evaluate",
    "load_policy",
    "network_policy",
    "score",
    "shipped_policies",
    "teach",
    "train",
]


def __getattr__(name: str) -> Any:
    if name not in _LATE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    with needs_extra(name, "train"):
        return getattr(import_module(_LATE[name]), name)
