"""What kernels take together or leave out: to the last bit what each lane alone, with everything, would work out."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from flexarm_env.envs.settings import Settings
from flexarm_env.envs.vector import FlexArmVectorEnv
from tests.support.envs import GAIN, SQUARE, actions_for, assert_same, make, vector

REACH = "FlexArm/Reach-v0"
# Equally late readings without anything random, which a block takes from its delay line together (`sampling`).
ALIKE: list[tuple[str, dict[str, Any]]] = [
    (SQUARE, {}),
    (SQUARE, {"delay": 0.0}),
    (SQUARE, {"delay": 0.02}),
    (SQUARE, {"delay": 0.0372}),
    (SQUARE, {"sensor": "rigid", "delay": 0.0372}),
    (SQUARE, {"sensor": "rigid", "delay": (0.02, 0.0113)}),
    (SQUARE, {"sensor": "collocated"}),
    (SQUARE, {"frame": "world", "lap_time": 4.0, "error_limit": None}),
    ("FlexArm/Track-v0", {"reference": ["square", "line", "circle"]}),
    (REACH, {}),
    (GAIN, {"law_sensor": "sensor", "compensation": "shared", "delay": 0.0372}),
    (GAIN, {"law_sensor": "sensor", "compensation": "per_joint"}),
    (GAIN, {"lap_time": 8.0}),
]


def same_as_alone(batch: FlexArmVectorEnv, env_id: str, options: dict[str, Any], steps: int) -> None:
    """Episodes begin anew after 23 steps, and where they end before."""
    alone = [make(env_id, max_episode_steps=23, **options) for _ in range(batch.num_envs)]
    found, _ = batch.reset(seed=7)
    expected = [env.reset(seed=7 + i)[0] for i, env in enumerate(alone)]
    ended = np.zeros(len(alone), dtype=bool)
    for actions in 0.7 * actions_for(batch, steps):
        assert_same(found, np.array(expected))
        found, rewards, terminated, truncated, infos = batch.step(actions)
        for i, env in enumerate(alone):
            if ended[i]:
                expected[i], info = env.reset()
                ended[i] = False
            else:
                expected[i], reward, over, cut, info = env.step(actions[i])
                assert (rewards[i], terminated[i], truncated[i]) == (reward, over, cut)
                ended[i] = over or cut
            for name in ("sensed", "state", "reference", "torque"):
                assert_same(infos[name][i], info[name], name)


@pytest.mark.parametrize(("env_id", "options"), ALIKE, ids=str)
@pytest.mark.parametrize("count", [8, 11])
def test_lanes_that_are_alike(count: int, env_id: str, options: dict[str, Any]) -> None:
    """A full block, and one with lanes of no environment."""
    batch = vector(env_id, count, max_episode_steps=23, **options)
    same_as_alone(batch, env_id, options, 60)


def test_lanes_of_no_environment_rest_and_are_like_the_others() -> None:
    batch = vector(SQUARE, 11)
    batch.reset(seed=0)
    simulator = batch.simulator
    for actions in actions_for(batch, 300):
        batch.step(actions)
    first, count = simulator._rows["SENSOR_DELAY"]
    delays = simulator._arenas[:, first : first + count]
    np.testing.assert_array_equal(delays, np.broadcast_to(delays[:1, :, :1], delays.shape))
    first, count = simulator._rows["V"]
    idle = simulator._arenas[1, first : first + count, 3:]
    assert idle.size > 0
    assert not idle.any()


@pytest.mark.parametrize("last", [1, 7, 8, 9, 16])
def test_observations_of_any_length(last: int) -> None:
    """Eight numbers of eight lanes are written at once: fewer, just as many, and some more."""
    options = {"observation": ["last_actions"], "last_actions": last}
    batch = vector(GAIN, 8, max_episode_steps=23, **options)
    assert batch.single_observation_space.shape == (last,)
    same_as_alone(batch, GAIN, options, 40)


def test_a_lane_whose_state_is_invalid_keeps_its_observation() -> None:
    batch = vector(SQUARE, 8, autoreset_mode="Disabled", error_limit=None, deflection_limit=None)
    batch.reset(seed=0)
    state = np.zeros((8, 12))
    state[:, 1] = 1.0
    state[3, 6] = 200.0  # [rad/s]; an episode ends at less
    before, _ = batch.reset(options={"state": state})
    after, _, terminated, _, _ = batch.step(np.zeros((8, 2), np.float32))
    assert terminated.tolist() == [i == 3 for i in range(8)]
    np.testing.assert_array_equal(after[3], before[3])
    assert (after[[0, 1, 2, 4, 5, 6, 7]] != before[[0, 1, 2, 4, 5, 6, 7]]).any(axis=1).all()


@pytest.mark.parametrize(
    "options",
    [
        {"noise": 0.05},
        {"encoder_noise": (0.05, 0.0)},
        {"encoder_noise": (0.0, 0.05)},
        {"jitter": 0.02},
        {"dropout": 0.5},
        {"hold": 0.03},
        {"actuation_delay": 0.013},
        {"randomisation": {"noise": (0.05, 0.1)}},
        {"randomisation": {"actuation_delay": (0.01, 0.02)}},
    ],
    ids=str,
)
@pytest.mark.parametrize("count", [1, 9])
def test_each_disturbance_acts_by_itself(count: int, options: dict[str, Any]) -> None:
    """Kernels leave disturbances out where none can occur: no option that brings one may be forgotten there."""
    assert not Settings.of({}).disturbed
    assert Settings.of(options).disturbed
    disturbed, exact = (vector(SQUARE, count, start="corner", **each) for each in (options, {}))
    disturbed.reset(seed=0)
    exact.reset(seed=0)
    farthest = np.zeros(count)
    for actions in actions_for(exact, 12):
        found, expected = (env.step(actions)[0] * env.observation_scale for env in (disturbed, exact))
        farthest = np.maximum(farthest, np.abs(found - expected).max(axis=1))
    assert (farthest > 1e-4).all()
