"""How wide the tube of a safety filter may be: what a network behind it loses on unknown arms, and how far it errs."""

from functools import partial
from typing import Any

import numpy as np

from flexarm_agents.policies.safety_filter import OWN, SafetyFilter
from flexarm_baselines.arrays import Floats
from flexarm_baselines.controller import Memory, Seen
from scripts.common.markdown import table
from scripts.common.study import study
from scripts.control.robust import LOSSES, losses, run_unknown

EPISODES = 128
TUBES = {"the backup alone": 0.0, **{f"{x:g}": x for x in (0.3, 0.4, 0.5, 0.6)}, "the network alone": np.inf}


class Counting(SafetyFilter):
    """A filter that keeps how many arms it has driven for a period, and in how many it has changed the torques."""

    periods = acts = 0

    def torque(self, seen: Seen, memory: Memory) -> tuple[Floats, Memory]:
        """See `SafetyFilter`."""
        torque, memory = super().torque(seen, memory)
        self.periods, self.acts = self.periods + len(seen), self.acts + int(np.sum(memory[OWN] < 1.0))
        return torque, memory


def run_tube(tube: float) -> dict[str, Any]:
    """Return the errors of `run_unknown`, and the share of periods in which the filter acts.

    The tube is the share of the limits in which predictions must stay; 0: nothing passes, infinite: everything.
    """
    made: list[Counting] = []

    def make(envs: Any) -> Counting:
        made.append(Counting.for_env(envs))
        made[0].limits = tube * np.array([envs.settings.error_limit, envs.settings.deflection_limit])
        return made[0]

    errors = run_unknown(make, Counting.options(), EPISODES)
    return {"unknown": errors, "acts": made[0].acts / made[0].periods}


def safety_filter_table(results: Any) -> str:
    """Tabulate losses, errors, and how often the filter acts."""
    lines = [[name, *losses(one["unknown"]), f"{one['acts']:.0%}"] for name, one in results.items()]
    return table(["tube", *LOSSES, "periods in which it acts"], lines)


STUDIES = study(
    __name__,
    "safety_filter",
    "a network behind a safety filter, by the width of its tube",
    lambda: {name: partial(run_tube, tube) for name, tube in TUBES.items()},
    safety_filter_table,
)
