"""Tables of docs/optimal.md, from the reports beside the plans."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from scripts.common.markdown import table
from scripts.optimise.score import CASES

ERRORS = ("true_tip_rms", "true_tip_rms_after_2s")  # over the lap / after 2 s
DRAWN, CHANGED = "moves.json", "corner.json"  # the reports on drawn motions, and on changed laps
CHANGED_ERRORS = {"true_tip_rms_after_2s": 2, "true_tip_max_after_2s": 0}  # with digits
EFFORTS = {"torque_rms": "torques, r.m.s. [N m]", "torque_change_rms": "their change in a period [N m]"}


def reports(folder: Path) -> dict[str, Any]:
    """Read the reports of plans, by the plans' names."""
    return {path.stem: json.loads(path.with_suffix(".json").read_text()) for path in sorted(folder.glob("*.npz"))}


def laps(folder: Path) -> str:
    """Show the best known laps."""
    found = reports(folder)
    head = ["arm, lap", "error [mm]", "largest [mm]", "elbow", *EFFORTS.values(), "residual"]
    return table(head, [_lap(name, report) for name, report in found.items()])


def _lap(name: str, report: dict[str, Any]) -> list[str]:
    score = report["score"]
    largest, branches = f"{1e3 * score['true_tip_max']:.0f}", f"`{report['branches']}`"
    return [_words(name), _errors(score), largest, branches, *_efforts(score), f"{report['residual']:.0e}"]


def pareto(folder: Path) -> str:
    """Show error against effort on the default arm's plain lap."""
    found = reports(folder)
    head = ["weight on changes [m²]", "error [mm]", *EFFORTS.values()]
    return table(
        head,
        [
            [f"{row['change_weight']:g}", _errors(row), *_efforts(row)]
            for row in found["default_plain"].get("pareto", [])
        ],
    )


def regulated(folder: Path) -> str:
    """Show the errors of other arms under regulators along the default arm's plans of the square."""
    found = reports(folder)
    cases = list(CASES)
    return table(
        ["arm, lap", "regulator", *cases],
        [
            [_words(name), regulator, *(_errors(rows[case]) for case in cases)]
            for name, report in found.items()
            if parts(name)[:2] == ("default", "square")
            for regulator, rows in report["regulated"].items()
        ],
    )


def drawn(folder: Path) -> str:
    """Show the best known runs of `FlexArm/Reach-v0`."""
    rows = json.loads((folder / DRAWN).read_text())
    head = ["seed", "episode r.m.s. [mm]", "largest [mm]", "residual"]
    return table(
        head,
        [
            [
                str(row["seed"]),
                *(f"{1e3 * row[key]:.3f}" for key in ("true_tip_rms", "true_tip_max")),
                f"{row['residual']:.0e}",
            ]
            for row in rows
        ],
    )


def changed(folder: Path) -> str:
    """Show what changes make of a corner."""
    rows = json.loads((folder / CHANGED).read_text())
    head = ["change", "after 2 s [mm]", "largest after 2 s [mm]", "largest bending of a link [m]", "residual"]
    return table(
        head,
        [
            [
                row["change"],
                *(f"{1e3 * row[key]:.{digits}f}" for key, digits in CHANGED_ERRORS.items()),
                f"{row['peak_deflection']:.2f}",
                f"{row['residual']:.0e}",
            ]
            for row in rows
        ],
    )


def plan_name(arm: str, path: str, lap: str) -> str:
    """Name the plan of an arm for a lap of a path."""
    return "_".join([arm, *([] if path == "square" else [path]), lap])


def parts(name: str) -> tuple[str, str, str]:
    """Return arm, path and lap of a plan's name."""
    arm, _, rest = name.partition("_")
    path, _, lap = rest.rpartition("_")
    return arm, path or "square", lap


def _words(name: str) -> str:
    arm, path, lap = parts(name)
    return ", ".join([arm, *([] if path == "square" else [path.replace("_", " ")]), lap])


def _errors(row: dict[str, Any]) -> str:
    return " / ".join(f"{1e3 * row[key]:.1f}" for key in ERRORS)


def _efforts(row: dict[str, Any]) -> list[str]:
    return [" / ".join(f"{x:.1f}" for x in row[key]) for key in EFFORTS]


TABLES = {"laps": laps, "corner": changed, "drawn": drawn, "pareto": pareto, "regulated": regulated}
