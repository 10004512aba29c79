"""Plain data -> Markdown tables."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from scripts.common.markdown import table

_NAMES = {"ifdc": "IFDC", "flsac": "FLSAC", "constant": "constant", "nmp": "NMP", "corrected": "corrected"}


def brief(value: Any) -> str:
    """A short text for a number, a list of numbers, or a dict of these."""
    if isinstance(value, dict):
        separator = "; " if any(isinstance(v, dict | list) for v in value.values()) else ", "
        return separator.join(
            f"{_NAMES.get(k, k.replace('_', ' '))} " + (f"{v:.3f}" if k.endswith("ratio") else brief(v))
            for k, v in value.items()
        )
    if isinstance(value, list):
        return " / ".join(brief(v) for v in value)
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.2g}" if 0.0 < abs(value) < 0.095 else f"{value:.2f}"
    return str(value)


def _shown(values: dict[str, Any]) -> str:
    return brief({k: v for k, v in values.items() if k != "under_condition"})


def verdicts(rows: Sequence[dict[str, Any]], titles: dict[str, str]) -> str:
    """The verdicts at a glance."""
    return table(
        ["claim", "the paper says", "verdict", *titles.values()],
        [
            [
                r["id"],
                r["quote"],
                f"**{r['verdict']}**" + (f" ({r['condition']})" if r["condition"] else ""),
                *("holds" if r["holds"][c] else "fails" for c in titles),
            ]
            for r in rows
        ],
    )


def claims(rows: Sequence[dict[str, Any]], titles: dict[str, str]) -> str:
    """Each claim with its measure and the figures of every column."""
    text = ""
    for r in rows:
        text += f"\n### {r['id']}: {r['verdict']}\n\n> {r['quote']}\n\n*Measure:* {r['measure']}.\n"
        if r["condition"]:
            text += f"\n*Condition:* {r['condition']}.\n"
        if r["note"]:
            text += f"\n*Note:* {r['note']}\n"
        body = [[titles[c], "holds" if r["holds"][c] else "fails", _shown(r["values"][c])] for c in titles]
        gains = r["constant_gain"]
        for c, found in gains.get("equal_to_mean_of_flsac", {}).items():
            verdict = "holds" if found["holds"] else "fails"
            body.append([f"constant gain, FLSAC's mean: {titles[c]}", verdict, _shown(found["values"])])
        text += "\n" + table(["arm", "", "figures"], body)
        if "merit_of_flsac" in gains:
            up_to_1, of_all = gains["best_up_to_1"], gains["best_of_all"]
            text += (
                f"\nConstant gains on the paper's arm by this measure (worst of the cases; smaller is better), out of "
                f"{len(gains['gains_tried'])} tried: best up to 1 is {up_to_1['gain']:g} with {up_to_1['merit']:.3g}, "
                f"best of all {of_all['gain']:g} with {of_all['merit']:.3g}; FLSAC has {gains['merit_of_flsac']:.3g}.\n"
            )
    return text.lstrip("\n")


def numbers(rows: Sequence[dict[str, Any]]) -> str:
    """The paper's numbers beside ours."""
    return table(
        ["quantity", "unit", "source", "paper", "ours", "note"],
        [[r["name"], r["unit"], r["source"], f"{r['paper']:.6g}", f"{r['ours']:.6g}", r["note"]] for r in rows],
    )


def runs(summary: dict[str, dict[str, dict[str, Any]]], column: str) -> str:
    """The runs of one column; no clock times, so that the table is the same on every machine."""
    return table(
        [
            "run",
            "overshoot at the three switches [m]",
            "rigid tip r.m.s. / max [m]",
            "true tip r.m.s. / max [m]",
            "peak deflection [m]",
            "peak torque [N m]",
            "vibration [m/s]",
            "mean gain",
        ],
        [
            [
                name.replace("_", " "),
                " / ".join(f"{x:.2f}" for x in r["rigid_overshoot"]) if name.endswith("tip") else "(circle)",
                f"{r['rigid_tip_rms']:.2f} / {r['rigid_tip_max']:.2f}",
                f"{r['true_tip_rms']:.2f} / {r['true_tip_max']:.2f}",
                " / ".join(f"{x:.2f}" for x in r["peak_deflection"]),
                " / ".join(f"{x:.0f}" for x in r["peak_torque"]),
                f"{r['vibration']:.2f}",
                f"{r['mean_gain']:.2f}",
            ]
            for name, r in summary[column].items()
        ],
    )


def sensitivity(rows: Sequence[dict[str, Any]]) -> str:
    """Alternative readings of the law, NMP case, sensor at the end effector."""
    chosen = [r for r in rows if r["sweep"] in ("alternatives", "current_jacobian", "elbow_branch")]
    return table(
        ["reading", "controller", "overshoot top left [m]", "rigid tip r.m.s. [m]", "true tip r.m.s. [m]", "run"],
        [
            [
                r["value"],
                _NAMES[r["controller"]],
                *(
                    [
                        f"{r['rigid_overshoot'][0]:.2f}",
                        f"{r['rigid_tip_rms']:.2f}",
                        f"{r['true_tip_rms']:.2f}",
                        "whole lap",
                    ]
                    if r["ended"] == "truncated"
                    else ["", "", "", "unstable"]
                ),
            ]
            for r in chosen
        ],
    )


def sweep(rows: Sequence[dict[str, Any]], name: str, label: str) -> str:
    """One sweep over a number, sensor at the end effector and 0.5 m from the elbow."""

    def cell(row: dict[str, Any]) -> str:
        """What is compared at the run's sensor place."""
        if row["ended"] != "truncated":
            return "unstable"  # when it stops hangs on the last digit; sweeps.json has the time
        if row["place"] == "elbow":
            return f"{row['vibration']:.2f}"
        return f"{row['rigid_overshoot'][0]:.2f} / {row['true_tip_rms']:.2f}"

    chosen = [r for r in rows if r["sweep"] == name]
    columns = list(dict.fromkeys((r["arm"], r["sensing"], r["place"]) for r in chosen))
    several_arms = len({arm for arm, *_ in columns}) > 1
    head = [
        (arm if several_arms else _NAMES.get(sensing, sensing))
        + (", tip: overshoot / true r.m.s. [m]" if place == "tip" else ", elbow: vibration [m/s]")
        for arm, sensing, place in columns
    ]
    values = list(dict.fromkeys(r["value"] for r in chosen))
    at = {(r["value"], r["arm"], r["sensing"], r["place"]): cell(r) for r in chosen}
    return table([label, *head], [[f"{v:g}", *(at.get((v, *c), "") for c in columns)] for v in values])
