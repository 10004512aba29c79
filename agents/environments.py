"""Environments by their ids: which there are, one of them, a batch of them."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from importlib import import_module
from inspect import getdoc
from pathlib import Path
from types import ModuleType
from typing import Any

import gymnasium
from gymnasium.envs.registration import EnvSpec
from gymnasium.vector import AutoresetMode

import flexarm_env  # noqa: F401  (registers the ids)
from flexarm_env.envs.registration import IDS, NAMESPACE, Id
from flexarm_env.envs.settings import Settings
from flexarm_env.envs.single import FlexArmEnv
from flexarm_env.envs.vector import FlexArmVectorEnv
from flexarm_env.validation import mapping, shown

# Options that are a policy's own: what it observes, and what its action means.
INTERFACE = (
    *("action_mode", "torque_rate_limit", "gain_limit", "shift_limit", "inner_stiffness", "inner_damping"),
    *("proportional_gain", "derivative_gain", "compensation", "feedback_source", "rate_jacobian", "delayed", "sensor"),
    *("observation", "frame", "previews", "last_actions", "scaled", "imu_link", "imu_noise"),
)
_ENTRY_POINTS = {one.entry for one in IDS.values()}


def check_id(environment: object) -> str:
    """Return the id of a FlexArm environment with its namespace, without its module; refuse another one.

    Args:
        environment: "Square-v0", "FlexArm/Square-v0" or "flexarm_env:FlexArm/Square-v0"; of another module, which is
            imported, "module:Mine/Task-v0", and that is returned.
    """
    module, _, name = environment.rpartition(":") if isinstance(environment, str) else ("", "", "")
    if "/" not in name:
        name = f"{NAMESPACE}/{name}"
    own = module not in ("", "flexarm_env")
    if own:
        try:
            import_from_here(module)
        except (ImportError, TypeError, ValueError) as error:
            raise ValueError(f"environment = {shown(environment)}: its module cannot be imported: {error}") from None
    known = sorted(name for name, spec in gymnasium.registry.items() if spec.entry_point in _ENTRY_POINTS)
    if name not in known:
        raise ValueError(f"environment = {shown(environment)}: must be one of {', '.join(map(repr, known))}")
    return f"{module}:{name}" if own else name


def import_from_here(module: str) -> ModuleType:
    """Import a module, which may lie in the present folder."""
    if (here := str(Path.cwd())) not in sys.path:
        sys.path.insert(0, here)
    return import_module(module)


def spec_of(environment: str) -> EnvSpec:
    """Return what is registered under an id, checked."""
    return gymnasium.registry[environment.rpartition(":")[2]]


def declared_id(environment: str) -> Id:
    """Return the declaration of an id, checked; that of another module has the words of the module's docstring."""
    module, _, name = environment.rpartition(":")
    if name.partition("/")[2] in IDS and name.startswith(f"{NAMESPACE}/"):
        return IDS[name.partition("/")[2]]
    summary, _, text = (getdoc(sys.modules.get(module)) or "An id of your own.").partition("\n")
    spec = spec_of(environment)
    steps = spec.max_episode_steps or FlexArmEnv(**spec.kwargs).lap_steps
    return Id(steps, spec.kwargs, summary.removesuffix("."), text.strip(), history=("registered elsewhere",))


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
    return Settings.of(spec_of(environment).kwargs | dict(options))


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
    if spec_of(name).vector_entry_point is None:
        raise ValueError(f"environment = {shown(environment)}: has no batch of its own; take an id that has one")
    if "autoreset_mode" in chosen:
        raise ValueError(f"autoreset_mode = {chosen['autoreset_mode']!r}: must be left out; 'SameStep' is set")
    env = gymnasium.make_vec(name, num_envs=num_envs, autoreset_mode=AutoresetMode.SAME_STEP, **chosen)
    assert isinstance(env, FlexArmVectorEnv)
    return env
