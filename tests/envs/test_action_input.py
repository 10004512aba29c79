"""Actions and calls that a single environment refuses."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from flexarm_env.envs.single import FlexArmEnv
from tests.support.envs import RESIDUAL, SQUARE, assert_same, bare


@pytest.mark.parametrize(
    ("action", "message"),
    [
        ([math.nan, 0.0], r"action\[0\] = nan: must be finite"),
        ([0.0, -math.inf], r"action\[1\] = -inf: must be finite"),
        ([0.0], r"action: must have shape \(2,\), got \(1,\)"),
        (0.0, r"action: must have shape \(2,\), got \(\)"),
        ([[0.0, 0.0]], r"action: must have shape \(2,\), got \(1, 2\)"),
    ],
    ids=str,
)
@pytest.mark.parametrize("env_id", [SQUARE, RESIDUAL])
def test_a_wrong_action_is_refused_and_nothing_moves(env_id: str, action: Any, message: str) -> None:
    env, twin = bare(env_id), bare(env_id)
    with pytest.raises(ValueError, match=message):
        env.step(np.asarray(action))
    assert_same(env.step(np.zeros(2, np.float32)), twin.step(np.zeros(2, np.float32)))


def test_steps_before_the_first_reset_are_refused() -> None:
    with pytest.raises(RuntimeError, match=r"step\(\) before reset\(\)"):
        FlexArmEnv().step(np.zeros(2, np.float32))
    with pytest.raises(RuntimeError, match=r"render\(\) before reset\(\)"):
        FlexArmEnv(render_mode="rgb_array").render()
    with pytest.raises(AttributeError, match="gain_limit: the action is 'torque', not the gain"):
        _ = FlexArmEnv().gain_limit
