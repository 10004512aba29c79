"""The default arm against the chain: controllers, the paper's laws, damping."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from scripts.common.markdown import table
from scripts.validation.checks import Check, Findings, Settings
from scripts.validation.plant import study
from scripts.validation.plant.drivers import WEIGHTS

GROUP = "plant"
DEFAULT = "3 polynomials"
GENTLE, AGGRESSIVE = (f"plan with {name} feedback" for name in WEIGHTS)
CHECKED = ("plain", GENTLE)  # whole laps in the short version, too: the checks are of these


def run(settings: Settings) -> Findings:
    """Run all laps."""
    quick = settings.quick
    seconds = 0.5 if quick else 16.0
    rows, arrays = study.under_control(lambda lap, name: 16.0 if (lap, name) == CHECKED else seconds, settings.progress)
    laws = dict.fromkeys(study.LAW_SECONDS, 0.5) if quick else study.LAW_SECONDS
    records: dict[str, Any] = {
        "control": rows,
        "laws": study.under_the_laws(laws, settings.progress),
        "damping": study.damping((5, 10) if quick else (5, 10, 20), seconds, settings.progress),
    }
    return Findings(_checks(records), arrays, records, _quoted(records))


def _checks(records: dict[str, Any]) -> list[Check]:
    gentle = study.find_row(records["control"], lap=CHECKED[0], controller=CHECKED[1], plant=DEFAULT)
    former = study.find_row(records["control"], lap=CHECKED[0], controller=CHECKED[1], plant=study.FORMER.label)
    coarse = study.find_row(
        records["control"], lap=CHECKED[0], controller=CHECKED[1], plant=f"chain, {study.ELEMENTS[0]} elements"
    )
    laws = [study.find_row(records["laws"], law=law, plant=DEFAULT) for law in study.LAW_SECONDS]
    return [
        Check(
            GROUP,
            "the plain lap under gentle feedback: the coarser chain from the finer one, r.m.s.",
            1e3 * coarse["rms"],
            "a choice: a tenth of the 10 mm that the validity range allows a model",
            "mm",
            most=1.0,
        ),
        Check(
            GROUP,
            "the plain lap under gentle feedback: the default arm from the chain, r.m.s.",
            1e3 * gentle["rms"],
            "a choice: the 10 mm that the validity range allows a model",
            "mm",
            most=10.0,
        ),
        Check(
            GROUP,
            "the same, linear arm over default arm",
            former["rms"] / gentle["rms"],
            "a choice: the default arm must have at most a quarter of the error",
            least=4.0,
        ),
        Check(
            GROUP,
            "the paper's laws, undamped: the default arm from the chain, r.m.s.",
            1e3 * max(row["rms"] for row in laws),
            "a choice: three times the 10 mm of the validity range, since the stiff law excites modes beyond the arm's",
            "mm",
            most=30.0,
        ),
    ]


def _quoted(records: dict[str, Any]) -> dict[str, float]:
    """Return what the docs quote, lengths in mm."""
    quoted = {}
    for row in records["control"]:
        which = f"{row['lap']}, {row['controller']}, {row['plant']}"
        for name in ("rms", "maximum", "after_2s", "score", "score_after_2s"):
            if row.get(name) is not None:
                quoted[f"{which}, {name}"] = 1e3 * row[name]
        quoted[f"{which}, torque change"] = row["torque_change"]
        if "ahead" in row:
            quoted[f"{which}, ahead median"] = 1e3 * row["ahead"]["median"]
    for row in records["laws"]:
        quoted |= {f"{row['law']}, {row['plant']}, {name}": 1e3 * row[name] for name in ("rms", "maximum")}
    for row in records["damping"]:
        which = f"{row['damping']}, {row['elements']} elements"
        quoted |= {f"{which}, {name}": 1e3 * row[name] for name in ("score", "from_coarser") if name in row}
    return quoted


# --- tables -----------------------------------------------------------------------------------------------------------


def tables(findings: Findings) -> dict[str, str]:
    """Return the tables of docs/plant.md."""
    return {
        "plant_control": _control_table(findings.records),
        "plant_damping": _damping_table(findings.records),
    }


def _mm(metres: float | None) -> str:
    return "" if metres is None else f"{1e3 * metres:.3g}"


def _score(row: Mapping[str, Any]) -> str:
    after = row["score_after_2s"]
    return f"{1e3 * row['score']:.1f} / {'-' if after is None else f'{1e3 * after:.1f}'}"


def _control_table(records: Mapping[str, Any]) -> str:
    """Return a row for each lap and controller: distances from the finer chain, scores, changes of the torque."""
    control, chain = records["control"], f"chain, {study.ELEMENTS[1]} elements"
    plants = [plant for plant in dict.fromkeys(row["plant"] for row in control) if plant not in (DEFAULT, chain)]
    rows = []
    for lap, controller in dict.fromkeys((row["lap"], row["controller"]) for row in control):
        found = {row["plant"]: row for row in control if (row["lap"], row["controller"]) == (lap, controller)}
        own, truth = found[DEFAULT], found[chain]
        away = (_mm(found[plant]["rms"]) for plant in (DEFAULT, *plants))
        scores = f"{1e3 * own['score']:.1f}, {1e3 * truth['score']:.1f}"
        changes = f"{own['torque_change']:.3g}, {truth['torque_change']:.3g}"
        rows.append([lap, controller, *away, scores, changes])
    first, last = "default arm: from the chain, r.m.s. [mm]", "score on the default arm, on the chain [mm]"
    return table(["lap", "controller", first, *plants, last, "torque change there, r.m.s. [N m]"], rows)


def _damping_table(records: Mapping[str, Any]) -> str:
    rows = [
        [
            row["damping"],
            str(row["elements"]),
            _score(row),
            _mm(row.get("from_coarser")),
            f"{row['torque_change']:.3g}",
        ]
        for row in records["damping"]
    ]
    header = ("damping", "elements a link", "score [mm]: lap / after 2 s", "from the coarser one [mm]: r.m.s.")
    return table([*header, "torque change, r.m.s. [N m]"], rows)
