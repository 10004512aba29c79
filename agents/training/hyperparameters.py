"""The tuned settings of the algorithms: the files of `hyperparams`, in rl-zoo's format."""

import ast
from collections.abc import Mapping
from dataclasses import fields
from functools import cache
from pathlib import Path
from typing import Any

from flexarm_env.extras import needs_extra

FOLDER = Path(__file__).resolve().parents[1] / "hyperparams"
HOME = "FlexArm/Square-v0"  # whose settings other ids have, unless a file has some of their own
CURRICULUM = "curriculum_options"  # the field for all else that a file says of the environment
Values = dict[str, Any]
_ENVIRONMENT = "env_kwargs."
# What a file has beside them: the policy follows from the algorithm, `shared_lstm` from `enable_critic_lstm`.
IMPLIED = ("policy", "policy_kwargs.shared_lstm")


def names_in_zoo(kind: Any) -> dict[str, str]:
    """Return the names of settings in a file, by the names of a configuration's fields."""
    return {one.name: one.metadata["zoo"] for one in fields(kind) if one.metadata.get("zoo")}


def tuned(kind: Any, environment: str) -> Values:
    """Return the tuned settings for an id, by the names of the fields of a class of configurations.

    An id that the file lacks has the settings of `HOME`, without its curriculum.

    Raises:
        ModuleNotFoundError: without the package that reads the file, naming the extra.
        ValueError: if the file lacks a setting, or has one that no field stands for.
    """
    files = _read(kind.algorithm)
    if environment in files:
        return settings_of(kind, files[environment])
    return {**settings_of(kind, files[HOME]), CURRICULUM: {}}


def settings_of(kind: Any, zoo: Mapping[str, Any]) -> Values:
    """Read an environment's settings in rl-zoo's format (`zoo`); the result and the errors are those of `tuned`."""
    flat: Values = {}
    for name, value in zoo.items():
        inner = _arguments(value) if name == "policy_kwargs" else value
        flat |= {f"{name}.{key}": one for key, one in inner.items()} if isinstance(inner, Mapping) else {name: value}
    names = {zoo: name for name, zoo in names_in_zoo(kind).items()}
    others = [key for key in flat if key.startswith(_ENVIRONMENT) and key not in names]
    curriculum = {key.removeprefix(_ENVIRONMENT): flat.pop(key) for key in others}
    unused, missing = flat.keys() - names.keys() - set(IMPLIED), names.keys() - flat.keys()
    for text, found in (("has no use for", unused), ("lacks", missing)):
        if found:
            raise ValueError(f"hyperparams/{kind.algorithm}.yml: {text} {', '.join(sorted(found))}")
    return {CURRICULUM: curriculum, **{name: _plain(name, flat[key]) for key, name in names.items()}}


@cache
def _read(algorithm: str) -> Values:
    with needs_extra(f"hyperparams/{algorithm}.yml", "train"):
        import yaml
    read: Values = yaml.safe_load((FOLDER / f"{algorithm}.yml").read_text(encoding="utf-8"))
    return read


def _arguments(text: str) -> Values:
    """Read "dict(net_arch=[128], activation_fn=nn.ELU)", as rl-zoo writes a policy's arguments; nothing is executed."""
    call = ast.parse(text, mode="eval").body
    if not isinstance(call, ast.Call) or call.args:
        raise ValueError(f"policy_kwargs = {text!r}: must be dict(name=value, ...)")
    return {
        str(one.arg): one.value.attr if isinstance(one.value, ast.Attribute) else ast.literal_eval(one.value)
        for one in call.keywords
    }


def _plain(name: str, value: Any) -> Any:
    if name == "learning_rate":
        return float(value.removeprefix("lin_"))
    if name == "temperature":
        return float(value.removeprefix("auto_"))
    if name == "activation":
        return value.lower()
    return int(value) if name == "steps" else value
