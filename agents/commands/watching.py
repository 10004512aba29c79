"""`Watched`: an environment that says how far an episode is, for the commands that run one."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import gymnasium

from flexarm_env.envs.single import FlexArmEnv


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
