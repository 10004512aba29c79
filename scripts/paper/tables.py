"""Plain data -> Markdown tables."""

from collections.abc import Sequence
from typing import Any

from scripts.common.markdown import table
from scripts.paper.cases import COLUMNS
from scripts.paper.measures import least_along
from scripts.paper.numbers import numbers as printed_numbers
from scripts.paper.sweep_figures import TIP_SWEEPS

TITLES = {name: column.title for name, column in COLUMNS.items()}
SWEEP_LABELS = {
    "constant_gain": "constant gain lambda",
    "K_s": "output scale K_s",
    "K_n": "normaliser K_n",
    "width_scale": "K_s as width scale of the input sets",
}
KEPT = " °"  # after the figures of a lap whose elbow keeps its side
_NAMES = {"ifdc": "IFDC", "flsac": "FLSAC", "constant": "constant", "nmp": "NMP", "corrected": "corrected"}


def everything(
    found: dict[str, dict[str, dict[str, Any]]], rows: Sequence[dict[str, Any]], decided: Sequence[dict[str, Any]]
) -> dict[str, str]:
    """Return all tables and paragraphs, by the names of the blocks that show them.

    They are made of measures by column and case, and of rows of the sweeps and of claims.json, if there are any.
    """
    texts = {f"summary_{column}": runs(found, column) for column in found}
    texts |= {"reach": reach(found["paper"]), "numbers": numbers()}
    if rows:
        texts["sensitivity"] = sensitivity(rows)
        labels = SWEEP_LABELS | dict.fromkeys(TIP_SWEEPS, "constant gain lambda")
        texts |= {f"sweep_{name}": sweep(rows, name, label) for name, label in labels.items()}
    if decided:
        texts |= {"verdicts_one_side": one_side(decided), "elbow_claim": elbow_claim(found), "claims": claims(decided)}
    return texts


def brief(value: Any) -> str:
    """Write a short text for a number, a list of numbers, or a dict of these."""
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


def one_side(rows: Sequence[dict[str, Any]]) -> str:
    """Tabulate the verdicts from all runs, and from those whose elbow keeps its side."""

    def cell(found: dict[str, Any]) -> str:
        word = {True: "holds", False: "fails", None: "undecided"}[found["holds"]]
        return f"{word} ({len(found['runs'])} of {found['of']} runs)"

    body = []
    for r in rows:
        own = r["one_side"]
        condition = f" ({own['condition']})" if own["condition"] else ""
        cells = (cell(own["columns"][c]) for c in TITLES)
        body.append([r["id"], r["verdict"], f"**{own['verdict']}**{condition}", *cells])
    return table(["claim", "from all runs", "from runs whose elbow keeps its side", *TITLES.values()], body)


def elbow_changes(row: dict[str, Any]) -> str:
    """Write when the elbow changes sides [s], or how often if that is more than four times."""
    times = row["elbow_changes"]
    if len(times) > 4:
        return f"{len(times)} times"
    return ", ".join(f"{t:.1f}" for t in times) or "never"


def elbow_claim(found: dict[str, dict[str, dict[str, Any]]]) -> str:
    """Write how many of the paper's runs keep their elbow on its side, as a paragraph."""
    laps = {
        (column, name): row["elbow_changes"]
        for column, named in found.items()
        for name, row in named.items()
        if not name.startswith("constant") and not row["ended_early"]
    }
    at_tip = {key: times for key, times in laps.items() if key[1].endswith("_tip")}
    counts = [len(times) for key, times in laps.items() if key not in at_tip]
    kept = [f"{name.replace('_', ' ')}, {TITLES[column]}" for (column, name), times in at_tip.items() if not times]
    keeping = f"{len(kept)}: {'; '.join(kept)}" if kept else "none"
    text = f"Of the {len(at_tip)} laps with the sensor at the end effector, the elbow keeps its side in {keeping}."
    if counts:
        text += f"\nWith the sensor near the elbow it changes sides {min(counts)} to {max(counts)} times a lap.\n"
    return text


def ended_early(row: dict[str, Any]) -> str:
    """Write why a run ended; when it did depends on the last digit, and sweeps.json has it."""
    return f"ended early: {row['ended']}"


def reach(found: dict[str, dict[str, Any]]) -> str:
    """Tabulate overshoots of one column's runs, and where the arm's reach lets the tip be so far past a corner."""

    def cell(values: Sequence[float]) -> str:
        return " / ".join(f"{v:.2f}" for v in values)

    body = []
    for name, row in found.items():
        if name.endswith("_tip") and not row["ended_early"]:
            over, along = row["rigid_overshoot"], row["rigid_overshoot_along"]
            body.append([name.replace("_", " "), *map(cell, (over, [*map(least_along, over)], along))])
    places = (f"distance along the next side, {what} [m]" for what in ("at least", "measured"))
    return table(["run", "overshoot at the three switches [m]", *places], body)


