"""Environments by their ids: which there are, one of them, a batch of them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import gymnasium
from gymnasium.vector import AutoresetMode

import flexarm_env  # noqa: F401  (registers the ids)
from flexarm_env.envs.registration import IDS, NAMESPACE
from flexarm_env.envs.settings import Settings
from flexarm_env.envs.single import FlexArmEnv
from flexarm_env.envs.vector import FlexArmVectorEnv
from flexarm_env.validation import mapping, shown

# Options that are a policy's own: what it observes, and what its action means.
INTERFACE = (
    *("action_mode", "torque_rate_limit", "gain_limit", "shift_limit", "inner_stiffness", "inner_resistance"),
    *("proportional_gain", "derivative_gain", "compensation", "law_sensor", "rate_jacobian", "delayed", "sensor"),
    *("observation", "frame", "previews", "last_actions", "scaled"),
)
_ENTRY_POINTS = {one.entry for one in IDS.values()}


def check_id(environment: object) -> str:
    """Check that an id is that of a FlexArm environment.

    Args:
        environment: with or without the module that registers it, "flexarm_env:FlexArm/Square-v0", and with or without
            the namespace, "Square-v0".

    Returns:
        The id with its namespace, without the module.

    Raises:
        ValueError: naming those there are.
    """
    known = sorted(name for name, spec in gymnasium.registry.items() if spec.entry_point in _ENTRY_POINTS)
    name = environment.rpartition(":")[2] if isinstance(environment, str) else ""
    if "/" not in name:
        name = f"{NAMESPACE}/{name}"
    if name not in known:
        raise ValueError(f"environment = {shown(environment)}: must be one of {', '.join(map(repr, known))}")
    return name


def check_options(environment: str, options: object) -> dict[str, Any]:
    """Check options of an environment, and that a file can keep them (JSON).

    Args:
        environment: its id, checked.
        options: fields of `Settings` in which it differs from the id's own.

    Returns:
        The options as a file gives them back.

    Raises:
        TypeError, ValueError: if they are no mapping, not plain, unknown, or bad.
    """
    given = mapping("options", options)
    try:
        plain: dict[str, Any] = json.loads(json.dumps(given, allow_nan=False))
    except (TypeError, ValueError) as error:
        raise TypeError(f"options = {shown(options)}: must be plain values (JSON): {error}") from None
    settings_of(environment, plain)
    return plain


def settings_of(environment: str, options: Mapping[str, Any]) -> Settings:
    """Return all options of an environment, checked.

    Raises:
        TypeError, ValueError: for an unknown or a bad one.
    """
    return Settings.of(gymnasium.registry[environment].kwargs | dict(options))


def make_one(environment: str, options: Mapping[str, Any] | None = None) -> gymnasium.Env[Any, Any]:
    """Make one environment.

    Raises:
        TypeError, ValueError: for an unknown id or a bad option.
    """
    env = gymnasium.make(check_id(environment), **dict(options or {}))
    assert isinstance(env.unwrapped, FlexArmEnv)
    return env


def make_batch(environment: str, num_envs: int, options: Mapping[str, Any] | None = None) -> FlexArmVectorEnv:
    """Make a batch whose episodes begin in the step that ends the one before.

    Args:
        environment: their id.
        num_envs: how many.
        options: options of the environment, or `max_episode_steps`, `render_mode`, `threads`.

    Raises:
        TypeError, ValueError: for an unknown id or a bad option.
    """
    name, chosen = check_id(environment), dict(options or {})
    if gymnasium.spec(name).vector_entry_point is None:
        raise ValueError(f"environment = {shown(environment)}: has no batch of its own; take an id that has one")
    if "autoreset_mode" in chosen:
        raise ValueError(f"autoreset_mode = {chosen['autoreset_mode']!r}: must be left out; 'SameStep' is set")
    env = gymnasium.make_vec(name, num_envs=num_envs, autoreset_mode=AutoresetMode.SAME_STEP, **chosen)
    assert isinstance(env, FlexArmVectorEnv)
    return env
