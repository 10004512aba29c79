"""Rendering through the environments: pictures, videos, windows; no display is needed."""

import copy
import pickle
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.wrappers import RecordVideo

pytest.importorskip("pygame")

GAIN, SQUARE = "flexarm_env:FlexArm/SquareGain-v0", "flexarm_env:FlexArm/Square-v0"


def stepped(env: Any, steps: int, seed: int = 0) -> Any:
    """Draw the picture, or pictures, after some steps with the largest action from the standard start."""
    env.reset(seed=seed, options={"start": "corner"})
    for _ in range(steps):
        env.step(np.ones(env.action_space.shape, np.float32))
    return env.render()


@pytest.mark.parametrize(("env_id", "arm"), [(GAIN, "default"), (SQUARE, "linear")])
def test_a_picture_shows_the_present_instant(env_id: str, arm: str) -> None:
    env = gymnasium.make(env_id, arm=arm, render_mode="rgb_array")
    first, later, again = stepped(env, 0), stepped(env, 20), stepped(env, 20)
    assert (first != later).any()
    np.testing.assert_array_equal(later, again)


@pytest.mark.parametrize("how", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_a_copy_of_an_environment_that_has_drawn_goes_on(how: Any) -> None:
    env = gymnasium.make(GAIN, render_mode="rgb_array")
    stepped(env, 5)
    twin = how(env)
    for each in (env, twin):
        each.step(np.zeros(1, np.float32))
    np.testing.assert_array_equal(env.render(), twin.render())


def test_a_batch_draws_each_of_its_arms() -> None:
    envs = gymnasium.make_vec(SQUARE, num_envs=3, arm="linear", render_mode="rgb_array")
    assert envs.render() is None  # nothing to show yet
    pictures = stepped(envs, 3)
    assert len(pictures) == 3
    alone = gymnasium.make(SQUARE, arm="linear", render_mode="rgb_array")
    np.testing.assert_array_equal(pictures[1], stepped(alone, 3, seed=1))
    envs.close()


def test_videos_are_recorded(tmp_path: Path) -> None:
    pytest.importorskip("moviepy")
    env = RecordVideo(gymnasium.make(GAIN, render_mode="rgb_array"), str(tmp_path / "videos"), lambda episode: True)
    assert env.metadata["render_fps"] == 100  # real time: a picture for each 10 ms
    stepped(env, 10)
    env.close()
    (video,) = (tmp_path / "videos").glob("*.mp4")
    assert video.stat().st_size > 1000


def test_a_window_follows_the_steps(pygame: Any) -> None:
    env = gymnasium.make(GAIN, render_mode="human")
    assert stepped(env, 3) is None
    assert pygame.display.get_surface() is not None
    env.close()
    assert pygame.display.get_surface() is None
    env.close()


def test_nothing_is_drawn_without_a_mode() -> None:
    with pytest.warns(UserWarning, match="render mode"):
        assert gymnasium.make(GAIN).unwrapped.render() is None
