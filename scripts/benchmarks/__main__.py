"""Measure the speed of FlexArm beside what a user knows: one environment beside a batch, Acrobot, MuJoCo.

All subjects of a group are timed by turns in one run, on one core (threads: on all), and compared repeat by repeat:
trust the ratios. The times behind them belong to the machine. Prints tables and writes one JSON file.
"""

import os
import platform
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import llvmlite.binding
from tqdm import tqdm

from flexarm_agents.commands.text import columns
from flexarm_env.validation import choice, integer
from scripts.benchmarks import environments, family, peers
from scripts.benchmarks.timing import Group, measure
from scripts.common import command_line
from scripts.common.command_line import read_options
from scripts.common.result_files import write_json

# Packages of groups that are measured where they are installed.
NEEDED = {"chain in MuJoCo": ("mujoco",), "learning": ("stable_baselines3", "torch", "flexarm_agents")}


@dataclass
class Options:
    """Measure the speed of simulation and environments."""

    output: Path = Path("results/bench.json")
    """JSON file for the results; an existing one is replaced."""
    repeats: int = 10
    """How often the short measurements are repeated; some long ones half as often or less."""
    only: tuple[str, ...] = ()
    """Groups to measure, by the names that the progress bar shows; without, all."""
    cold: int = 2
    """How often the start without compiled code is measured."""
    quick: bool = False
    """A trial of the script: two short repeats. Its numbers mean little."""


def keep_on_one_core() -> int | None:
    """Keep this process and all threads that it starts on one core, and return its number; None: the system cannot.

    EnvPool's worker and the thread that waits for it would otherwise spin on two cores, which slows both.
    """
    if not hasattr(os, "sched_setaffinity"):
        return None
    core = max(os.sched_getaffinity(0))
    os.sched_setaffinity(0, {core})
    return core


def machine() -> dict[str, Any]:
    """Describe the machine and the libraries on which the times depend."""
    names = ("numba", "numpy", "scipy", "gymnasium", "flexarm")
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return {
        "cpu": _cpu_model(),
        "compiled_for": llvmlite.binding.get_host_cpu_name(),
        "cores": usable,
        "system": platform.system(),
        "load": os.getloadavg()[0] if hasattr(os, "getloadavg") else None,
        "python": platform.python_version(),
    } | {name: version(name) for name in names}


def _cpu_model() -> str:
    facts = Path("/proc/cpuinfo")
    lines = facts.read_text().splitlines() if facts.exists() else []
    models = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return models[0] if models else platform.processor() or platform.machine()


def run(options: Options, cache: Path) -> dict[str, Any]:
    """Measure everything, and return what the JSON file holds."""
    repeats, effort = (2, 0.05) if options.quick else (options.repeats, 1.0)
    facts = machine()
    cores = os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else set[int]()
    makers: dict[str, Callable[[], Group]] = {
        "Jacobians": lambda: family.jacobians(effort),
        "environments": lambda: environments.steps(effort),
        "first step": lambda: environments.first_step(1 if options.quick else options.cold, cache),
        "batches": lambda: family.batch(effort),
        "sensors": lambda: family.sensors(effort),
        "chain in MuJoCo": lambda: family.chain(effort),
        "learning": lambda: family.learning(effort),
        "threads": lambda: family.threads(effort, cores),  # last: it is not kept on one core
    }
    chosen = [choice("only", label, list(makers)) for label in options.only] or list(makers)
    missing = [label for label, needed in NEEDED.items() if label in chosen and not peers.installed(*needed)]
    groups = {}
    facts["core"] = keep_on_one_core()
    with tqdm(total=0, unit="call") as bar:
        for label in (label for label in makers if label in chosen and label not in missing):
            bar.set_description(f"{label}, compiling")
            group = makers[label]()
            bar.total += sum(min(s.at_most or repeats, group.repeats(repeats)) for s in group.subjects)
            bar.set_description(label)
            groups[group.name] = measure(group, repeats, bar.update)
    missing += ["EnvPool"] if "batches" in chosen and not peers.installed("envpool") else []
    return {"machine": facts, "quick": options.quick, "not_installed": missing, "groups": groups}


def table(rows: Sequence[Sequence[str]]) -> str:
    """Columns of text; all but the last to the right."""
    return columns([("", *row) for row in rows], right=True)


def report(results: dict[str, Any]) -> str:
    """Tables of the ratios, then of the times, for people."""
    facts = results["machine"]
    lines = ["", f"{facts['cpu']} (compiled for {facts['compiled_for']}), {facts['cores']} cores, load {facts['load']}"]
    lines += ["not kept on one core" if facts["core"] is None else f"all on core {facts['core']}"]
    lines += [", ".join(f"{name} {facts[name]}" for name in ("python", "numba", "numpy", "scipy", "gymnasium"))]
    if results["quick"]:
        lines += ["A quick trial: these numbers mean little."]
    if results["not_installed"]:
        lines += [f"Not measured, since a package is missing: {', '.join(results['not_installed'])}"]
    groups = results["groups"].values()
    lines += ["", "RATIOS: subjects timed by turns, compared repeat by repeat; these carry over to other machines best"]
    rows = [_figures(ratio, ratio["says"]) for group in groups for ratio in group["ratios"]]
    lines += [table([("median", "least", "most", "what is compared"), *rows])]
    lines += ["", "TIMES on this machine: processor time where `wall`, the clock's median, stands beside it"]
    for group in groups:
        rows = [_time(values, name, group["clock"]) for name, values in group["times"].items()]
        header = ("median", "least", "most", "wall", "a second", "")
        lines += ["", f"{group['title']}: {group['unit']}", table([header, *rows])]
    return "\n".join(lines)


def _figures(values: dict[str, Any], last: str) -> tuple[str, ...]:
    return (*(_number(values[key]) for key in ("median", "min", "max")), last)


def _time(values: dict[str, Any], name: str, clock: str) -> tuple[str, ...]:
    wall = _number(values["wall"]) if clock == "processor" else ""
    return (*_figures(values, wall), f"{values['per_second']:.3g}", name)


def _number(value: float) -> str:
    return f"{value:.0f}" if value >= 100.0 else f"{value:.3g}"


def main() -> None:
    """Command line."""
    options = read_options("python -m scripts.benchmarks", Options())
    for name in ("repeats", "cold"):
        integer(name, getattr(options, name), 1)
    with tempfile.TemporaryDirectory() as cache:
        results = run(options, Path(cache))
    options.output.parent.mkdir(parents=True, exist_ok=True)
    write_json(options.output, results)
    print(report(results))
    print(f"\n{options.output}: written")


if __name__ == "__main__":
    command_line.run(main)
