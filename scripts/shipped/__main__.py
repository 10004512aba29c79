"""Train the shipped agent anew with several seeds, ship the median one, and write its card and tables.

Interrupted trainings go on when the command is given again, and finished ones are taken over.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import tyro

from flexarm_agents import StandardScore, TrainingConfig, load_policy
from flexarm_agents.load import POLICIES
from flexarm_env.validation import integer
from scripts.common.command_line import run
from scripts.common.markdown import DOCS, filled
from scripts.shipped import tables
from scripts.shipped.trainings import export, trained_all

NAME = "square"
PAGES = (DOCS.parent / "README.md", DOCS / "agents.md")
COMMAND = "python -m scripts.shipped"


@dataclass
class Options:
    """Train the shipped agent anew with several seeds, ship the median one, and write its card and tables."""

    seeds: int = 5
    """How many trainings, with the seeds from 0 on; an odd number."""
    jobs: int = 1
    """How many trainings run at once, on one core each."""
    output: Path = Path("results/shipped")
    """Folder for the trainings and the tables."""
    train: bool = True
    """Train and ship; without it, only the tables of the shipped agent are made anew."""


def train_and_ship(seeds: int, jobs: int, output: Path) -> None:
    """Train, choose and export.

    Args:
        seeds: how many trainings, an odd number.
        jobs: how many at once.
        output: holds their folders.
    """
    if integer("seeds", seeds, 1) % 2 == 0:
        raise ValueError(f"seeds = {seeds}: must be odd, so that one training is in the middle")
    found = trained_all([TrainingConfig(seed=seed) for seed in range(seeds)], output, integer("jobs", jobs, 1))
    for one in found:
        print(f"seed {one.config.seed}: {StandardScore.of(one.best)}")
    export(found, POLICIES, NAME, COMMAND)
    print(f"{POLICIES / NAME}.npz, .json: seed {load_policy(NAME).notes['config']['seed']}")


def write_tables(output: Path) -> None:
    """Write the tables, and bring README and docs/agents.md up to date.

    Args:
        output: folder for the tables.
    """
    output.mkdir(parents=True, exist_ok=True)
    agent = load_policy(NAME)
    card = json.loads((POLICIES / f"{NAME}.json").read_text())
    texts = {
        "agent_scores": tables.scores(agent),
        "agent_seeds": tables.seeds(card),
        "agent_conditions": tables.conditions(agent),
    }
    for name, text in texts.items():
        (output / f"{name}.md").write_text(text)
    for page in PAGES:
        page.write_text(filled(page.read_text(), output))
        print(f"{page}: tables up to date")


def main() -> None:
    """Command line."""
    options = tyro.cli(Options, prog=COMMAND)
    if options.train:
        train_and_ship(options.seeds, options.jobs, options.output)
    write_tables(options.output)


if __name__ == "__main__":
    run(main)
