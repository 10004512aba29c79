"""Tables of the comparison with MuJoCo's chain, for the docs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from scripts.common.markdown import table
from scripts.validation.checks import Findings
from scripts.validation.engine.validity import FASTEST, FIRST_CLAMPED


def tables(findings: Findings) -> dict[str, str]:
    """For the docs: errors at 4 %, their parts, limits, spin, the square."""
    records = findings.records
    return {
        "engine_errors": _error_table(records),
        "engine_parts": _part_table(records),
        "engine_limits": _limit_table(records),
        "engine_spins": _spin_table(records),
        "engine_square": _square_table(records),
    }


def _labels(records: Mapping[str, Any]) -> list[str]:
    return list(dict.fromkeys(row["model"] for row in records["errors"]))


def _mm(value: float | None) -> str:
    return "" if value is None else f"{1e3 * value:.2g}" if value < 0.1 else f"{1e3 * value:.0f}"


def _both(row: dict[str, Any]) -> str:
    return f"{_mm(row['rms'])} / {_mm(row['maximum'])}"


def _error_table(records: Mapping[str, Any]) -> str:
    rows = records["convergence"]
    programmes = [row["programme"] for row in rows]
    header = ["tip [mm]: r.m.s. / largest; angles [mrad]", *(name.replace("_", " ") for name in programmes)]
    finest = [max(row["tip"], key=int) for row in rows]
    lines = [
        ["largest deflection / length", *(f"{100.0 * row['bend']:.1f} %" for row in rows)],
        [
            f"the chain, {finest[0]} elements: largest; angles low-passed / raw",
            *(
                f"{_mm(row['tip'][n])}; {_mm(row['low_passed_angles'])} / {_mm(row['angles'])}"
                for row, n in zip(rows, finest, strict=True)
            ),
        ],
    ]
    for label in _labels(records):
        found = [error_of(records, name, label) for name in programmes]
        lines.append([label, *(f"{_both(row)}; {_mm(row['angles'])}" for row in found)])
    return table(header, lines)


def _part_table(records: Mapping[str, Any]) -> str:
    programmes = [row["programme"] for row in records["convergence"]]
    header = ["truncation + rest [mm], order", *(name.replace("_", " ") for name in programmes)]
    by_key = {(row["programme"], row["model"]): row for row in records["parts"]}
    rows = []
    for label in _labels(records):
        found = [by_key.get((name, label)) for name in programmes]
        cells = ["" if r is None else f"{_mm(r['first_order'])} + {_mm(r['rest'])}, {r['order']:.1f}" for r in found]
        rows.append([label, *cells])
    return table(header, rows)


def _limit_table(records: Mapping[str, Any]) -> str:
    names = [name for name in records["limits"][0] if name != "model"]

    def cell(limit: float | None, name: str) -> str:
        tried = records["tried"].get(name.rsplit(", ", 1)[0], 0.0)
        return f"> {floored(100.0 * tried)} %" if limit is None else f"{100.0 * limit:.2g} %"

    rows = [[row["model"], *(cell(row[name], name) for name in names)] for row in records["limits"]]
    return table(["deflection / length", *names], rows)


def floored(value: float) -> str:
    """One decimal, not rounded up."""
    return f"{int(10.0 * value) / 10.0:.1f}"


def _spin_table(records: Mapping[str, Any]) -> str:
    names = [name for name in records["spins"][0] if name != "model"]
    rows = [
        [row["model"], *(f"> {FASTEST:g}" if row[n] is None else f"{row[n]:.2g}" for n in names)]
        for row in records["spins"]
    ]
    return table([f"spin / {FIRST_CLAMPED:.2f} rad/s", *names], rows)


def _square_table(records: Mapping[str, Any]) -> str:
    header = (
        "tip on the square [mm]",
        "who drives",
        "from the chain: r.m.s. / largest",
        "from the chain with 1 % of every mode",
        "score: lap / after 2 s",
        "torque change [N m]",
        "kinematics alone",
        "0.5 s ahead",
    )
    rows = []
    for row in records["square"]:
        alone = [
            f"{_mm(row[n]['rms'])} / {_mm(row[n]['maximum'])}" if n in row else "" for n in ("kinematics", "ahead")
        ]
        score = f"{1e3 * row['score']:.1f} / " + (
            "" if row["score_after_2s"] is None else f"{1e3 * row['score_after_2s']:.1f}"
        )
        away = "" if row["model"] == "chain" else f"{_mm(row['rms'])} / {_mm(row['maximum'])}"
        modal = f"{_mm(row['modal']['rms'])} / {_mm(row['modal']['maximum'])}" if "modal" in row else ""
        change = f"{row['torque_change']:.3g}" if "torque_change" in row else ""
        rows.append([row["model"], row["driver"], away, modal, score, change, *alone])
    return table(header, rows)


def error_of(records: Mapping[str, Any], programme: str, label: str, amplitude: float = 1.0) -> dict[str, Any]:
    """Find the row of a programme, a model's label, and an amplitude."""
    return next(
        row
        for row in records["errors"]
        if (row["programme"], row["model"], row["amplitude"]) == (programme, label, amplitude)
    )
