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
    """Return the id of a FlexArm environment with its namespace, without its module; refuse another one.

    Args:
        environment: "Square-v0", "FlexArm/Square-v0" or "flexarm_env:FlexArm/Square-v0".
    """
    known = sorted(name for name, spec in gymnasium.registry.items() if spec.entry_point in _ENTRY_POINTS)
    name = environment.rpartition(":")[2] if isinstance(environment, str) else ""
    if "/" not in name:
        name = f"{NAMESPACE}/{name}"
    if name not in known:
        raise ValueError(f"environment = {shown(environment)}: must be one of {', '.join(map(repr, known))}")
    return name


def check_options(environment: str, options: object) -> dict[str, Any]:
    """Return options of an environment as a file (JSON) gives them back; refuse what is bad or not plain."""
    given = mapping("options", options)
    try:
        plain: dict[str, Any] = json.loads(json.dumps(given, allow_nan=False))
    except (TypeError, ValueError) as error:
        raise TypeError(f"options = {shown(options)}: must be plain values (JSON): {error}") from None
    settings_of(environment, plain)
    return plain


def settings_of(environment: str, options: Mapping[str, Any]) -> Settings:
    """Return all options of an environment, checked."""
    return Settings.of(gymnasium.registry[environment].kwargs | dict(options))


def make_one(environment: str, options: Mapping[str, Any] | None = None) -> gymnasium.Env[Any, Any]:
    """Make one environment."""
    env = gymnasium.make(check_id(environment), **dict(options or {}))
    assert isinstance(env.unwrapped, FlexArmEnv)
    return env


def make_batch(environment: str, num_envs: int, options: Mapping[str, Any] | None = None) -> FlexArmVectorEnv:
    """Make a batch whose episodes begin in the step that ends the one before.

    Args:
        environment: their id.
        num_envs: how many.
        options: options of the environment, or `max_episode_steps`, `render_mode`, `threads`.
    """
    name, chosen = check_id(environment), dict(options or {})
    if gymnasium.spec(name).vector_entry_point is None:
        raise ValueError(f"environment = {shown(environment)}: has no batch of its own; take an id that has one")
    if "autoreset_mode" in chosen:
        raise ValueError(f"autoreset_mode = {chosen['autoreset_mode']!r}: must be left out; 'SameStep' is set")
    env = gymnasium.make_vec(name, num_envs=num_envs, autoreset_mode=AutoresetMode.SAME_STEP, **chosen)
    assert isinstance(env, FlexArmVectorEnv)
    return env
