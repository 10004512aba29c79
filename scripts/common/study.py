"""A study: results, the tables and pictures that show them, and the one command behind all studies."""

import json
import shutil
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from operator import call
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
from tqdm import tqdm

from flexarm_agents.code_version import WITH_POLICIES, code_version
from flexarm_agents.files import write_text
from flexarm_agents.jobs.executors import Processes
from flexarm_env.validation import choice, integer
from scripts.common.command_line import read_options
from scripts.common.markdown import DOCS, fill_pages, kept_tables
from scripts.common.plotting import save, write
from scripts.common.result_files import plain, write_json

Trial = Callable[[], Any]  # a worker can run it; returns mappings, lists, arrays and numbers


@dataclass(frozen=True)
class Study:
    """A comparison."""

    text: str  # what it shows, in one line
    # Returns what the tables and pictures show; its arguments are the study's folder, which may keep results, and the
    # number of processes
    results: Callable[[Path, int], Any]
    tables: Mapping[str, Callable[[Any], str]]  # write Markdown, by the names of the blocks in docs/ that show them
    # Draw, by the names of the files in docs/figures/
    pictures: Mapping[str, Callable[[Any], Figure]] = field(default_factory=dict)
    svg: bool = False  # write the pictures as SVG, too, for print

    def show(self, results: Any, folder: Path) -> None:
        """Write the tables and pictures into a folder, and print the tables."""
        for name, tabulate in self.tables.items():
            text = tabulate(results)
            write_text(folder / f"{name}.md", text)
            print(f"\n{self.text}:\n\n{text}")
        for name, draw in self.pictures.items():
            figure, path = draw(results), folder / "figures" / f"{name}.png"
            path.parent.mkdir(parents=True, exist_ok=True)
            if self.svg:
                save(figure, path.parent, path.stem)
            else:
                write(figure, path)


@dataclass(frozen=True)
class Trials:
    """A study's `results` from trials, by their labels: each is run once, and kept while the code is the same."""

    module: str  # name of the module that declares the trials
    trials: Callable[[], Mapping[str, Trial]]  # returns them

    def __call__(self, folder: Path, jobs: int) -> dict[str, Any]:
        """Return the results of all trials, by label; run those that the folder has not."""
        path, code = folder / "results.json", code_version([self.module], data=WITH_POLICIES)
        kept = json.loads(path.read_text()) if path.is_file() else {}
        found = kept["results"] if kept.get("code") == code else {}
        trials = self.trials()
        waiting = {label: trial for label, trial in trials.items() if label not in found}
        for label, result in run_all(waiting, jobs, folder.name):
            found[label] = plain(result)
            write_json(path, {"code": code, "results": found}, levels=3)
        return {label: found[label] for label in trials}


def run_all(trials: Mapping[str, Trial], jobs: int, text: str) -> Iterator[tuple[str, Any]]:
    """Run trials in so many processes (1: this one), and yield each with its label as soon as it is done."""
    labels, calls = list(trials), list(trials.values())
    with tqdm(total=len(trials), unit="job", desc=text) as bar:
        here = jobs == 1 or len(trials) < 2
        for n, result in enumerate(map(call, calls)) if here else Processes(jobs).run(call, calls):
            if isinstance(result, BaseException):
                raise result
            bar.set_postfix_str(labels[n])
            bar.update()
            yield labels[n], result


def study(
    module: str,
    name: str,
    text: str,
    trials: Callable[[], Mapping[str, Trial]],
    tabulate: Callable[[Any], str],
    draw: Callable[[Any], Figure] | None = None,
) -> dict[str, Study]:
    """Return a study of one table, and one picture of the same name, by its name; `module` declares its trials."""
    return {name: Study(text, Trials(module, trials), {name: tabulate}, {} if draw is None else {name: draw})}


@dataclass
class Options:
    """What each command of studies takes."""

    output: Path
    """Folder for results, tables and pictures; those that are not made again stay."""
    only: tuple[str, ...]
    """Names of studies."""
    jobs: int = 1
    """Processes."""
    docs: bool = False
    """Bring the tables and pictures of docs/ up to date."""


def command(name: str, studies: Mapping[str, Study], text: str) -> None:
    """Read the command line of `python -m scripts.NAME`, and make the studies."""
    options = read_options(f"python -m scripts.{name}", Options(Path("results") / name, tuple(studies)), text)
    integer("jobs", options.jobs, 1)
    chosen = {one: studies[choice("only", one, tuple(studies))] for one in options.only}
    for one, study in chosen.items():
        folder = options.output / one
        folder.mkdir(parents=True, exist_ok=True)
        study.show(study.results(folder, options.jobs), options.output)
    if options.docs:
        update_docs(chosen.values(), options.output)


def update_docs(studies: Any, output: Path) -> None:
    """Fill the blocks of docs/ with the tables that studies have in a folder, and copy their pictures."""
    tables = kept_tables(output)
    for page in fill_pages({name: tables[name] for study in studies for name in study.tables}):
        print(f"{page}: tables up to date")
    for picture in (picture for study in studies for picture in study.pictures):
        file = DOCS / "figures" / f"{picture}.png"
        file.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(output / "figures" / f"{picture}.png", file)
        print(f"{file}: up to date")
