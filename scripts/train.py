"""Train many agents, every setting of a file with every seed: `python -m scripts.train --seeds 0-9 --sweep FILE`.

A sweep is a JSON object of lists, {"learning_rate": [1e-3, 2e-3], "envs": [32, 64]}, whose combinations are trained.
Finished trainings are reused, interrupted ones are resumed.
"""

import hashlib
import json
import re
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from itertools import product
from pathlib import Path
from typing import Any

from tqdm import tqdm

from flexarm_agents import Spread
from flexarm_agents.commands.arguments import json_object
from flexarm_agents.commands.fields import add_fields, read_fields
from flexarm_agents.commands.train import tuned_for
from flexarm_agents.evaluation.scoring import rank
from flexarm_agents.files import write_text
from flexarm_agents.jobs.executors import executor
from flexarm_agents.jobs.failures import check_failures
from flexarm_agents.training.config import ALGORITHMS, RunConfig
from flexarm_env.validation import known_names, mapping, shown
from scripts.common.command_line import parser, run
from scripts.common.markdown import table
from scripts.common.result_files import write_json
from scripts.common.trainings import Job, Training, trained_all

Setting = dict[str, Any]


@dataclass
class Options:
    """Train every setting of a sweep with every seed."""

    seeds: str = "0"
    """Seeds: 0-9, or 0,3,5-7."""
    sweep: Path | None = None
    """JSON file with lists of values of the configuration; without it, only seeds differ."""
    output: Path = Path("results/trainings")
    """Folder for the trainings and what came out."""
    jobs: int = 1
    """Processes, or tasks of Slurm."""
    executor: str = "processes"
    """Where trainings run: processes, ray, slurm, or submitit-local."""
    submitit: str = "{}"
    """Parameters of submitit as a JSON object."""


def seeds_of(text: str) -> list[int]:
    """Return the seeds that a text names, "0-2,7" for example, in order."""
    found: set[int] = set()
    for part in text.split(","):
        range_of = re.fullmatch(r"([0-9]+)(?:-([0-9]+))?", part)
        first, last = (0, -1) if range_of is None else (int(range_of[1]), int(range_of[2] or range_of[1]))
        if last < first:
            raise ValueError(f"seeds = {shown(text)}: must be numbers and ranges, such as 0-9 or 0,3,5-7")
        found |= set(range(first, last + 1))
    return sorted(found)


def settings_of(sweep: object, config: RunConfig) -> list[Setting]:
    """Return all combinations of a sweep's values."""
    lists = mapping("sweep", sweep)
    known_names("sweep", lists, [one.name for one in fields(config) if one.name not in ("seed", "environment")])
    for name, values in lists.items():
        if not isinstance(values, list) or not values:
            raise ValueError(f"sweep[{name!r}] = {shown(values)}: must be a list with a value at least")
    return [dict(zip(lists, values, strict=True)) for values in product(*lists.values())]


def jobs_of(config: RunConfig, settings: Sequence[Setting], seeds: Sequence[int], output: Path) -> list[Job]:
    """Return a training for each setting and seed; the folder is named by the whole configuration but the seed."""
    every = [replace(config, **setting, seed=seed) for setting in settings for seed in seeds]
    return [(one, output / _key(one) / f"seed-{one.seed}") for one in every]


def summary(settings: Sequence[Setting], config: RunConfig, found: Sequence[Training]) -> list[dict[str, Any]]:
    """Return for each setting its trainings, and the spread of both laps' mean r.m.s. error, or of a race's time."""
    rows = []
    for setting in settings:
        key = _key(replace(config, **setting))
        own = [one for one in found if one.folder.parent.name == key]
        if own:
            spread = Spread.of(rank([one.score])[1] if one.score.complete else None for one in own)
            trainings = [{"seed": one.config.seed, "folder": str(one.folder), **one.best} for one in own]
            rows.append({"setting": setting, **spread._asdict(), "trainings": trainings})
    return rows


def summary_table(rows: Sequence[Mapping[str, Any]]) -> str:
    """Write the spreads [m], of races [s]; "-" where too many laps ended early."""
    head = ["setting", "seeds, complete", "median", "interquartile mean", "best", "worst"]
    lines = []
    for row in rows:
        figures = [row[name] for name in ("median", "interquartile_mean", "best", "worst")]
        text = ", ".join(f"{name} = {json.dumps(value)}" for name, value in row["setting"].items()) or "as given"
        lines.append([text, f"{row['total']}, {row['complete']}", *("-" if x is None else f"{x:.4f}" for x in figures)])
    return table(head, lines)


def read() -> tuple[RunConfig, Options]:
    """Read the arguments: what all trainings have in common, and the sweep."""
    reader = parser("python -m scripts.train", Options())
    tuned = tuned_for(sys.argv[1:])
    reader.add_argument("--algorithm", choices=tuple(ALGORITHMS), default="ppo", help="see `flexarm train`")
    add_fields(reader, tuned)
    given = reader.parse_args()
    return read_fields(reader, type(tuned), given), read_fields(reader, Options, given)


def main() -> None:
    """Command line of many trainings; what some made is kept where others failed."""
    config, options = read()
    if config.seed:
        raise ValueError(f"seed = {config.seed}: must go without --seeds and --sweep, which say what seeds")
    sweep = {} if options.sweep is None else json_object(options.sweep.read_text())
    settings, seeds = settings_of(sweep, config), seeds_of(options.seeds)
    jobs = jobs_of(config, settings, seeds, options.output)
    where = executor(options.executor, options.jobs, options.output / "submitit", json_object(options.submitit))
    with tqdm(total=len(jobs), unit="training") as bar:
        found, failed = trained_all(jobs, where, bar.update)
    rows = summary(settings, config, found)
    write_json(options.output / "trainings.json", {"settings": rows})
    write_text(options.output / "trainings.md", text := summary_table(rows))
    print(text, end="")
    check_failures(failed, options.output, "the other trainings are kept")


def _key(config: RunConfig) -> str:
    whole = {name: value for name, value in config.plain().items() if name != "seed"}
    return hashlib.sha256(json.dumps(whole, sort_keys=True).encode()).hexdigest()[:12]


if __name__ == "__main__":
    run(main)
