"""Find the best known laps of arms by trajectory optimisation, and write them as plans.

For each arm, reference and lap every sequence of elbow branches is tried, and the best ones are carried on to
convergence. The plan, `ARM_LAP.npz` or `ARM_REFERENCE_LAP.npz`, lies beside a JSON file with its score, settings,
trials and the solver's log. An interrupted run goes on where it was. `--ship` puts the plans where the package has
them (baselines/plans), `--docs` their figures into docs/optimal.md.
"""

from __future__ import annotations

import itertools
import json
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tqdm import tqdm

from flexarm_agents.files import put
from flexarm_baselines.optimal import Iteration, Plan, load_plan
from flexarm_baselines.optimal.laps import CHANGE_WEIGHT
from flexarm_baselines.optimal.plan import PLANS
from flexarm_env.laps import LAPS
from flexarm_env.parameters import PRESETS, ArmParameters
from flexarm_env.physics.paths import PATHS
from flexarm_env.validation import choice
from scripts.common.command_line import read_options, run
from scripts.common.markdown import DOCS, filled
from scripts.common.result_files import write_json
from scripts.optimise import corner, reach
from scripts.optimise.pareto import ITERATIONS, WEIGHTS, curve
from scripts.optimise.score import regulated, score
from scripts.optimise.search import SIDES, Candidate, Effort, search
from scripts.optimise.tables import CHANGED, DRAWN, TABLES, plan_name

PAGE = "optimal.md"
CHANGE_WEIGHTS = {"linear": 7e-5}  # [m^2]; of some arms, where smoothness costs more
PATHS_OF: dict[str, tuple[str, ...]] = {"linear": ("square",)}  # of some arms; others have all


@dataclass
class Options:
    """Find the best known laps."""

    output: Path = Path("results/optimise")
    """Folder for the results; what is there with the same settings is taken over."""
    arms: tuple[str, ...] = ("default", "linear")
    """Names of arms."""
    laps: tuple[str, ...] = ("plain", "swing")
    """Names of laps; a lap is also tried on the end of the other one's plan where the folder has that."""
    paths: tuple[str, ...] = (*PATHS, reach.PATH, corner.PATH)
    """Names of references; moves: those that `FlexArm/Reach-v0` draws, of the default arm; corner: what limits the
    plain lap of the square at its corners, one change at a time."""
    change_weight: float | None = None
    """Weight on changes of the torques [m^2]; None: 3e-3, on the linear arm 7e-5, where smoothness costs more."""
    trial: int = 10
    """Iterations of each start."""
    finalists: int = 1
    """So many of the starts go on."""
    iterations: int = 400
    """Most iterations of each of these."""
    quick: bool = False
    """A trial of the script: a few iterations."""
    pareto: bool = False
    """Follow each best lap of the square over a range of weights on changes of the torques: error against effort."""
    packaged: bool = False
    """Begin with the plans of the package, without a search."""
    ship: bool = False
    """Copy the plans to baselines/plans."""
    docs: bool = False
    """Bring docs/optimal.md up to date with the plans in baselines/plans."""


def main() -> None:
    """Command line.

    Raises:
        ValueError: for an unknown arm or lap, or plans of a quick run to be shipped.
    """
    options = read_options("python -m scripts.optimise", Options())
    for arm in options.arms:
        choice("arms", arm, tuple(PRESETS))
    for lap in options.laps:
        choice("laps", lap, tuple(LAPS))
    for path in options.paths:
        choice("paths", path, (*PATHS, reach.PATH, corner.PATH))
    if options.ship and options.quick:
        raise ValueError("ship = True: a quick run's plans are no good; must go without quick")
    options.output.mkdir(parents=True, exist_ok=True)
    for arm, path, lap in itertools.product(options.arms, options.paths, options.laps):
        if path not in PATHS_OF.get(arm, tuple(PATHS)):
            continue
        _optimise(arm, path, lap, options)
        if options.ship:
            PLANS.mkdir(exist_ok=True)
            for suffix in (".npz", ".json"):
                file = plan_name(arm, path, lap) + suffix
                shutil.copyfile(options.output / file, PLANS / file)
    if reach.PATH in options.paths:
        _drawn(options)
    if corner.PATH in options.paths:
        _changed(options)
    if options.docs:
        update_docs(options.output)


