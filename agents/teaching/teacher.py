"""`Teacher`: the best known plan of an arm's own plant, and feedback of its true state along it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexarm_agents.teaching.config import DAggerConfig
from flexarm_agents.teaching.plans import Bank, bank
from flexarm_env.envs.settings import Settings
from flexarm_env.validation import shown

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]
TURN = 2.0 * np.pi
NEEDED = {"action_mode": "torque", "reference": ("square",), "direction": "clockwise", "control_period": 0.01}


class Pupils(NamedTuple):
    """Arms that the teacher drives, with what it may know of them.

    Attributes:
        lap: index of the lap that each runs, in the order of `LAPS`. Shape (n,).
        parameters: quantities of their episodes, as `Episode` has them. Shape (n,) each.
    """

    lap: Indices
    parameters: Mapping[str, Floats]


class Teacher:
    """Torques for arms whose state and plant are known.

    Between the plants of the grid, plans and gains are interpolated linearly. Torques that act late are those that the
    plan has then.
    """

    def __init__(self, plans: Bank, limits: tuple[float, float], period: float) -> None:
        """Keep the plans.

        Args:
            plans: of the grid.
            limits: of the torques of shoulder and elbow [N m].
            period: control period [s].
        """
        self.plans, self.limits, self.period = plans, np.array(limits), period
        self.periods = plans.torques.shape[-2]

    @classmethod
    def of(cls, config: DAggerConfig, settings: Settings, folder: Path) -> Teacher:
        """Make a teacher for an environment, with a grid over what it draws.

        Raises:
            ValueError: if the environment's laps are not the standard ones.
        """
        for name, value in NEEDED.items():
            if getattr(settings, name) != value:
                raise ValueError(f"{name} = {shown(getattr(settings, name))}: the teacher has plans for {value!r} only")
        payloads, stiffnesses = (
            np.unique(np.linspace(*settings.range_of(name), count)).tolist()
            for name, count in zip(("payload_mass", "stiffness"), config.plants, strict=True)
        )
        wishes = {"change_weight": config.change_weight, "deflection_limit": config.deflection_limit}
        plans = bank(settings.flexible_arm.parameters, payloads, stiffnesses, folder, wishes)
        return cls(plans, settings.motor_limit, settings.control_period)

    def actions(self, pupils: Pupils, period: Indices, states: Floats) -> tuple[NDArray[np.float32], Floats]:
        """Choose actions.

        Args:
            pupils: the arms.
            period: control periods since each one's lap began. Shape (n,).
            states: true ones. Shape (n, 4 + 4 m).

        Returns:
            Actions in [-1, 1], and how far the feedback changes them. Shape (n, 2) each.
        """
        now = np.minimum(period, self.periods - 1)
        late = pupils.parameters["actuation_delay"] / self.period
        whole = np.floor(late).astype(np.int64)
        first, then = (np.minimum(now + whole + more, self.periods - 1) for more in (0, 1))
        share = (late - whole)[:, None]
        planned, wanted = np.zeros((len(now), 2)), np.zeros(states.shape)
        gains = np.zeros((len(now), 2, states.shape[1]))
        for p, s, weight in self._corners(pupils.parameters):
            place = pupils.lap, p, s
            torques = (1.0 - share) * self.plans.torques[(*place, first)] + share * self.plans.torques[(*place, then)]
            planned += weight[:, None] * torques
            wanted += weight[:, None] * self.plans.states[(*place, now)]
            gains += weight[:, None, None] * self.plans.gains[(*place, now)]
        off = states - wanted
        off[:, 0] -= TURN * np.round(off[:, 0] / TURN)
        feedback = np.einsum("nij,nj->ni", gains, off) / self.limits
        return np.clip(planned / self.limits + feedback, -1.0, 1.0).astype(np.float32), feedback

    def _corners(self, parameters: Mapping[str, Floats]) -> list[tuple[Indices, Indices, Floats]]:
        """Return the grid's plants about each arm's, by their indices, with their weights."""
        payload = _bracket(self.plans.payloads, parameters["payload_mass"])
        stiffness = _bracket(self.plans.stiffnesses, parameters["stiffness"])
        return [(p, s, one * other) for p, one in payload for s, other in stiffness]


def _bracket(grid: Floats, values: Floats) -> list[tuple[Indices, Floats]]:
    """Return the neighbours of values in a grid, with their weights; one neighbour where the grid has one entry."""
    if len(grid) == 1:
        return [(np.zeros(len(values), dtype=np.int64), np.ones(len(values)))]
    low = np.clip(np.searchsorted(grid, values, side="right") - 1, 0, len(grid) - 2)
    share = (values - grid[low]) / (grid[low + 1] - grid[low])
    return [(low, 1.0 - share), (low + 1, share)]
