"""Whatever the options and actions: observations within their space, rewards within their range, no exception."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, reject
from hypothesis import strategies as st

from flexarm_env import end_reason
from tests.hardening.strategies import any_options, cases
from tests.support.envs import make, terms_of
from tests.support.plain import run_plainly

POLICIES = ("random", "bang-bang", "spin", "none")


def actions_of(policy: str, shape: tuple[int, ...], steps: int, seed: int) -> np.ndarray:
    """Make the worst actions: full torques that change at random, or never, beyond the range now and then."""
    rng = np.random.default_rng(seed)
    if policy == "random":
        return rng.uniform(-1.5, 1.5, (steps, *shape)).astype(np.float32)
    if policy == "bang-bang":
        return np.repeat(rng.choice([-1.0, 1.0], (steps // 3 + 1, *shape)), 3, axis=0)[:steps]
    return np.full((steps, *shape), 1.0 if policy == "spin" else 0.0, np.float32)


def play(env: Any, policy: str, steps: int, seed: int) -> None:
    """Play episodes until so many steps are done."""
    largest = sum(env.unwrapped.settings.reward_weights.values()) * (1.0 + 1e-9)
    observation, _ = env.reset(seed=seed)
    assert env.observation_space.contains(observation)
    for action in actions_of(policy, env.action_space.shape, steps, seed):
        observation, reward, terminated, truncated, info = env.step(action)
        assert env.observation_space.contains(observation), observation
        assert 0.0 <= reward <= largest
        assert sum(terms_of(info).values()) == pytest.approx(reward, rel=1e-12, abs=1e-12)
        assert min(terms_of(info).values()) >= 0.0
        assert (end_reason(info["end_code"]) != "none") == terminated
        if terminated or truncated:
            observation, _ = env.reset()
            assert env.observation_space.contains(observation)


@cases(15, 1_000)
@given(any_options(garbage=False), st.sampled_from(POLICIES), st.integers(0, 2**32 - 1))
def test_no_options_leave_the_bounds(options: dict[str, Any], policy: str, seed: int) -> None:
    """Any that one may give; `test_contract.py` has a case for each of them."""
    with pytest.MonkeyPatch.context() as patch:
        run_plainly(patch)
        try:
            env: Any = make(max_episode_steps=8, **options)
        except (ValueError, UserWarning):  # options that do not go together, or a coarse step
            reject()
        affordable = 200 // env.unwrapped.settings.substeps  # periods; an integration step takes milliseconds
        play(env, policy, min(max(affordable, 2), 10), seed)
