"""Agents that learn: an adapter for stable-baselines3, training, and policies that were trained.

A name is imported at its first use: the command begins at once, and trained policies run without torch.

A shipped agent chooses the motors' torques, as shares of their limits:

    >>> from flexarm_agents import load_policy
    >>> agent = load_policy("student")
    >>> env = agent.make_env()
    >>> action, memory = agent.policy.predict(env.reset(seed=0)[0])
    >>> agent.environment, action.shape
    ('FlexArm/Square-v0', (2,))
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from flexarm_agents.descent.config import DescentConfig
    from flexarm_agents.descent.training import descend
    from flexarm_agents.evaluation.scoring import Score, StandardScore, evaluate, score
    from flexarm_agents.evaluation.seed_statistics import Spread
    from flexarm_agents.jobs.stopping import TrainingStopped
    from flexarm_agents.policies.load import Trained, load_policy, shipped_policies
    from flexarm_agents.policies.network import NetworkPolicy
    from flexarm_agents.sb3.export import network_policy
    from flexarm_agents.sb3.vec_env import FlexArmVecEnv
    from flexarm_agents.teaching.config import TeachingConfig
    from flexarm_agents.teaching.training import teach
    from flexarm_agents.training.config import TrainingConfig
    from flexarm_agents.training.train import Outcome, train

_MODULES = {
    "DescentConfig": "descent.config",
    "FlexArmVecEnv": "sb3.vec_env",
    "NetworkPolicy": "policies.network",
    "Outcome": "training.train",
    "Score": "evaluation.scoring",
    "Spread": "evaluation.seed_statistics",
    "StandardScore": "evaluation.scoring",
    "TeachingConfig": "teaching.config",
    "Trained": "policies.load",
    "TrainingConfig": "training.config",
    "TrainingStopped": "jobs.stopping",
    "descend": "descent.training",
    "evaluate": "evaluation.scoring",
    "load_policy": "policies.load",
    "network_policy": "sb3.export",
    "score": "evaluation.scoring",
    "shipped_policies": "policies.load",
    "teach": "teaching.training",
    "train": "training.train",
}

__all__ = [
    "DescentConfig",
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
    "descend",
    "evaluate",
    "load_policy",
    "network_policy",
    "score",
    "shipped_policies",
    "teach",
    "train",
]


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from flexarm_env.extras import needs_extra  # imports all of flexarm_env

    with needs_extra(name, "train"):
        return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
