"""What the paper leaves open, varied: gains, scales, and the alternative readings of its law."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from flexarm_baselines import FLSAC, IFDC
from flexarm_env import FlexibleArm
from flexarm_env.physics.damping import unit_damping
from scripts.paper.cases import COLUMNS, Case, Column, Study, all_cases, simulate
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
    """One run of a sweep."""

    value: float | str  # what is varied, a number or a name
    case: Case
    policy: str | dict[str, Any]  # "ifdc", or options of FLSAC
    gain: float = 1.0  # lambda at action 1
    options: dict[str, Any] = field(default_factory=dict)  # further ones of the environment


def _alternatives(readings: dict[str, dict[str, Any]]) -> list[Run]:
    """List the runs with readings of the law, the end effector's sensor, and each controller."""
    policies: dict[str, str | dict[str, Any]] = {"ifdc": "ifdc", "flsac": {}}
    return [
        Run(name, Case(controller, "nmp", "tip"), policy, options=options)
        for controller, policy in policies.items()
        for name, options in readings.items()
    ]


def _true_tip(delay: float | None) -> list[Run]:
    """List the runs of the law on the physical tip; None: late by the wave's travel."""
    case, options = Case("constant", "nmp", "tip"), {"sensor": "true", "delay": delay}
    return [Run(v, case, "ifdc", v, options) for v in TRUE_TIP_GAINS]


def _columns_for_true_tip(damping: Sequence[float] = TRUE_TIP_DAMPING) -> dict[str, Column]:
    base = COLUMNS["complete"]
    clamped = unit_damping(base.arm).clamped_ratio  # zeta is that of the clamped modes
    return {
        f"zeta {zeta:g}": Column(base.title, dataclasses.replace(base.arm, damping_ratio=zeta / clamped))
        for zeta in damping
    }


READINGS: dict[str, dict[str, Any]] = {  # of the law
    "adopted reading": {},
    "command delayed per joint": {"compensation": "per_joint"},
    "rates delayed too": {"delayed": "position+rate"},
    "rates delayed too, by 1.2 ms only": {"delayed": "position+rate", "delay": SHORT_DELAY},
}
PAPER, LATE = {"paper": COLUMNS["paper"]}, all_cases(["flsac"], ("collocated", "nmp"))
SCALED = [*all_cases(["flsac"], places=["tip"]), Case("flsac", "nmp", "elbow")]
# name -> arms, and the runs made with each
SWEEPS: dict[str, tuple[dict[str, Column], list[Run]]] = {
    "constant_gain": (PAPER, [Run(v, case, "ifdc", v) for v in GAINS for case in all_cases(["constant"])]),
    "K_s": (PAPER, [Run(v, case, {}, v) for v in OUTPUT_SCALES for case in SCALED]),
    "K_n": (PAPER, [Run(v, case, {"K_n": v}) for v in NORMALISERS for case in LATE]),
    "width_scale": (PAPER, [Run(v, case, {"K_s": v, "scale": "width"}) for v in WIDTH_SCALES for case in LATE]),
    "alternatives": (PAPER, _alternatives(READINGS)),
    "current_jacobian": (PAPER, _alternatives({"rates through the current Jacobian": {}})),
    "true_tip_feedback": (_columns_for_true_tip(), _true_tip(0.0)),
    "late_true_tip_feedback": (_columns_for_true_tip((0.01,)), _true_tip(None)),
}


def run_sweep(study: Study, name: str) -> list[dict[str, Any]]:
    """Make a sweep's runs; return a row for each: sweep, arm, value, its case, and its `measures`."""
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
