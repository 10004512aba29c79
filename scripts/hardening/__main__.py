"""Fuzz, soak and kill the package as often as asked, and write what came of it.

The fuzzing goes on where it was interrupted, as long as the code is the same. The exit status is 1 if there are faults.
"""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import tyro
from tqdm import tqdm

from flexarm_agents.code_version import code_version
from flexarm_agents.files import put
from flexarm_agents.jobs.executors import THREADS
from flexarm_agents.jobs.worker_pool import worker_pool
from flexarm_env.validation import choice, integer
from scripts.common.command_line import run
from scripts.common.markdown import DOCS, filled
from scripts.common.result_files import write_json
from scripts.hardening import calls, files, options, values
from scripts.hardening.campaign import Tally, run_part
from scripts.hardening.kills import TASKS, kill_often
from scripts.hardening.page import BLOCK, FLAT, OTHER, Code, fuzzing_table, joined, kills_table, soak_table
from scripts.hardening.soak import PROCESSES, soak

PARTS = {"options": options.PART, "values": values.PART, "calls": calls.PART, "files": files.PART}
ALL = (*PARTS, "soak", "kills")
PAGE = "developers/reliability.md"
HEAD, NOTHING = 2, "Not run yet.\n"  # lines of a table without rows, and what stands in its place
SHOWING = tuple(f"flexarm_env.envs.{name}" for name in ("documentation", "drawing", "rendering", "scene"))


# What is run by tasks that are killed.
KILLED = {"kills": ("flexarm_agents.commands.train", "scripts.leaderboard.__main__", "scripts.paper.__main__")}


@dataclass
class Options:
    """Fuzz, soak and kill."""

    parts: tuple[str, ...] = ALL
    """What is done."""
    options: int = 100_000
    """Option sets of which environments are made."""
    values: int = 20_000
    """Sets of fields of parameters, configurations, controllers and plans."""
    calls: int = 100_000
    """Resets and steps."""
    files: int = 10_000
    """Damaged files."""
    soak: int = 100_000_000
    """Steps of each process of the soak."""
    kills: int = 20
    """How often each task is killed."""
    tasks: tuple[str, ...] = tuple(TASKS)
    """Tasks that are killed."""
    seed: int = 0
    """Of all that is drawn."""
    jobs: int = 1
    """Processes of the soak that run at the same time."""
    output: Path = Path("results/hardening")
    """Folder for the counts."""
    docs: bool = False
    """Bring docs/developers/reliability.md up to date with the counts of the folder."""


def stamp_of(name: str, seed: int = 0) -> dict[str, Any]:
    """Return what the counts of a part depend on."""
    return {"code": code_version([f"scripts.hardening.{name}", *KILLED.get(name, ())], SHOWING), "seed": seed}


def fuzz(name: str, count: int, seed: int, path: Path) -> Tally:
    """Try the cases of a part, as far as they were not tried before.

    Args:
        name: of the part.
        count: how much is to be tried in all.
        seed: of the campaign.
        path: of the counts so far, which are kept after each block.
    """
    stamp = stamp_of(name, seed)
    known = json.loads(path.read_text()) if path.exists() else {}
    tally = Tally.of(known["tally"]) if known.get("stamp") == stamp else Tally()
    with tqdm(total=count, initial=min(count, tally.total), unit=f" {PARTS[name].counted}", desc=name) as bar:

        def tick(done: int) -> None:
            """Keep the counts."""
            write_json(path, {"stamp": stamp, "tally": tally.plain()})
            bar.update(min(done, bar.total - bar.n))

        run_part(PARTS[name], seed, count, tally, tick)
    return tally


def soaked(steps: int, seed: int, jobs: int) -> list[dict[str, Any]]:
    """Run the soak in processes of its own.

    Raises:
        AssertionError: if their bits differ, or memory has grown.
    """
    os.environ.update(THREADS)
    found = []
    for first in range(0, PROCESSES, jobs):
        with worker_pool(min(jobs, PROCESSES - first)) as pool:
            running = [pool.submit(soak, steps, seed) for _ in range(min(jobs, PROCESSES - first))]
            found += [one.result() for one in running]
    assert len({one["hash"] for one in found}) == 1, f"soak: processes differ: {found}"
    grown = max(one["end"] - one["settled"] for one in found)
    assert grown < FLAT, f"soak: memory grew by {grown:.1f} MB"
    return found


