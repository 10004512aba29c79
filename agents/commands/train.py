"""`flexarm train`: an agent by any algorithm; logs, evaluations, the best policy and checkpoints in one folder."""

import argparse
import logging
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from flexarm_agents import TrainingStopped, config_of, load_policy, train
from flexarm_agents.commands.arguments import Reader, of_verb
from flexarm_agents.commands.fields import add_fields, read_fields
from flexarm_agents.environments import settings_of
from flexarm_agents.evaluation.races import read_score
from flexarm_agents.training.config import ALGORITHMS, RunConfig, config_class

DESCRIPTION = """\
Train an agent: by reward with PPO, RecurrentPPO, SAC or TQC, by a teacher that follows the best known plans with DAgger
(dagger), or by first-order policy gradients, which run back through arm and sensor (fopg). The help shows the options
of one algorithm: `flexarm train --algorithm sac --help`."""


def run(arguments: Sequence[str]) -> None:
    """Train, and print what came out."""
    named = _named(arguments)
    reader = parser(named.algorithm, named.environment)
    given = reader.parse_args(arguments)
    config = read_fields(reader, config_class(given.algorithm), given)
    _train(config, given.folder or config.folder, given)


def parser(algorithm: str = "ppo", environment: str = RunConfig.environment) -> Reader:
    """Return the parser of the arguments; their defaults are tuned for the algorithm and the environment."""
    switch = argparse.BooleanOptionalAction
    reader = of_verb("train", DESCRIPTION)
    reader.usage = "flexarm train [OPTIONS]"  # there are many
    which = "PPO, RecurrentPPO, SAC, TQC, DAgger (dagger) or first-order policy gradients (fopg); ppo"
    reader.add_argument("--algorithm", choices=tuple(ALGORITHMS), default="ppo", help=which)
    reader.add_argument("--folder", type=Path, metavar="PATH", help="folder for the results; runs/NAME-ALGORITHM-SEED")
    resume = "continue the interrupted training in the folder; it must have the same configuration"
    reader.add_argument("--resume", action=switch, default=False, help=resume)
    progress = "show a bar where there is a terminal; without a bar, print a line for each evaluation"
    reader.add_argument("--progress", action=switch, default=True, help=progress)
    add_fields(reader, config_of(algorithm, environment=environment))
    return reader


def tuned_for(arguments: Sequence[str]) -> RunConfig:
    """Return the tuned configuration of the algorithm and the environment that arguments name."""
    config: RunConfig = config_of(**vars(_named(arguments)))
    return config


def _named(arguments: Sequence[str]) -> argparse.Namespace:
    """Return the algorithm and the environment that arguments name, which decide the other defaults."""
    first = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    for name, usual in (("algorithm", "ppo"), ("environment", RunConfig.environment)):
        first.add_argument(f"--{name}", default=usual)
    return first.parse_known_args(list(arguments))[0]


def _train(config: RunConfig, folder: Path, given: argparse.Namespace) -> None:
    """Train, and print what came out; ends the process with 128 + its number after a signal."""
    try:
        with _printed(logging.getLogger("flexarm_agents")):
            outcome = train(config, folder, given.resume, given.progress)
    except TrainingStopped as stopped:
        done = f"all {stopped.steps} steps are kept in {folder}" if stopped.steps else f"{folder}: no step was done yet"
        print(f"stopped; {done}; the same command with --resume goes on", file=sys.stderr)
        sys.exit(128 + stopped.signal)
    trained = load_policy(outcome.folder)
    races = settings_of(trained.environment, trained.options).mode.races
    for name, row in (("best", outcome.best), ("last", outcome.last)):
        print(f"{name}: {read_score(row, races)}, at {row['steps']} steps")
    print(f"{outcome.folder}: complete after {outcome.last['seconds']:.0f} s, compiling included")
    if pictures := sorted(map(str, outcome.folder.glob("*.png"))):
        print(f"pictures: {', '.join(pictures)}")
    lap = " --lap own" if races else ""
    print(f"next: flexarm render {outcome.folder}{lap} --output lap.png")


@contextmanager
def _printed(logger: logging.Logger) -> Iterator[None]:
    handler = logging.StreamHandler(sys.stdout)
    level = logger.level
    logger.addHandler(handler)
    logger.setLevel(logging.INFO)
    try:
        yield
    finally:
        logger.removeHandler(handler)
        logger.setLevel(level)
