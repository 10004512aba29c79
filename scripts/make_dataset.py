"""Make Minari data sets of controllers, of a trained agent and of random actions, with sensors late by several delays.

Each data set holds laps of one contender at one delay, in turns of either kind; the noise of sensors makes them differ. An
environment is rebuilt from a data set by `recover_environment`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import tyro
from tqdm import tqdm

from flexarm_agents.contenders import ENVIRONMENT, Contender, from_controller, from_training
from flexarm_agents.environments import make_one
from flexarm_baselines.registry import controller_names
from flexarm_env.extras import needs_extra
from flexarm_env.info import end_reason
from flexarm_env.laps import LAPS
from flexarm_env.validation import integer, number, shown
from scripts.common.command_line import run
from scripts.common.markdown import table
from scripts.common.result_files import write_json

RANDOM = "random"
FORMAT = "hdf5"


@dataclass
class Options:
    """Make a data set for each contender and each delay."""

    contenders: tuple[str, ...] = ("ifdc", "flsac", "lqg", "nmpc", "square", RANDOM)
    """Names of controllers, of shipped agents, or "random"."""
    delays: tuple[float, ...] = (0.0, 0.0312, 0.06)
    """Delays of the sensor on link 2 [s]."""
    episodes: int = 4
    """Episodes in a data set, half of them of each lap."""
    noise: float = 0.002
    """Standard deviation of that sensor's noise [m]."""
    max_episode_steps: int | None = None
    """Control periods of an episode; None: a whole lap."""
    seed: int = 0
    """Of the first episode; each other has the next one."""
    folder: Path = Path("results/datasets")
    """For the data sets, and a table of them."""


def main() -> None:
    """Command line."""
    options = tyro.cli(Options, prog="python -m scripts.make_dataset", description=__doc__)
"""""
