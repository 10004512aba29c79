"""Agents that learn: an adapter for stable-baselines3, training, and policies that were trained.

A name is imported at its first use, so that the command starts at once and trained policies run without torch.

A shipped agent chooses the motors' torques, as shares of their limits:

    >>> from flexarm_agents import load_policy
    >>> agent = load_policy("student")
    >>> env = agent.make_env()
    >>> action, memory = agent.policy.predict(env.reset(seed=0)[0])
    >>> agent.environment, action.shape
    ('FlexArm/Square-v0', (2,))
"""

import warnings
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from flexarm_agents.descent.config import FOPGConfig as FOPGConfig
    from flexarm_agents.evaluation.races import evaluate as evaluate
    from flexarm_agents.evaluation.scoring import Score as Score
    from flexarm_agents.evaluation.scoring import Spread as Spread
    from flexarm_agents.evaluation.scoring import StandardScore as StandardScore
    from flexarm_agents.evaluation.scoring import score as score
    from flexarm_agents.jobs.stopping import TrainingStopped as TrainingStopped
    from flexarm_agents.policies.load import Trained as Trained
    from flexarm_agents.policies.load import load_policy as load_policy
    from flexarm_agents.policies.load import shipped_policies as shipped_policies
    from flexarm_agents.policies.network import NetworkPolicy as NetworkPolicy
    from flexarm_agents.policies.onnx_file import export_onnx as export_onnx
    from flexarm_agents.sb3.export import network_policy as network_policy
    from flexarm_agents.sb3.vec_env import FlexArmVecEnv as FlexArmVecEnv
    from flexarm_agents.teaching.config import DAggerConfig as DAggerConfig
    from flexarm_agents.training.algorithms import PPOConfig as PPOConfig
    from flexarm_agents.training.algorithms import RecurrentPPOConfig as RecurrentPPOConfig
    from flexarm_agents.training.algorithms import SACConfig as SACConfig
    from flexarm_agents.training.algorithms import TQCConfig as TQCConfig
    from flexarm_agents.training.config import config_of as config_of
    from flexarm_agents.training.train import Outcome as Outcome
    from flexarm_agents.training.train import train as train

_MODULES = {
    "DAggerConfig": "teaching.config",
    "FOPGConfig": "descent.config",
    "FlexArmVecEnv": "sb3.vec_env",
    "NetworkPolicy": "policies.network",
    "Outcome": "training.train",
    "PPOConfig": "training.algorithms",
    "RecurrentPPOConfig": "training.algorithms",
    "SACConfig": "training.algorithms",
    "Score": "evaluation.scoring",
    "Spread": "evaluation.scoring",
    "StandardScore": "evaluation.scoring",
    "TQCConfig": "training.algorithms",
    "Trained": "policies.load",
    "TrainingStopped": "jobs.stopping",
    "config_of": "training.config",
    "evaluate": "evaluation.races",
    "export_onnx": "policies.onnx_file",
    "load_policy": "policies.load",
    "network_policy": "sb3.export",
    "score": "evaluation.scoring",
    "shipped_policies": "policies.load",
    "train": "training.train",
}
# Former names, each with its present one; they stay for one release.
_FORMER = {
    "DescentConfig": "FOPGConfig",
    "TeachingConfig": "DAggerConfig",
    "TrainingConfig": "config_of",
    "descend": "train",
    "teach": "train",
}

__all__ = list(_MODULES)


def __getattr__(name: str) -> Any:
    if name in _FORMER:
        text = f"flexarm_agents.{name} is now flexarm_agents.{_FORMER[name]}; the old name goes with the next release"
        warnings.warn(text, DeprecationWarning, stacklevel=2)
        name = _FORMER[name]
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from flexarm_env.extras import needs_extra  # imports all of flexarm_env

    with needs_extra(name, "train"):
        return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
