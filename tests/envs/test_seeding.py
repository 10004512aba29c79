"""Keys of episodes: drawn ahead, and still those that come one by one."""

from __future__ import annotations

import copy

import numpy as np
from gymnasium.utils import seeding
from hypothesis import given
from hypothesis import strategies as st

from flexarm_env.envs.seeding import AHEAD, EpisodeKeys, new_keys

COUNT = 3


@given(
    calls=st.lists(st.lists(st.integers(0, COUNT - 1), unique=True, min_size=1), max_size=3 * AHEAD),
    seeded_anew=st.integers(0, 3 * AHEAD),
)
def test_keys_drawn_ahead_are_those_drawn_one_by_one(calls: list[list[int]], seeded_anew: int) -> None:
    keys, everyone = EpisodeKeys(COUNT), np.ones(COUNT, dtype=bool)
    keys.seed([7, 8, 9], everyone)
    generators = [seeding.np_random(seed)[0] for seed in (7, 8, 9)]
    for n, chosen in enumerate(calls):
        if n == seeded_anew:  # the second one; the third is named, but masked
            keys.seed([None, 5, 6], np.array([True, True, False]))
            generators[1] = seeding.np_random(5)[0]
        expected = [new_keys(generators[i], 1)[0] for i in chosen]
        assert keys.take(np.array(chosen)).tolist() == expected


def test_a_copy_goes_on_with_the_same_keys() -> None:
    keys, everyone = EpisodeKeys(2), np.arange(2)
    keys.seed([1, None], np.ones(2, dtype=bool))
    keys.take(everyone)
    twin = copy.deepcopy(keys)
    for _ in range(2 * AHEAD):
        np.testing.assert_array_equal(keys.take(everyone), twin.take(everyone))
