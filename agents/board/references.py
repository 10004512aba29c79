"""What entries are compared with: the best plans known, which play the part of an oracle."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from flexarm_agents.board.summary import nominal_errors
from flexarm_baselines.optimal.plan import PLANS
from flexarm_env.laps import LAPS
from flexarm_env.metrics import optimality_gap

YARDSTICK = "ifdc"


def references() -> dict[str, dict[str, float]]:
    """Return the errors of the best plan known for each lap of the default arm [m]."""
    found = {}
    for lap in LAPS:
        score = json.loads((PLANS / f"default_{lap}.json").read_text())["score"]
        found[lap] = {"rms": score["true_tip_rms"], "rms_after_2s": score["true_tip_rms_after_2s"]}
    return found


def gap(results: Mapping[str, Any], lap: str, rms: float) -> float | None:
    """Return where an error lies between the best plan's, 0, and the yardstick's, 1; None without the yardstick."""
    for entry in results["rows"]:
        if entry["name"] == YARDSTICK:
            errors = nominal_errors(entry)[lap]
            if errors is not None:
                return optimality_gap(rms, results["references"][lap]["rms"], errors["rms"])
    return None
