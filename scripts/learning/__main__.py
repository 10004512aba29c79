"""Compare what learning gives: agents trained with several seeds each, beside classical laws and limits.

Finished trainings are taken over, interrupted ones go on. What was measured of each stays as data beside the page
(`scripts.learning.records`), and tables have that of trainings that are not there. Each study is a module of this
folder with a `STUDY`, and a line in `STUDIES`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import tyro
from tqdm import tqdm

from flexarm_agents.files import put
from flexarm_agents.jobs.executors import executor
from flexarm_agents.jobs.failures import check_failures
from flexarm_agents.training.run_folder import RunFolder
from flexarm_env.validation import choice, integer
from scripts.common.command_line import run
from scripts.common.curves import FOLDER
from scripts.common.markdown import fill_pages
from scripts.common.trainings import Job, trained_all
from scripts.learning import delays, exploration, gradients, modes, off_policy, records, schedulers, spillover
from scripts.learning.study import Records, Study, jobs_of

STUDIES: dict[str, Study] = {
    "schedulers": schedulers.STUDY,
    "modes": modes.STUDY,
    "delays": delays.STUDY,
    "exploration": exploration.STUDY,
    "gradients": gradients.STUDY,
    "off_policy": off_policy.STUDY,
    "spillover": spillover.STUDY,
}


@dataclass
class Options:
    """Compare what learning gives."""

    only: tuple[str, ...] = tuple(STUDIES)
    """Names of studies."""
    seeds: int | None = None
    """How many trainings of each agent, with the seeds from 0 on; without, as many as the study has."""
    jobs: int = 1
    """How many trainings run at once, on one core each."""
    output: Path = Path("results/learning")
    """Folder for the trainings and the tables."""
    train: bool = True
    """Train; without it, tables have the trainings that are finished, and what is known of others."""
    missing: bool = False
    """Train only those of which nothing is known."""
    tables: bool = True
    """Write the tables; without it, only train."""
    docs: bool = False
    """Bring the pages of docs/ that show the tables up to date."""


def study_tables(name: str, options: Options) -> None:
    """Train the agents of a study, and write its tables.

    Raises:
        OSError: if trainings failed; what the others made is kept.
        ValueError: if there is nothing of an agent that the study cannot do without.
    """
    study, folder, data = STUDIES[name], options.output / name, FOLDER / f"{name}.json"
    known = records.read(study, data)
    jobs = jobs_of(study, study.seeds if options.seeds is None else options.seeds, folder)
    if not options.train:
        jobs = [job for job in jobs if RunFolder(job[1]).last.is_file()]
    elif options.missing:
        jobs = missing(jobs, known)
    with tqdm(total=len(jobs), unit="training", desc=name) as bar:
        found, failed = trained_all(jobs, executor("processes", options.jobs, options.output), bar.update)
    check_failures(failed, folder, "the other trainings are kept")
    if not options.tables:
        return
    agents = records.renewed(study, found, folder, known)
    check_complete(study, agents)
    options.output.mkdir(parents=True, exist_ok=True)
    for table, text in study.tables(agents, folder).items():
        put(options.output / f"{table}.md", lambda path, text=text: path.write_text(text))  # type: ignore[misc]
        print(f"\n{study.text}:\n\n{text}")
    if options.docs:
        records.write(agents, data)
        if study.picture:
            put(FOLDER / study.picture, lambda path: path.write_bytes((folder / study.picture).read_bytes()))


def missing(jobs: Sequence[Job], known: Records) -> list[Job]:
    """Return the trainings of which there are no records.

    Args:
        jobs: of one study.
        known: its records.
    """
    seeds = {name: {one.seed for one in agent.trainings} for name, agent in known.items()}
    return [(config, folder) for config, folder in jobs if config.seed not in seeds.get(folder.parent.name, ())]


def check_complete(study: Study, agents: Records) -> None:
    """Refuse to write tables without an agent that they need.

    Args:
        study: the comparison.
        agents: what is known.

    Raises:
        ValueError: naming what lacks.
    """
    lacking = [name for name in study.agents if name not in agents]
    if lacking and (not study.partial or not agents):
        raise ValueError(f"train = False: no training of {', '.join(lacking)} is finished; train first")


def main() -> None:
    """Command line.

    Raises:
        ValueError: for an unknown study, a bad number, or the page without tables.
    """
    options = tyro.cli(Options, prog="python -m scripts.learning")
    integer("jobs", options.jobs, 1)
    if options.seeds is not None:
        integer("seeds", options.seeds, 1)
    if not options.tables and (options.docs or not options.train):
        raise ValueError("tables = False: must go with train, and without docs, which shows the tables")
    if options.missing and not options.train:
        raise ValueError("missing = True: says what is trained, and must go with train")
    for name in options.only:
        choice("only", name, tuple(STUDIES))
    for name in options.only:
        study_tables(name, options)
    if options.docs:
        names = [table for name in options.only for table in STUDIES[name].names]
        for page in fill_pages(options.output, names):
            print(f"{page}: tables up to date")


if __name__ == "__main__":
    run(main)