def update_docs(output: Path) -> None:
    """Fill the page's tables from the plans of the package."""
    for name, make in TABLES.items():
        (output / f"{name}.md").write_text(make(PLANS))
    page = DOCS / PAGE
    page.write_text(filled(page.read_text(), output))
    print(f"{page}: tables up to date")


def _optimise(arm: str, path: str, lap: str, options: Options) -> None:
    """Search, write the best plan and its report, and print a line."""
    output, name = options.output, plan_name(arm, path, lap)
    weight = options.change_weight or CHANGE_WEIGHTS.get(arm, CHANGE_WEIGHT)
    effort = Effort(options.trial, options.finalists, options.iterations, weight)
    if options.quick:
        effort = Effort(1, 1, 1, weight)
    follow_curve = options.pareto and path == "square"
    most = effort.trial * 2 ** SIDES.get(path, 1) + effort.iterations * (effort.finalists + 1)
    most = most * (not options.packaged) + follow_curve * len(WEIGHTS) * ITERATIONS
    with tqdm(total=most, unit="iteration", desc=name) as bar:

        def tick(word: str, line: Iteration | None) -> None:
            bar.update()
            if line is not None:
                bar.set_postfix_str(f"{word}: {line.cost:.4g} m^2, residual {line.residual:.1e}")

        if options.packaged:
            best, report = load_plan(name), json.loads((PLANS / f"{name}.json").read_text())
        else:
            other = _other(name, ArmParameters.named(arm), lap, output)
            found = search(ArmParameters.named(arm), lap, path, effort, output / name, other, tick)
            best, report = found[0].plan, _report(found, lap, path)
        earlier = _earlier_curve(output / f"{name}.json", report)
        if follow_curve or earlier:
            report["pareto"] = earlier or curve(best, lap, path, output / name, tick)
    put(output / f"{name}.npz", best.save)
    write_json(output / f"{name}.json", report)
    figures = report["score"]
    print(
        f"{name}: {figures['true_tip_rms']:.4f} m over the lap, {figures['true_tip_rms_after_2s']:.4f} m after 2 s, "
        f"largest {figures['true_tip_max']:.3f} m; branches {report['branches']}, residual {report['residual']:.1e}"
        + ("" if report["converged"] else " (not converged)")
    )


def _drawn(options: Options) -> None:
    """Optimise drawn motions, write their report, and print a line for each."""
    seeds, rows = reach.SEEDS[: 1 if options.quick else None], []
    with tqdm(total=len(seeds) * reach.ITERATIONS, unit="iteration", desc=reach.PATH) as bar:
        for seed in seeds:
            rows.append(reach.best(seed, options.output / reach.PATH, lambda word, line: bar.update()))
            print(f"moves, seed {seed}: {rows[-1]['true_tip_rms']:.5f} m, residual {rows[-1]['residual']:.1e}")
    write_json(options.output / DRAWN, rows)
    if options.ship:
        shutil.copyfile(options.output / DRAWN, PLANS / DRAWN)


def _changed(options: Options) -> None:
    """Optimise laps with one thing changed at a time, and write their report."""
    iterations = 1 if options.quick else corner.ITERATIONS
    with tqdm(unit="iteration", desc=corner.PATH) as bar:
        write_json(options.output / CHANGED, corner.study(lambda line: bar.update(), iterations))
    if options.ship:
        shutil.copyfile(options.output / CHANGED, PLANS / CHANGED)


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
        "score": score(plan, lap, path),
        "regulated": regulated(plan),
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
