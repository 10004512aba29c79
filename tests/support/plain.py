"""An environment whose kernels run in plain Python: slow to step, but nothing is compiled."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexarm_env.codegen.declarations import plain_python
from flexarm_env.envs.batch import BatchSimulator
from flexarm_env.envs.settings import Settings
from flexarm_env.episode.step import step_only
from flexarm_env.kernels.entries import word


class PlainEnvironment:
    """One environment.

    Attributes:
        simulator: the batch of one that it steps.
    """

    def __init__(self, **options: Any) -> None:
        """Lay out its memory; `options`: as of `FlexArm/Square-v0`."""
        self.simulator = BatchSimulator(Settings.of(options), 1)

    def reset(self, key: int = 0) -> None:
        """Begin an episode; `key`: of its random numbers."""
        self.simulator.request_resets(np.array([key], dtype=np.uint64), np.array([0]), self.simulator.usual_requests)
        self.simulator._header[word.DRIVING] = 0
        self._run()
        self.simulator._header[word.DRIVING] = 1

    def step(self, action: ArrayLike) -> None:
        """Hold an action for a control period. Shape (channels,)."""
        self.simulator.actions[0] = action
        self._run()

    def block(self, name: str) -> NDArray[np.float32]:
        """Return a block of the present observation, in a new array."""
        return self.simulator.observations[0, self.simulator.layout.blocks[name]].copy()

    def result(self, name: str) -> NDArray[np.float64]:
        """Return a part of what is known at the present instant (`result_sizes`), in a new array."""
        return self.simulator.result(0)[self.simulator.parts[name]]

    def _run(self) -> None:
        with plain_python(self.simulator._variant), np.errstate(all="ignore"):  # keys overflow, as compiled
            assert step_only(self.simulator._memory), "an action that is not finite"
