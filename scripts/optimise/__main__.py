"""Find the best known laps of arms by trajectory optimisation, and write them as plans.

For each arm, reference and lap every sequence of elbow branches is tried, and the best ones are carried on to
convergence. The plan, `ARM_LAP.npz` or `ARM_REFERENCE_LAP.npz`, lies beside a JSON file with its score, settings,
trials and the solver's log. An interrupted run goes on where it was. `--ship` puts the plans where the package has
them (baselines/plans), `--docs` their figures into docs/optimal.md.
"""

import itertools
import json
import shutil
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from flexarm_agents.files import put
from flexarm_baselines.optimal import Plan, load_plan
from flexarm_baselines.optimal.plan import PLANS
from flexarm_env.laps import LAPS
from flexarm_env.parameters import PRESETS, ArmParameters
from flexarm_env.validation import choice, integer
from scripts.common.command_line import read_options, run
from scripts.common.result_files import write_json
from scripts.common.study import Study, update_docs
from scripts.optimise import corner, reach
from scripts.optimise.pareto import curve
from scripts.optimise.score import score
from scripts.optimise.search import Candidate, Effort, search
from scripts.optimise.tables import CHANGED, DRAWN, TABLES, plan_name, published
from scripts.optimise.tracks import LAB, LAB_ARM, TRACKS

PUBLISHED = Study("the best known laps", lambda folder, jobs: published(PLANS), TABLES)
CHANGE_WEIGHTS = {"linear": 7e-5}  # [m^2]; of some arms, where smoothness costs more
PATHS_OF: dict[str, tuple[str, ...]] = {"linear": ("square",), LAB_ARM: (LAB,)}  # of some arms
PLANNED = tuple(name for name in TRACKS if name != LAB)  # of the others


@dataclass
class Options:
    """Find the best known laps."""

    output: Path = Path("results/optimise")
    """Folder for the results; what is there with the same settings is reused."""
    arms: tuple[str, ...] = ("default", "linear", LAB_ARM)
    """Names of arms."""
    laps: tuple[str, ...] = ("plain", "swing")
    """Names of laps; a lap is also tried on the end of the other one's plan where the folder has that."""
    paths: tuple[str, ...] = (*TRACKS, reach.PATH, corner.PATH)
    """Names of references; smooth: the square with corners blended over 0.4 s; pace14 to pace5: the square in so many
    seconds; lab: the path of `FlexArm/Lab-v0`, on the arm of the data sheet; moves: those that `FlexArm/Reach-v0`
    draws, of the default arm; corner: what limits the plain lap of the square at its corners, one change at a time."""
    change_weight: float | None = None
    """Weight on changes of the torques [m^2]; None: 3e-3; 7e-5 on the linear arm, where smoothness costs more; 1e-4
    for smooth and 1e-7 for lab, where it would cost more than the error."""
    trial: int = 10
    """Iterations of each start."""
    finalists: int = 1
    """So many of the starts go on."""
    iterations: int = 400
    """Most iterations of each of these."""
    pareto: bool = False
    """Follow each best lap of the square over a range of weights on changes of the torques: error against effort."""
    packaged: bool = False
    """Begin with the plans of the package, without a search."""
    ship: bool = False
    """Copy the plans to baselines/plans."""
    docs: bool = False
    """Bring docs/optimal.md up to date with the plans in baselines/plans."""


