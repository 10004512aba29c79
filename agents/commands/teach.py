"""`flexarm teach`: DAgger, a student of late sensors taught by a teacher that knows plan, state and plant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import tyro

from flexarm_agents import TeachingConfig, teach
from flexarm_agents.commands.training_verb import RunOptions, carry_out, options_of


@dataclass
class Options(RunOptions):
    """Teach a student with DAgger."""

    config: tyro.conf.OmitArgPrefixes[TeachingConfig] = field(default_factory=TeachingConfig)
    """What is taught and how."""
    plans: Path | None = None
    """Folder for the teacher's plans, which several teachings can share; default: in the results' folder."""


def run(arguments: Sequence[str]) -> None:
    """Teach, and print what came out."""
    given = options_of(Options, "teach", arguments)
    folder = given.folder or given.config.folder
    carry_out(lambda: teach(given.config, folder, given.resume, given.progress, given.plans), folder)