def claims(rows: Sequence[dict[str, Any]]) -> str:
    """Tabulate each claim's sentence, verdict, measure and figures on the paper's arm; claims.json has all."""
    body = []
    for r in rows:
        measure = ". ".join(text.rstrip(".") for text in (r["measure"], r["note"]) if text)
        shown = {name: value for name, value in r["values"]["paper"].items() if name != "under_condition"}
        body.append([r["id"], r["quote"], _verdict(r), measure, brief(shown)])
    return table(("claim", "the paper's sentence", "verdict", "measure", "figures on the paper's arm"), body)


def _verdict(r: dict[str, Any]) -> str:
    """Write a verdict, its condition, and on which arms the claim fails; if it is not reproduced, on which it holds."""
    reading = "" if r["holds"]["paper"] else r["condition"]
    met = [c for c in TITLES if r["holds"][c] or (reading and r["values"][c].get("under_condition"))]
    word, arms = ("fails", [c for c in TITLES if c not in met]) if "paper" in met else ("holds", met)
    on = f"{word} on: {'; '.join(TITLES[c] for c in arms)}" if arms else ""
    details = "; ".join(filter(None, (reading, on)))
    return f"**{r['verdict']}**" + (f" ({details})" if details else "")


def numbers() -> str:
    """Tabulate the paper's numbers beside ours."""
    rows = ((n.name, n.unit, n.source, f"{n.paper:.6g}", f"{n.ours:.6g}", n.note) for n in printed_numbers())
    return table(["quantity", "unit", "source", "paper", "ours", "note"], rows)


def runs(summary: dict[str, dict[str, dict[str, Any]]], column: str) -> str:
    """Tabulate the runs of one column, without clock times, so that the table is the same on every machine."""
    head = [
        "run",
        "overshoot at the three switches [m]",
        "rigid tip r.m.s. / max [m]",
        "true tip r.m.s. / max [m]",
        "peak deflection [m]",
        "peak torque [N m]",
        "vibration [m/s]",
        "mean gain",
        "elbow changes sides at [s]",
    ]
    body = []
    for name, r in summary[column].items():
        cells = [ended_early(r), *[""] * (len(head) - 3)] if r["ended_early"] else _figures_of_run(name, r)
        body.append([name.replace("_", " "), *cells, elbow_changes(r)])
    return table(head, body)


def _figures_of_run(name: str, r: dict[str, Any]) -> list[str]:
    return [
        " / ".join(f"{x:.2f}" for x in r["rigid_overshoot"]) if name.endswith("tip") else "(circle)",
        f"{r['rigid_tip_rms']:.2f} / {r['rigid_tip_max']:.2f}",
        f"{r['true_tip_rms']:.2f} / {r['true_tip_max']:.2f}",
        " / ".join(f"{x:.2f}" for x in r["peak_deflection"]),
        " / ".join(f"{x:.0f}" for x in r["peak_torque"]),
        f"{r['vibration']:.2f}",
        f"{r['mean_gain']:.2f}",
    ]


def sensitivity(rows: Sequence[dict[str, Any]]) -> str:
    """Tabulate alternative readings of the law, NMP case, sensor at the end effector."""
    chosen = [r for r in rows if r["sweep"] in ("alternatives", "current_jacobian", "elbow_branch")]

    def cells(r: dict[str, Any]) -> list[str]:
        if r["ended_early"]:
            return ["", "", "", "", ended_early(r)]
        figures = (r["rigid_overshoot"][0], r["rigid_tip_rms"], r["true_tip_rms"])
        return [*(f"{x:.2f}" for x in figures), elbow_changes(r), "whole lap"]

    head = ["reading", "controller", "overshoot top left [m]", "rigid tip r.m.s. [m]", "true tip r.m.s. [m]"]
    return table(
        [*head, "elbow changes sides at [s]", "run"], [[r["value"], _NAMES[r["controller"]], *cells(r)] for r in chosen]
    )


def sweep(rows: Sequence[dict[str, Any]], name: str, label: str) -> str:
    """Tabulate a sweep over a number, both places of the sensor; `KEPT` marks elbows that keep their side."""

    def cell(row: dict[str, Any]) -> str:
        """Return what is compared at the run's sensor place."""
        if row["ended_early"]:
            return ended_early(row)
        if row["place"] == "elbow":
            return f"{row['vibration']:.2f}"
        kept = "" if row["elbow_changes"] else KEPT
        return f"{row['rigid_overshoot'][0]:.2f} / {row['true_tip_rms']:.2f}{kept}"

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
