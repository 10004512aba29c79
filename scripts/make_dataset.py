"""Make Minari data sets of controllers, of a trained agent and of random actions, with a sensor late by several delays.

A data set holds episodes of one candidate at one delay, which take turns with the two standard laps; the sensor's noise
makes them differ. Minari makes its environment again from it.
"""

import importlib
import os
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from tqdm import tqdm

from flexarm_agents import shipped_policies
from flexarm_agents.environments import make_one
from flexarm_agents.evaluation.candidates import ENVIRONMENT, Candidate, from_controller, from_training
from flexarm_baselines.registry import controller_names
from flexarm_env.extras import needs_extra
from flexarm_env.laps import LAPS
from flexarm_env.rollout import run_policy
from flexarm_env.validation import choice, integer, number, shown
from scripts.common.command_line import read_options, run
from scripts.common.markdown import table
from scripts.common.result_files import write_json

RANDOM = "random"
KEPT = ("observations", "actions", "rewards", "terminations", "truncations")  # of an episode
NAMES = ("id", "episodes", "complete", "steps")


@dataclass
class Options:
    """Make Minari data sets of controllers, an agent and random actions, with a sensor late by several delays."""

    candidates: tuple[str, ...] = ("ifdc", "flsac", "lqg", "nmpc", "square", RANDOM)
    """Names of controllers or shipped agents, or "random"."""
    delays: tuple[float, ...] = (0.0, 0.0312, 0.06)
    """Delays of the sensor on link 2 [s]."""
    episodes: int = 4
    """Episodes in a data set."""
    noise: float = 0.002
    """Standard deviation of that sensor's noise [m]."""
    max_episode_steps: int | None = None
    """Control periods after which an episode is cut off; None: a lap."""
    seed: int = 0
    """Seed of the first episode; the next ones have the next seeds."""
    folder: Path = Path("results/datasets")
    """Folder for the data sets and a summary; data sets of the same names are replaced."""


