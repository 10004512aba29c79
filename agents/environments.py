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
    """Check the id of a FlexArm environment; return it with its namespace, and with its module where that is not ours.

    Args:
        environment: "Square-v0", "FlexArm/Square-v0" or "flexarm_env:FlexArm/Square-v0"; for an id of another module,
            which is imported, "module:Mine/Task-v0".

    Raises:
        ValueError: if there is no such id, or its module cannot be imported.
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
    """Return the spec that is registered under a checked id (`check_id`)."""
    return gymnasium.registry[environment.rpartition(":")[2]]


def declared_id(environment: str) -> Id:
    """Return the declaration of a checked id; that of another module takes its texts from the module's docstring."""
    module, _, name = environment.rpartition(":")
    if name.partition("/")[2] in IDS and name.startswith(f"{NAMESPACE}/"):
        return IDS[name.partition("/")[2]]
    summary, _, text = (getdoc(sys.modules.get(module)) or "An id of your own.").partition("\n")
    spec = spec_of(environment)
    steps = spec.max_episode_steps or FlexArmEnv(**spec.kwargs).lap_steps
    return Id(steps, spec.kwargs, summary.removesuffix("."), text.strip(), history=("registered elsewhere",))


def check_options(environment: str, options: object) -> dict[str, Any]:
    """Check options of an environment, and return them as a JSON file gives them back.

    Raises:
        TypeError: if they are not plain values (JSON), or one is of a wrong type.
        ValueError: if one is not allowed.
    """
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

    Raises:
        ValueError: if the id has no batch of its own, or for the option `autoreset_mode`.
    """
    name, chosen = check_id(environment), dict(options or {})
    if spec_of(name).vector_entry_point is None:
        raise ValueError(f"environment = {shown(environment)}: has no batch of its own; take an id that has one")
    if "autoreset_mode" in chosen:
        raise ValueError(f"autoreset_mode = {chosen['autoreset_mode']!r}: must be left out; 'SameStep' is set")
    env = gymnasium.make_vec(name, num_envs=num_envs, autoreset_mode=AutoresetMode.SAME_STEP, **chosen)
    assert isinstance(env, FlexArmVectorEnv)
    return env
