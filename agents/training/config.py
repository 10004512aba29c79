"""`RunConfig` and `TrainingConfig`: everything that decides what a training gives, with tuned defaults."""

from __future__ import annotations

import json
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, fields
from functools import partial
from pathlib import Path
from typing import Any, Literal, Self

from flexarm_agents.environments import check_id, check_options, settings_of
from flexarm_agents.policies.encoders import LONGEST_LAG, checked_increasing
from flexarm_agents.policies.network import ACTIVATIONS
from flexarm_agents.policies.observer import KINDS, check_observed
from flexarm_agents.training.hyperparameters import ALGORITHMS, LESSONS, SETTINGS, own_settings, tuned
from flexarm_env.validation import choice, flag, integer, known_names, mapping, number, shown

Activation = Literal["elu", "tanh", "relu"]
AlgorithmName = Literal["ppo", "recurrent_ppo", "sac", "tqc"]
ObserverName = Literal["none", "nominal", "delay"]
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

    def check_same(self, other: RunConfig, place: Path) -> None:
        """Check that this configuration goes on with what another one began.

        Args:
            other: of the same kind.
            place: where it was found, for the message.

        Raises:
            ValueError: naming the first parameter that differs.
        """
        differing = self.differences(other)
        if differing:
            name = differing[0]
            raise ValueError(
                f"{name} = {getattr(self, name)!r}: the training in {place} has {getattr(other, name)!r}; "
                f"only the same configuration resumes (different: {', '.join(differing)})"
            )


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


_TUNED: Any = None  # a value that is that of the tuned settings unless it is given


