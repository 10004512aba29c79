"""`RunConfig` and `TrainingConfig`: everything that decides what a training gives, with tuned defaults."""

from __future__ import annotations

import json
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any, Literal, Self

from flexarm_agents.environments import check_id, check_options
from flexarm_agents.network import ACTIVATIONS
from flexarm_env.validation import choice, integer, known_names, number, shown

Activation = Literal["elu", "tanh", "relu"]
LARGEST_SEED = 2**32 - 1


@dataclass(frozen=True, kw_only=True)
class RunConfig(ABC):
    """What the configurations of all kinds of training have in common; a field is checked when it is made."""

    environment: str = "FlexArm/Square-v0"
    """Id of the environment."""
    options: dict[str, Any] = field(default_factory=dict)
    """Options of the environment that differ from the id's own."""
    seed: int = 0
    """Seed of everything random."""

    def __post_init__(self) -> None:
        """Validate; lists (as JSON has them) become tuples.

        Raises:
            TypeError, ValueError: naming the parameter, its value and what is allowed.
        """
        environment = check_id(self.environment)
        common = {
            "environment": environment,
            "options": check_options(environment, self.options),
            "seed": integer("seed", self.seed, 0, LARGEST_SEED),
        }
        for name, value in (common | self._checked()).items():
            object.__setattr__(self, name, value)

    @abstractmethod
    def _checked(self) -> dict[str, Any]:
        """Check the fields that a subclass adds, and return their values."""

    @property
    def folder(self) -> Path:
        """The default folder of a run."""
        return Path("runs") / f"{self.environment.partition('/')[2]}-{self.seed}"

    def plain(self) -> dict[str, Any]:
        """Return plain values, as a JSON file keeps them."""
        values: dict[str, Any] = json.loads(json.dumps(asdict(self)))
        return values

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> Self:
        """Read what `plain` gave.

        Raises:
            TypeError: for an unknown name, with the nearest known one.
            ValueError: for a bad value.
        """
        known_names(cls.__name__, values, [one.name for one in fields(cls)])
        return cls(**values)

    def differences(self, other: RunConfig) -> list[str]:
        """Return the names of the parameters in which two of a kind differ."""
        mine, theirs = self.plain(), other.plain()
        return [name for name in mine if mine[name] != theirs[name]]


def checked_network(hidden: Any, activation: Any) -> dict[str, Any]:
    """Check sizes and activation of a network's hidden layers.

    Raises:
        TypeError, ValueError: naming the parameter, its value and what is allowed.
    """
    if not isinstance(hidden, list | tuple) or not hidden:
        raise TypeError(f"hidden = {shown(hidden)}: must be a list of sizes, one at least")
    return {
        "hidden": tuple(integer(f"hidden[{n}]", size, 1) for n, size in enumerate(hidden)),
        "activation": choice("activation", activation, ACTIVATIONS),
    }


@dataclass(frozen=True, kw_only=True)
class TrainingConfig(RunConfig):
    """PPO on one environment; the defaults are tuned on `FlexArm/Square-v0`."""

    steps: int = 2_000_000
    """Environment steps of the training, rounded up to whole rollouts."""
    envs: int = 64
    """Environments side by side."""
    rollout: int = 64
    """Steps of each environment between two updates."""
    batch: int = 1024
    """Steps in a minibatch; must divide rollout times envs."""
    epochs: int = 6
    """Passes through a rollout in an update."""
    episode_steps: int = 600
    """Control periods after which a training episode is cut off, its value bootstrapped."""
    gamma: float = 0.985
    """Discount of a step."""
    gae_lambda: float = 0.95
    """Smoothing of the advantages."""
    learning_rate: float = 1.5e-3
    """At the beginning; it falls linearly."""
    final_learning_rate: float = 2e-5
    """At the end."""
    clip: float = 0.2
    """Range of the probabilities' ratio."""
    entropy: float = 0.0
    """Weight of the entropy."""
    log_std: float = -0.7
    """Logarithm of the actions' standard deviation at the beginning."""
    hidden: tuple[int, ...] = (128, 128)
    """Sizes of the hidden layers, of the policy and of the value each."""
    activation: Activation = "elu"
    """Between the layers."""
    evaluate_every: int = 50_000
    """Steps between two evaluations, rounded up to whole rollouts."""
    evaluation_laps: int = 1
    """How often an evaluation runs each of the two standard laps; more than once where episodes differ."""
    checkpoint_every: int = 250_000
    """Steps between two checkpoints, rounded up to whole rollouts."""

    def __post_init__(self) -> None:
        """Validate, each field and what they are together.

        Raises:
            TypeError, ValueError: naming the parameter, its value and what is allowed.
        """
        super().__post_init__()
        size = self.rollout * self.envs
        if size < 2 or self.batch > size or size % self.batch:
            raise ValueError(
                f"batch = {shown(self.batch)}: must divide rollout * envs = {shown(self.rollout)} * {shown(self.envs)} "
                f"= {shown(size)}"
            )
        if self.final_learning_rate > self.learning_rate:
            raise ValueError(
                f"final_learning_rate = {self.final_learning_rate}: must be <= learning_rate = {self.learning_rate}"
            )

    def _checked(self) -> dict[str, Any]:
        least = {"rollout": 1, "envs": 1, "batch": 2, "epochs": 1, "episode_steps": 1, "steps": 1}
        least |= {"evaluate_every": 1, "evaluation_laps": 1, "checkpoint_every": 1}
        return {name: integer(name, getattr(self, name), bound) for name, bound in least.items()} | {
            "gamma": number("gamma", self.gamma, least=0.0, most=1.0),
            "gae_lambda": number("gae_lambda", self.gae_lambda, least=0.0, most=1.0),
            "learning_rate": number("learning_rate", self.learning_rate, above=0.0, most=1.0),
            "final_learning_rate": number("final_learning_rate", self.final_learning_rate, least=0.0),
            "clip": number("clip", self.clip, above=0.0),
            "entropy": number("entropy", self.entropy, least=0.0),
            "log_std": number("log_std", self.log_std, least=-10.0, most=2.0),
            **checked_network(self.hidden, self.activation),
        }
