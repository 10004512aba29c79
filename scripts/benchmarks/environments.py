"""Environments through `gymnasium.make` with its default wrappers: steps, and the way to the first one."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from scripts.benchmarks.timing import Group, Ratio, Subject

SQUARE, PAPER = "FlexArm/Square-v0", "FlexArm/Paper-v0"
ACROBOT, EMPTY = "Acrobot-v1", "FlexArmBench/Empty-v0"
LINEAR = "linear"  # the arm beside which the default one is timed


class EmptyEnv(gymnasium.Env[NDArray[np.float32], NDArray[np.float32]]):
    """Does nothing: what Gymnasium itself costs."""

    observation_space = gymnasium.spaces.Box(-1.0, 1.0, (12,), np.float32)
    action_space = gymnasium.spaces.Box(-1.0, 1.0, (1,), np.float32)
    _observation = np.zeros(12, dtype=np.float32)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> Any:
        """Start an episode."""
        super().reset(seed=seed)
        return self._observation.copy(), {}

    def step(self, action: Any) -> Any:
        """Do nothing."""
        return self._observation.copy(), 0.0, False, False, {}


def steps(effort: float) -> Group:
    """Single environments with random actions, resets included."""
    if EMPTY not in gymnasium.registry:
        gymnasium.register(EMPTY, entry_point=f"{__name__}:{EmptyEnv.__name__}", max_episode_steps=16_000)
    counts = {SQUARE: 8000, PAPER: 2000, ACROBOT: 3000, EMPTY: 50_000}
    subjects = [stepped(name, name, round(effort * count)) for name, count in counts.items()]
    linear = stepped(f"{SQUARE}, linear arm", SQUARE, round(effort * counts[SQUARE]), arm=LINEAR)
    subjects.append(linear)
    ratios = [
        Ratio(SQUARE, linear.name, "the default arm over the linear one, time of a step"),
        Ratio(ACROBOT, linear.name, f"{linear.name} over Acrobot, steps in the same time"),
        Ratio(ACROBOT, SQUARE, f"{SQUARE} over Acrobot, steps in the same time"),
        Ratio(ACROBOT, PAPER, f"{PAPER} over Acrobot, steps in the same time"),
        Ratio(SQUARE, EMPTY, "FlexArm's time over that of an empty environment"),
        Ratio(ACROBOT, EMPTY, "Acrobot's time over that of an empty environment"),
    ]
    title = "One environment, gymnasium.make with default wrappers, random actions"
    return Group("environment", title, "us", "env step", subjects, ratios)


def stepped(name: str, env_id: str, count: int, **options: Any) -> Subject:
    """One environment, stepped with random actions, and reset where an episode ends."""
    env = gymnasium.make(env_id, **options)
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(count)]

    def work() -> None:
        for action in actions:
            _, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                env.reset()

    return Subject(name, work, count, prepare=lambda: env.reset(seed=0))


# What a new process does until it has made one step; it prints the seconds of each part, and those of the processor.
_FIRST_STEP = """
import json, sys, time
clock = [time.perf_counter()]
import gymnasium
if sys.argv[1].startswith("FlexArm"):
    import flexarm_env
clock.append(time.perf_counter())
env = gymnasium.make(sys.argv[1], **json.loads(sys.argv[2]))
clock.append(time.perf_counter())
env.reset(seed=0)
clock.append(time.perf_counter())
env.step(env.action_space.sample())
clock.append(time.perf_counter())
parts = dict(zip(("import", "make", "reset", "step"), [b - a for a, b in zip(clock, clock[1:])]))
print(json.dumps(parts | {"processor": time.process_time()}))
"""


def first_step(colds: int, cache: Path) -> Group:
    """Time processes from their start to their first step, with an empty cache (so often) and with a filled one."""
    cold, cached = f"{SQUARE}, nothing compiled yet", f"{SQUARE}, compiled code cached"
    linear, empty = f"{SQUARE}, linear arm, nothing compiled yet", cache / "linear"
    subjects = [  # the first one comes first
        Subject(cold, lambda: _process(SQUARE, cache), prepare=lambda: shutil.rmtree(cache), at_most=colds),
        Subject(cached, lambda: _process(SQUARE, cache)),
        Subject(ACROBOT, lambda: _process(ACROBOT, cache)),
        Subject(
            linear,
            lambda: _process(SQUARE, empty, arm=LINEAR),
            prepare=lambda: shutil.rmtree(empty, ignore_errors=True),
            at_most=colds,
        ),
    ]
    ratios = [
        Ratio(cold, cached, "first time ever over a later process"),
        Ratio(cached, ACROBOT, "FlexArm (cached) over Acrobot, time to the first step"),
    ]
    title = "From process start to the first step (import, make, reset, step)"
    return Group("first_step", title, "s", "process", subjects, ratios, wall=True, warm=False, share=0.5)


def _process(name: str, cache: Path, **options: Any) -> dict[str, float]:
    environment = os.environ | {"FLEXARM_CACHE_DIR": str(cache)}
    command = [sys.executable, "-c", _FIRST_STEP, name, json.dumps(options)]
    done = subprocess.run(command, env=environment, check=True, stdout=subprocess.PIPE, text=True)
    return json.loads(done.stdout)