def main() -> None:
    """Command line."""
    options = read_options("python -m scripts.optimise", Options())
    known = {"arms": tuple(PRESETS), "laps": tuple(LAPS), "paths": (*TRACKS, reach.PATH, corner.PATH)}
    for name, these in known.items():
        for one in getattr(options, name):
            choice(name, one, these)
    for name in ("trial", "finalists", "iterations"):
        integer(name, getattr(options, name), 1)
    every = itertools.product(options.arms, options.paths, options.laps)
    planned = [one for one in every if one[1] in PATHS_OF.get(one[0], PLANNED)]
    if options.paths and not planned and not {reach.PATH, corner.PATH} & {*options.paths}:
        raise ValueError(f"paths = {', '.join(options.paths)}: none is planned on arms = {', '.join(options.arms)}")
    options.output.mkdir(parents=True, exist_ok=True)
    files = [file for one in planned for file in _optimise(*one, options)]
    if reach.PATH in options.paths:
        files.append(DRAWN)
        write_json(options.output / DRAWN, [reach.best(seed, options.output / reach.PATH) for seed in reach.SEEDS])
    if corner.PATH in options.paths:
        files.append(CHANGED)
        write_json(options.output / CHANGED, [corner.best(change) for change in corner.CHANGES])
    if options.ship:
        PLANS.mkdir(exist_ok=True)
        for file in files:
            shutil.copyfile(options.output / file, PLANS / file)
    if options.docs:
        PUBLISHED.show(published(PLANS), options.output)
        update_docs([PUBLISHED], options.output)


def _optimise(arm: str, path: str, lap: str, options: Options) -> list[str]:
    """Search, write the best plan and its report, print a line, and return the names of both files."""
    output, name = options.output, plan_name(arm, path, lap)
    if options.packaged:
        best, report = load_plan(name), json.loads((PLANS / f"{name}.json").read_text())
    else:
        weight = CHANGE_WEIGHTS.get(arm) if options.change_weight is None else options.change_weight
        weights = {} if weight is None else {"change_weight": weight}
        effort = Effort(options.trial, options.finalists, options.iterations)
        parameters, track = ArmParameters.named(arm), TRACKS[path]
        problem, other = track.problem(parameters, lap, **weights), _other(name, parameters, lap, output)
        found = search(problem, track.task(lap), track.sides, effort, output / name, other)
        best, report = found[0].plan, _report(found, lap, path)
    earlier = _earlier_curve(output / f"{name}.json", report)
    if earlier or (options.pareto and path == "square"):
        report["pareto"] = earlier or curve(best, lap, path, output / name)
    put(output / f"{name}.npz", partial(best.save, run=not TRACKS[path].compact))
    write_json(output / f"{name}.json", report)
    figures = report["score"]
    print(
        f"{name}: {figures['true_tip_rms']:.4f} m over the lap, {figures['true_tip_rms_after_2s']:.4f} m after 2 s, "
        f"largest {figures['true_tip_max']:.3f} m; branches {report['branches']}, residual {report['residual']:.1e}"
        + ("" if report["converged"] else " (not converged)")
    )
    return [f"{name}.npz", f"{name}.json"]


def _other(name: str, arm: ArmParameters, lap: str, output: Path) -> Plan | None:
    """Load the plan of the other lap, if it is there."""
    (opposite,) = set(LAPS) - {lap}
    path = output / f"{name.removesuffix(lap)}{opposite}.npz"
    plan = Plan.load(path) if path.exists() else None
    return plan if plan is not None and plan.parameters == arm else None


def _earlier_curve(path: Path, report: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the curve in an earlier report of the same plan; empty if there is none."""
    earlier = json.loads(path.read_text()) if path.exists() else {}
    same = earlier.get("log") == json.loads(json.dumps(report["log"]))
    return earlier.get("pareto", []) if same else []


def _report(found: list[Candidate], lap: str, path: str) -> dict[str, Any]:
    """Collect what the JSON file holds of the candidates, the best one first."""
    plan = found[0].plan
    log = plan.notes["log"]
    return {
        "score": score(plan, lap, TRACKS[path].options),
        "converged": plan.notes["converged"],
        "residual": log["residual"][-1],
        "cost": log["cost"][-1],
        "weights": {name: plan.notes[name] for name in ("torque_weight", "change_weight")},
        "limits": plan.limits,
        "branches": found[0].sequence,
        "costs_by_branches": {one.sequence: one.cost for one in found},
        "log": log,
    }


if __name__ == "__main__":
    run(main)
