"""Keys of episodes, drawn from an environment's generator: all that is random in an episode follows from its key."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from gymnasium.utils import seeding
from numpy.typing import NDArray

AHEAD = 16  # keys drawn at once


def new_keys(generator: np.random.Generator, count: int) -> NDArray[np.uint64]:
    """Keys of an environment's next episodes. Shape (count,)."""
    return generator.bit_generator.random_raw(count)


class EpisodeKeys:
    """Keys for the episodes of many environments, each with a generator of its own.

    They are the ones that `new_keys` would draw one by one, drawn ahead: a generator that was not used for a while has
    left the processor's cache, and to fetch it takes longer than to draw.
    """

    def __init__(self, count: int) -> None:
        """No generator is seeded yet.

        Args:
            count: of the environments.
        """
        self._generators: list[np.random.Generator] = []
        self._drawn = np.zeros((count, AHEAD), dtype=np.uint64)
        self._used = np.full(count, AHEAD)

    def seed(self, seeds: Sequence[int | None], mask: NDArray[np.bool_]) -> None:
        """Seed generators anew; None leaves one as it is.

        Args:
            seeds: of all environments. Shape (N,).
            mask: environments whose seed counts, once all have a generator. Shape (N,).
        """
        if not self._generators:
            self._generators = [seeding.np_random(seed)[0] for seed in seeds]
            return
        # all are made before the first is used: a bad seed changes nothing
        new = {i: seeding.np_random(seeds[i])[0] for i in np.flatnonzero(mask).tolist() if seeds[i] is not None}
        for i, generator in new.items():
            self._generators[i] = generator
            self._used[i] = AHEAD

    def take(self, chosen: NDArray[np.int64]) -> NDArray[np.uint64]:
        """The next episode's key of some environments, each named once. Shape (n,)."""
        places = self._used[chosen]
        spent = places == AHEAD
        for i in chosen[spent].tolist():
            self._drawn[i] = new_keys(self._generators[i], AHEAD)
        places[spent] = 0
        self._used[chosen] = places + 1
        return self._drawn[chosen, places]
