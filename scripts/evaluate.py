"""Score controllers and trained policies on the standard lap: one table, and the same as JSON."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium
import tyro
from tqdm import tqdm

from flexarm_agents import Score, evaluate, load_policy, shipped_policies
from flexarm_agents.constant import ConstantPolicy
from flexarm_agents.environments import make_one
from flexarm_baselines import FLSAC, IFDC
from flexarm_env.parameters import Kinematics
from scripts.common.command_line import run
from scripts.common.result_files import write_json

TORQUE, GAIN = "FlexArm/Square-v0", "FlexArm/SquareGain-v0"  # the same plant, sensor and path
NAMES = ("ifdc", "flsac", "zero", "random")


@dataclass
class Options:
    """Score controllers and trained policies on the standard lap, from rest on the first corner."""

    runs: tyro.conf.Positional[tuple[str, ...]] = ()
    """Trained policies: folders of trainings or npz files. A shipped policy can be named, too."""
    baselines: bool = True
    """Score IFDC, FLSAC, no torque and random torque."""
    shipped: bool = True
    """Score all shipped policies."""
    kinematics: Kinematics | None = None
    """Of the arm that all are scored on; without it, as each was made. "foreshortened" is the more accurate arm."""
    seed: int = 0
    """Of what is random."""
    output: Path = Path("results/evaluation/evaluation.json")
    """JSON file for the results; an existing one is replaced."""


class Entry(NamedTuple):
    """What is scored: a name, a policy and its environment, by id and changed options."""

    name: str
    policy: Any
    env: gymnasium.Env[Any, Any]
    environment: str
    options: dict[str, Any]


def entries(options: Options) -> Iterator[Entry]:
    """Everything that the command line asks for, each made when it is its turn."""
    if options.baselines:
        changed = _arm({}, options.kinematics)
        gain, torque = make_one(GAIN, changed), make_one(TORQUE, changed)
        yield Entry("IFDC", IFDC.for_env(gain), gain, GAIN, changed)
        yield Entry("FLSAC", FLSAC.for_env(gain), gain, GAIN, changed)
        yield Entry("no torque", ConstantPolicy(2), torque, TORQUE, changed)
        yield Entry("random torque", ConstantPolicy(2, 1.0, options.seed), torque, TORQUE, changed)
    for source in (*(shipped_policies() if options.shipped else ()), *options.runs):
        trained = load_policy(source)
        changed = _arm(trained.options, options.kinematics)
        yield Entry(source, trained.policy, trained.make_env(**changed), trained.environment, trained.options | changed)


def _arm(options: dict[str, Any], kinematics: Kinematics | None) -> dict[str, Any]:
    """The change of an environment's options that gives its arm other kinematics."""
    arm = options.get("arm", "default")
    fields = {"preset": arm} if isinstance(arm, str) else arm
    return {} if kinematics is None else {"arm": {**fields, "kinematics": kinematics}}


def figures(score: Score) -> tuple[str, ...]:
    """Columns of the table; what a run that ended early does not have is a dash, and its scores are in brackets."""

    def pair(values: tuple[float, float] | None, digits: int) -> str:
        """Of shoulder and elbow, or of the links."""
        return "-" if values is None else " / ".join(f"{value:.{digits}f}" for value in values)

    def metres(value: float | None) -> str:
        """A distance; in brackets where the run ended early."""
        text = "-" if value is None else f"{value:.3f}"
        return text if score.complete or value is None else f"({text})"

    lengths = (score.rms, score.maximum, score.rms_after_2s)
    return (
        *(metres(value) for value in lengths),
        pair(score.torque_change, 1),
        pair(score.peak_deflection, 2),
        pair(score.peak_torque, 0),
        "complete" if score.complete else f"ENDED at {score.duration:.2f} s: {score.ended}",
    )


HEADER = (
    ("", "environment", "lap r.m.s.", "maximum", "after 2 s", "torque change", "peak deflection", "peak torque", "end"),
    ("", "", "[m]", "[m]", "r.m.s. [m]", "r.m.s. [N m]", "[m]", "[N m]", ""),
)


def table(results: Sequence[tuple[Entry, Score]]) -> str:
    """Complete laps by their r.m.s., then those that ended early."""
    ordered = sorted(results, key=lambda result: result[1].rank)
    rows = [*HEADER, *((entry.name, _environment(entry), *figures(score)) for entry, score in ordered)]
    widths = [max(len(row[column]) for row in rows) for column in range(len(HEADER[0]))]

    def line(row: Sequence[str]) -> str:
        """Name and end to the left, figures to the right."""
        middle = (cell.rjust(width) for cell, width in zip(row[1:-1], widths[1:-1], strict=True))
        return "  ".join((row[0].ljust(widths[0]), *middle, row[-1])).rstrip()

    return "\n".join(line(row) for row in rows)


def _environment(entry: Entry) -> str:
    return entry.environment.partition("/")[2] + ("*" if entry.options else "")


def main() -> None:
    """Command line."""
    options = tyro.cli(Options)
    results, kept = [], []
    with tqdm(unit="lap", disable=None) as bar:
        for entry in entries(options):
            bar.set_description(entry.name)
            score = evaluate(entry.env, entry.policy, options.seed)
            results.append((entry, score))
            about = {"name": entry.name, "environment": entry.environment, "options": entry.options}
            kept.append(about | score.plain())
            bar.update()
    if not results:
        raise ValueError("runs = (): nothing to score; name a run, or leave --baselines or --shipped on")
    options.output.parent.mkdir(parents=True, exist_ok=True)
    write_json(options.output, {"seed": options.seed, "laps": kept})
    print("Pairs: shoulder / elbow, or link 1 / link 2. *: with changed options. In brackets: laps that ended early.")
    print(f"{table(results)}\n{options.output}: written")


if __name__ == "__main__":
    run(main)
