"""Policies that ignore the observation: they show the score without control."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexarm_env.validation import integer

State = tuple[NDArray[Any], ...] | None


class ConstantPolicy:
    """The same action always, or a new random one in each step; has stable-baselines3's ``predict``."""

    def __init__(self, actions: int, spread: float = 0.0, seed: int = 0) -> None:
        """Choose how many numbers an action has; they are 0, or drawn evenly from [-spread, spread]."""
        self._size, self._spread = integer("actions", actions, 1), spread
        self._generator = np.random.default_rng(seed)

    def __repr__(self) -> str:
        return f"{type(self).__name__}(actions={self._size}, spread={self._spread})"

    def predict(
        self,
        observation: Any,
        state: State = None,
        episode_start: NDArray[Any] | None = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[np.float32], State]:
        """Choose actions, for one observation or a batch; the state comes back as it is."""
        shape = (*np.shape(observation)[:-1], self._size)
        return self._generator.uniform(-self._spread, self._spread, shape).astype(np.float32), state
