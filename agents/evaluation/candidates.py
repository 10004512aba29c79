"""`Candidate`: a policy that is scored, with its environment: a trained policy, a user's class or function, a model."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import gymnasium

from flexarm_agents.environments import INTERFACE, check_id, import_from_here, make_one
from flexarm_agents.policies.load import check_fits, load_policy
from flexarm_baselines.registry import controller
from flexarm_env.envs.blocks import INFORMATION, PRIVILEGED
from flexarm_env.envs.observation import readings_of
from flexarm_env.extras import needs_extra
from flexarm_env.validation import shown

Options = Mapping[str, Any]
ENVIRONMENT = "FlexArm/Square-v0"  # of the standard laps
WITHOUT = "none"  # in the place of a file of statistics
STATISTICS = ("*vec*normalize*.pkl", "*/vecnormalize.pkl")  # where trainings leave them, beside a model


class Candidate(NamedTuple):
    """A policy and the environment that it is scored on."""

    name: str  # as it was given
    policy: Any  # as `run_policy` takes it
    env: gymnasium.Env[Any, Any]  # its environment
    environment: str  # id of that
    options: dict[str, Any]  # options of the environment, where they differ from the id's own
    config: dict[str, Any] | None = None  # configuration of the training that it comes from, None for others
    # Those of the options that are not a policy's own (`flexarm_agents.environments.INTERFACE`)
    plant: Options = MappingProxyType({})

    @property
    def reads(self) -> tuple[str, ...]:
        """Names of what it has of arm and task, ordered as `INFORMATION`: by its observation and the policy's `knows`.

        Raises:
            ValueError: if `knows` has another name.
        """
        named = tuple(getattr(self.policy, "knows", ()))
        for name in named:
            if name not in INFORMATION:
                raise ValueError(f"policy {self.name}: knows = {named}: must be names of {', '.join(INFORMATION)}")
        found = {*named, *readings_of(self.env.unwrapped.settings)}  # type: ignore[attr-defined]
        return tuple(name for name in INFORMATION if name in found)

    @property
    def privileged(self) -> bool:
        """Whether it reads what no sensor delivers."""
        return not set(PRIVILEGED).isdisjoint(self.reads)


class Normalized:
    """A stable-baselines3 model behind the statistics by which `VecNormalize` scaled its observations."""

    batched = True

    def __init__(self, model: Any, statistics: Any) -> None:
        self._model, self._statistics = model, statistics

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = True
    ) -> tuple[Any, Any]:
        """Choose actions, as the model does."""
        scaled = self._statistics.normalize_obs(observation) if self._statistics.norm_obs else observation
        found: tuple[Any, Any] = self._model.predict(scaled, state, episode_start, deterministic)
        return found


def changed(own: Options, options: Options, arm: str | None) -> dict[str, Any]:
    """Return the options of an environment after changes, and with another arm if one is named (`PRESETS`)."""
    return {**own, **options, **({} if arm is None else {"arm": arm})}


def from_training(source: str, options: Options, arm: str | None) -> Candidate:
    """Load a trained policy, with its own environment; see `load_policy` and `Trained.make_env`."""
    trained = load_policy(source)
    whole = changed(trained.options, options, arm)
    config = trained.notes["config"]
    env, plant = trained.make_env(**whole), plant_of(whole)
    return Candidate(source, trained.policy, env, trained.environment, whole, config, plant)


def plant_of(options: Options) -> dict[str, Any]:
    """Return the options that say what a policy is run on, without those that say what it observes and how it acts."""
    return {name: value for name, value in options.items() if name not in INTERFACE}


def from_controller(name: str, environment: str, options: Options, **design: Any) -> Candidate:
    """Make a controller of the registry with an environment, the options that it needs and further ones."""
    entry = controller(name)
    whole = changed(entry.options, options, None)
    env = make_one(environment, whole)
    return Candidate(name, entry.make(env, **design), env, check_id(environment), whole)


def made_for(env: gymnasium.Env[Any, Any], found: Any, source: str) -> Any:
    """Make a policy of what a module holds: a class with `for_env` or without arguments, an object, or a function."""
    if hasattr(found, "for_env"):
        return found.for_env(env)
    if not isinstance(found, type):
        return found
    try:
        return found()
    except TypeError as error:
        raise TypeError(f"policy {source}: needs a classmethod for_env(env), or no arguments ({error})") from error


def loaded_model(source: str, algorithm: str, env: gymnasium.Env[Any, Any], vec_normalize: str = "") -> Any:
    """Load a stable-baselines3 model, which must be from a source that you trust: reading it can execute code.

    Args:
        source: its zip file.
        algorithm: its class, a name in stable-baselines3, "PPO", or "module:Class", "sb3_contrib:TQC".
        env: environment that it is for.
        vec_normalize: file of the statistics by which `VecNormalize` scaled its observations; reading it can execute
            code, too. `WITHOUT`: there are none; "": none, and no such file may lie beside the model.

    Raises:
        ImportError: without the package.
        TypeError, ValueError: for another class, a bad file, a model for another environment, or statistics that lie
            beside the model and are not mentioned.
    """
    beside = [file for place in STATISTICS for file in sorted(Path(source).parent.glob(place))]
    if beside and not vec_normalize:
        raise ValueError(
            f"{source}: {beside[0]} lies beside it; vec_normalize = '': must be the file by which the model's "
            f"observations were scaled (--vec-normalize {beside[0]}), or {WITHOUT!r} if they were not"
        )
    with needs_extra(source, "train"):
        vec_env: Any = importlib.import_module("stable_baselines3.common.vec_env")
    kind = imported(algorithm if ":" in algorithm else f"stable_baselines3:{algorithm}")
    if not hasattr(kind, "load"):
        raise TypeError(f"algorithm = {shown(algorithm)}: must be a class of stable-baselines3's models")
    try:
        model = kind.load(source, device="cpu")
    except Exception as error:  # whatever reading something else ends in
        raise ValueError(f"{source}: is no model of {algorithm} ({error})") from error
    check_fits(source, model.observation_space.shape, model.action_space.shape, env)
    if vec_normalize in ("", WITHOUT):
        return model
    try:
        statistics = vec_env.VecNormalize.load(vec_normalize, vec_env.DummyVecEnv([lambda: env]))
        return Normalized(model, statistics)
    except Exception as error:  # whatever reading something else ends in
        raise ValueError(
            f"vec_normalize = {shown(vec_normalize)}: is no file of VecNormalize.save ({error})"
        ) from error


def imported(source: str) -> Any:
    """Import what "module:attribute" names; the module may lie in the present folder.

    Raises:
        ImportError: if there is no such module.
        ValueError: for another text, or if the module has no such attribute.
    """
    module, _, attribute = source.partition(":")
    if not module or not attribute:
        raise ValueError(f"{shown(source)}: must be 'module:attribute'")
    found: Any = import_from_here(module)
    for name in attribute.split("."):
        if not hasattr(found, name):
            raise ValueError(f"{shown(source)}: {module} has no attribute {attribute}")
        found = getattr(found, name)
    return found
