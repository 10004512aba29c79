"""Error of the integration step against its cost: the tip after a second of random torques, by steps in a period.

Torques are drawn uniformly within the limits, held for 50 ms and the same for every step; the finest step is exact. The
environments choose the fewest steps whose expected error (`flexarm_env.simulation.step_error`) is 0.1 mm.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexarm_env import ArmParameters, FlexibleArm
from flexarm_env.actions import TORQUE_LIMIT
from flexarm_env.envs.settings import Settings as EnvSettings
from flexarm_env.simulation.step_error import HELD, SECONDS, TOLERANCE
from scripts.common.markdown import table
from scripts.validation.checks import Check, Findings, Settings, shown

Array = NDArray[np.float64]
PERIOD, SEED = 0.01, 20081
EPISODES, QUICK_EPISODES = 200, 8
COUNTS = (4, 5, 7, 10, 14, 20, 28)  # steps in a period
FINER = 4  # the solution that counts as exact has so many times the steps of the finest
STABLE = 2.0  # h omega, above which the environments refuse a step
SCATTER = 3.0  # of medians about what the linear arm predicts, times the tolerance


class Case(NamedTuple):
    """An arm and the torques that drive it."""

    name: str
    parameters: ArmParameters
    limits: tuple[float, float] = TORQUE_LIMIT


def cases() -> list[Case]:
    """Return the arms."""
    own = ArmParameters()
    one, two = own.flexural_rigidities
    stiff = replace(own, flexural_rigidities=(10.0 * one, 10.0 * two))
    strong = (10.0 * TORQUE_LIMIT[0], 10.0 * TORQUE_LIMIT[1])
    return [
        Case("default arm", own),
        Case("payload 2 kg", replace(own, payload_mass=2.0)),
        Case("undamped", replace(own, damping_ratio=0.0)),
        Case("10 times as stiff, 10 times the torque", stiff, strong),
        Case("linear arm", ArmParameters.linear()),
    ]


def run(settings: Settings) -> Findings:
    """Measure the errors of each arm."""
    rows: list[dict[str, Any]] = []
    for case in cases():
        settings.progress(case.name)
        rows.append(measured(case, QUICK_EPISODES if settings.quick else EPISODES))
    return Findings([_check(row) for row in rows], {}, {"rows": rows}, _quoted(rows))


def measured(case: Case, episodes: int) -> dict[str, Any]:
    """Return the errors of one arm: median and largest by steps in a period [m], and the environments' default."""
    how = EnvSettings.of({"arm": asdict(case.parameters), "torque_limit": case.limits}).integration
    least = int(np.ceil(PERIOD * FlexibleArm(case.parameters).fastest_rate() / STABLE))
    counts = sorted({count for count in (*COUNTS, how.substeps) if count >= least})
    errors = tip_errors(case.parameters, case.limits, counts, episodes, SEED)
    return {
        "arm": case.name,
        "default": how.substeps,
        "expected": how.expected_error,
        "counts": counts,
        "median": [float(np.median(errors[count])) for count in counts],
        "largest": [float(errors[count].max()) for count in counts],
    }


def tip_errors(
    parameters: ArmParameters, limits: tuple[float, float], counts: Sequence[int], episodes: int, seed: int
) -> dict[int, Array]:
    """Return how far the tip is from where a far shorter step takes it, after a second of random torques [m].

    Args:
        parameters: of the arm.
        limits: largest torques of shoulder and elbow [N m].
        counts: steps in a period, the most last.
        episodes: how many motions.
        seed: of the torques and of the elbow's angles at the start.

    Returns:
        Errors by the number of steps. Shape (episodes,) each.
    """
    arm, rng = FlexibleArm(parameters), np.random.default_rng(seed)
    start = np.zeros((episodes, 2 * arm.size))
    start[:, 1] = rng.uniform(-2.5, 2.5, episodes)
    drawn = rng.uniform(-1.0, 1.0, (episodes, round(SECONDS / HELD), 2)) * limits
    torques = np.repeat(drawn, round(HELD / PERIOD), axis=1)

    def tips(count: int) -> Array:
        states = arm.rollout(start, torques, period=PERIOD, step=PERIOD / count).states
        return arm.tip(states[:, -1, : arm.size])

    exact = tips(FINER * counts[-1])
    return {count: np.linalg.norm(tips(count) - exact, axis=1) for count in counts}


def tables(findings: Findings) -> dict[str, str]:
    """Errors by arm and steps; those of the default in bold."""
    lines = []
    for row in findings.records["rows"]:
        found = dict(zip(row["counts"], zip(row["median"], row["largest"], strict=True), strict=True))

        def cell(count: int, found: dict[int, Any] = found) -> str:
            if count not in found:
                return "refused"
            return " / ".join(shown(1e3 * error) for error in found[count])

        lines.append(
            [row["arm"], f"{row['default']} steps: {cell(row['default'])}", *(cell(count) for count in COUNTS)]
        )
    head = [f"{count} steps ({4 * count})" for count in COUNTS]
    return {"step_errors": table(("arm", "default [mm]", *head), lines)}


def _check(row: dict[str, Any]) -> Check:
    return Check(
        "steps",
        f"tip after a second of random torques, {row['arm']}, default step: median error",
        1e3 * row["median"][row["counts"].index(row["default"])],
        f"the default step is the longest whose expected error is {1e3 * TOLERANCE:g} mm; medians of random torques "
        "scatter about what the linear arm predicts",
        unit="mm",
        most=SCATTER * 1e3 * TOLERANCE,
    )


def _quoted(rows: list[dict[str, Any]]) -> dict[str, float]:
    """Median and largest error of the default steps [mm]."""
    quoted: dict[str, float] = {}
    for row in rows:
        at = row["counts"].index(row["default"])
        quoted |= {f"{row['arm']}, {what}": 1e3 * row[what][at] for what in ("median", "largest")}
        quoted[f"{row['arm']}, steps"] = float(row["default"])
    return quoted
