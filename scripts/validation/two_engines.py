"""Both independent engines, as recorded, and the arm's models: needs neither engine.

MuJoCo's chain of rigid segments (extrapolated) and Exudyn's cables share no method and no author. How far they are
apart is what either can be trusted with; a model's distance from both is its own.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from scripts.common.markdown import table
from scripts.validation import recorded
from scripts.validation.checks import Check, Findings, Settings
from scripts.validation.engine.models import model
from scripts.validation.engine.motion import Motion, apart, model_motion, peak_bend, rms

Array = NDArray[np.float64]
GROUP = "two_engines"
BEST = model("foreshortened", 4, "polynomial")
MODELS = (model("linear", 2), model("foreshortened", 2), model("foreshortened", 3, "polynomial"), BEST)


def run(settings: Settings) -> Findings:
    """All that is recorded; the short version compares the best model only."""
    kept, models = recorded.load(), MODELS[-1:] if settings.quick else MODELS
    rows, arrays = [], {}
    for name, programme in recorded.cases().items():
        settings.progress(name)
        chain, cables = (kept[engine][name] for engine in recorded.ENGINES)
        row = {"case": name, "bend": peak_bend(cables.deflection), "engines": _distance(chain, cables)}
        for m in models:
            motion = recorded.thinned(model_motion(programme, **m.fields))
            row[m.label] = {engine: _distance(motion, kept[engine][name]) for engine in recorded.ENGINES}
            if m is BEST:
                arrays[f"{name}, model"] = apart(motion, cables)
        arrays[f"{name}, engines"] = apart(chain, cables)
        rows.append(row)
    return Findings(_checks(rows), arrays, {"rows": rows, "versions": recorded.versions()}, _quoted(rows))


def _distance(one: Motion, other: Motion) -> dict[str, float]:
    away = apart(one, other)
    return {"rms": rms(away), "maximum": float(away.max())}


def _checks(rows: list[dict[str, Any]]) -> list[Check]:
    smooth = [row for row in rows if row["case"] in recorded.DOUBLED]
    twice = [row for row in rows if row["case"].endswith("twice")]
    jumps = [row for row in rows if row not in smooth + twice]
    asked = "a choice: the 1 mm that the models are asked for"
    table = (
        ("the two engines' tips apart, smooth torques at 4 %: largest", _worst(smooth, "maximum"), asked, 1.0),
        ("the same at 7.5 %", _worst(twice, "maximum"), asked, 1.0),
        (
            "torques that jump, 4 %: r.m.s.",
            _worst(jumps, "rms"),
            "a choice: the 10 mm of the validity range; undamped vibrations beyond either's mesh drift apart",
            10.0,
        ),
        (
            "smooth torques at 4 %: four polynomials with foreshortening from either engine, r.m.s.",
            _worst_of_model(smooth),
            "its own next order is the third: 4 % cubed of 4.5 m is 0.3 mm; three times that is a choice, for growth "
            "over two seconds",
            1.0,
        ),
        (
            "the same at 7.5 %",
            _worst_of_model(twice),
            "the same: 7.5 % cubed of 4.5 m is 1.9 mm; three times that",
            5.7,
        ),
    )
    return [Check(GROUP, what, found, reason, "mm", most=most) for what, found, reason, most in table]


def _worst(rows: list[dict[str, Any]], figure: str) -> float:
    """Return the largest of a figure of the two engines' distance [mm]."""
    return float(1e3 * max(row["engines"][figure] for row in rows))


def _worst_of_model(rows: list[dict[str, Any]]) -> float:
    """Return the largest r.m.s. distance of the best model from either engine [mm]."""
    return float(1e3 * max(row[BEST.label][engine]["rms"] for row in rows for engine in recorded.ENGINES))


def _quoted(rows: list[dict[str, Any]]) -> dict[str, float]:
    """Return what the docs quote [mm]."""
    quoted = {f"{row['case']}, engines, {n}": 1e3 * value for row in rows for n, value in row["engines"].items()}
    for row in rows:
        for engine in recorded.ENGINES:
            quoted[f"{row['case']}, best, {engine}"] = 1e3 * row[BEST.label][engine]["rms"]
    return quoted


def tables(findings: Findings) -> dict[str, str]:
    """Return the table of distances for the docs."""
    rows = findings.records["rows"]
    header = ["tips apart [mm]: r.m.s. / largest", *(row["case"].replace("_", " ") for row in rows)]
    lines = [
        ["largest deflection / length", *(f"{100.0 * row['bend']:.1f} %" for row in rows)],
        ["MuJoCo from Exudyn", *(_both(row["engines"]) for row in rows)],
    ]
    for m in MODELS:
        if m.label in rows[0]:
            for engine, title in zip(recorded.ENGINES, ("MuJoCo", "Exudyn"), strict=True):
                lines.append([f"{m.label}, from {title}", *(_both(row[m.label][engine]) for row in rows)])
    return {"two_engines_distances": table(header, lines)}


def _both(distance: dict[str, float]) -> str:
    return " / ".join(f"{1e3 * distance[name]:.2g}" for name in ("rms", "maximum"))
