"""What the verbs that train have in common: their options, their lines, how they stop."""

from __future__ import annotations

import argparse
import json
import logging
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from inspect import cleandoc
from pathlib import Path
from typing import Any, TypeVar

import tyro

from flexarm_agents import StandardScore, TrainingConfig, TrainingStopped
from flexarm_agents.commands.arguments import epilog, json_object
from flexarm_agents.training.train import Outcome


@dataclass
class RunOptions:
    """Options of every verb that trains."""

    folder: Path | None = None
    """Folder for the results; default runs/NAME-SEED."""
    resume: bool = False
    """Go on with the interrupted training in the folder; it must be one of the same configuration."""
    progress: bool = True
    """Show a bar where there is a terminal; without a bar, print a line for each evaluation."""


Given = TypeVar("Given", bound=RunOptions)


def tuned_for(arguments: Sequence[str]) -> TrainingConfig:
    """Return the tuned configuration of the algorithm and the environment that arguments name.

    Args:
        arguments: others count for nothing.

    Raises:
        ValueError: if there is no such algorithm or environment.
    """
    parser = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    for name in ("algorithm", "environment"):
        parser.add_argument(f"--{name}", default=getattr(TrainingConfig, name))
    given, _ = parser.parse_known_args(list(arguments))
    return TrainingConfig(algorithm=given.algorithm, environment=given.environment)


def options_of(kind: type[Given], verb: str, arguments: Sequence[str], default: Given | None = None) -> Given:
    """Read a verb's arguments; mappings are JSON.

    Args:
        kind: class of the options.
        verb: e.g. "train"; its examples end the help.
        arguments: without the verb.
        default: options without arguments; None: those of the class.
    """
    registry = tyro.constructors.ConstructorRegistry()
    _read_mappings_as_json(registry)
    return tyro.cli(
        kind,
        prog=f"flexarm {verb}",
        description=f"{cleandoc(kind.__doc__ or '')}\n\n{epilog(verb)}",
        args=list(arguments),
        default=kind() if default is None else default,
        registry=registry,
    )


def carry_out(training: Callable[[], Outcome], folder: Path) -> None:
    """Train, and print what came out; ends the process with 128 + its number after a signal.

    Args:
        training: trains.
        folder: of the results.
    """
    try:
        with _told(logging.getLogger("flexarm_agents")):
            outcome = training()
    except TrainingStopped as stopped:
        done = f"all {stopped.steps} steps are kept in {folder}" if stopped.steps else f"{folder}: no step was done yet"
        print(f"stopped; {done}; the same command with --resume goes on", file=sys.stderr)
        sys.exit(128 + stopped.signal)
    for name, row in (("best", outcome.best), ("last", outcome.last)):
        print(f"{name}: {StandardScore.of(row)}, at {row['steps']} steps")
    print(f"{outcome.folder}: complete after {outcome.last['seconds']:.0f} s, compiling included")


@contextmanager
def _told(logger: logging.Logger) -> Iterator[None]:
    """Have what is logged printed, each line at once."""
    handler = logging.StreamHandler(sys.stdout)
    level = logger.level
    logger.addHandler(handler)
    logger.setLevel(logging.INFO)
    try:
        yield
    finally:
        logger.removeHandler(handler)
        logger.setLevel(level)


def _read_mappings_as_json(registry: tyro.constructors.ConstructorRegistry) -> None:
    """Have mappings given as JSON: --options '{"noise": 0.01}'."""

    @registry.primitive_rule
    def rule(info: tyro.constructors.PrimitiveTypeInfo) -> tyro.constructors.PrimitiveConstructorSpec[Any] | None:
        """How a mapping is read from one argument and shown; None for other types."""
        if info.type_origin is not dict:
            return None
        return tyro.constructors.PrimitiveConstructorSpec(
            nargs=1,
            metavar="JSON",
            instance_from_str=lambda arguments: json_object(arguments[0]),
            is_instance=lambda value: isinstance(value, dict),
            str_from_instance=lambda value: [json.dumps(value)],
        )
