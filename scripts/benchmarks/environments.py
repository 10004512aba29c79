"""Environments through `gymnasium.make` with its default wrappers: steps, and the way to the first one."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import gymnasium

from scripts.benchmarks.timing import Group, Ratio, Subject

SQUARE = "FlexArm/Square-v0"
ACROBOT = "Acrobot-v1"
LINEAR = "linear"  # the arm beside which the default one is timed


def steps(effort: float) -> Group:
    """Single environments with random actions, resets included."""
    counts = {SQUARE: 8000, ACROBOT: 3000}
    subjects = [stepped(name, name, round(effort * count)) for name, count in counts.items()]
    linear = stepped(f"{SQUARE}, linear arm", SQUARE, round(effort * counts[SQUARE]), arm=LINEAR)
    ratios = [
        Ratio(SQUARE, linear.name, "the default arm over the linear one, time of a step"),
        Ratio(ACROBOT, linear.name, f"{linear.name} over Acrobot, steps in the same time"),
        Ratio(ACROBOT, SQUARE, f"{SQUARE} over Acrobot, steps in the same time"),
    ]
    title = "One environment, gymnasium.make with default wrappers, random actions"
    return Group("environment", title, "us", "env step", [*subjects, linear], ratios)


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
env = gymnasium.make(sys.argv[1])
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
    subjects = [  # the first one comes first
        Subject(cold, lambda: _process(SQUARE, cache), prepare=lambda: shutil.rmtree(cache), at_most=colds),
        Subject(cached, lambda: _process(SQUARE, cache)),
        Subject(ACROBOT, lambda: _process(ACROBOT, cache)),
    ]
    ratios = [
        Ratio(cold, cached, "first time ever over a later process"),
        Ratio(cached, ACROBOT, "FlexArm (cached) over Acrobot, time to the first step"),
    ]
    title = "From process start to the first step (import, make, reset, step)"
    return Group("first_step", title, "s", "process", subjects, ratios, wall=True, warm=False, share=0.5)


def _process(name: str, cache: Path) -> dict[str, float]:
    environment = os.environ | {"FLEXARM_CACHE_DIR": str(cache)}
    command = [sys.executable, "-c", _FIRST_STEP, name]
    done = subprocess.run(command, env=environment, check=True, stdout=subprocess.PIPE, text=True)
    return json.loads(done.stdout)
