"""Train an agent with PPO: logs, evaluations by the true score, the best policy and checkpoints in one folder."""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import tyro

from flexarm_agents import TrainingConfig, train
from flexarm_agents.run_folder import RunFolder
from scripts.common.command_line import run


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
    """Show a bar where there is a terminal."""


def json_options(registry: tyro.constructors.ConstructorRegistry) -> None:
    """Have mappings given as JSON: --options '{"noise": 0.01}'."""

    @registry.primitive_rule
    def rule(info: tyro.constructors.PrimitiveTypeInfo) -> tyro.constructors.PrimitiveConstructorSpec[Any] | None:
        """How a mapping is read from one argument and shown; None for other types."""
        if info.type_origin is not dict:
            return None
        return tyro.constructors.PrimitiveConstructorSpec(
            nargs=1,
            metavar="JSON",
            instance_from_str=lambda arguments: read_mapping(arguments[0]),
            is_instance=lambda value: isinstance(value, dict),
            str_from_instance=lambda value: [json.dumps(value)],
        )


def read_mapping(text: str) -> dict[str, Any]:
    """A JSON object.

    Raises:
        ValueError: if the text is something else.
    """
    try:
        value = json.loads(text)
    except ValueError as error:
        raise ValueError(f"{text}: not JSON ({error})") from None
    if not isinstance(value, dict):
        raise ValueError(f"{text}: must be a JSON object")
    return value


def main() -> None:
    """Command line."""
    registry = tyro.constructors.ConstructorRegistry()
    json_options(registry)
    options = tyro.cli(Options, registry=registry)
    folder = options.folder or options.config.folder
    try:
        outcome = train(options.config, folder, options.resume, options.progress)
    except KeyboardInterrupt:
        kept = RunFolder(folder).checkpoint.exists()
        sys.exit(f"interrupted; {'go on with --resume' if kept else 'no checkpoint was written yet'}")
    for name, row in (("best", outcome.best), ("last", outcome.last)):
        end = "" if row["complete"] else f", ended early: {row['ended']} after {row['duration']:.2f} s"
        after = "-" if row["rms_after_2s"] is None else f"{row['rms_after_2s']:.4f}"
        print(f"{name}: r.m.s. {row['rms']:.4f} m, after 2 s {after} m, at {row['steps']} steps{end}")
    print(f"{outcome.folder}: complete after {outcome.last['seconds']:.0f} s")


if __name__ == "__main__":
    run(main)
