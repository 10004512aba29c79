"""Automatic domain randomisation: ranges widen from the arm as published to those of the options, while few are lost.

Source: OpenAI et al., *Solving Rubik's cube with a robot hand*, 2019. There each end of a range has its own
test; here all ranges share one width, since losses are counted among the episodes of the training itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from flexarm_env.envs.quantities import QUANTITIES
from flexarm_env.envs.settings import Settings
from flexarm_env.envs.termination import END_CODES
from flexarm_env.validation import shown

FIRST, STEP = 0.1, 0.05  # widths, as shares of the ranges of the options
EPISODES = 100  # that end before the next decision
LOSS = (0.05, 0.2)  # shares of these: below the first the ranges widen, above the second they narrow


class Width(NamedTuple):
    """How wide the ranges are, and what ended since the last decision.

    Attributes:
        share: of the ranges of the options, beginning at the arm as published.
        ended: episodes.
        lost: those of them that terminated, but for races that were finished.
    """

    share: float = FIRST
    ended: int = 0
    lost: int = 0

    def after(self, dones: Any, infos: Sequence[dict[str, Any]]) -> Width:
        """Count the episodes that a step of a `VecEnv` ended."""
        over = [infos[n] for n in np.flatnonzero(dones).tolist()]
        lost = sum(not one["TimeLimit.truncated"] and one["end_code"] != END_CODES["finished"] for one in over)
        return self._replace(ended=self.ended + len(over), lost=self.lost + lost)

    def decided(self) -> Width:
        """Return the width of the episodes to come; itself while too few have ended."""
        if self.ended < EPISODES:
            return self
        loss = self.lost / self.ended
        change = STEP if loss < LOSS[0] else -STEP if loss > LOSS[1] else 0.0
        return Width(min(max(round(self.share + change, 9), FIRST), 1.0))

    def ranges(self, settings: Settings) -> dict[str, tuple[float, float]]:
        """Return the ranges of this width, by the quantities that the settings draw."""
        found = {}
        for name, (low, high) in settings.randomisation.items():
            own = min(max(settings.own_value(name), low), high)
            found[name] = own + self.share * (low - own), own + self.share * (high - own)
        return found


def check_ranges(settings: Settings) -> None:
    """Check that ranges can widen.

    Raises:
        ValueError: if nothing is drawn, or something else than quantities from ranges.
    """
    drawn = settings.randomisation
    if not drawn or not all(name in QUANTITIES and not isinstance(drawn[name][0], str) for name in drawn):
        raise ValueError(
            f"automatic_randomisation = True: randomisation = {shown(dict(drawn))} must have ranges (least, largest), "
            f"of {', '.join(map(repr, QUANTITIES))} only"
        )
