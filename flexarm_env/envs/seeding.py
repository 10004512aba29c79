"""Keys of episodes, drawn from an environment's generator: a key determines all that is random in an episode."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.utils import seeding
from numpy.typing import NDArray

AHEAD = 16  # keys drawn at once
LOW = 2**64 - 1  # mask of the low word of a number of 128 bits


def new_keys(generator: np.random.Generator, count: int) -> NDArray[np.uint64]:
    """Draw the keys of an environment's next episodes. Shape (count,)."""
    return generator.bit_generator.random_raw(count)


def generator_words(generator: np.random.Generator, ahead: int = 0) -> NDArray[np.uint64]:
    """Return the state of a generator as words.

    Args:
        generator: by PCG64, as Gymnasium makes them.
        ahead: numbers that it has already drawn, and that the state has yet to draw.

    Raises:
        TypeError: for another bit generator.
    """
    source = generator.bit_generator
    if not isinstance(source, np.random.PCG64):
        raise TypeError(f"np_random: its bit generator is {type(source).__name__}; must be PCG64 for states")
    if ahead:
        twin = np.random.PCG64()
        twin.state = source.state
        source = twin.advance(2**128 - ahead)
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
        self.seeds: list[int] = []  # of the generators
        self._drawn = np.zeros((count, AHEAD), dtype=np.uint64)
        self._used = np.full(count, AHEAD)
        self._words = np.zeros((count, 5), dtype=np.uint64)  # states that generators take when they next draw,
        self._waiting = np.zeros(count, dtype=np.bool_)  # where there is one

    def seed(self, seeds: Sequence[int | None], mask: NDArray[np.bool_]) -> None:
        """Seed generators anew; None leaves one as it is.

        Args:
            seeds: seed of each environment. Shape (N,).
            mask: environments to seed; the first call seeds all. Shape (N,).
        """
        if not self._generators:
            made = [seeding.np_random(seed) for seed in seeds]
            self._generators, self.seeds = [one for one, _ in made], [seed for _, seed in made]
            return
        # all generators are made before any is replaced, so that a bad seed changes nothing
        new = {i: seeding.np_random(seeds[i]) for i in np.flatnonzero(mask).tolist() if seeds[i] is not None}
        for i, (generator, seed) in new.items():
            self._generators[i], self.seeds[i] = generator, seed
            self._used[i] = AHEAD
            self._waiting[i] = False

    def take(self, chosen: NDArray[np.int64]) -> NDArray[np.uint64]:
        """Return the next episode's key of some environments, each named once. Shape (n,)."""
        places = self._used[chosen]
        spent = places == AHEAD
        for i in chosen[spent].tolist():
            if self._waiting[i]:
                set_generator(self._generators[i], self._words[i])
                self._waiting[i] = False
            self._drawn[i] = new_keys(self._generators[i], AHEAD)
        places[spent] = 0
        self._used[chosen] = places + 1
        return self._drawn[chosen, places]

    def words(self, chosen: NDArray[np.int64]) -> NDArray[np.uint64]:
        """Return the states of some generators, as if keys were drawn one at a time. Shape (n, 5)."""
        words = self._words[chosen]
        for n in np.flatnonzero(~self._waiting[chosen]).tolist():
            i = chosen[n]
            words[n] = generator_words(self._generators[i], AHEAD - int(self._used[i]))
        return words

    def set_words(self, chosen: NDArray[np.int64], words: NDArray[np.uint64]) -> None:
        """Set some generators to states, one for all or one for each. Shape (1 or n, 5).

        They take them when they next draw: a planner that sets a thousand environments never begins their episodes.
        """
        self._used[chosen], self._words[chosen], self._waiting[chosen] = AHEAD, words, True
