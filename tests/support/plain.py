"""An environment whose kernels run in plain Python: slow to step, but nothing is compiled."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexarm_env.codegen.declarations import plain_python
from flexarm_env.envs.batch import Fleet
from flexarm_env.envs.settings import Settings
from flexarm_env.episode.step import step_only
from flexarm_env.kernels.entries import header


class PlainEnvironment:
    """One environment.

    Attributes:
        fleet: the batch of one that it steps.
    """

    def __init__(self, **options: Any) -> None:
        """Lay out its memory; `options`: as of `FlexArm/Square-v0`."""
        self.fleet = Fleet(Settings.of(options), 1)

    def reset(self, key: int = 0) -> None:
        """Begin an episode; `key`: of its random numbers."""
        self.fleet.order_starts(np.array([key], dtype=np.uint64), np.array([0]), self.fleet.usual_orders)
        self.fleet._plan[header.DRIVING] = 0
        self._run()
        self.fleet._plan[header.DRIVING] = 1

    def step(self, action: ArrayLike) -> None:
        """Hold an action for a control period. Shape (channels,)."""
        self.fleet.actions[0] = action
        self._run()

    def block(self, name: str) -> NDArray[np.float32]:
        """A block of the present observation, in a new array."""
        return self.fleet.observations[0, self.fleet.layout.blocks[name]].copy()

    def result(self, name: str) -> NDArray[np.float64]:
        """A part of what is known at the present instant (`episode_sizes`), in a new array."""
        return self.fleet.result(0)[self.fleet.parts[name]]

    def _run(self) -> None:
        with plain_python(self.fleet._variant), np.errstate(all="ignore"):  # keys overflow, as compiled
            assert step_only(self.fleet._memory), "an action that is not finite"
