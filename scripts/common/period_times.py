"""How long a policy computes in each control period of a lap."""

from __future__ import annotations

import time
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from flexarm_env.laps import LAPS
from flexarm_env.predictor import predictor

LAP = "plain"
FIRST = 10  # control periods that do not count: something may be made at the first call


def period_times(env: gymnasium.Env[Any, Any], policy: Any, most: int | None = None) -> NDArray[np.float64]:
    """Time each action of the plain lap; where the path is lost, the lap begins anew.

    The time is that of this process alone, on all its cores (`time.process_time`): other work on the machine counts
    little.

    Args:
        env: a `FlexArmEnv`, wrapped or not.
        policy: as `run_policy` takes it.
        most: periods to run at most; None: the whole lap.

    Returns:
        Of each period but the first ones [ms].
    """
    predict, options = predictor(policy, deterministic=True), LAPS[LAP].reset_options()
    periods = env.get_wrapper_attr("lap_steps") if most is None else most
    done, taken = True, list[float]()
    while len(taken) < periods:
        if done:
            observation, _ = env.reset(seed=0, options=options)
            memory, start = None, np.ones(1, dtype=bool)
        begun = time.process_time()
        action, memory = predict(observation, memory, start)
        taken.append(1e3 * (time.process_time() - begun))
        start = np.zeros(1, dtype=bool)
        observation, _, terminated, truncated, _ = env.step(action)
        done = bool(terminated or truncated)
    return np.array(taken[FIRST:])
