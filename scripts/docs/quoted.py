"""The figures that texts of docs/ quote: what the expressions before them may use."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from scripts.common.markdown import span


def of_validation(record: dict[str, Any]) -> dict[str, Any]:
    """Return the figures of the pages that quote the validation, from the content of docs/validation.json.

    Returns:
        The quoted figures of each group of checks, by the group's name; `orders`: of the energy's drift by the step;
        `span`; `engine` takes a pattern, too: `engines("doublet, linear, {} modes, rms", 2, 3)`; `checks`: how many;
        `planned`: distance from the chain under gentle feedback along the plan [mm].
    """
    quoted = {name: group["quoted"] for name, group in record["groups"].items()}
    engine = quoted["engine"]

    def engines(pattern: str, *parts: object) -> list[float]:
        return [engine[pattern.format(part)] for part in parts]

    def planned(lap: str, model: str, what: str = "rms") -> str:
        return f"{quoted['plant'][f'{lap}, plan with gentle feedback, {model}, {what}']:.1f}"

    return {
        **quoted,
        "engines": engines,
        "orders": [check["figure"] for check in record["checks"] if "that furthest from 5" in check["name"]],
        "planned": planned,
        "checks": len(record["checks"]),
        "span": span,
    }


def of_reproduction(results: Path) -> dict[str, Any]:
    """Return the figures of docs/reproduction.md, as functions that name a run and return a text.

    Returns:
        `claims`: how many have a verdict, or how many there are; `over` and `rms`: overshoot and r.m.s. error [m] of a
        run; `three`: a controller's overshoots by sensing; `swept`: a figure of a sweep's row; `mean_gain`:
        of a run; `modal`: span of IFDC's modal coordinates.
    """
    runs = json.loads((results / "summary.json").read_text())["runs"]
    rows = json.loads((results / "sweeps.json").read_text())
    verdicts = [claim["verdict"] for claim in json.loads((results / "claims.json").read_text())]

    def claims(verdict: str = "") -> int:
        return verdicts.count(verdict) if verdict else len(verdicts)

    def over(name: str, column: str = "paper") -> str:
        return f"{runs[column][name]['rigid_overshoot'][0]:.2f}"

    def rms(name: str, tip: str = "true") -> str:
        return f"{runs['paper'][name][f'{tip}_tip_rms']:.2f}"

    def three(controller: str) -> str:
        return " / ".join(over(f"{controller}_{sensing}_tip") for sensing in ("collocated", "nmp", "corrected"))

    def swept(sweep: str, value: object, key: str, sensing: str = "collocated", **other: str) -> str:
        wanted = {"sweep": sweep, "value": value, "sensing": sensing, "place": "tip"} | other
        (row,) = [row for row in rows if all(row[name] == one for name, one in wanted.items())]
        return f"{row[key][0] if isinstance(row[key], list) else row[key]:.2f}"

    def constant(gain: float, key: str, sensing: str = "collocated") -> str:
        return swept("constant_gain", gain, key, sensing)

    def of_run(key: str) -> Callable[..., str]:
        return lambda name: f"{runs['paper'][name][key]:.2f}"

    modal = [runs["paper"][f"ifdc_{sensing}_tip"]["peak_deflection"][0] / 0.2 for sensing in ("collocated", "nmp")]
    return {
        "claims": claims,
        "over": over,
        "rms": rms,
        "three": three,
        "swept": swept,
        "constant": constant,
        "mean_gain": of_run("mean_gain"),
        "vibration": of_run("vibration"),
        "modal": span(modal),
    }
