"""Gymnasium's wrappers and vectors step our environments, a row for each; what they do with them is Gymnasium's."""

from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
import pytest
import torch
from gymnasium.wrappers import FrameStackObservation, TransformAction, TransformObservation, TransformReward, vector

from tests.support.envs import SQUARE, assert_same, make, shared_arm
from tests.support.envs import vector as make_batch

# DtypeObservation compares float32 bounds with the least float64.
pytestmark = pytest.mark.filterwarnings("ignore:overflow encountered in cast:RuntimeWarning:gymnasium.spaces.box")

LIMIT = 5  # steps of a short episode
SHORT = {"max_episode_steps": LIMIT}
PICTURES = {"render_mode": "rgb_array"}
FILM = {"video_folder": "films", "disable_logger": True}
TWO = np.float32(2.0)


class Row(NamedTuple):
    name: str
    wrap: Callable[[ModuleType, Any], Any]  # puts the wrapper of a module around an environment, or a batch
    options: dict[str, Any]  # of the environment


def row(name: str, *arguments: Any, options: Any = None, inner: Any = None, **named: Any) -> Row:
    """Return a wrapper's row; it is put around what `inner` makes of the environment."""

    def wrap(module: ModuleType, env: Any) -> Any:
        return getattr(module, name)(inner(env) if inner else env, *arguments, **named)

    return Row(name, wrap, options or {})


def half(x: Any) -> Any:
    return 0.5 * x


# Those that environments and batches have by the same names.
ALIKE = (
    row("ClipAction"),
    row("RescaleAction", -TWO, TWO),
    row("DtypeObservation", np.float64),
    row("ReshapeObservation", (21, 2)),
    row("RescaleObservation", np.float32(0.0), np.float32(1.0)),
    row("NormalizeObservation"),
    row("NormalizeReward"),
    row("TransformReward", half),
    row("ClipReward", 0.0, 0.3),
    row("NumpyToTorch"),
    row("RecordEpisodeStatistics", options=SHORT),
    row("RecordVideo", options=PICTURES | SHORT, video_length=LIMIT, **FILM),
)
SINGLE = (
    *ALIKE,
    row("TimeLimit", LIMIT),
    row("OrderEnforcing", inner=lambda env: env.unwrapped),
    row("PassiveEnvChecker", inner=lambda env: env.unwrapped),
    row("Autoreset", options=SHORT),
    row("TransformAction", np.negative, None),
    row("TransformObservation", half, None),
    row("StickyAction", 0.999),
    row("MaxAndSkipObservation", 4),
    row("RepeatAction", 4),
    row("DiscretizeAction", 5),
    row("DiscretizeObservation", 9, multidiscrete=True),
    row("FrameStackObservation", 3),
    row("FlattenObservation", inner=lambda env: FrameStackObservation(env, 3)),
    row("DelayObservation", 2),
    row("TimeAwareObservation"),
    row("AddRenderObservation", options=PICTURES),
    row("RenderCollection", options=PICTURES),
)
BATCH = (
    *ALIKE,
    row("TransformAction", np.negative),
    row("TransformObservation", half),
    row("VectorizeTransformAction", TransformAction, func=np.negative, action_space=None),
    row("VectorizeTransformObservation", TransformObservation, func=half, observation_space=None),
    row("FlattenObservation"),
    row("VectorizeTransformReward", TransformReward, func=half),
    row("DictInfoToList"),
)


def cases(rows: tuple[Row, ...]) -> list[Any]:
    return [pytest.param(row, id=row.name, marks=[pytest.mark.slow] * ("render_mode" in row.options)) for row in rows]


def stepped(env: Any) -> list[Any]:
    """Return observation and reward of some steps, beyond the end of a short episode."""
    found: list[Any] = [(env.reset(seed=3)[0], 0.0)]
    env.action_space.seed(0)
    for _ in range(LIMIT + 2):
        action = env.action_space.sample()
        observation, reward, *_ = env.step(
            torch.from_numpy(action) if isinstance(found[0][0], torch.Tensor) else action
        )
        found.append((observation, reward))
    return found


def check(env: Any) -> None:
    for observation, reward in stepped(env):
        assert np.asarray(observation) in env.observation_space
        assert np.isfinite(np.asarray(reward)).all()
    env.close()


@pytest.mark.parametrize("row", cases(SINGLE))
def test_wrappers_of_one_environment(row: Row, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if not hasattr(gym.wrappers, row.name):
        pytest.skip("this Gymnasium is older than the wrapper")
    monkeypatch.chdir(tmp_path)
    check(row.wrap(gym.wrappers, make(**row.options)))


@pytest.mark.parametrize("row", cases(BATCH))
def test_wrappers_of_a_batch(row: Row, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    check(row.wrap(vector, make_batch(**row.options)))


@pytest.mark.parametrize("mode", ["SameStep", "Disabled"])
def test_running_means_of_observations_need_next_step(mode: str) -> None:
    with pytest.raises((ValueError, AssertionError)):  # Gymnasium 1.2 asserts, without a message
        vector.NormalizeObservation(make_batch(autoreset_mode=mode))


def test_tensors_have_no_last_observations() -> None:
    with pytest.raises(BufferError, match="DLPack"):
        stepped(vector.NumpyToTorch(make_batch(autoreset_mode="SameStep", **SHORT)))


def test_a_vector_of_single_environments_is_the_batch() -> None:
    """By name, in this process; `tests/envs/test_contract.py` has those in processes."""
    envs = gym.make_vec(SQUARE, num_envs=3, vectorization_mode="sync", **shared_arm(SQUARE, SHORT))
    for one, other in zip(stepped(envs), stepped(make_batch(**SHORT)), strict=True):
        assert_same(one[0], other[0])
        np.testing.assert_array_equal(one[1], other[1])
