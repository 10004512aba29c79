"""Trained policies with what they were trained on: from the folder of a run, from a file, or one that is shipped."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium

from flexarm_agents.environments import make_one
from flexarm_agents.network import NetworkPolicy

POLICIES = Path(__file__).resolve().parent / "policies"
_BEST, _LAST = "best_policy.npz", "last_policy.npz"  # of a run's folder


@dataclass(frozen=True)
class Trained:
    """A trained policy.

    Attributes:
        name: of the policy, or of its run's folder.
        policy: has stable-baselines3's ``predict``.
        environment: id of the environment it was trained on.
        options: of that environment.
        notes: how it was made.
    """

    name: str
    policy: NetworkPolicy
    environment: str
    options: dict[str, Any]
    notes: dict[str, Any]

    def make_env(self, **options: Any) -> gymnasium.Env[Any, Any]:
        """The environment it was trained on.

        Args:
            **options: changed ones, or `render_mode`; those that change observation or action do not fit the policy.

        Raises:
            TypeError, ValueError: for a bad option.
            ValueError: if the environment's observation or action has another size than the policy's.
        """
        env = make_one(self.environment, self.options | options)
        sizes = {"observation": env.observation_space.shape, "action": env.action_space.shape}
        own = {"observation": (self.policy.observation_size,), "action": self.policy.log_std.shape}
        for what, shape in sizes.items():
            if shape != own[what]:
                env.close()
                raise ValueError(f"policy {self.name!r}: was trained with {what} of shape {own[what]}, got {shape}")
        return env


def shipped_policies() -> list[str]:
    """Names of the policies that come with the package."""
    return sorted(path.stem for path in POLICIES.glob("*.npz"))


def load_policy(source: str | Path, last: bool = False) -> Trained:
    """Load a trained policy.

    Args:
        source: the folder of a training, a policy's npz file, or the name of a shipped policy.
        last: of a folder, the policy at the end instead of the best one.

    Raises:
        FileNotFoundError: if there is none, naming those that are shipped.
        ValueError: if the file is not a policy's.
    """
    path = Path(source)
    if path.is_dir():
        name, file = path.name, path / (_LAST if last else _BEST)
        if not file.is_file():
            raise FileNotFoundError(f"source = {str(source)!r}: the folder holds no {file.name}")
    elif path.is_file():
        name, file = path.stem, path
    else:
        name, file = str(source), POLICIES / f"{source}.npz"
        if name not in shipped_policies():
            raise FileNotFoundError(
                f"source = {name!r}: neither a folder or file nor a shipped policy; these are {shipped_policies()}"
            )
    policy = NetworkPolicy.load(file)
    try:
        config = policy.notes["config"]
        return Trained(name, policy, config["environment"], config["options"], policy.notes)
    except KeyError as error:
        raise ValueError(f"{file}: does not say what it was trained on (no {error} in its notes)") from error
