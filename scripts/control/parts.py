"""What each part of LQG is worth: as published, from a start off the plan, and with other arms and delays."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from flexarm_agents.contenders import from_controller
from flexarm_agents.scoring import StandardScore, score
from flexarm_baselines.observers import NoiseModel
from flexarm_env.laps import LAPS
from flexarm_env.rollout import run_policy
from scripts.common.markdown import table
from scripts.control.trials import Scores, Study, Trial, Trials, cell

NOISE = {"noise": 0.003}  # [m]
OFF = (-0.02, 0.02)  # [rad]
ROWS: dict[str, tuple[str, dict[str, Any]]] = {
    "LQG": ("lqg", {}),
    "delay ignored": ("lqg", {"delay": "ignored"}),
    "no feed-forward": ("lqg", {"feed_forward": False}),
    "with integral action": ("lqg", {"integral": 0.02}),
    "with strain gauges": ("lqg_gauges", {}),
    "filter of the true noise": ("lqg", {"noise": NoiseModel(joint_angle=1e-4, joint_rate=0.03, tip=3e-3)}),
    "payload, stiffness and delays estimated": ("lqg_adaptive", {}),
    "true state in place of a filter": ("plan_lqr", {}),
}


@dataclass(frozen=True)
class OffTrial(Trial):
    """A trial whose arm begins off the first corner.

    Attributes:
        off: of the joints [rad].
    """

    off: tuple[float, float] = (0.0, 0.0)

    def score(self) -> StandardScore:
        """Run both laps."""
        contender = from_controller(self.controller, self.environment, self.options, **self.design)
        scores = []
        for lap in LAPS.values():
            begin = lap.reset_options()
            state = contender.env.reset(options=begin)[1]["state"]
            state[:2] += self.off
            options = begin | {"state": state}
            scores.append(score(run_policy(contender.env, contender.policy, seed=self.seed, options=options)))
        contender.env.close()
        return StandardScore(*scores)


def _drawn(**quantities: float) -> dict[str, Any]:
    """Return options of a plant that differs from what is published."""
    return NOISE | {"randomisation": {name: (value, value) for name, value in quantities.items()}}


CASES: dict[str, dict[str, Any]] = {
    "as published": {"options": NOISE},
    "start 0.02 rad off": {"options": NOISE, "off": OFF},
    "payload 0.5 kg": {"options": _drawn(payload_mass=0.5)},
    "frequencies -10 %": {"options": _drawn(stiffness=0.81)},
    "frequencies +10 %": {"options": _drawn(stiffness=1.21)},
    "no delay": {"options": _drawn(delay=0.0)},
    "delay 60 ms": {"options": _drawn(delay=0.06)},
}


def trials_of(rows: Mapping[str, tuple[str, dict[str, Any]]], quick: bool) -> Trials:
    """Return each row, a controller with its design, in each case."""
    found: Trials = {
        f"{row}, {case}": OffTrial(name, design, **changes)
        for row, (name, design) in rows.items()
        for case, changes in CASES.items()
    }
    return dict(list(found.items())[:1]) if quick else found


def table_of(rows: Iterable[str], scores: Scores) -> str:
    """Write the table of some rows, a line for each lap."""
    lines = [
        [row, lap, *(cell(getattr(scores[f"{row}, {case}"], lap), 4) for case in CASES if f"{row}, {case}" in scores)]
        for row in rows
        for lap in LAPS
        if f"{row}, {next(iter(CASES))}" in scores
    ]
    return table(["", "lap", *list(CASES)[: len(lines[0]) - 2]], lines)


STUDY = Study(
    "what each part of LQG is worth: r.m.s. over the lap / after 2 s [m]",
    partial(trials_of, ROWS),
    partial(table_of, ROWS),
    "lqg.md",
)
