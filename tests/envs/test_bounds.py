"""Whatever the options and actions: observations within their space, rewards within their range, no exception."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, reject
from hypothesis import strategies as st

from flexarm_env import end_reason
from tests.hardening.strategies import any_options, cases
from tests.support.envs import CASE_NAMES, CASES, make, terms_of
from tests.support.plain import KERNELS, run_plainly

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


@pytest.mark.parametrize(("env_id", "options"), CASES, ids=CASE_NAMES)
@pytest.mark.parametrize("kernels", KERNELS, indirect=True)
def test_no_policy_leaves_the_bounds(env_id: str, options: dict[str, Any], kernels: str) -> None:
    """In plain Python a policy for each case, compiled all of them, and for longer."""
    if kernels == "plain":
        play(make(env_id, max_episode_steps=12, **options), POLICIES[CASES.index((env_id, options)) % 4], 15, seed=4)
    else:
        for policy in POLICIES:
            play(make(env_id, max_episode_steps=150, **options), policy, 200, seed=4)


@cases(15, 1_000)
@given(any_options(garbage=False), st.sampled_from(POLICIES), st.integers(0, 2**32 - 1))
def test_no_options_leave_the_bounds(options: dict[str, Any], policy: str, seed: int) -> None:
    with pytest.MonkeyPatch.context() as patch:
        run_plainly(patch)
        try:
            env = make(max_episode_steps=8, **options)
        except (ValueError, UserWarning):  # options that do not go together, or a coarse step
            reject()
        play(env, policy, 10, seed)
