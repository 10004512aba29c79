"""`flexarm descend`: learning by derivatives of the simulation, with what `flexarm train` leaves in its folder."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import tyro

from flexarm_agents import DescentConfig, descend
from flexarm_agents.commands.training_verb import RunOptions, carry_out, options_of


@dataclass
class Options(RunOptions):
    """Train an agent by first-order gradients, which run back through arm and sensor (short-horizon actor-critic)."""

    config: tyro.conf.OmitArgPrefixes[DescentConfig] = field(default_factory=DescentConfig)
    """What is trained and how."""


def run(arguments: Sequence[str]) -> None:
    """Train, and print what came out."""
    given = options_of(Options, "descend", arguments)
    folder = given.folder or given.config.folder
    carry_out(lambda: descend(given.config, folder, given.resume, given.progress), folder)
