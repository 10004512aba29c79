"""POLICY on the command line: a training, a controller, a class or function, a stable-baselines3 model."""

import argparse
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from threading import Timer

from flexarm_agents.board.entries import Entry
from flexarm_agents.board.terms import interface_of
from flexarm_agents.commands.arguments import add_options
from flexarm_agents.environments import check_id
from flexarm_agents.evaluation.candidates import (
    ENVIRONMENT,
    WITHOUT,
    Candidate,
    Options,
    changed,
    from_training,
    plant_of,
)
from flexarm_agents.policies.load import load_policy, shipped_policies
from flexarm_baselines.registry import controller, controller_names
from flexarm_env.parameters import PRESETS
from flexarm_env.validation import shown

PATIENCE = 1.0  # before a line names what takes so long [s]

POLICY = """\
folder of a training, or its npz file; name of a shipped policy or of a controller, as `flexarm list` has them;
module:attribute, a class with for_env(env) or without arguments, an object with predict, or a function from an
observation to an action"""
MODELS = """\
stable-baselines3 models (*.zip), of this class: PPO, SAC, or module:Class as in sb3_contrib:TQC. Reading such a
file unpickles it, which can execute code: only files that you trust"""
STATISTICS = f"""\
file by which VecNormalize scaled what these models observe; unpickled, too. {WITHOUT}: they were trained without one"""


def add_environment(parser: argparse.ArgumentParser, where: str) -> None:
    """Add arguments that say where policies run, and how models are read."""
    add_options(parser, "options of the environments, for all")
    parser.add_argument("--arm", choices=tuple(PRESETS), help="arm of all environments; without it, their own")
    environment = f"environment in which all policies run; without it, {where}; controllers of races race"
    parser.add_argument("--environment", metavar="ID", help=environment)
    parser.add_argument("--stable-baselines3", metavar="CLASS", help=MODELS)
    parser.add_argument("--vec-normalize", metavar="FILE", default="", help=STATISTICS)


def check_environment(parser: argparse.ArgumentParser, given: argparse.Namespace, sources: Sequence[str]) -> None:
    """End with wrong usage if an argument of `add_environment` is for none of the policies, or two contradict."""
    if given.arm is not None and "arm" in given.options:
        parser.error("--arm: cannot go with an arm among --options")
    for name in ("stable_baselines3", "vec_normalize"):
        if getattr(given, name) and not any(map(_is_model, sources)):
            parser.error(f"--{name.replace('_', '-')}: there is no zip file among the policies")


def _is_model(source: str) -> bool:
    return source.endswith(".zip") and Path(source).is_file()


def _is_training(source: str) -> bool:
    is_attribute = ":" in source and not Path(source).exists()
    return not (_is_model(source) or is_attribute or source in controller_names())


def from_source(source: str, given: argparse.Namespace, own: bool) -> Candidate:
    """Make the policy that POLICY names, with its environment; see `evaluation.candidates` and `Entry.on`.

    Args:
        source: POLICY.
        given: arguments of `add_environment`.
        own: run a training in the environment that it was trained in, unless another one is given.

    Raises:
        FileNotFoundError: if there is no such file, folder, shipped policy or controller.
    """
    if _is_training(source):
        if not Path(source).exists() and source not in shipped_policies():
            names = f"shipped policies are {', '.join(shipped_policies())}; controllers {', '.join(controller_names())}"
            raise FileNotFoundError(f"policy {shown(source)}: neither a file or folder nor a known name; {names}")
        trained = load_policy(source)
        if given.environment is None and (own or trained.has_own_arm or trained.has_own_task):
            return from_training(source, given.options, given.arm)
    entry = entry_of(source, given, interface_of(given.options))
    with _message_if_long(f"{source}: the policy is made"):
        return entry.on(check_id(entry.environment), changed({}, plant_of(given.options), given.arm))


def entry_of(source: str, given: argparse.Namespace, options: Options) -> Entry:
    """Return what POLICY names as an entry of the board; a model needs `--stable-baselines3`."""
    model = (given.stable_baselines3, given.vec_normalize) if _is_model(source) else ()
    if None in model:
        raise ValueError(f"{source}: needs --stable-baselines3 CLASS, since reading it can execute code")
    made_for = controller(source).environment if source in controller_names() else ENVIRONMENT
    return Entry(source, "", given.environment or made_for, options, *model)


@contextmanager
def _message_if_long(what: str) -> Iterator[None]:
    """Say on stderr what goes on, once it takes longer than a second."""
    timer = Timer(PATIENCE, print, (what,), {"file": sys.stderr, "flush": True})
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
