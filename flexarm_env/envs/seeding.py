"""Keys of episodes, drawn from an environment's generator: a key determines all that is random in an episode."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.utils import seeding
from numpy.typing import NDArray

LOW = 2**64 - 1  # mask of the low word of a number of 128 bits


def new_keys(generator: np.random.Generator, count: int) -> NDArray[np.uint64]:
    """Draw the keys of an environment's next episodes. Shape (count,)."""
    return generator.bit_generator.random_raw(count)


def generator_words(generator: np.random.Generator) -> NDArray[np.uint64]:
    """Return the state of a generator as words.

    Raises:
        TypeError: for another bit generator than PCG64, which Gymnasium makes.
    """
    source = generator.bit_generator
    if not isinstance(source, np.random.PCG64):
        raise TypeError(f"np_random: its bit generator is {type(source).__name__}; must be PCG64 for states")
    known: Any = source.state
    state, step = known["state"]["state"], known["state"]["inc"]
    last = known["has_uint32"] << 32 | known["uinteger"]
    return np.array([state >> 64, state & LOW, step >> 64, step & LOW, last], dtype=np.uint64)


def set_generator(generator: np.random.Generator, words: NDArray[np.uint64]) -> None:
    """Set a generator to a state that `generator_words` has returned."""
    high, low, step_high, step_low, last = words.tolist()
    generator.bit_generator.state = {
        "bit_generator": "PCG64",
        "state": {"state": high << 64 | low, "inc": step_high << 64 | step_low},
        "has_uint32": last >> 32,
        "uinteger": last & 0xFFFFFFFF,
    }


class EpisodeKeys:
    """Keys for the episodes of many environments, each with its own generator."""

    def __init__(self, count: int) -> None:
        """Reserve memory for so many environments; `seed` makes the generators."""
        self._generators: list[np.random.Generator] = []
        self.seeds: list[int] = []  # of the generators
        self._words = np.zeros((count, 5), dtype=np.uint64)  # states that generators take when they next draw,
        self._waiting = np.zeros(count, dtype=np.bool_)  # where there is one

    def seed(self, seeds: Sequence[int | None], mask: NDArray[np.bool_]) -> None:
        """Seed the generators of a mask anew, and at the first call all; None leaves one as it is. Shape (N,) each."""
        if not self._generators:
            made = [seeding.np_random(seed) for seed in seeds]
            self._generators, self.seeds = [one for one, _ in made], [seed for _, seed in made]
            return
        # all generators are made before any is replaced, so that a bad seed changes nothing
        new = {i: seeding.np_random(seeds[i]) for i in np.flatnonzero(mask).tolist() if seeds[i] is not None}
        for i, (generator, seed) in new.items():
            self._generators[i], self.seeds[i] = generator, seed
            self._waiting[i] = False

    def take(self, chosen: NDArray[np.int64]) -> NDArray[np.uint64]:
        """Return the next episode's key of some environments, each named once. Shape (n,)."""
        for i in chosen[self._waiting[chosen]].tolist():
            set_generator(self._generators[i], self._words[i])
        self._waiting[chosen] = False
        return np.array([self._generators[i].bit_generator.random_raw() for i in chosen.tolist()], dtype=np.uint64)

    def words(self, chosen: NDArray[np.int64]) -> NDArray[np.uint64]:
        """Return the states of some generators. Shape (n, 5)."""
        words = self._words[chosen]
        for n in np.flatnonzero(~self._waiting[chosen]).tolist():
            words[n] = generator_words(self._generators[chosen[n]])
        return words

    def set_words(self, chosen: NDArray[np.int64], words: NDArray[np.uint64]) -> None:
        """Set some generators to states, one for all or one for each. Shape (1 or n, 5).

        They take them when they next draw: a planner that sets a thousand environments never begins their episodes.
        """
        self._words[chosen], self._waiting[chosen] = words, True
