"""Make Minari data sets of controllers, of a trained agent and of random actions, with a sensor late by several delays.

A data set holds episodes of one contender at one delay, which take turns with the two standard laps; the sensor's noise
makes them differ. Minari makes its environment again from it.
"""

from __future__ import annotations

import importlib
import os
import shutil
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import tyro
from tqdm import tqdm

from flexarm_agents import shipped_policies
from flexarm_agents.environments import make_one
from flexarm_agents.evaluation.candidates import ENVIRONMENT, Candidate, from_controller, from_training
from flexarm_baselines.registry import controller_names
from flexarm_env import end_reason
from flexarm_env.envs.single import FlexArmEnv
from flexarm_env.extras import needs_extra
from flexarm_env.laps import LAPS
from flexarm_env.predictor import predictor
from flexarm_env.validation import choice, integer, number, shown
from scripts.common.command_line import run
from scripts.common.markdown import table
from scripts.common.result_files import replacing, write_json

RANDOM = "random"
NAMES = ("id", "episodes", "complete", "steps")
ROOT = "MINARI_DATASETS_PATH"  # where Minari reads and writes
CONTENT = "data"  # Minari's folder in that of a data set


@dataclass
class Options:
    """Make a data set of each contender at each delay."""

    contenders: tuple[str, ...] = ("ifdc", "flsac", "lqg", "nmpc", "square", RANDOM)
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
    """For the data sets and a summary; data sets of the same names are replaced."""


class Episode(NamedTuple):
    """A lap of one contender.

    Attributes:
        seed: of the reset.
        options: of the reset.
        observations: Shape (steps + 1, k).
        actions: Shape (steps, channels).
        rewards: Shape (steps,).
        tip_errors: distance of the true tip from the reference at each observation [m]. Shape (steps + 1,).
        ended: "truncated", or why it terminated.
    """

    seed: int
    options: dict[str, Any]
    observations: np.ndarray
    actions: np.ndarray
    rewards: np.ndarray
    tip_errors: np.ndarray
    ended: str


def dataset_id(name: str, delay: float) -> str:
    """Return the id of a data set: "flexarm/square/lqg-31ms-v0"."""
    return f"flexarm/square/{name.replace('_', '-')}-{1e3 * delay:.0f}ms-v0"


def contender(name: str, options: dict[str, Any]) -> Candidate:
    """Make a contender with its environment.

    Args:
        name: see `Options.contenders`.
        options: of the environment.

    Raises:
        TypeError, ValueError: for a bad option.
    """
    if name == RANDOM:
        env = make_one(ENVIRONMENT, options)
        return Candidate(name, lambda observation: env.action_space.sample(), env, ENVIRONMENT, options)
    if name in controller_names():
        return from_controller(name, ENVIRONMENT, options)
    return from_training(name, options, None)


def recorded(one: Candidate, seed: int, lap: str) -> Episode:
    """Run an episode.

    Args:
        one: acts.
        seed: of the reset, and of random actions.
        lap: one of `LAPS`.

    Raises:
        ValueError: if an action is outside of its space; the environment would clip it, and the data set would not say
            what moved the arm.
    """
    env = one.env
    assert isinstance(env.unwrapped, FlexArmEnv)
    options = LAPS[lap].reset_options(env.unwrapped.settings.direction)
    env.action_space.seed(seed)
    observation, info = env.reset(seed=seed, options=options)
    act = predictor(one.policy, deterministic=True)
    observations, rewards, errors = [observation], [], [info["tip_error"]]
    actions: list[np.ndarray] = []
    memory, start, ended = None, np.ones(1, dtype=bool), None
    while ended is None:
        action, memory = act(observation, memory, start)
        start = np.zeros(1, dtype=bool)
        action = np.asarray(action, env.action_space.dtype)
        if not env.action_space.contains(action):
            raise ValueError(
                f"action = {shown(action)} of {one.name} in step {len(actions)}: not in {env.action_space}"
            )
        observation, reward, terminated, truncated, info = env.step(action)
        observations.append(observation)
        actions.append(action)
        rewards.append(float(reward))
        errors.append(info["tip_error"])
        if terminated:
            ended = end_reason(info["end_code"])
        elif truncated:
            ended = "truncated"
    arrays = (np.array(observations), np.array(actions), np.array(rewards), np.array(errors))
    return Episode(seed, options, *arrays, ended)


