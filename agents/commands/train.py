"""`flexarm train`: learning by reward; logs, evaluations, the best policy and checkpoints in one folder."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import tyro

from flexarm_agents import TrainingConfig, train
from flexarm_agents.commands.training_verb import RunOptions, carry_out, options_of, tuned_for


@dataclass
class Options(RunOptions):
    """Train an agent by reward: PPO, RecurrentPPO, SAC or TQC; defaults are tuned, None is for another algorithm."""

    config: tyro.conf.OmitArgPrefixes[TrainingConfig] = field(default_factory=TrainingConfig)
    """What is trained and how."""


def run(arguments: Sequence[str]) -> None:
    """Train, and print what came out."""
    given = options_of(Options, "train", arguments, Options(config=tuned_for(arguments)))
    folder = given.folder or given.config.folder
    carry_out(lambda: train(given.config, folder, given.resume, given.progress), folder)
