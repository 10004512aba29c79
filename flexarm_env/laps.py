"""The two standard laps: their names, and the reset options with which an episode is one of them.

On the first corner the arm is nearly straight, and the reference leaves at full speed. On which side the elbow is
decides how well the first side of the path can be followed. A lap in the other direction with the elbow on the other
side is the mirror image, so there are two laps, not four.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from flexarm_env.parameters import DIRECTIONS, EITHER, ElbowBranch
from flexarm_env.validation import choice

SETTLED = 2.0  # [s] since the lap began; the start's transient is over, and scores have a figure from here on


@dataclass(frozen=True)
class Lap:
    """One of the laps.

    Attributes:
        text: description.
        elbow_branch: side of theta2 at the start of the clockwise lap.
    """

    text: str
    elbow_branch: ElbowBranch

    def reset_options(self, direction: str = "clockwise") -> dict[str, Any]:
        """Return the options of `reset` that begin the lap from rest on the first corner.

        Args:
            direction: the environment's option of that name. With "either" the lap is clockwise.
        """
        if choice("direction", direction, (*DIRECTIONS, EITHER)) == EITHER:
            return self.reset_options() | {"direction": "clockwise"}
        mirrored: dict[ElbowBranch, ElbowBranch] = {"positive": "negative", "negative": "positive"}
        branch = self.elbow_branch if direction == "clockwise" else mirrored[self.elbow_branch]
        return {"start": "corner", "elbow_branch": branch}


LAPS = {
    "swing": Lap(
        "clockwise with theta2 > 0 at the start, or its mirror image. The first edge cannot be followed at once; the "
        "best plans known swing the elbow through the straight arm",
        "positive",
    ),
    "plain": Lap(
        "clockwise with theta2 < 0 at the start, or its mirror image. The first edge can be followed with the elbow on "
        "its side",
        "negative",
    ),
}
