"""`History`: what a policy remembers of past observations, passed from call to call as the state of `predict`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexarm_env.validation import integer, listed

Array = NDArray[np.float32]
LONGEST_LAG = 1000  # [steps]
MOST_NUMBERS = 1_000_000  # of an observation


@dataclass(frozen=True)
class History:
    """Which numbers of past observations a network sees beside the present observation.

    Attributes:
        lags: how old they are [steps], increasing; none: nothing is remembered.
        remembered: indices of the numbers in an observation, increasing.
    """

    lags: tuple[int, ...] = ()
    remembered: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        """Check both.

        Raises:
            TypeError, ValueError: for entries that are no integers, out of range or out of order, or one without the
                other.
        """
        for name, values, least, most in (
            ("lags", self.lags, 1, LONGEST_LAG),
            ("remembered", self.remembered, 0, MOST_NUMBERS),
        ):
            object.__setattr__(self, name, checked_increasing(name, values, least, most))
        if bool(self.lags) != bool(self.remembered):
            raise ValueError(f"lags = {self.lags}, remembered = {self.remembered}: one without the other has no effect")

    @property
    def size(self) -> int:
        """How many numbers it adds to an observation."""
        return len(self.lags) * len(self.remembered)

    def begin(self, observations: Array) -> Array:
        """Return the memory of arms whose episode begins: it was always as it is now.

        Args:
            observations: Shape (n, k).

        Returns:
            What is remembered, the newest first. Shape (n, longest lag, numbers).
        """
        now = observations[:, list(self.remembered)]
        return np.repeat(now[:, None], self.lags[-1], axis=1)

    def inputs(self, observations: Array, memory: Array) -> Array:
        """Return observations followed by what they were at each lag. Shape (n, k + size)."""
        past = memory[:, np.array(self.lags) - 1]
        return np.concatenate([observations, past.reshape(len(observations), -1)], axis=1)

    def advance(self, observations: Array, memory: Array) -> Array:
        """Return the memory for the next observations, in a new array."""
        return np.concatenate([observations[:, None, list(self.remembered)], memory[:, :-1]], axis=1)


def memory_of(
    history: History, observations: Array, state: Sequence[NDArray[Any]] | None, starting: NDArray[Any] | None
) -> Array:
    """Return the memory of n arms: that of the state, begun anew where an episode starts.

    Args:
        history: what is remembered.
        observations: Shape (n, k).
        state: as `predict` returned it; None: every arm's episode begins.
        starting: arms whose episode begins. Shape (n,).

    Raises:
        ValueError: if the state is that of another number of arms or of another policy.
    """
    if state is None:
        return history.begin(observations)
    shape = (len(observations), history.lags[-1], len(history.remembered))
    if len(state) != 1 or np.shape(state[0]) != shape:
        raise ValueError(f"state: must be what predict returned for as many observations, one array of shape {shape}")
    begun = np.zeros(len(observations), dtype=bool) if starting is None else np.asarray(starting, dtype=bool)
    if not begun.any():
        return np.asarray(state[0], dtype=np.float32)
    memory = np.array(state[0], dtype=np.float32)
    memory[begun] = history.begin(observations[begun])
    return memory


def checked_increasing(name: str, values: object, least: int, most: int) -> tuple[int, ...]:
    """Check integers that increase.

    Raises:
        TypeError, ValueError: naming what is no list, the entry that is no integer or out of range, or the order.
    """
    checked = tuple(integer(f"{name}[{n}]", value, least, most) for n, value in enumerate(listed(name, values)))
    if list(checked) != sorted(set(checked)):
        raise ValueError(f"{name} = {checked}: must increase")
    return checked