@dataclass(frozen=True, kw_only=True)
class TrainingConfig(RunConfig):
    """A training by reward. What is not given is as the tuned settings of its algorithm (`hyperparameters.tuned`).

    Fields that the algorithm does not have are None, and cannot be given.
    """

    algorithm: AlgorithmName = "ppo"
    """Which one: PPO, or RecurrentPPO, SAC, TQC."""
    steps: int = _TUNED
    """Environment steps of the training, rounded up to whole rollouts."""
    envs: int = _TUNED
    """Environments side by side."""
    batch: int = _TUNED
    """Steps in a minibatch; of PPO it must divide rollout times envs."""
    episode_steps: int = _TUNED
    """Control periods after which a training episode is cut off, its value bootstrapped."""
    gamma: float = _TUNED
    """Discount of a step."""
    learning_rate: float = _TUNED
    """At the beginning; it falls linearly."""
    final_learning_rate: float = 2e-5
    """At the end."""
    hidden: tuple[int, ...] = _TUNED
    """Sizes of the hidden layers, of the policy and of the value each."""
    activation: Activation = _TUNED
    """Between the layers."""
    rollout: int | None = None
    """PPO: steps of each environment between two updates."""
    epochs: int | None = None
    """PPO: passes through a rollout in an update."""
    gae_lambda: float | None = None
    """PPO: smoothing of the advantages."""
    clip: float | None = None
    """PPO: range of the probabilities' ratio."""
    entropy: float | None = None
    """PPO: weight of the entropy."""
    log_std: float | None = None
    """PPO: logarithm of the actions' standard deviation at the beginning."""
    lstm: int | None = None
    """RecurrentPPO: size of the memory, an LSTM."""
    critic_lstm: bool | None = None
    """RecurrentPPO: the value has an LSTM of its own; else it sees what the policy's remembers."""
    buffer: int | None = None
    """SAC, TQC: steps that are kept for learning; must be a multiple of envs."""
    learning_starts: int | None = None
    """SAC, TQC: steps of random actions before the first update."""
    tau: float | None = None
    """SAC, TQC: how quickly the target networks follow."""
    train_every: int | None = None
    """SAC, TQC: steps of each environment between updates."""
    updates: int | None = None
    """SAC, TQC: how many updates there are then."""
    temperature: float | None = None
    """SAC, TQC: weight of the entropy at the beginning; it is learned."""
    critics: int | None = None
    """SAC, TQC: how many there are."""
    quantiles: int | None = None
    """TQC: of each critic."""
    dropped_quantiles: int | None = None
    """TQC: of these, how many of the largest do not count."""
    lags: tuple[int, ...] = ()
    """PPO: ages of the readings that the policy sees beside the present ones [control periods]."""
    observer: ObserverName = "none"
    """PPO: Kalman filter in place of late readings: none, with the nominal delay, or one that estimates the delay."""
    initial_policy: str | None = None
    """PPO: policy whose network the training begins with: folder of a training, npz file or name of a shipped one."""
    value_steps: int = 0
    """After `initial_policy`: steps at the beginning in which the value learns alone, whole rollouts of them."""
    value_learning_rate: float = 1e-3
    """In these steps; they have no part in the fall of `learning_rate`."""
    lesson_options: dict[str, Any] = _TUNED
    """Options in which the training's environments differ from that of the score, e.g. a slower lap."""
    lesson_steps: int | None = None
    """Steps until which `lesson_options` hold, rounded up to whole rollouts; None: to the end."""
    evaluate_every: int = _TUNED
    """Steps between two evaluations, rounded up to whole rollouts; SAC and TQC: 5000, else 50 000."""
    evaluation_laps: int = 1
    """How often an evaluation runs each of the two standard laps; more than once where episodes differ."""
    checkpoint_every: int = _TUNED
    """Steps between two checkpoints, rounded up to whole rollouts; SAC and TQC: 25 000, else 250 000."""

    def __post_init__(self) -> None:
        """Take what is not given from the tuned settings; validate, each field and what they are together.

        Raises:
            ModuleNotFoundError: without what reads the settings, naming the extra.
            TypeError, ValueError: naming the parameter, its value and what is allowed.
        """
        for name, value in self._defaults().items():
            if getattr(self, name) is None:
                object.__setattr__(self, name, value)
        super().__post_init__()
        if self.rollout is not None:
            size = self.rollout * self.envs
            if size < 2 or self.batch > size or size % self.batch:
                raise ValueError(
                    f"batch = {shown(self.batch)}: must divide rollout * envs = {shown(self.rollout)} * "
                    f"{shown(self.envs)} = {shown(size)}"
                )
        if self.buffer is not None and (self.buffer % self.envs or self.buffer < self.batch):
            raise ValueError(
                f"buffer = {shown(self.buffer)}: must be a multiple of envs = {self.envs}, and >= batch = {self.batch}"
            )
        if self.dropped_quantiles is not None and self.dropped_quantiles >= (self.quantiles or 0):
            raise ValueError(f"dropped_quantiles = {self.dropped_quantiles}: must be < quantiles = {self.quantiles}")
        if self.final_learning_rate > self.learning_rate:
            raise ValueError(
                f"final_learning_rate = {self.final_learning_rate}: must be <= learning_rate = {self.learning_rate}"
            )
        if self.initial_policy is not None and self.observer != "none":
            raise ValueError(
                f"initial_policy = {shown(self.initial_policy)}, observer = {self.observer!r}: the network behind an "
                "observer begins untrained"
            )
        if self.value_steps and (self.initial_policy is None or self.value_steps >= self.steps):
            raise ValueError(
                f"value_steps = {self.value_steps}: must go with initial_policy, and be < steps = {self.steps}"
            )
        if self.lesson_steps is not None and (not self.lesson_options or self.lesson_steps >= self.steps):
            raise ValueError(
                f"lesson_steps = {self.lesson_steps}: must go with lesson_options, and be < steps = {self.steps}"
            )
        if self.lags and self.observer != "none":
            raise ValueError(f"lags = {self.lags}, observer = {self.observer!r}: a policy has one of them at most")
        if self.observer != "none":
            check_observed(settings_of(self.environment, self.options))

    def _defaults(self) -> dict[str, Any]:
        """Return the values of fields that are not given, after a check that those given have an effect."""
        algorithm = ALGORITHMS[choice("algorithm", self.algorithm, ALGORITHMS)]
        own = own_settings(self.algorithm)
        foreign = [name for name in SETTINGS if name not in own and getattr(self, name) is not None]
        if self.algorithm != "ppo":
            alone = {
                "lags": self.lags,
                "observer": self.observer != "none",
                "initial_policy": self.initial_policy is not None,
            }
            foreign += [name for name, given in alone.items() if given]
        if foreign:
            name = foreign[0]
            raise ValueError(
                f"{name} = {shown(getattr(self, name))}: has no effect with algorithm = {self.algorithm!r}, whose "
                f"settings are {', '.join(own)}"
            )
        every = {"evaluate_every": algorithm.evaluate_every, "checkpoint_every": algorithm.checkpoint_every}
        if all(getattr(self, name) is not None for name in [*own, LESSONS]):
            return every
        found = tuned(self.algorithm, check_id(self.environment))
        return {**found, **every, LESSONS: self._fitting(found[LESSONS])}

    def _fitting(self, lessons: dict[str, Any]) -> dict[str, Any]:
        """Return tuned lessons as far as the options leave them a meaning."""
        options = mapping("options", self.options)
        own = {name: value for name, value in lessons.items() if name not in options}
        try:
            check_options(check_id(self.environment), {**options, **own})
        except (TypeError, ValueError):  # either the options are bad by themselves, which is found later, or own ones
            return {}
        return own

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> Self:
        """Read what `plain` gave; files of versions without lessons have none."""
        return super().of({LESSONS: {}, **values})

    def _checked(self) -> dict[str, Any]:
        choice("observer", self.observer, KINDS)
        if self.initial_policy is not None and (not isinstance(self.initial_policy, str) or not self.initial_policy):
            raise TypeError(f"initial_policy = {shown(self.initial_policy)}: must be a folder, a file or a name")
        if self.lesson_steps is not None:
            integer("lesson_steps", self.lesson_steps, 1)
        environment = check_id(self.environment)
        whole = {**mapping("options", self.options), **mapping("lesson_options", self.lesson_options)}
        lessons = check_options(environment, whole)
        return {
            "lesson_options": {name: lessons[name] for name in self.lesson_options},
            "steps": integer("steps", self.steps, 1),
            "envs": integer("envs", self.envs, 1),
            "batch": integer("batch", self.batch, 2),
            "episode_steps": integer("episode_steps", self.episode_steps, 1),
            "evaluate_every": integer("evaluate_every", self.evaluate_every, 1),
            "evaluation_laps": integer("evaluation_laps", self.evaluation_laps, 1),
            "checkpoint_every": integer("checkpoint_every", self.checkpoint_every, 1),
            "gamma": number("gamma", self.gamma, least=0.0, most=1.0),
            "learning_rate": number("learning_rate", self.learning_rate, above=0.0, most=1.0),
            "final_learning_rate": number("final_learning_rate", self.final_learning_rate, least=0.0),
            "value_steps": integer("value_steps", self.value_steps, 0),
            "value_learning_rate": number("value_learning_rate", self.value_learning_rate, above=0.0, most=1.0),
            "lags": checked_increasing("lags", self.lags, 1, LONGEST_LAG),
            **checked_network(self.hidden, self.activation),
            **{name: _OWN[name](name, getattr(self, name)) for name in own_settings(self.algorithm) if name in _OWN},
        }


# How fields that only some algorithms have are checked.
_OWN: dict[str, Callable[[str, Any], Any]] = {
    "rollout": partial(integer, least=1),
    "epochs": partial(integer, least=1),
    "gae_lambda": partial(number, least=0.0, most=1.0),
    "clip": partial(number, above=0.0),
    "entropy": partial(number, least=0.0),
    "log_std": partial(number, least=-10.0, most=2.0),
    "lstm": partial(integer, least=1),
    "critic_lstm": flag,
    "buffer": partial(integer, least=1),
    "learning_starts": partial(integer, least=0),
    "tau": partial(number, above=0.0, most=1.0),
    "train_every": partial(integer, least=1),
    "updates": partial(integer, least=1),
    "temperature": partial(number, above=0.0),
    "critics": partial(integer, least=1),
    "quantiles": partial(integer, least=1),
    "dropped_quantiles": partial(integer, least=0),
}
