"""Data sets for Minari: what is recorded, and what is refused; tests/recipes writes and loads one."""

import importlib.util
import re
from typing import Any

import numpy as np
import pytest

from flexarm_env.extras import install_command
from scripts import make_dataset
from scripts.make_dataset import Options, candidate, dataset_id, recorded, summary


def test_an_episode_is_recorded_whole() -> None:
    one = candidate("random", {"arm": "linear", "delay": 0.02, "noise": 0.001, "max_episode_steps": 20})
    episode, again, other = (recorded(one, seed, "plain") for seed in (3, 3, 4))
    assert np.shape(episode["observations"]) == (21, *one.env.observation_space.shape)  # type: ignore[misc]
    assert [len(episode[name]) for name in ("actions", "rewards", "truncations")] == [20] * 3
    assert len(episode["infos"]["tip_error"]) == 21
    assert (episode["truncations"][-1], episode["options"]["elbow_branch"]) == (True, "negative")
    np.testing.assert_array_equal(episode["observations"], again["observations"])
    assert (np.array(episode["actions"]) != other["actions"]).any()
    told = summary("name", [episode, other])
    assert (told["episodes"], told["complete"], told["steps"]) == (2, 2, 40)


def test_a_controller_acts_in_its_own_environment() -> None:
    one = candidate("ifdc", {"arm": "linear", "delay": 0.02, "max_episode_steps": 3})
    assert np.shape(recorded(one, 0, "swing")["actions"]) == (3, 1)  # the gain


def test_an_action_outside_of_its_space_is_refused() -> None:
    one = candidate("random", {"arm": "linear", "max_episode_steps": 3})
    with pytest.raises(ValueError, match=r"action = .*1\.5.* in step 0: not in Box"):
        recorded(one._replace(policy=lambda observation: np.array([0.0, 1.5])), 0, "plain")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"episodes": 0}, "episodes = 0"),
        ({"seed": -1}, "seed = -1"),
        ({"candidates": ("lqg", "lqg")}, "candidates = .*: must differ"),
        ({"candidates": ("lgq",)}, "candidate = 'lgq'"),
        ({"delays": (0.0312, 0.0313)}, "must differ by a millisecond"),
        ({"delays": (-0.1,)}, r"delay = -0\.1"),
    ],
)
def test_bad_options_are_refused(monkeypatch: pytest.MonkeyPatch, changes: dict[str, Any], message: str) -> None:
    monkeypatch.setattr(make_dataset, "_minari", lambda: None)
    with pytest.raises(ValueError, match=message):
        make_dataset.check(Options(**changes))


def test_without_minari_the_extra_is_named() -> None:
    if importlib.util.find_spec("minari") is not None:
        pytest.skip("Minari is installed")
    with pytest.raises(ModuleNotFoundError, match=re.escape(install_command("recipes"))):
        make_dataset.check(Options())


def test_names_say_whose_they_are() -> None:
    assert dataset_id("lqg_gauges", 0.0312) == "flexarm/square/lqg-gauges-31ms-v0"
