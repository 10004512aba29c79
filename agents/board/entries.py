"""`Entry`: a controller, a trained policy, or a user's class or function, as plain values; all entries of the board."""

import hashlib
import json
import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import gymnasium

from flexarm_agents.board.terms import (
    RACE,
    SQUARE,
    TASKS,
    entry_options,
    home_of,
    interface_of,
    limits,
    nominal_options,
)
from flexarm_agents.code_version import code_version, file_hash
from flexarm_agents.environments import INTERFACE, check_id, make_one, settings_of, spec_of
from flexarm_agents.evaluation.candidates import WITHOUT, Candidate, imported, loaded_model, made_for
from flexarm_agents.policies.load import check_fits, load_policy, policy_file, shipped_policies
from flexarm_agents.policies.network import NetworkPolicy
from flexarm_baselines.controller import TorqueController
from flexarm_baselines.policy import GainPolicy
from flexarm_baselines.registry import CONTROLLERS, controller_names
from flexarm_env.validation import known_names, mapping

_FIT = r"\w.+:=,()/ -"  # characters of a name
NAME = re.compile(f"[{_FIT}]{{1,60}}")
# Code that runs every entry alike. It is no entry's content: what changes its bits raises `terms.BOARD`.
SHARED = ("flexarm_env", "flexarm_agents.environments", "flexarm_agents.policies.network")
_BATCHED = (TorqueController, GainPolicy, NetworkPolicy)


@dataclass(frozen=True)
class Entry:
    """A policy of the board as plain values, from which any machine makes the same policy."""

    # Name of a controller (`flexarm_baselines.registry`) or of a shipped policy; a training's folder or npz file;
    # "module:attribute"; or a stable-baselines3 model's zip file, with `algorithm`
    source: str
    name: str = ""  # shown in tables; "": the source, of a file or folder its name
    # Id of the environment that observation and action are those of; an agent of this package knows its own
    environment: str = SQUARE
    # Options of that environment which an entry may choose (`environments.INTERFACE`)
    options: Mapping[str, Any] = field(default_factory=dict)
    algorithm: str | None = None  # class of the model, see `flexarm_agents.evaluation.candidates.loaded_model`
    vec_normalize: str = ""  # file of its statistics, see there
    # Whether a law whose action is a gain has the limits of all others: of torque, error and deflection
    limited: bool = False

    def __post_init__(self) -> None:
        path = Path(self.source)
        if path.is_dir() and self.source:
            own = os.path.basename(os.path.abspath(path))
        else:
            own = path.stem if path.is_file() else self.source
        object.__setattr__(self, "name", self.name or re.sub(f"[^{_FIT}]", "_", own)[-60:])
        object.__setattr__(self, "environment", check_id(self.environment))
        object.__setattr__(self, "options", interface_of(self.options, strict=True))
        if not NAME.fullmatch(self.name):
            raise ValueError(f"name = {self.name!r}: must match {NAME.pattern}")

    def __hash__(self) -> int:
        return hash(json.dumps(self.plain(), sort_keys=True))

    def plain(self) -> dict[str, Any]:
        """Return plain values, of which `Entry(**values)` makes the entry again."""
        return asdict(self)

    @property
    def interface(self) -> dict[str, Any]:
        """The entry's own options of its environments."""
        return {**_recipe(self).interface, **(limits() if self.limited else {})}

    @property
    def home(self) -> str:
        """Name of the task that it is made for (`terms.TASKS`)."""
        return home_of(_recipe(self).environment)

    def candidate(self, task: str = "", fresh: bool = False) -> Candidate:
        """Return the policy with its nominal environment on a task.

        Args:
            task: a name in `terms.TASKS`; "": the entry's home.
            fresh: make both anew, also where they were made before.

        Raises:
            ValueError: if the policy cannot do the task.
        """
        return (_candidate.__wrapped__ if fresh else _candidate)(self, task or self.home)

    def on(self, environment: str, options: Mapping[str, Any]) -> Candidate:
        """Return the policy with any environment that fits it, both made anew."""
        recipe = _recipe(self)
        whole = {**entry_options(self.interface), **options}
        env = make_one(environment, whole)
        return Candidate(self.source, recipe.make(env), env, environment, whole, recipe.config, dict(options))

    @property
    def batched(self) -> bool:
        """Whether one call may choose the actions of several episodes, with all memory in `state`."""
        policy = self.candidate().policy
        return bool(getattr(policy, "batched", self.algorithm is not None or isinstance(policy, _BATCHED)))

    @property
    def independent(self) -> bool:
        """Whether an episode's actions have the same bits whatever other episodes share a call of the policy.

        This holds for controllers; a network's product may be rounded differently for another number of rows.
        """
        return self.source in CONTROLLERS

    @property
    def fingerprint(self) -> dict[str, str]:
        """The hashes of the policy's data and of the code that it runs."""
        return self._hashes()

    @property
    def content(self) -> str:
        """Hash of its data and its own code, from which the seeds of its episodes follow."""
        return hashlib.sha256(json.dumps(self._hashes(SHARED), sort_keys=True).encode()).hexdigest()

    def _hashes(self, without: Sequence[str] = ()) -> dict[str, str]:
        policy, recipe = self.candidate().policy, _recipe(self)
        files = " ".join(map(file_hash, [*recipe.files, *map(Path, getattr(policy, "files", ()))]))
        return {**recipe.label, "files": files, "code": code_version([*recipe.modules, *_modules(policy)], without)}


