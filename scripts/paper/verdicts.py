"""Claims over all columns: the verdicts, and what constant gains do by the same measures."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from scripts.paper.cases import COLUMNS
from scripts.paper.checks import Differences, Finding, Measures
from scripts.paper.claims import ANY, CLAIMS, Claim


def verdict(claim: Claim, findings: dict[str, Finding]) -> tuple[str, str]:
    """Return the verdict and the condition under which it stands."""
    own = findings["paper"]
    failing = [COLUMNS[name].title for name, finding in findings.items() if not finding.holds]
    if own.holds and not failing:
        return "reproduced", ""
    if own.holds:
        return "reproduced under condition", f"not for: {'; '.join(failing)}"
    if claim.condition and own.values.get("under_condition"):
        return "reproduced under condition", claim.condition
    return "not reproduced", ""


def decide(
    table: Mapping[str, Measures], differences: Mapping[str, Differences], sweep: list[dict[str, Any]]
) -> list[dict[str, Any]]:
    """Decide all claims, as rows of claims.json, from measures by column and case name.

    `sweep` has the rows of the sweep "constant_gain" (the paper's arm); it may be empty.
    """
    rows = []
    for claim in CLAIMS:
        findings = {name: claim.find(table[name], differences[name], "flsac") for name in table}
        decided, condition = verdict(claim, findings)
        gains = _constant_gains(claim, table, differences, sweep) if ANY in claim.controllers else {}
        rows.append(
            {name: getattr(claim, name) for name in ("id", "quote", "measure")}
            | {
                "values": {name: finding.values for name, finding in findings.items()},
                "verdict": decided,
                "condition": condition,
                "note": claim.note,
                "holds": {name: finding.holds for name, finding in findings.items()},
                "one_side": _on_one_side(claim, table, differences),
                "constant_gain": gains,
            }
        )
    return rows


def _on_one_side(claim: Claim, table: Mapping[str, Measures], differences: Mapping[str, Differences]) -> dict[str, Any]:
    """Decide the claim without the runs whose elbow changes sides in the part of the lap that it looks at."""
    found = {name: claim.find_on_one_side(table[name], differences[name], "flsac") for name in table}
    decided = {name: finding for name, (finding, _) in found.items() if finding is not None}
    word, condition = verdict(claim, decided) if "paper" in decided else ("undecided", "")
    if word == "reproduced" and len(decided) < len(table):
        word = "reproduced where decided"
    return {
        "verdict": word,
        "condition": condition,
        "columns": {
            name: {
                "holds": finding.holds if finding else None,
                "values": finding.values if finding else {},
                "runs": kept,
                "of": len(claim.runs("flsac")),
            }
            for name, (finding, kept) in found.items()
        },
    }


def _constant_gains(
    claim: Claim, table: Mapping[str, Measures], differences: Mapping[str, Differences], sweep: list[dict[str, Any]]
) -> dict[str, Any]:
    """Decide the same sentence for constant gains: FLSAC's mean in each column, and the best of the sweep's."""
    mean = {name: claim.find(table[name], differences[name], "constant") for name in table}
    result: dict[str, Any] = {
        "equal_to_mean_of_flsac": {
            name: {"holds": finding.holds, "values": finding.values} for name, finding in mean.items()
        }
    }
    own = claim.find(table["paper"], differences["paper"], "flsac")
    by_gain: dict[float, dict[str, dict[str, Any]]] = {}
    for row in sweep:
        by_gain.setdefault(row["value"], {})[f"constant_{row['sensing']}_{row['place']}"] = row
    found = {
        gain: claim.find({**table["paper"], **rows}, differences["paper"], "constant").merit
        for gain, rows in by_gain.items()
    }
    merits = {gain: merit for gain, merit in found.items() if merit is not None and np.isfinite(merit)}
    if merits and own.merit is not None:
        result["merit_of_flsac"] = own.merit
        # up to 1 is what FLSAC with K_s = 1 may use
        for name, top in (("best_up_to_1", 1.0), ("best_of_all", max(merits))):
            best = min((gain for gain in merits if gain <= top), key=lambda gain: merits[gain])
            result[name] = {"gain": best, "merit": merits[best]}
        result["gains_tried"] = sorted(found)
        result["ended_early"] = sorted(set(found) - set(merits))
    return result
