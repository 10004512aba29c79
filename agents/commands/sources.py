"""POLICY on the command line: a training, a controller, a class or function of a module, or somebody's model."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from threading import Timer

from flexarm_agents.commands.arguments import add_options
from flexarm_agents.contenders import (
    ENVIRONMENT,
    Contender,
    changed,
    from_attribute,
    from_controller,
    from_model,
    from_training,
)
from flexarm_agents.load import shipped_policies
from flexarm_baselines.registry import controller_names
from flexarm_env.parameters import PRESETS
from flexarm_env.validation import shown

PATIENCE = 1.0  # before a line says what takes so long [s]

POLICY = """\
folder of a training, or its npz file; name of a shipped policy or of a controller, as `flexarm list` has them;
module:attribute, a class with for_env(env) or without arguments, an object with predict, or a function from an
observation to an action"""
MODELS = """\
stable-baselines3 models (*.zip), of this class: PPO, SAC, or module:Class as in sb3_contrib:TQC. Reading such a
file unpickles it, which can execute code: only files that you trust"""


def add_environment(parser: argparse.ArgumentParser) -> None:
    """Add arguments that say where policies run: `--options`, `--arm`, `--environment`, `--stable-baselines3`."""
    add_options(parser, "options of the environments, for all")
    parser.add_argument("--arm", choices=tuple(PRESETS), help="arm of all environments; without it, as each was made")
    parser.add_argument(
        "--environment",
        metavar="ID",
        help=f"of controllers, module:attribute and stable-baselines3 models; {ENVIRONMENT}",
    )
    parser.add_argument("--stable-baselines3", metavar="CLASS", help=MODELS)


def check_environment(parser: argparse.ArgumentParser, given: argparse.Namespace, sources: Sequence[str]) -> None:
    """End with wrong usage if an argument of `add_environment` is for none of the policies.

    Args:
        parser: reports it.
        given: has the arguments.
        sources: each one's POLICY.
    """
    if given.stable_baselines3 is not None and not any(map(_is_model, sources)):
        parser.error("--stable-baselines3: there is no zip file among the policies")
    if given.environment is not None and all(map(_is_training, sources)):
        parser.error("--environment: is for controllers, module:attribute and zip files; trainings have their own")


def _is_model(source: str) -> bool:
    """Return whether POLICY is a model of stable-baselines3."""
    return source.endswith(".zip") and Path(source).is_file()


def _is_training(source: str) -> bool:
    """Return whether POLICY is a training, which has its own environment."""
    return not (_is_model(source) or _is_attribute(source) or source in controller_names())


def from_source(source: str, given: argparse.Namespace) -> Contender:
    """Make what POLICY names, with its environment.

    Args:
        source: POLICY.
        given: has the arguments of `add_environment`.

    Raises:
        FileNotFoundError, ImportError, TypeError, ValueError: see `flexarm_agents.contenders`.
    """
    if _is_training(source):
        if not Path(source).exists() and source not in shipped_policies():
            names = f"shipped policies are {', '.join(shipped_policies())}; controllers {', '.join(controller_names())}"
            raise FileNotFoundError(f"policy {shown(source)}: neither a file or folder nor a known name; {names}")
        return from_training(source, given.options, given.arm)
    environment = given.environment or ENVIRONMENT
    options = changed({}, given.options, given.arm)
    if source in controller_names():
        with _said_if_long(f"{source}: the controller is designed"):
            return from_controller(source, environment, options)
    if _is_attribute(source):
        return from_attribute(source, environment, options)
    if given.stable_baselines3 is None:
        raise ValueError(f"{source}: needs --stable-baselines3 CLASS, since reading it can execute code")
    return from_model(source, given.stable_baselines3, environment, options)


def _is_attribute(source: str) -> bool:
    return ":" in source and not Path(source).exists()


@contextmanager
def _said_if_long(what: str) -> Iterator[None]:
    """Say on stderr what goes on, once it takes longer than a second."""
    timer = Timer(PATIENCE, print, (what,), {"file": sys.stderr, "flush": True})
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
