"""Gymnasium's wrappers and vectors, one by one; see `tests.recipes.wrappers`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.wrappers import vector

from tests.recipes import wrappers
from tests.recipes.checks import LIMIT, trace
from tests.recipes.vectors import VECTORS, Vector
from tests.recipes.wrappers import BATCH, SINGLE, Row, actions_of
from tests.support.envs import SQUARE, assert_same, shared_arm

# DtypeObservation compares float32 bounds with the least float64.
pytestmark = pytest.mark.filterwarnings("ignore:overflow encountered in cast:RuntimeWarning:gymnasium.spaces.box")


def cases(rows: tuple[Any, ...]) -> list[Any]:
    return [pytest.param(row, id=row.name, marks=[pytest.mark.slow] if row.slow else []) for row in rows]


def checked(row: Row, make: Any) -> None:
    bare, wrapped = make(row.options), row.wrap(make(row.options))
    actions = actions_of(bare)
    row.check(wrapped, trace(bare, actions[:LIMIT] if row.slow else actions), actions)


@pytest.mark.parametrize("row", cases(SINGLE))
def test_wrappers_of_one_environment(row: Row, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if not hasattr(gym.wrappers, row.name):
        pytest.skip("this Gymnasium is older than the wrapper")
    monkeypatch.chdir(tmp_path)
    checked(row, wrappers.single)


@pytest.mark.parametrize("row", cases(BATCH))
def test_wrappers_of_a_batch(row: Row, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    checked(row, wrappers.batch)


@pytest.mark.parametrize("mode", ["SameStep", "Disabled"])
def test_running_means_of_observations_need_next_step(mode: str) -> None:
    with pytest.raises((ValueError, AssertionError)):  # Gymnasium 1.2 asserts, without a message
        vector.NormalizeObservation(wrappers.batch({"autoreset_mode": mode}))


@pytest.mark.parametrize("kind", cases(VECTORS))
def test_kinds_of_vectors(kind: Vector) -> None:
    batch = wrappers.batch(wrappers.SHORT)
    actions = actions_of(batch)
    expected = trace(batch, actions)
    options = shared_arm(SQUARE, {}) | wrappers.SHORT
    envs = gym.make_vec(f"flexarm_env:{SQUARE}", num_envs=3, **options, **kind.arguments)
    found = trace(envs, actions)
    envs.close()
    for one, other in zip(found, expected, strict=True):
        assert_same(one.observation, other.observation)
        np.testing.assert_array_equal(one.reward, other.reward)
        np.testing.assert_array_equal(one.truncated, other.truncated)


def test_the_page_is_that_of_the_rows() -> None:
    assert wrappers.PAGE.read_text(encoding="utf-8") == wrappers.page(), "run: python -m tests.recipes.wrappers"
