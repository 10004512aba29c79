"""Train the shipped agents anew with several seeds each, ship the median ones, and write their cards and tables.

When the command is given again, interrupted trainings are resumed and finished ones reused.
"""

from dataclasses import dataclass
from pathlib import Path

from tqdm import tqdm

from flexarm_agents import load_policy
from flexarm_agents.board.cells import Store
from flexarm_agents.jobs.executors import executor
from flexarm_agents.jobs.failures import check_failures
from flexarm_agents.policies.load import POLICIES
from flexarm_env.validation import choice, integer
from scripts.common.command_line import read_options, run
from scripts.common.study import Study, update_docs
from scripts.common.trainings import trained_all
from scripts.shipped import board
from scripts.shipped.agents import AGENTS
from scripts.shipped.board import measured
from scripts.shipped.curves import keep_curves
from scripts.shipped.trainings import export

COMMAND = "python -m scripts.shipped"
TABLES = {"nominal_plant": board.nominal, "unknown_plant": board.unknown, "own_tasks": board.own_tasks}
CARDS = Study("the shipped agents", lambda folder, jobs: board.cards(), TABLES)


@dataclass
class Options:
    """Train the shipped agents anew with several seeds each, ship the median ones, and write cards and tables."""

    only: tuple[str, ...] = ()
    """Names of agents; without, all are trained."""
    seeds: int | None = None
    """How many trainings of each, with the seeds from 0 on. Without, as many as are shipped."""
    jobs: int = 1
    """How many trainings run at once, on one core each."""
    output: Path = Path("results/shipped")
    """Folder for the trainings and the tables."""
    train: bool = True
    """Train and ship; without it, only the tables of the shipped agents are made anew."""
    tables: bool = True
    """Bring the pages of docs/ that show the tables up to date."""


def train_and_ship(name: str, options: Options) -> None:
    """Train, choose and export an agent; trainings are kept where others failed."""
    agent = AGENTS[name]
    seeds = agent.seeds if options.seeds is None else integer("seeds", options.seeds, 1)
    jobs = agent.jobs(options.output / name, seeds)
    with tqdm(total=seeds, unit="training", desc=name) as bar:
        found, failed = trained_all(jobs, executor("processes", options.jobs, options.output), bar.update)
    check_failures(failed, jobs[0][1].parent, "the other trainings are kept")
    for one in found:
        print(f"{name}, seed {one.config.seed}: {one.score}")
    if agent.drawn:
        keep_curves({name: found})
    cells = Store(options.output / "cells")
    own_arm = load_policy(found[0].folder).has_own_arm
    measurable = () if own_arm else tqdm(found, unit="training", desc="board")
    boards = [measured(one.folder, cells) for one in measurable]
    export(found, boards, POLICIES, name, f"{COMMAND} --only {name} --seeds {seeds}")
    print(f"{POLICIES / name}.npz, .json: seed {load_policy(name).notes['config']['seed']}")


def main() -> None:
    """Command line."""
    options = read_options(COMMAND, Options())
    if options.train:
        for name in [choice("only", name, AGENTS) for name in options.only] or AGENTS:
            train_and_ship(name, options)
    if options.tables:
        options.output.mkdir(parents=True, exist_ok=True)
        CARDS.show(CARDS.results(options.output, 1), options.output)
        update_docs([CARDS], options.output)


if __name__ == "__main__":
    run(main)