def saved(folder: Path, name: str, one: Candidate, episodes: list[Episode]) -> None:
    """Write a data set aside, and put it in the place of one of the same id when it is complete.

    Args:
        folder: of the data sets.
        name: id.
        one: whose it is.
        episodes: what it holds.

    Raises:
        ValueError: if something that is no data set lies there.
    """
    minari = _minari()
    with replacing(folder / name, CONTENT) as work:
        aside = work / "aside"
        with _minari_folder(aside), warnings.catch_warnings():
            # Minari asks for an address and a link to the code, which whoever publishes the data set adds.
            warnings.simplefilter("ignore", UserWarning)
            minari.create_dataset_from_buffers(
                name,
                [buffer(index, episode) for index, episode in enumerate(episodes)],
                env=one.env.spec,
                algorithm_name=one.name,
                author="FlexArm contributors",
                description=f"Laps of the square by {one.name}; docs/recipes/minari.md",
                requirements=["flexarm"],
                data_format="hdf5",
            )
        os.replace(aside / name / CONTENT, work / CONTENT)
        for path in aside.rglob("*.json"):  # of the namespaces that the id names; uploading needs them
            os.replace(path, folder / path.relative_to(aside))
        shutil.rmtree(aside)


@contextmanager
def _minari_folder(folder: Path) -> Iterator[None]:
    """Let Minari write into a folder within the block."""
    before = os.environ.get(ROOT)
    os.environ[ROOT] = str(folder.resolve())
    try:
        yield
    finally:
        del os.environ[ROOT]
        if before is not None:
            os.environ[ROOT] = before


def buffer(index: int, episode: Episode) -> Any:
    """Return an episode as Minari takes it.

    Args:
        index: of the episode in its data set.
        episode: what happened.
    """
    flags = np.zeros((2, len(episode.rewards)), dtype=bool)
    flags[int(episode.ended == "truncated"), -1] = True
    return importlib.import_module("minari.data_collector").EpisodeBuffer(
        id=index,
        seed=episode.seed,
        options=episode.options,
        observations=list(episode.observations),
        actions=list(episode.actions),
        rewards=episode.rewards.tolist(),
        terminations=flags[0].tolist(),
        truncations=flags[1].tolist(),
        infos={"tip_error": list(episode.tip_errors)},
    )


def summary(name: str, episodes: list[Episode]) -> dict[str, Any]:
    """Return what a data set holds."""
    whole = [episode for episode in episodes if episode.ended == "truncated"]
    rms = [float(np.sqrt(np.mean(np.square(episode.tip_errors)))) for episode in whole]
    return {
        "id": name,
        "episodes": len(episodes),
        "complete": len(whole),
        "steps": sum(len(episode.rewards) for episode in episodes),
        "mean_rms": float(np.mean(rms)) if rms else None,
    }


def check(options: Options) -> None:
    """Refuse options before anything is simulated.

    Args:
        options: to be checked.

    Raises:
        ModuleNotFoundError: without Minari.
        TypeError, ValueError: naming the option.
    """
    _minari()
    integer("episodes", options.episodes, 1)
    integer("seed", options.seed, 0)
    if len(set(options.contenders)) < len(options.contenders):
        raise ValueError(f"contenders = {options.contenders}: must differ, since they name the data sets")
    for name in options.contenders:
        choice("contender", name, (*controller_names(), *shipped_policies(), RANDOM))
    ids = [dataset_id("x", number("delay", delay, "s", least=0.0)) for delay in options.delays]
    if len(set(ids)) < len(ids):
        raise ValueError(f"delays = {options.delays}: must differ by a millisecond, since they name the data sets")


def make(options: Options, tick: Callable[[], Any]) -> list[dict[str, Any]]:
    """Make all data sets.

    Args:
        options: which.
        tick: called after each episode.

    Returns:
        A summary of each.
    """
    rows, laps = [], list(LAPS)
    for name in options.contenders:
        for delay in options.delays:
            given: dict[str, Any] = {"delay": delay, "noise": options.noise}
            if options.max_episode_steps is not None:
                given["max_episode_steps"] = options.max_episode_steps
            one = contender(name, given)
            episodes = []
            for n in range(options.episodes):
                episodes.append(recorded(one, options.seed + n, laps[n % len(laps)]))
                tick()
            saved(options.folder, dataset_id(name, delay), one, episodes)
            rows.append(summary(dataset_id(name, delay), episodes))
            one.env.close()
    return rows


def _minari() -> Any:
    with needs_extra("scripts.make_dataset", "recipes"):
        return importlib.import_module("minari")


def main() -> None:
    """Command line: data sets, `datasets.json`, and a table on the terminal."""
    options = tyro.cli(Options, prog="python -m scripts.make_dataset", description=__doc__)
    check(options)
    with tqdm(total=len(options.contenders) * len(options.delays) * options.episodes, unit="episode") as bar:
        rows = make(options, bar.update)
    write_json(options.folder / "datasets.json", {"datasets": rows})
    figures = [[str(row[name]) for name in NAMES] + [_metres(row["mean_rms"])] for row in rows]
    print(table(["data set", "episodes", "complete", "steps", "mean r.m.s. error [m]"], figures), end="")


def _metres(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"


if __name__ == "__main__":
    run(main)
