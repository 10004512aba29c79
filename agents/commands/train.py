"""`flexarm train`: learning by reward; logs, evaluations, the best policy and checkpoints in one folder."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, make_dataclass
from typing import Annotated, Any, get_args, get_type_hints

import tyro

from flexarm_agents import TrainingConfig, train
from flexarm_agents.commands.training_verb import RunOptions, carry_out, options_of, tuned_for
from flexarm_agents.training.hyperparameters import SETTINGS, own_settings

# beside those of `SETTINGS`
ONLY_PPO = ["lags", "observer", "initial_policy", "value_steps", "value_learning_rate"]


@dataclass
class Options(RunOptions):
    """Train an agent by reward: PPO, RecurrentPPO, SAC or TQC, with tuned defaults.

    The help shows the options of one algorithm: `flexarm train --algorithm sac --help`.
    """

    config: tyro.conf.OmitArgPrefixes[TrainingConfig] = field(default_factory=TrainingConfig)
    """What is trained and how."""


def run(arguments: Sequence[str]) -> None:
    """Train, and print what came out."""
    tuned = tuned_for(arguments)
    if not {"-h", "--help"}.isdisjoint(arguments):
        options_of(_shown_for(tuned), "train", arguments)
    given = options_of(Options, "train", arguments, Options(config=tuned))
    folder = given.folder or given.config.folder
    carry_out(lambda: train(given.config, folder, given.resume, given.progress), folder)


def _shown_for(tuned: TrainingConfig) -> type[Options]:
    """Return the options as the help shows them: without those that have no effect with the algorithm.

    Args:
        tuned: configuration of the algorithm.
    """
    hints = get_type_hints(TrainingConfig)
    own = own_settings(tuned.algorithm)
    without_effect = [name for name in SETTINGS if name not in own]
    if tuned.algorithm != "ppo":
        without_effect += ONLY_PPO
    kinds: dict[str, Any] = {name: Annotated[hints[name], tyro.conf.Suppress] for name in without_effect}
    kinds |= {name: get_args(hints[name])[0] for name in own if type(None) in get_args(hints[name])}
    columns = [(name, kind, field(default=getattr(tuned, name))) for name, kind in kinds.items()]
    config: Any = make_dataclass("TrainingConfig", columns, bases=(TrainingConfig,), frozen=True, kw_only=True)
    given: Any = field(default_factory=lambda: config(algorithm=tuned.algorithm, environment=tuned.environment))
    whole = [("config", Annotated[config, tyro.conf.OmitArgPrefixes], given)]
    return make_dataclass("Options", whole, bases=(Options,), namespace={"__doc__": Options.__doc__})
