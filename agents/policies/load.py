"""Trained policies with what they were trained on: from the folder of a run, from a file, or one that is shipped."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium

from flexarm_agents.environments import check_id, make_one, settings_of
from flexarm_agents.policies.network import NetworkPolicy
from flexarm_env.envs.settings import Settings, present_names
from flexarm_env.parameters import arm_parameters
from flexarm_env.simulation import archive
from flexarm_env.validation import known_names, mapping, shown

POLICIES = Path(__file__).resolve().parent
_STABLE_BASELINES = {"data", "policy.pth"}  # in the zip files of its models
_BEST, _LAST = "best_policy.npz", "last_policy.npz"  # of a run's folder


@dataclass(frozen=True)
class Trained:
    """A trained policy.

    Attributes:
        name: name of the policy, or of its run's folder.
        policy: has stable-baselines3's ``predict``.
        environment: id of the environment it was trained on.
        options: options of that environment.
        notes: how it was made.
    """

    name: str
    policy: NetworkPolicy
    environment: str
    options: dict[str, Any]
    notes: dict[str, Any]

    def __repr__(self) -> str:
        changed = f" with its own {', '.join(self.options)}" if self.options else ""
        return f"{type(self).__name__}({self.name!r}, {self.policy}, {self.environment}{changed})"

    @property
    def has_own_arm(self) -> bool:
        """Whether it was trained on another arm than the board's: the default one, or its id's for an own task."""
        usual = settings_of(self.environment, {}).arm if self.has_own_task else "default"
        return arm_parameters(settings_of(self.environment, self.options).arm) != arm_parameters(usual)

    @property
    def has_own_task(self) -> bool:
        """Whether it was trained on another task than the square: a race, or loads to carry."""
        settings = settings_of(self.environment, self.options)
        return settings.mode.races or settings.payload_changes is not None

    def make_env(self, **options: Any) -> gymnasium.Env[Any, Any]:
        """Make the environment that it was trained on.

        Args:
            **options: changed ones, or `render_mode`; those that change observation or action do not fit the policy.

        Raises:
            ValueError: if the environment's observation or action has another size than the policy's.
        """
        env = make_one(self.environment, self.options | options)
        check_fits(self.name, (self.policy.observation_size,), self.policy.log_std.shape, env)
        return env


def check_fits(
    name: str, observation: tuple[int, ...] | None, action: tuple[int, ...] | None, env: gymnasium.Env[Any, Any]
) -> None:
    """Check that a policy was trained with observations and actions of an environment's shapes.

    Raises:
        ValueError: if not; the environment is closed then.
    """
    spaces = {"observation": (observation, env.observation_space), "action": (action, env.action_space)}
    for what, (shape, space) in spaces.items():
        if shape != space.shape:
            env.close()
            raise ValueError(f"policy {name!r}: was trained with {what} of shape {shape}, got {space.shape}")


def shipped_policies() -> list[str]:
    """Return the names of the policies that come with the package."""
    return sorted(path.stem for path in POLICIES.glob("*.npz"))


def load_policy(source: str | Path, last: bool = False) -> Trained:
    """Load a trained policy.

    Args:
        source: the folder of a training, a policy's npz file, or the name of a shipped policy.
        last: load the policy at the end of the training instead of the best one.

    Raises:
        FileNotFoundError: if there is none, naming those that are shipped.
        TypeError: if the source is neither text nor a path.
        ValueError: if the file is not a policy's, or its environment is not there.
    """
    file = policy_file(source, last)
    name = Path(source).name if os.path.isdir(source) else file.stem
    try:
        policy = NetworkPolicy.load(file)
    except ValueError as error:
        if not _STABLE_BASELINES.issubset(archive.names(file)):
            raise
        raise ValueError(
            f"{file}: a stable-baselines3 model, and reading one can execute code; if you trust it, "
            "`flexarm evaluate --stable-baselines3 CLASS` scores it"
        ) from error
    try:
        config = mapping("config", policy.notes["config"])
        options = present_names(mapping("options", config["options"]), of_file=True)
        known_names("FlexArmEnv", options, list(Settings.__dataclass_fields__))  # making it has other arguments, too
        return Trained(name, policy, check_id(config["environment"]), options, policy.notes)
    except KeyError as error:
        raise ValueError(f"{file}: does not say what it was trained on (no {error} in its notes)") from error
    except (TypeError, ValueError) as error:
        raise ValueError(f"{file}: what its notes say that it was trained on is not there ({error})") from error


def policy_file(source: str | Path, last: bool = False) -> Path:
    """Return the file that holds a trained policy; arguments and errors as of `load_policy`."""
    if not isinstance(source, str | os.PathLike):
        raise TypeError(f"source = {shown(source)}: must be a folder, a file or the name of a shipped policy")
    path = Path(source)
    if os.path.isdir(path):
        file = path / (_LAST if last else _BEST)
        if not os.path.isfile(file):
            raise FileNotFoundError(f"source = {shown(str(source))}: the folder holds no {file.name}")
        return file
    if os.path.isfile(path):
        return path
    if str(source) not in shipped_policies():
        raise FileNotFoundError(
            f"source = {shown(str(source))}: neither a folder or file nor a shipped policy; these are "
            f"{', '.join(shipped_policies())}"
        )
    return POLICIES / f"{source}.npz"
