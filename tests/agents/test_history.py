"""A policy that sees past readings: the state of `predict`, files, bad ones."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flexarm_agents import NetworkPolicy
from flexarm_agents.policies.encoders import PastReadings
from tests.support.refusals import refuses

LINEAR = PastReadings(3, (1, 3), (0, 2))


def policy(encoder: PastReadings = LINEAR) -> NetworkPolicy:
    """Return a policy of one layer with random weights."""
    weight = 0.1 * np.random.default_rng(0).normal(size=(2, encoder.inputs)).astype(np.float32)
    return NetworkPolicy([weight], [np.zeros(2, np.float32)], np.zeros(2, np.float32), encoder=encoder)


@given(
    lags=st.sets(st.integers(1, 9), min_size=1, max_size=4),
    starts=st.lists(st.booleans(), min_size=12, max_size=12),
)
def test_the_network_sees_what_was_observed_at_each_lag(lags: set[int], starts: list[bool]) -> None:
    """Before an episode's first observation it was always that one."""
    encoder = PastReadings(3, tuple(sorted(lags)), (0, 2))
    one, state = policy(encoder), None
    observations = np.random.default_rng(1).normal(size=(len(starts), 3)).astype(np.float32)
    first = 0
    for k, start in enumerate(starts):
        first = k if start else first
        past = [observations[max(k - lag, first)][[0, 2]] for lag in encoder.lags]
        expected = one.weights[0] @ np.concatenate([observations[k], *past])
        found, state = one.predict(observations[k], state, np.array([start]), deterministic=True)
        np.testing.assert_allclose(found, np.clip(expected, -1.0, 1.0), atol=1e-6)


def test_a_batch_remembers_as_its_members_do() -> None:
    one, random = policy(), np.random.default_rng(2)
    together, alone = None, [None, None, None]
    for k in range(8):
        seen = random.normal(size=(3, 3)).astype(np.float32)
        start = np.array([k == 0, k in (0, 4), k == 0])
        given_state = together
        actions, together = one.predict(seen, together, start, deterministic=True)
        again, _ = one.predict(seen, given_state, start, deterministic=True)  # the state given was not changed
        np.testing.assert_array_equal(actions, again)
        for n in range(3):
            action, alone[n] = one.predict(seen[n], alone[n], start[n : n + 1], deterministic=True)  # type: ignore[call-overload]
            np.testing.assert_allclose(action, actions[n], atol=1e-6)


def test_a_history_survives_a_file(tmp_path: Path) -> None:
    one = policy()
    one.save(tmp_path / "policy.npz")
    again = NetworkPolicy.load(tmp_path / "policy.npz")
    assert (again.encoder, again.observation_size) == (LINEAR, 3)


@pytest.mark.parametrize(
    ("history", "words"),
    [
        ({"lags": [3, 1], "remembered": [0]}, "lags = (3, 1): must increase"),
        ({"lags": [1.5], "remembered": [0]}, "lags[0] = 1.5: must be an integer"),
        ({"lags": [1], "remembered": []}, "remembered = (): must have an entry"),
        ({"lags": [1], "remembered": [9]}, "remembered = (9,): must be indices in an observation of"),
        ({"lags": [10**9], "remembered": [0]}, "lags[0] = 1000000000: must be an integer from 1 to 1000"),
        ({"lags": [1, 2, 3, 4, 5, 6, 7], "remembered": [0]}, "size = 0: must be an integer from 1"),
        ("text", "not a saved policy"),
    ],
)
def test_a_tampered_history_is_refused(tmp_path: Path, history: Any, words: str) -> None:
    one = policy()
    one.save(tmp_path / "policy.npz")
    with np.load(tmp_path / "policy.npz") as file:
        arrays = dict(file)
    head = json.loads(str(arrays.pop("head")))
    assert head["history"] == {"lags": [1, 3], "remembered": [0, 2]}
    np.savez(tmp_path / "policy.npz", head=np.array(json.dumps(head | {"history": history})), **arrays)
    with refuses(ValueError, "policy.npz", words):
        NetworkPolicy.load(tmp_path / "policy.npz")


def test_a_foreign_state_is_refused() -> None:
    with refuses(ValueError, "state: must be what predict returned for as many observations", "(1, 3, 2)"):
        policy().predict(np.zeros(3, np.float32), (np.zeros((2, 3, 2), np.float32),))
