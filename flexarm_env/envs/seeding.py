"""Keys of episodes, drawn from an environment's generator: a key determines all that is random in an episode."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from gymnasium.utils import seeding
from numpy.typing import NDArray

AHEAD = 16  # keys drawn at once


def new_keys(generator: np.random.Generator, count: int) -> NDArray[np.uint64]:
    """Draw the keys of an environment's next episodes. Shape (count,)."""
    return generator.bit_generator.random_raw(count)


class EpisodeKeys:
    """Keys for the episodes of many environments, each with its own generator.

    Each environment has the same keys as with `new_keys` for one episode at a time. They are drawn several at once,
    since loading a generator into the processor's cache takes longer than drawing a key.
    """

    def __init__(self, count: int) -> None:
        """Reserve memory; `seed` makes the generators.

        Args:
            count: number of environments.
        """
        self._generators: list[np.random.Generator] = []
        self._drawn = np.zeros((count, AHEAD), dtype=np.uint64)
        self._used = np.full(count, AHEAD)

    def seed(self, seeds: Sequence[int | None], mask: NDArray[np.bool_]) -> None:
        """Seed generators anew; None leaves one as it is.

        Args:
            seeds: seed of each environment. Shape (N,).
            mask: environments to seed; the first call seeds all. Shape (N,).
        """
        if not self._generators:
            self._generators = [seeding.np_random(seed)[0] for seed in seeds]
            return
        # all generators are made before any is replaced, so that a bad seed changes nothing
        new = {i: seeding.np_random(seeds[i])[0] for i in np.flatnonzero(mask).tolist() if seeds[i] is not None}
        for i, generator in new.items():
            self._generators[i] = generator
            self._used[i] = AHEAD

    def take(self, chosen: NDArray[np.int64]) -> NDArray[np.uint64]:
        """Return the next episode's key of some environments, each named once. Shape (n,)."""
        places = self._used[chosen]
        spent = places == AHEAD
        for i in chosen[spent].tolist():
            self._drawn[i] = new_keys(self._generators[i], AHEAD)
        places[spent] = 0
        self._used[chosen] = places + 1
        return self._drawn[chosen, places]
