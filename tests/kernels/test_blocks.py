"""What kernels take together or leave out: to the last bit what each lane alone, with everything, would work out."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from flexarm_env.envs.settings import Settings
from tests.support.envs import FORESHORTENED, GAIN, SQUARE, actions_for, same_as_alone, vector
from tests.support.plain import KERNELS

REACH = "FlexArm/Reach-v0"
# Equally late readings without anything random, which a block takes from its delay line together (`sensor`).
ALIKE: list[tuple[str, dict[str, Any]]] = [
    (SQUARE, {}),
    (SQUARE, {"delay": 0.0}),
    (SQUARE, {"delay": 0.02}),
    (SQUARE, {"delay": 0.0372}),
    (SQUARE, {"frame": "world", "lap_time": 4.0, "error_limit": None}),
    ("FlexArm/Track-v0", {"reference": ["square", "line", "circle"]}),
]
ALIKE_OF_OTHER_KERNELS: list[tuple[str, dict[str, Any]]] = [
    (SQUARE, {"sensor": "rigid", "delay": 0.0372}),
    (SQUARE, {"sensor": "rigid", "delay": (0.02, 0.0113)}),
    (SQUARE, {"sensor": "collocated"}),
    (REACH, {}),
    (GAIN, {"law_sensor": "sensor", "compensation": "shared", "delay": 0.0372}),
    (GAIN, {"law_sensor": "sensor", "compensation": "per_joint"}),
    (GAIN, {"lap_time": 8.0}),
]


@pytest.mark.parametrize(("env_id", "options"), ALIKE, ids=str)
@pytest.mark.parametrize("count", [8, 11])
def test_lanes_that_are_alike(count: int, env_id: str, options: dict[str, Any]) -> None:
    """A full block, and one with lanes of no environment."""
    batch = vector(env_id, count, max_episode_steps=23, **options)
    same_as_alone(batch, env_id, [options] * count, 60)


@pytest.mark.parametrize(("env_id", "options"), ALIKE_OF_OTHER_KERNELS, ids=str)
@pytest.mark.parametrize("kernels", KERNELS, indirect=True)
def test_lanes_that_are_alike_of_other_kernels(kernels: str, env_id: str, options: dict[str, Any]) -> None:
    batch = vector(env_id, 8, max_episode_steps=23, **options)
    same_as_alone(batch, env_id, [options] * 8, 10 if kernels == "plain" else 60)


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


@pytest.mark.parametrize("count", [1, 7, 8, 9, 16])
def test_observations_of_any_length(count: int) -> None:
    """Eight numbers of eight lanes are written at once: fewer, just as many, and some more."""
    blocks = ["inner_gain"] * (count % 2) + ["last_actions"] * (count > 1)  # one number, and two an action
    options = {"observation": blocks, **({"last_actions": count // 2} if count > 1 else {})}
    batch = vector(SQUARE, 8, max_episode_steps=23, **options)
    assert batch.single_observation_space.shape == (count,)
    same_as_alone(batch, SQUARE, [options] * 8, 40)


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
    disturbed, exact = (vector(SQUARE, count, start="corner", **FORESHORTENED | each) for each in (options, {}))
    disturbed.reset(seed=0)
    exact.reset(seed=0)
    farthest = np.zeros(count)
    for actions in actions_for(exact, 12):
        found, expected = (env.step(actions)[0] * env.observation_scale for env in (disturbed, exact))
        farthest = np.maximum(farthest, np.abs(found - expected).max(axis=1))
    assert (farthest > 1e-4).all()
