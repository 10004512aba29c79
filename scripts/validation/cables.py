"""The second independent engine by itself: do Exudyn's cables converge, and do they give what was recorded of them?"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from scripts.common.markdown import table
from scripts.validation import recorded
from scripts.validation.ancf_cables import AXIAL_STIFFNESS, ELEMENTS, STEP, cable_motion
from scripts.validation.checks import Check, Findings, Settings
from scripts.validation.engine.motion import Motion, apart, peak_bend, rms

Array = NDArray[np.float64]
GROUP = "cables"
COARSER = (2, 3, 4, 6, 8, 12)  # elements of a cable, against `FINEST`
FINEST = 24


def run(settings: Settings) -> Findings:
    """Smooth programmes on finer and coarser cables; the short version takes one of them."""
    names = recorded.DOUBLED[:1] if settings.quick else recorded.DOUBLED
    kept, rows = recorded.load()["exudyn"], []
    for name in names:
        settings.progress(name)
        rows.append(_row(name, kept[name]))
    return Findings(_checks(rows), records={"rows": rows})


def _row(name: str, kept: Motion) -> dict[str, Any]:
    """Return how far other meshes and steps take the tip of a programme [m]."""
    programme = recorded.cases()[name]
    usual, finest = cable_motion(programme), cable_motion(programme, FINEST)
    meshes = {n: usual if n == ELEMENTS else cable_motion(programme, n) for n in COARSER}
    return {
        "programme": name,
        "bend": peak_bend(usual.deflection),
        "elements": {str(n): float(apart(motion, finest).max()) for n, motion in meshes.items()},
        "halved": float(apart(usual, cable_motion(programme, ELEMENTS, 0.5 * STEP)).max()),
        "stretched": rms(apart(usual, cable_motion(programme, axial_stiffness=AXIAL_STIFFNESS / 3.0))),
        "record": float(apart(recorded.thinned(usual), kept).max()),
    }


def _checks(rows: list[dict[str, Any]]) -> list[Check]:
    tenth = "a choice: a tenth of the 1 mm that the models are asked for"
    found = {
        f"smooth torques: the tip with {FINEST} elements a cable instead of {ELEMENTS}": max(
            row["elements"][str(ELEMENTS)] for row in rows
        ),
        "the same with the step halved": max(row["halved"] for row in rows),
        "the same with a third of the axial stiffness, r.m.s.": max(row["stretched"] for row in rows),
    }
    return [
        *(Check(GROUP, name, 1e3 * figure, tenth, "mm", most=0.1) for name, figure in found.items()),
        Check(
            GROUP,
            "the tip as recorded",
            1e3 * max(row["record"] for row in rows),
            "the same programme again; Newton's method stops at 1e-4 N, and records are rounded to 1e-6 m",
            "mm",
            most=0.01,
        ),
    ]


def tables(findings: Findings) -> dict[str, str]:
    """Return the table of convergence for the docs."""
    rows = findings.records["rows"]
    header = ["largest change of the tip [mm]", *(f"{row['programme']}".replace("_", " ") for row in rows)]
    lines = [["largest deflection / length", *(f"{100.0 * row['bend']:.1f} %" for row in rows)]]
    lines += [
        [f"{n} elements a cable, from {FINEST}", *(f"{1e3 * row['elements'][str(n)]:.2g}" for row in rows)]
        for n in COARSER
    ]
    lines.append(["step halved", *(f"{1e3 * row['halved']:.2g}" for row in rows)])
    return {"cables_convergence": table(header, lines)}
