"""The algorithms of `train`; their tuned settings lie in the files of `hyperparams` alone, in rl-zoo's format."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from flexarm_env.extras import needs_extra
from flexarm_env.validation import choice

FOLDER = Path(__file__).resolve().parent.parent / "hyperparams"
HOME = "FlexArm/Square-v0"  # whose settings other ids have, unless a file has some of their own
Values = dict[str, Any]


class Algorithm(NamedTuple):
    """An algorithm of stable-baselines3 or sb3-contrib.

    Attributes:
        text: its name.
        kind: its class, as "module:class".
        policy: its policy's name in the library, or "module:class".
        evaluate_every: steps between two evaluations, unless told otherwise.
        checkpoint_every: steps between two checkpoints, unless told otherwise.
    """

    text: str
    kind: str
    policy: str
    evaluate_every: int
    checkpoint_every: int


ALGORITHMS = {
    "ppo": Algorithm("PPO", "stable_baselines3:PPO", "MlpPolicy", 50_000, 250_000),
    "recurrent_ppo": Algorithm("RecurrentPPO", "sb3_contrib:RecurrentPPO", "MlpLstmPolicy", 50_000, 250_000),
    "sac": Algorithm("SAC", "stable_baselines3:SAC", "MlpPolicy", 5_000, 25_000),
    "tqc": Algorithm("TQC", "sb3_contrib:TQC", "MlpPolicy", 5_000, 25_000),
}
ALL, ON_POLICY, OFF_POLICY = tuple(ALGORITHMS), ("ppo", "recurrent_ppo"), ("sac", "tqc")


class Setting(NamedTuple):
    """What a field of `TrainingConfig` is in a file of settings.

    Attributes:
        name: there; "a.b" is b within a.
        algorithms: that have it.
    """

    name: str
    algorithms: tuple[str, ...] = ALL


SETTINGS = {
    "steps": Setting("n_timesteps"),
    "envs": Setting("n_envs"),
    "episode_steps": Setting("env_kwargs.max_episode_steps"),
    "batch": Setting("batch_size"),
    "gamma": Setting("gamma"),
    "learning_rate": Setting("learning_rate"),
    "hidden": Setting("policy_kwargs.net_arch"),
    "activation": Setting("policy_kwargs.activation_fn"),
    "rollout": Setting("n_steps", ON_POLICY),
    "epochs": Setting("n_epochs", ON_POLICY),
    "gae_lambda": Setting("gae_lambda", ON_POLICY),
    "clip": Setting("clip_range", ON_POLICY),
    "entropy": Setting("ent_coef", ON_POLICY),
    "log_std": Setting("policy_kwargs.log_std_init", ON_POLICY),
    "lstm": Setting("policy_kwargs.lstm_hidden_size", ("recurrent_ppo",)),
    "critic_lstm": Setting("policy_kwargs.enable_critic_lstm", ("recurrent_ppo",)),
    "buffer": Setting("buffer_size", OFF_POLICY),
    "learning_starts": Setting("learning_starts", OFF_POLICY),
    "tau": Setting("tau", OFF_POLICY),
    "train_every": Setting("train_freq", OFF_POLICY),
    "updates": Setting("gradient_steps", OFF_POLICY),
    "temperature": Setting("ent_coef", OFF_POLICY),
    "critics": Setting("policy_kwargs.n_critics", OFF_POLICY),
    "quantiles": Setting("policy_kwargs.n_quantiles", ("tqc",)),
    "dropped_quantiles": Setting("top_quantiles_to_drop_per_net", ("tqc",)),
}
LESSONS = "lesson_options"  # the field for all else that a file says of the environment
_ENVIRONMENT = "env_kwargs."
# What a file has beside them: the policy follows from the algorithm, `shared_lstm` from `enable_critic_lstm`.
IMPLIED = ("policy", "policy_kwargs.shared_lstm")


def own_settings(algorithm: str) -> list[str]:
    """Return the names of the fields that an algorithm has."""
    return [name for name, one in SETTINGS.items() if algorithm in one.algorithms]


def tuned(algorithm: str, environment: str) -> Values:
    """Return the tuned settings of an algorithm for an environment, by the names of `TrainingConfig`'s fields.

    Args:
        algorithm: a name in `ALGORITHMS`.
        environment: its id; one that the file lacks has the settings of `HOME`, without its lessons.

    Raises:
        ModuleNotFoundError: without what reads the file, naming the extra.
        TypeError, ValueError: for another algorithm, or a file with other settings than the algorithm has.
    """
    choice("algorithm", algorithm, ALL)
    files = _read(algorithm)
    if environment in files:
        return settings_of(algorithm, files[environment])
    return {**settings_of(algorithm, files[HOME]), LESSONS: {}}


def settings_of(algorithm: str, zoo: Mapping[str, Any]) -> Values:
    """Read settings in rl-zoo's format; arguments and errors as of `tuned`.

    Args:
        algorithm: a name in `ALGORITHMS`.
        zoo: of one environment.
    """
    flat: Values = {}
    for name, value in zoo.items():
        inner = _arguments(value) if name == "policy_kwargs" else value
        flat |= {f"{name}.{key}": one for key, one in inner.items()} if isinstance(inner, Mapping) else {name: value}
    lessons = {key.removeprefix(_ENVIRONMENT): flat.pop(key) for key in [*flat] if _of_lessons(key)}
    own = {SETTINGS[name].name: name for name in own_settings(algorithm)}
    unused, missing = flat.keys() - own.keys() - set(IMPLIED), own.keys() - flat.keys()
    for text, names in (("has no use for", unused), ("lacks", missing)):
        if names:
            raise ValueError(f"hyperparams/{algorithm}.yml: {text} {', '.join(sorted(names))}")
    return {LESSONS: lessons, **{name: _plain(name, flat[key]) for key, name in own.items()}}


def _of_lessons(key: str) -> bool:
    """Return whether a setting is an option of the environments in which an agent learns."""
    return key.startswith(_ENVIRONMENT) and key != SETTINGS["episode_steps"].name


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
    """Turn a value of a file into that of a field."""
    if name == "learning_rate":
        return float(value.removeprefix("lin_"))
    if name == "temperature":
        return float(value.removeprefix("auto_"))
    if name == "activation":
        return value.lower()
    return int(value) if name == "steps" else value
