"""Data sets for Minari: what is recorded, and what is refused; tests/recipes writes and loads one."""

from __future__ import annotations

import importlib.util
import os
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from flexarm_env.extras import install_command
from scripts import make_dataset
from scripts.make_dataset import CONTENT, ROOT, Options, contender, dataset_id, recorded, saved, summary


def test_an_episode_is_recorded_whole() -> None:
    one = contender("random", {"arm": "linear", "delay": 0.02, "noise": 0.001, "max_episode_steps": 20})
    episode, again, other = (recorded(one, seed, "plain") for seed in (3, 3, 4))
    assert episode.observations.shape == (21, *one.env.observation_space.shape)  # type: ignore[misc]
    assert (episode.actions.shape, episode.rewards.shape, episode.tip_errors.shape) == ((20, 2), (20,), (21,))
    assert (episode.ended, episode.options["elbow_branch"]) == ("truncated", "negative")
    np.testing.assert_array_equal(episode.observations, again.observations)
    assert (episode.actions != other.actions).any()
    told = summary("name", [episode, other])
    assert (told["episodes"], told["complete"], told["steps"]) == (2, 2, 40)


def test_a_controller_acts_in_its_own_environment() -> None:
    one = contender("ifdc", {"arm": "linear", "delay": 0.02, "max_episode_steps": 3})
    assert recorded(one, 0, "swing").actions.shape == (3, 1)  # the gain


def test_an_action_outside_of_its_space_is_refused() -> None:
    one = contender("random", {"arm": "linear", "max_episode_steps": 3})
    with pytest.raises(ValueError, match=r"action = .*1\.5.* of random in step 0: not in Box"):
        recorded(one._replace(policy=lambda observation: np.array([0.0, 1.5])), 0, "plain")


def test_a_data_set_stays_until_the_next_one_is_complete(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Minari's part is played by a function that writes what it is told, or fails with half of it written."""
    name = dataset_id("random", 0.0)
    content = tmp_path / name / CONTENT / "main_data.hdf5"

    def write(name: str, *arguments: Any, algorithm_name: str, **named: Any) -> None:
        folder = Path(os.environ[ROOT], name, CONTENT)
        folder.mkdir(parents=True)
        (folder.parents[1] / "namespace_metadata.json").write_text("{}")
        (folder / content.name).write_text(algorithm_name)
        if algorithm_name == "fails":
            raise OSError("no space left")

    monkeypatch.setattr(make_dataset, "_minari", lambda: SimpleNamespace(create_dataset_from_buffers=write))
    monkeypatch.setenv(ROOT, "before")
    one = contender("random", {"arm": "linear"})
    for algorithm in ("first", "second"):
        saved(tmp_path, name, one._replace(name=algorithm), [])
        assert content.read_text() == algorithm
    with pytest.raises(OSError, match="no space left"):
        saved(tmp_path, name, one._replace(name="fails"), [])
    assert content.read_text() == "second"
    assert sorted(path.name for path in content.parents[2].iterdir()) == [
        "namespace_metadata.json",
        content.parents[1].name,
    ]
    assert os.environ[ROOT] == "before"


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"episodes": 0}, "episodes = 0"),
        ({"seed": -1}, "seed = -1"),
        ({"contenders": ("lqg", "lqg")}, "contenders = .*: must differ"),
        ({"contenders": ("lgq",)}, "contender = 'lgq'"),
        ({"delays": (0.0312, 0.0313)}, "must differ by a millisecond"),
        ({"delays": (-0.1,)}, r"delay = -0\.1"),
    ],
)
def test_bad_options_are_refused_at_once(
    monkeypatch: pytest.MonkeyPatch, changes: dict[str, Any], message: str
) -> None:
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
