"""`RunConfig`: everything that decides the result of a training; one class for each algorithm, in `ALGORITHMS`."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, fields
from functools import partial
from pathlib import Path
from pkgutil import resolve_name
from typing import Any, ClassVar, Literal, Self

from flexarm_agents.environments import check_id, check_options
from flexarm_agents.policies.network import ACTIVATIONS
from flexarm_env.allowed import Custom, Integer, OneOf, check_fields, declared
from flexarm_env.envs.settings import present_names
from flexarm_env.extras import needs_extra
from flexarm_env.validation import choice, integer, known_names, mapping, number, shown

ALGORITHMS = {
    "ppo": "flexarm_agents.training.algorithms:PPOConfig",
    "recurrent_ppo": "flexarm_agents.training.algorithms:RecurrentPPOConfig",
    "sac": "flexarm_agents.training.algorithms:SACConfig",
    "tqc": "flexarm_agents.training.algorithms:TQCConfig",
    "dagger": "flexarm_agents.teaching.config:DAggerConfig",
    "fopg": "flexarm_agents.descent.config:FOPGConfig",
}
Activation = Literal["elu", "tanh", "relu"]
LARGEST_SEED = 2**32 - 1
# Former names of fields, in the files of earlier versions.
_FORMER = {"lesson_options": "curriculum_options", "lesson_steps": "curriculum_steps"}


def setting(default: Any, check: Callable[..., Any], zoo: str = "", /, kept: bool = True, **bounds: Any) -> Any:
    """Declare a field of a configuration.

    Args:
        default: its value, unless another one is given.
        check: takes the field's name, the value and the bounds, and returns the value in its canonical type.
        zoo: name of the setting in rl-zoo's files; "a.b" is b within a.
        kept: whether the field belongs to the configuration in files; else it has no influence on the result.
        **bounds: of the check.
    """
    return declared(default, Custom(partial(check, **bounds)), zoo=zoo, kept=kept)


def layers(name: str, value: object) -> tuple[int, ...]:
    """Check the sizes of hidden layers."""
    if not isinstance(value, list | tuple) or not value:
        raise TypeError(f"{name} = {shown(value)}: must be a list of sizes, one at least")
    return tuple(integer(f"{name}[{n}]", size, 1) for n, size in enumerate(value))


def text(name: str, value: object, what: str) -> str:
    """Check a text that is not empty; `what` says what it names."""
    if not isinstance(value, str) or not value:
        raise TypeError(f"{name} = {shown(value)}: must be {what}")
    return value


def optional(name: str, value: object, check: Callable[..., Any], **bounds: Any) -> Any:
    """Check a value that may be None; arguments as of `setting`."""
    return None if value is None else check(name, value, **bounds)


@dataclass(frozen=True, kw_only=True)
class RunConfig:
    """Fields of all algorithms; each field is checked when a configuration is made."""

    algorithm: ClassVar[str]
    training: ClassVar[str]  # "module:class" of the `Training`

    environment: str = declared("FlexArm/Square-v0", Custom(lambda name, value: check_id(value)))
    """Id of the environment."""
    options: dict[str, Any] = declared({}, Custom(mapping))
    """Options of the environment that differ from the id's own."""
    curriculum_options: dict[str, Any] = declared({}, Custom(mapping))
    """Options in which the training's environments differ from the environment of the score, e.g. the start."""
    seed: int = declared(0, Integer(0, LARGEST_SEED))
    """Seed of everything random."""
    hidden: tuple[int, ...] = setting((128, 128), layers)
    """Sizes of the hidden layers, of each network."""
    activation: Activation = declared("elu", OneOf(tuple(ACTIVATIONS)))
    """Activation function between the layers."""
    learning_rate: float = setting(2e-3, number, above=0.0, most=1.0)
    """Learning rate at the beginning."""
    evaluation_laps: int = setting(1, integer, least=1)
    """Number of evaluations of each of the two standard laps; more than one where episodes differ."""

    def __post_init__(self) -> None:
        """Validate; lists (as JSON has them) become tuples."""
        check_fields(self)
        options = check_options(self.environment, self.options)
        whole = check_options(self.environment, {**self.options, **self.curriculum_options})
        object.__setattr__(self, "options", options)
        object.__setattr__(self, "curriculum_options", {name: whole[name] for name in self.curriculum_options})

    @property
    def folder(self) -> Path:
        """The default folder of a run."""
        return Path("runs") / f"{self.environment.partition('/')[2]}-{self.algorithm}-{self.seed}"

    def plain(self) -> dict[str, Any]:
        """Return plain values, as a JSON file keeps them."""
        own = {one.name for one in fields(self) if one.metadata.get("kept", True)}
        kept = {name: value for name, value in asdict(self).items() if name in own}
        values: dict[str, Any] = json.loads(json.dumps(kept))
        return {"algorithm": self.algorithm, **values}

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> Self:
        """Make a configuration from the values of `plain`, of this version or an earlier one."""
        own = {_FORMER.get(name, name): value for name, value in values.items()}
        for name in own.keys() & {"options", "curriculum_options"}:
            own[name] = present_names(mapping(name, own[name]), of_file=True)
        choice("algorithm", own.pop("algorithm", cls.algorithm), [cls.algorithm])
        known = [one.name for one in fields(cls)]
        own = {name: value for name, value in own.items() if name in known or not _unused(name, value)}
        known_names(cls.__name__, own, known)
        return cls(**own)

    def differences(self, other: RunConfig) -> list[str]:
        """Return the names of the parameters in which two configurations of a class differ."""
        mine, theirs = self.plain(), other.plain()
        return [name for name in mine if mine[name] != theirs[name]]

    def check_same(self, other: RunConfig, place: Path) -> None:
        """Check that this configuration can resume a training with another one.

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


def _unused(name: str, value: object) -> bool:
    """Return whether a field of a former file is one of another algorithm, left at its default."""
    former = {"lags": [], "observer": "none", "value_steps": 0, "value_learning_rate": 1e-3}
    others = {one.name for algorithm in ("ppo", "recurrent_ppo", "tqc") for one in fields(config_class(algorithm))}
    return name in others and (value is None or (name in former and former[name] == value))


def config_class(algorithm: str) -> Any:
    """Return the class of an algorithm's configurations."""
    place = ALGORITHMS[choice("algorithm", algorithm, ALGORITHMS)]
    with needs_extra(f"algorithm = {algorithm!r}", "train"):
        return resolve_name(place)


def config_of(algorithm: str = "ppo", **values: Any) -> Any:
    """Make the configuration of an algorithm by its name.

    Args:
        algorithm: a name in `ALGORITHMS`.
        **values: fields of its configuration; the others have their defaults.
    """
    kind, values = config_class(algorithm), {_FORMER.get(name, name): value for name, value in values.items()}
    known_names(kind.__name__, values, [one.name for one in fields(kind)])
    return kind(**values)


def read_config(values: Mapping[str, Any]) -> Any:
    """Make the configuration that `RunConfig.plain` returned, of any algorithm."""
    return config_class(values.get("algorithm", "ppo")).of(values)
