"""Tables of docs/optimal.md, from the reports beside the plans."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from flexarm_env.laps import LAPS
from flexarm_env.parameters import SquareParameters
from scripts.common.markdown import table
from scripts.optimise.tracks import PACE

Reports = Mapping[str, Any]  # by the names of their files
DRAWN, CHANGED = "moves.json", "corner.json"  # the reports on drawn motions, and on changed laps
EFFORTS = {"torque_rms": "torques, r.m.s. [N m]", "torque_change_rms": "their change in a period [N m]"}


def published(folder: Path) -> Reports:
    """Read the reports of a folder."""
    return {path.name: json.loads(path.read_text()) for path in sorted(folder.glob("*.json"))}


def _plans(reports: Reports) -> dict[str, Any]:
    """Return the reports of plans, by the plans' names."""
    return {Path(name).stem: one for name, one in reports.items() if name not in (DRAWN, CHANGED)}


def laps(reports: Reports) -> str:
    """Tabulate the best known laps."""
    rows = []
    for name, report in _plans(reports).items():
        if parts(name)[1].startswith(PACE):
            continue
        score = report["score"]
        largest, branches = f"{1e3 * score['true_tip_max']:.0f}", f"`{report['branches']}`"
        efforts = (" / ".join(f"{x:.1f}" for x in score[key]) for key in EFFORTS)
        rows.append((_text(name), _errors(score), largest, branches, *efforts, f"{report['residual']:.0e}"))
    return table(("arm, lap", "error [mm]", "largest [mm]", "elbow", *EFFORTS.values(), "residual"), rows)


def pace(reports: Reports) -> str:
    """Tabulate the default arm's best known laps of the square by their time."""
    found: dict[float, dict[str, Any]] = {}
    for name, report in _plans(reports).items():
        arm, path, lap = parts(name)
        if arm == "default" and (path == "square" or path.startswith(PACE)):
            lap_time = float(path.removeprefix(PACE)) if path != "square" else SquareParameters.lap_time
            found.setdefault(lap_time, {})[lap] = report["score"]
    rows = []
    for lap_time, laps in sorted(found.items(), reverse=True):
        cells = (cell for lap in LAPS for cell in (_errors(laps[lap]), f"{1e3 * laps[lap]['true_tip_max']:.0f}"))
        rows.append((f"{lap_time:g}", *cells))
    return table(("lap time [s]", *(cell for lap in LAPS for cell in (f"{lap} lap [mm]", "largest [mm]"))), rows)


def changed(reports: Reports) -> str:
    """Tabulate what changes make of a corner."""
    rows = []
    for row in reports[CHANGED]:
        errors = f"{1e3 * row['true_tip_rms_after_2s']:.2f}", f"{1e3 * row['true_tip_max_after_2s']:.0f}"
        rows.append((row["change"], *errors, f"{row['peak_deflection']:.2f}", f"{row['residual']:.0e}"))
    head = ("change", "after 2 s [mm]", "largest after 2 s [mm]", "largest bending of a link [m]", "residual")
    return table(head, rows)


def plan_name(arm: str, path: str, lap: str) -> str:
    """Name the plan of an arm for a lap of a path."""
    return "_".join([arm, *([] if path == "square" else [path]), lap])


def parts(name: str) -> tuple[str, str, str]:
    """Return arm, path and lap of a plan's name."""
    arm, _, rest = name.partition("_")
    path, _, lap = rest.rpartition("_")
    return arm, path or "square", lap


def _text(name: str) -> str:
    arm, path, lap = parts(name)
    return ", ".join([arm, *([] if path == "square" else [path.replace("_", " ")]), lap])


def _errors(row: Mapping[str, Any]) -> str:
    """Write the error over the lap / after 2 s."""
    return " / ".join(f"{1e3 * row[key]:.1f}" for key in ("true_tip_rms", "true_tip_rms_after_2s"))


TABLES = {"laps": laps, "corner": changed, "pace": pace}
