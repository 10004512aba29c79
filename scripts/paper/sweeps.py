"""What the paper leaves open, varied: gains, scales, and the alternative readings of its law."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from flexarm_baselines import FLSAC, IFDC
from flexarm_env import FlexibleArm
from flexarm_env.physics.damping import unit_damping
from scripts.paper.cases import COLUMNS, PLACES, SENSINGS, Case, Column, Study, simulate
from scripts.paper.measures import measures

GAINS = (0.05, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 1.0, 1.5, 2.0, 3.0, 5.0)
OUTPUT_SCALES = (1.0, 2.0, 3.0, 4.0, 6.0, 10.0, 14.0, 20.0)
NORMALISERS = (0.2, 1.0, 5.0)
WIDTH_SCALES = (0.75, 1.0, 2.0, 5.0)
TRUE_TIP_GAINS = (0.02, 0.03, 0.04, 0.06, 0.1, 0.2, 0.5, 1.0)
TRUE_TIP_DAMPING = (0.0, 0.01, 0.03)
SHORT_DELAY = 1.2e-3  # [s]
COMMON: dict[str, Any] = {"delay": None, "delayed": "position"}  # options unless a run has others


@dataclass(frozen=True)
class Run:
    """One run of a sweep.

    Attributes:
        value: what is varied, a number or a name.
        case: the case.
        policy: "ifdc", or options of FLSAC.
        gain: lambda at action 1.
        options: further options of the environment.
    """

    value: float | str
    case: Case
    policy: str | dict[str, Any]
    gain: float = 1.0
    options: dict[str, Any] = field(default_factory=dict)


def _over(values: Sequence[float], cases: Sequence[Case], make: Callable[[float, Case], dict[str, Any]]) -> list[Run]:
    return [Run(v, case, **make(v, case)) for v in values for case in cases]


def _constant_gain() -> list[Run]:
    cases = [Case("constant", sensing, place) for place in PLACES for sensing in SENSINGS]
    return _over(GAINS, cases, lambda v, _: {"policy": "ifdc", "gain": v})


def _output_scale() -> list[Run]:
    cases = [Case("flsac", sensing, "tip") for sensing in SENSINGS] + [Case("flsac", "nmp", "elbow")]
    return _over(OUTPUT_SCALES, cases, lambda v, _: {"policy": {}, "gain": v})


def _normaliser() -> list[Run]:
    cases = [Case("flsac", sensing, place) for place in PLACES for sensing in ("collocated", "nmp")]
    return _over(NORMALISERS, cases, lambda v, _: {"policy": {"K_n": v}})


def _width_scale() -> list[Run]:
    cases = [Case("flsac", sensing, place) for place in PLACES for sensing in ("collocated", "nmp")]
    return _over(WIDTH_SCALES, cases, lambda v, _: {"policy": {"K_s": v, "scale": "width"}})


def _alternatives(kind: str) -> list[Run]:
    """List the runs with other readings of the law than the one adopted, with the end effector's sensor."""
    runs = []
    for controller in ("ifdc", "flsac"):
        policy: str | dict[str, Any] = "ifdc" if controller == "ifdc" else {}
        nmp = Case(controller, "nmp", "tip")
        variants: dict[str, dict[str, Any]] = {
            "adopted reading": {},
            "command delayed per joint": {"compensation": "per_joint"},
            "rates delayed too": {"delayed": "position+rate"},
            "rates delayed too, by 1.2 ms only": {"delayed": "position+rate", "delay": SHORT_DELAY},
        }
        if kind == "current":
            variants = {"rates through the current Jacobian": {}}
        runs += [Run(name, nmp, policy, options=options) for name, options in variants.items()]
    return runs


def _true_tip(delay: str) -> list[Run]:
    """List the runs of the law on the physical tip; undelayed, or late by the wave's travel."""
    case = Case("constant", "nmp", "tip")
    options = {"sensor": "true", "delay": 0.0 if delay == "none" else None}
    return [Run(v, case, "ifdc", v, options) for v in TRUE_TIP_GAINS]


def _columns_for_true_tip(damping: Sequence[float] = TRUE_TIP_DAMPING) -> dict[str, Column]:
    base = COLUMNS["complete"]
    clamped = unit_damping(base.arm).clamped_ratio  # zeta is that of the clamped modes
    return {
        f"zeta {zeta:g}": Column(base.title, dataclasses.replace(base.arm, damping_ratio=zeta / clamped))
        for zeta in damping
    }


# name -> arms, and the runs made with each
SWEEPS: dict[str, tuple[dict[str, Column], list[Run]]] = {
    "constant_gain": ({"paper": COLUMNS["paper"]}, _constant_gain()),
    "K_s": ({"paper": COLUMNS["paper"]}, _output_scale()),
    "K_n": ({"paper": COLUMNS["paper"]}, _normaliser()),
    "width_scale": ({"paper": COLUMNS["paper"]}, _width_scale()),
    "alternatives": ({"paper": COLUMNS["paper"]}, _alternatives("plain")),
    "current_jacobian": ({"paper": COLUMNS["paper"]}, _alternatives("current")),
    "true_tip_feedback": (_columns_for_true_tip(), _true_tip("none")),
    "late_true_tip_feedback": (_columns_for_true_tip((0.01,)), _true_tip("wave")),
}


def run_sweep(study: Study, name: str) -> list[dict[str, Any]]:
    """Make a sweep's runs.

    Returns:
        A row for each run: sweep, arm, value, controller, sensing, place, and the run's `measures`.
    """
    columns, runs = SWEEPS[name]
    rows = []
    for arm_name, column in columns.items():
        arm = study.arm(column)
        policies = _policies(study, arm, runs)
        options = [COMMON | run.case.options | {"gain_limit": run.gain} | run.options for run in runs]
        jacobian = "current" if name == "current_jacobian" else "delayed"
        trajectories = simulate(study, column, options, policies, rate_jacobian=jacobian)
        for run, trajectory in zip(runs, trajectories, strict=True):
            head = {"sweep": name, "arm": arm_name, "value": run.value, **dataclasses.asdict(run.case)}
            rows.append(head | measures(trajectory, study.lap_time))
    return rows


def _policies(study: Study, arm: FlexibleArm, runs: Sequence[Run]) -> list[Any]:
    """One object for equal policies, so that a batch predicts them together."""
    made: dict[str, IFDC | FLSAC] = {}
    for run in runs:
        key = str(run.policy)
        if key not in made:
            made[key] = IFDC() if isinstance(run.policy, str) else study.fuzzy(arm, **run.policy)
    return [made[str(run.policy)] for run in runs]
