"""The episode in plain Python is that of the compiled environment, to rounding.

Both follow the same actions from the same start. The kernels round a product and its sum once where Python rounds
twice. The motion amplifies such differences, which stay below 1e-9 of the state's largest entry over an episode of
random torques and over a lap under a policy. Observations are float32, whose rounding is far coarser.
"""

from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import pytest

from flexarm_agents import load_policy
from flexarm_env.physics.sensing import truth
from flexarm_env.reference_episode import ReferenceEpisode


def compare(branch: str, act: Callable[[Any], Any]) -> tuple[bool, bool, int]:
    """Follow both to the end of the episode; return terminated, truncated and the number of steps."""
    env = gymnasium.make("FlexArm/Square-v0")
    observation, _ = env.reset(options={"start": "corner", "elbow_branch": branch})
    plain = ReferenceEpisode(branch)
    found, ended, steps = plain.reset(), (False, False), 0
    while not any(ended):
        np.testing.assert_allclose(found, observation, rtol=2e-7, atol=1e-7)
        action = act(observation)
        observation, reward, *ended, info = env.step(action)
        found, same_reward, *same_ended = plain.step(action)
        steps += 1
        assert same_ended == ended
        assert same_reward == pytest.approx(reward, abs=1e-9)
        state = truth(plain.k, plain.tip, plain.y, plain.v).state
        np.testing.assert_allclose(state, info["state"], rtol=0.0, atol=1e-9 * np.abs(info["state"]).max())
    return *ended, steps


def test_a_random_episode_is_the_compiled_one_until_it_terminates() -> None:
    rng = np.random.default_rng(0)
    terminated, truncated, steps = compare("positive", lambda observation: rng.uniform(-1.2, 1.2, 2))
    assert (terminated, truncated) == (True, False)
    assert steps > 50


@pytest.mark.slow
def test_a_lap_is_the_compiled_one() -> None:
    policy = load_policy("square").policy
    ends = compare("positive", lambda observation: policy.predict(observation, deterministic=True)[0])
    assert ends == (False, True, 1600)
