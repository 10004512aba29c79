"""The bar of a command that runs long, and what counts the steps of an episode for it."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

import gymnasium
from tqdm import tqdm

from flexarm_env.envs.single import FlexArmEnv

PATIENCE = 1.0  # before a bar is shown [s]
LOG = 30.0  # the same without a terminal, and between two lines there [s]


def progress_bar(total: int, unit: str) -> tqdm[Any]:
    """Return a bar on stderr for a number of units; it is shown once they take long, and removed at the end."""
    terminal = sys.stderr.isatty()
    pauses = {"delay": PATIENCE} if terminal else {"delay": LOG, "mininterval": LOG}
    return tqdm(total=total, unit=f" {unit}", leave=False, dynamic_ncols=terminal, **pauses)


class Watched(gymnasium.Wrapper[Any, Any, Any, Any]):
    """An environment that calls a function after each step."""

    def __init__(self, env: gymnasium.Env[Any, Any], tick: Callable[[], Any]) -> None:
        super().__init__(env)
        self._tick = tick

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """See `gymnasium.Env.step`."""
        found = self.env.step(action)
        self._tick()
        return found


def episode_steps(env: gymnasium.Env[Any, Any]) -> int:
    """Return the control periods of a whole episode: the time limit, or a lap where there is none."""
    inner = env.unwrapped
    assert isinstance(inner, FlexArmEnv)
    limit = None if env.spec is None else env.spec.max_episode_steps
    return inner.lap_steps if limit is None else limit
