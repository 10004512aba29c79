"""What each part of LQG is worth: on the default arm, from a start off the plan, and with other arms and delays."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from statistics import median
from typing import Any, NamedTuple

from flexarm_agents.evaluation.candidates import ENVIRONMENT, from_controller
from flexarm_agents.evaluation.scoring import Score, score
from flexarm_baselines.observers import NoiseModel
from flexarm_env.laps import LAPS
from flexarm_env.rollout import run_policy
from scripts.common.markdown import table
from scripts.control.trials import Study, cell

NOISE = {"noise": 0.003}  # [m]
OFF = (-0.02, 0.02)  # [rad]
DRAWS = 9  # of the noise, for a lap that is lost with the first one
ROWS: dict[str, tuple[str, dict[str, Any]]] = {
    "LQG": ("lqg", {}),
    "delay ignored": ("lqg", {"delay": "ignored"}),
    "no feed-forward": ("lqg", {"feed_forward": False}),
    "with integral action": ("lqg", {"integral": 0.02}),
    "with strain gauges": ("lqg_gauges", {}),
    "filter of the true noise": ("lqg", {"noise": NoiseModel(joint_angle=1e-4, joint_rate=0.03, tip=3e-3)}),
    "adaptive LQG": ("lqg_adaptive", {}),
    "true state in place of a filter": ("plan_lqr", {}),
}


class Laps(NamedTuple):
    """Both laps, each once, or with every draw of the noise where the first one was lost."""

    swing: Sequence[Score]
    plain: Sequence[Score]

    def as_mapping(self) -> dict[str, Any]:
        """Return plain values for a file."""
        return {lap: [one.as_mapping() for one in scores] for lap, scores in self._asdict().items()}


@dataclass(frozen=True)
class CaseTrial:
    """A controller on both laps, with a design of its own or not.

    Attributes:
        controller: its name in the registry.
        design: keyword arguments of its `for_env`.
        options: options of the environment, beside those that the controller needs.
        off: of the joints from the first corner, where the arm begins [rad].
    """

    controller: str
    design: Mapping[str, Any]
    options: Mapping[str, Any]
    off: tuple[float, float] = (0.0, 0.0)

    def score(self) -> Laps:
        """Run both laps; when a lap is lost depends on the noise, so that one that is lost is run again."""
        candidate = from_controller(self.controller, ENVIRONMENT, self.options, **self.design)
        found = []
        for lap in LAPS.values():
            begin = lap.reset_options()
            state = candidate.env.reset(options=begin)[1]["state"]
            state[:2] += self.off
            run = partial(run_policy, candidate.env, candidate.policy, options=begin | {"state": state})
            scores = [score(run(seed=0))]
            if not scores[0].complete:
                scores += [score(run(seed=seed)) for seed in range(1, DRAWS)]
            found.append(scores)
        candidate.env.close()
        return Laps(*found)


def _drawn(**quantities: float) -> dict[str, Any]:
    """Return options of a plant that differs from what is published."""
    return NOISE | {"randomisation": {name: (value, value) for name, value in quantities.items()}}


CASES: dict[str, dict[str, Any]] = {
    "default arm": {"options": NOISE},
    "start 0.02 rad off": {"options": NOISE, "off": OFF},
    "payload 0.5 kg": {"options": _drawn(payload_mass=0.5)},
    "frequencies -10 %": {"options": _drawn(stiffness=0.81)},
    "frequencies +10 %": {"options": _drawn(stiffness=1.21)},
    "no delay": {"options": _drawn(delay=0.0)},
    "delay 60 ms": {"options": _drawn(delay=0.06)},
}


def trials_of(rows: Mapping[str, tuple[str, dict[str, Any]]], quick: bool) -> dict[str, CaseTrial]:
    """Return each row, a controller with its design, in each case."""
    found = {
        f"{row}, {case}": CaseTrial(name, design, **changes)
        for row, (name, design) in rows.items()
        for case, changes in CASES.items()
    }
    return dict(list(found.items())[:1]) if quick else found


def cell_of(scores: Sequence[Score]) -> str:
    """Write a lap's errors; of one that was lost, of so many draws, the median time of the end and its range."""
    if len(scores) == 1:
        return cell(scores[0], 1)
    ends = [one.duration for one in scores if not one.complete]
    share = "" if len(ends) == len(scores) else f" {len(ends)} of {len(scores)}"
    least, middle, most = (f"{time:.1f}" for time in (min(ends), median(ends), max(ends)))
    return f"lost{share} at {middle} s" + ("" if least == most else f" ({least} to {most})")


def table_of(rows: Iterable[str], scores: Mapping[str, Laps]) -> str:
    """Write the table of some rows, a line for each lap."""
    lines = [
        [row, lap, *(cell_of(getattr(scores[f"{row}, {case}"], lap)) for case in CASES if f"{row}, {case}" in scores)]
        for row in rows
        for lap in LAPS
        if f"{row}, {next(iter(CASES))}" in scores
    ]
    return table(["", "lap", *list(CASES)[: len(lines[0]) - 2]], lines)


STUDY = Study(
    "what each part of LQG is worth: r.m.s. over the lap / after 2 s [mm]",
    partial(trials_of, ROWS),
    partial(table_of, ROWS),
    "lqg.md",
)