@dataclass(frozen=True)
class Recipe:
    """How an entry's policy is made."""

    environment: str  # id of the environment that it is made for
    interface: dict[str, Any]  # options of its environments that are its own
    make: Callable[[gymnasium.Env[Any, Any]], Any]  # makes the policy for an environment
    label: dict[str, str] = field(default_factory=dict)  # what identifies it beside its code and files
    files: tuple[Path, ...] = ()  # its data
    modules: tuple[str, ...] = ()  # names of modules beside that of its class
    config: dict[str, Any] | None = None  # configuration of its training; None for others


@lru_cache(maxsize=64)
def _candidate(entry: Entry, task: str) -> Candidate:
    recipe = _recipe(entry)
    options = nominal_options(entry.interface, task)
    environment = SQUARE if TASKS[task].hosted else TASKS[task].environment
    env = make_one(environment, options)
    if task != entry.home and (size := entry.candidate().env.action_space.shape) != env.action_space.shape:
        raise ValueError(f"entry {entry.name}: its actions have the shape {size}, not {env.action_space.shape}")
    if env.unwrapped.settings.mode.races != (environment == RACE):  # type: ignore[attr-defined]
        raise ValueError(f"entry {entry.name}: a race is run by entries of {RACE}, and these do nothing else")
    return Candidate(entry.name, recipe.make(env), env, environment, options)


def _modules(policy: Any) -> list[str]:
    """Return the module of a policy's class or function; nothing for a model of another library."""
    module = policy.__module__ if hasattr(policy, "__qualname__") else type(policy).__module__
    return [] if module.startswith(("stable_baselines3", "sb3_contrib")) else [module]


@lru_cache(maxsize=64)
def _recipe(entry: Entry) -> Recipe:
    if entry.source in CONTROLLERS:
        listed = CONTROLLERS[entry.source]
        label = {"controller": entry.source, "design": repr(dict(listed.design))}
        return Recipe(entry.environment, interface_of({**listed.options, **entry.options}), listed.make, label)
    declared = spec_of(entry.environment).kwargs
    if entry.algorithm is not None:
        own = interface_of({**declared, **entry.options})
        files = [entry.source] + [entry.vec_normalize] * (entry.vec_normalize not in ("", WITHOUT))
        load = partial(loaded_model, entry.source, entry.algorithm, vec_normalize=entry.vec_normalize)
        return Recipe(entry.environment, own, load, {"algorithm": entry.algorithm}, tuple(map(Path, files)))
    if ":" in entry.source and not Path(entry.source).exists():
        found = imported(entry.source)
        wanted = found.options() if hasattr(found, "options") else {}
        counted = {"last_actions": 1} if "observation" in wanted else {}  # else the id's own, which may have no effect
        own = interface_of({**declared, **counted, **wanted, **entry.options})
        make, label = partial(made_for, found=found, source=entry.source), {"attribute": entry.source}
        return Recipe(entry.environment, own, make, label, modules=(entry.source.partition(":")[0],))
    trained = load_policy(entry.source)
    settings = settings_of(trained.environment, trained.options)
    own = {name: getattr(settings, name) for name in INTERFACE} | interface_of(entry.options)

    def check(env: gymnasium.Env[Any, Any]) -> Any:
        check_fits(entry.source, (trained.policy.observation_size,), trained.policy.log_std.shape, env)
        return trained.policy

    file, config = policy_file(entry.source), trained.notes["config"]
    return Recipe(trained.environment, own, check, files=(file,), config=config)


# By default the law acts on the joints, which are not late; here it acts on the late sensor, as in the paper.
_LATE = {"feedback_source": "sensor", "sensor": "rigid"}
LATE = (
    Entry("ifdc", "ifdc_late", options=_LATE),
    Entry("ifdc", "ifdc_late_rates", options={**_LATE, "delayed": "position+rate"}),
)
FILTERED = (Entry("flexarm_agents.policies.safety_filter:SafetyFilter", "safety_filter"),)
# Variants of another entry, left out since they take long; `--add NAME` measures one.
LEFT_OUT = ("nmpc_path", "nmpc_adaptive_stamped")
LIMITED = tuple(Entry(name, f"{name}_limited", limited=True) for name in ("ifdc", "flsac"))


def all_entries(added: Sequence[str]) -> list[Entry]:
    """Return all entries, each with a name of its own.

    Args:
        added: further ones: sources (`Entry.source`), or JSON files with the fields of an `Entry`.

    Raises:
        ValueError: if two have the same name, or a file is no entry.
    """
    own = [name for name in controller_names() if name not in LEFT_OUT]
    entries = [*(Entry(name, environment=CONTROLLERS[name].environment) for name in own), *LATE, *LIMITED, *FILTERED]
    entries += [Entry(name, f"agent {name}") for name in shipped_policies() if not load_policy(name).has_own_arm]
    entries += [_added(source) for source in added]
    names = [entry.name for entry in entries]
    for name in names:
        if names.count(name) > 1:
            raise ValueError(f"entries: two have the name {name!r}; give one another name in its JSON file")
    return entries


def _added(source: str) -> Entry:
    if not source.endswith(".json"):
        return Entry(source)
    try:
        values = mapping(source, json.loads(Path(source).read_text(encoding="utf-8")))
        known_names(source, values, [one.name for one in fields(Entry)])
        return Entry(**values)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{source}: no entry ({error})") from error