def kept(path: Path, stamp: dict[str, Any], make: Callable[[], Any]) -> Any:
    """Make results and keep them in a file, which is absent if they cannot be made: it never holds older ones.

    Args:
        path: of the file.
        stamp: what the results depend on.
        make: makes them.
    """
    path.unlink(missing_ok=True)
    found = make()
    write_json(path, {"stamp": stamp, "found": found})
    return found


def update_page(folder: Path) -> None:
    """Write the tables of the page, of all that the folder has; lines of what was not run there stay, of this machine.

    A comment in each line, which the rendered page does not show, has the stamp of the code that made it.
    """
    known = {
        name: json.loads(path.read_text())
        for name in (*PARTS, "soak", *map(kill_file, TASKS))
        if (path := folder / f"{name}.json").exists()
    }
    now = {name: stamp_of(name)["code"] for name in ALL}
    codes = {name: Code(one["stamp"]["code"], now[name.partition("_")[0]]) for name, one in known.items()}
    tallies = {name: Tally.of(known[name]["tally"]) for name in PARTS if name in known}
    killed = {name: known[kill_file(name)]["found"] for name in TASKS if kill_file(name) in known}
    machine = (
        f"Python {platform.python_version()}, numpy {version('numpy')}, numba {version('numba')}, "
        f"{platform.system()} on {platform.machine()}.\n"
    )
    tables = {
        "fuzzing": fuzzing_table(PARTS, tallies, codes),
        "soak": soak_table(known["soak"]["found"] if "soak" in known else [], codes.get("soak")),
        "kills": kills_table(killed, {name: codes[kill_file(name)] for name in killed}),
    }
    lines = {
        "fuzzing": {part.text: now[name] for name, part in PARTS.items()},
        "soak": {f"{n}": now["soak"] for n in range(1, PROCESSES + 1)},
        "kills": {task.text: now["kills"] for task in TASKS.values()},
    }
    page = DOCS / PAGE
    text = page.read_text()
    former = dict(BLOCK.findall(text))
    if former.get("machine") == machine:
        tables = {name: joined(one, former.get(name, ""), lines[name]) for name, one in tables.items()}
    for name, one in ({"machine": machine} | tables).items():
        written = NOTHING if name != "machine" and one.count("\n") == HEAD else one
        put(folder / f"{name}.md", lambda aside, written=written: aside.write_text(written))  # type: ignore[misc]
    updated = filled(text, folder)
    put(page, lambda aside: aside.write_text(updated))
    print(f"{page}: up to date")
    if stale := sum(one.count(OTHER) for one in tables.values()):
        print(f"lines that were made by other code than the present one: {stale}")


def kill_file(name: str) -> str:
    """Return the name of the file with the counts of a task that is killed."""
    return f"kills_{name}"


def main() -> None:
    """Command line.

    Raises:
        ValueError: for a bad argument.
        OSError: if there are faults.
    """
    given = tyro.cli(Options, prog="python -m scripts.hardening")
    for name in given.parts:
        choice("parts", name, ALL)
    for name in given.tasks:
        choice("tasks", name, tuple(TASKS))
    for name in ALL:
        integer(name, getattr(given, name), 1)
    integer("seed", given.seed, 0)
    integer("jobs", given.jobs, 1)
    given.output.mkdir(parents=True, exist_ok=True)
    faults: list[str] = []
    for name in (one for one in PARTS if one in given.parts):
        tally = fuzz(name, getattr(given, name), given.seed, given.output / f"{name}.json")
        faults += [f"{name}: {fault}" for fault in tally.faults]
    try:
        if "soak" in given.parts:
            stamp = stamp_of("soak", given.seed)
            kept(given.output / "soak.json", stamp, lambda: soaked(given.soak, given.seed, given.jobs))
        for name in given.tasks if "kills" in given.parts else ():
            path, stamp = given.output / f"{kill_file(name)}.json", stamp_of("kills", given.seed)
            kill = partial(kill_often, name, given.kills, given.seed, given.output / "killed" / name)
            found = kept(path, stamp, kill)
            faults += found["faults"]
            print(f"kills, {name}: {found['kills']}", flush=True)
    except AssertionError as error:
        faults.append(str(error))
    if faults:
        print(*faults, sep="\n\n")
        raise OSError(f"{len(faults)} faults, see above")
    if given.docs:
        update_page(given.output)


if __name__ == "__main__":
    run(main)