class Recorder(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Collects what Minari keeps of an episode, in `buffer`."""

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin an episode."""
        observation, info = self.env.reset(seed=seed, options=options)
        self.buffer: dict[str, Any] = {"seed": seed, "options": options, "observations": [observation]}
        self.buffer |= {name: [] for name in KEPT[1:]}
        self.buffer["infos"] = {"tip_error": [info["tip_error"]]}
        return observation, info

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Step, and keep what happened; refuse an action that the environment would clip, unseen in the data."""
        action = np.asarray(action, self.action_space.dtype)
        if not self.action_space.contains(action):
            raise ValueError(
                f"action = {shown(action)} in step {len(self.buffer['actions'])}: not in {self.action_space}"
            )
        found = self.env.step(action)
        observation, reward, *ends, info = found
        for name, value in zip(KEPT, (observation, action, float(reward), *ends), strict=True):
            self.buffer[name].append(value)
        self.buffer["infos"]["tip_error"].append(info["tip_error"])
        return found


def dataset_id(name: str, delay: float) -> str:
    """Return the id of a data set: "flexarm/square/lqg-31ms-v0"."""
    return f"flexarm/square/{name.replace('_', '-')}-{1e3 * delay:.0f}ms-v0"


def candidate(name: str, options: dict[str, Any]) -> Candidate:
    """Make a candidate with its environment."""
    if name == RANDOM:
        env = make_one(ENVIRONMENT, options)
        return Candidate(name, lambda observation: env.action_space.sample(), env, ENVIRONMENT, options)
    if name in controller_names():
        return from_controller(name, ENVIRONMENT, options)
    return from_training(name, options, None)


def recorded(one: Candidate, seed: int, lap: str) -> dict[str, Any]:
    """Run an episode, and return the fields of Minari's buffer of it."""
    recorder = Recorder(one.env)
    recorder.action_space.seed(seed)
    run_policy(recorder, one.policy, seed, lap=lap)
    return recorder.buffer


def saved(name: str, one: Candidate, episodes: list[dict[str, Any]]) -> None:
    """Write a data set, in the place of one of the same id."""
    minari = _minari()
    buffer = importlib.import_module("minari.data_collector").EpisodeBuffer
    if name in minari.list_local_datasets():
        minari.delete_dataset(name)
    with warnings.catch_warnings():
        # Minari asks for an address and a link to the code, which whoever publishes the data set adds.
        warnings.simplefilter("ignore", UserWarning)
        minari.create_dataset_from_buffers(
            name,
            [buffer(id=index, **episode) for index, episode in enumerate(episodes)],
            env=one.env.spec,
            algorithm_name=one.name,
            author="FlexArm contributors",
            description=f"Laps of the square by {one.name}; docs/recipes/minari.md",
            requirements=["flexarm"],
            data_format="hdf5",
        )


def summary(name: str, episodes: list[dict[str, Any]]) -> dict[str, Any]:
    """Return what a data set holds."""
    complete = [episode for episode in episodes if episode["truncations"][-1]]
    rms = [float(np.sqrt(np.mean(np.square(episode["infos"]["tip_error"])))) for episode in complete]
    return {
        "id": name,
        "episodes": len(episodes),
        "complete": len(complete),
        "steps": sum(len(episode["rewards"]) for episode in episodes),
        "mean_rms": float(np.mean(rms)) if rms else None,
    }


def check(options: Options) -> None:
    """Refuse options before anything is simulated."""
    _minari()
    integer("episodes", options.episodes, 1)
    integer("seed", options.seed, 0)
    if len(set(options.candidates)) < len(options.candidates):
        raise ValueError(f"candidates = {options.candidates}: must differ, since they name the data sets")
    for name in options.candidates:
        choice("candidate", name, (*controller_names(), *shipped_policies(), RANDOM))
    ids = [dataset_id("x", number("delay", delay, "s", least=0.0)) for delay in options.delays]
    if len(set(ids)) < len(ids):
        raise ValueError(f"delays = {options.delays}: must differ by a millisecond, since they name the data sets")


def make(options: Options, tick: Callable[[], Any]) -> list[dict[str, Any]]:
    """Make all data sets, and return a summary of each."""
    rows, laps = [], list(LAPS)
    for name in options.candidates:
        for delay in options.delays:
            given: dict[str, Any] = {"delay": delay, "noise": options.noise}
            if options.max_episode_steps is not None:
                given["max_episode_steps"] = options.max_episode_steps
            one = candidate(name, given)
            episodes = []
            for n in range(options.episodes):
                episodes.append(recorded(one, options.seed + n, laps[n % len(laps)]))
                tick()
            saved(dataset_id(name, delay), one, episodes)
            rows.append(summary(dataset_id(name, delay), episodes))
            one.env.close()
    return rows


def _minari() -> Any:
    with needs_extra("scripts.make_dataset", "recipes"):
        return importlib.import_module("minari")


def main() -> None:
    """Command line: data sets, `datasets.json`, and a table on the terminal."""
    options = read_options("python -m scripts.make_dataset", Options())
    check(options)
    options.folder.mkdir(parents=True, exist_ok=True)
    os.environ["MINARI_DATASETS_PATH"] = str(options.folder.resolve())
    with tqdm(total=len(options.candidates) * len(options.delays) * options.episodes, unit="episode") as bar:
        rows = make(options, bar.update)
    write_json(options.folder / "datasets.json", {"datasets": rows})
    errors = ("-" if row["mean_rms"] is None else f"{row['mean_rms']:.3f}" for row in rows)
    figures = [[*(str(row[name]) for name in NAMES), error] for row, error in zip(rows, errors, strict=True)]
    print(table(["data set", "episodes", "complete", "steps", "mean r.m.s. error [m]"], figures), end="")


if __name__ == "__main__":
    run(main)
