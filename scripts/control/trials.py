"""What tables are made from: a controller of the registry with its design, on both standard laps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from statistics import median
from typing import Any

from flexarm_agents.evaluation.candidates import ENVIRONMENT, Candidate, from_controller
from flexarm_agents.evaluation.scoring import Score, score
from flexarm_env.laps import LAPS, Lap
from flexarm_env.rollout import run_policy

ERRORS = ("swing lap [mm]", "plain lap [mm]")  # see `cell`
DRAWS = 9  # of the noise, for a lap that is lost with the first one
Results = Mapping[str, Mapping[str, Sequence[Score]]]  # of each trial, of each lap


@dataclass(frozen=True)
class Trial:
    """A controller on both laps.

    Attributes:
        controller: its name in the registry.
        design: keyword arguments of its `for_env`.
        options: options of the environment, beside those that the controller needs.
        off: of the joints from the first corner, where the arm begins [rad].
    """

    controller: str
    design: Mapping[str, Any] = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)
    off: tuple[float, float] = (0.0, 0.0)

    def run(self) -> dict[str, list[dict[str, Any]]]:
        """Return the scores of both laps; a lap that is lost with the first draw of the noise has one for each."""
        candidate = from_controller(self.controller, ENVIRONMENT, self.options, **self.design)
        try:
            return {name: self._scores(candidate, lap) for name, lap in LAPS.items()}
        finally:
            candidate.env.close()

    def _scores(self, candidate: Candidate, lap: Lap) -> list[dict[str, Any]]:
        begin = lap.reset_options()
        if any(self.off):
            state = candidate.env.reset(options=begin)[1]["state"]
            state[:2] += self.off
            begin = {**begin, "state": state}
        found: list[Score] = []
        while not found or ("noise" in self.options and not found[0].complete and len(found) < DRAWS):
            found.append(score(run_policy(candidate.env, candidate.policy, seed=len(found), options=begin)))
        return [one.as_mapping() for one in found]


def cell(lap: Sequence[Mapping[str, Any]], digits: int = 0) -> str:
    """Write r.m.s. over a lap / after 2 s [mm]; of one that was lost, the median time of the end, and its range."""
    if lap[0]["complete"]:
        return " / ".join(f"{1e3 * lap[0][name]:.{digits}f}" for name in ("rms", "rms_after_2s"))
    ends = [one["duration"] for one in lap if not one["complete"]]
    share = "" if len(ends) == len(lap) else f" {len(ends)} of {len(lap)}"
    least, middle, most = (f"{time:.1f}" for time in (min(ends), median(ends), max(ends)))
    return f"lost{share} at {middle} s" + ("" if least == most else f" ({least} to {most})")
