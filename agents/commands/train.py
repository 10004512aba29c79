"""`flexarm train`: PPO on an environment; logs, evaluations, the best policy and checkpoints in one folder."""

from __future__ import annotations

import json
import logging
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import tyro

from flexarm_agents import StandardScore, TrainingConfig, TrainingStopped, train
from flexarm_agents.commands.arguments import epilog, json_object


@dataclass
class Options:
    """Train an agent with PPO."""

    config: tyro.conf.OmitArgPrefixes[TrainingConfig] = field(default_factory=TrainingConfig)
    """What is trained and how."""
    folder: Path | None = None
    """Folder for the results; default runs/NAME-SEED."""
    resume: bool = False
    """Go on with the interrupted training in the folder; it must be one of the same configuration."""
    progress: bool = True
    """Show a bar where there is a terminal; without a bar, print a line for each evaluation."""


def run(arguments: Sequence[str]) -> None:
    """Train, and print what came out."""
    registry = tyro.constructors.ConstructorRegistry()
    _read_mappings_as_json(registry)
    options = tyro.cli(
        Options,
        prog="flexarm train",
        description=f"{Options.__doc__}\n\n{epilog('train')}",
        args=list(arguments),
        registry=registry,
    )
    folder = options.folder or options.config.folder
    try:
        with _told(logging.getLogger("flexarm_agents")):
            outcome = train(options.config, folder, options.resume, options.progress)
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
