"""The second sensor's readings in an environment, beside those of one that does not have it."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from flexarm_env.envs.choices import DEFAULT_OBSERVATION
from flexarm_env.envs.sensors import SECOND
from flexarm_env.envs.settings import Settings
from tests.support.envs import FORESHORTENED, GAIN, RESIDUAL, SQUARE, actions_for, assert_same, bare, block, vector
from tests.support.plain import KERNELS

BOTH = ("sensed_position", *DEFAULT_OBSERVATION, *SECOND.blocks)
ON_LINK_1: dict[str, Any] = {"observation": BOTH, "second_sensor_link": 1}


def settings_of(env_id: str = SQUARE, **options: Any) -> Settings:
    """Return what an environment is made of."""
    return Settings.of({**gym.spec(env_id).kwargs, **options})


def test_the_delay_line_is_long_enough_for_either_sensor() -> None:
    usual = settings_of()
    assert settings_of(**ON_LINK_1).history_slots == usual.history_slots
    longest = settings_of(**ON_LINK_1, second_sensor_delay=0.5)
    assert longest.history_slots * longest.control_period / longest.substeps >= 0.52


@pytest.mark.parametrize("kernels", KERNELS, indirect=True)
def test_readings_in_an_environment(kernels: str) -> None:
    """The point of link 1 as late as it is, in the link's frame, with noise of its own; nothing else changes."""
    options = {"noise": 0.01, "encoder_noise": (1e-3, 1e-2), "frame": "world", "scaled": False, "start": "moving"}
    quiet = bare(**ON_LINK_1, **options, second_sensor_delay=0.02)
    noisy = bare(**ON_LINK_1, **options, second_sensor_delay=0.02, second_sensor_noise=0.05)
    without = bare(observation=BOTH[:-2], **options)
    actions = 0.2 * actions_for(quiet, 300)
    runs = []
    for env in (quiet, noisy, without):
        rows = [env.reset(seed=3), *(env.step(action)[::4] for action in actions)]
        runs.append((np.array([row[0] for row in rows], dtype=float), [row[1] for row in rows]))
    # what does not concern the second sensor keeps its bits, its noise included
    shared = runs[2][0].shape[1]
    np.testing.assert_array_equal(runs[0][0][:, :shared], runs[2][0])
    np.testing.assert_array_equal(runs[1][0][:, :shared], runs[2][0])
    assert "second_sensed" not in runs[2][1][0]
    states = np.array([info["state"] for info in runs[0][1]])
    points = quiet.arm.position(states[:, : quiet.arm.size], 1, 4.5)
    seen = np.array([info["second_sensed"] for info in runs[0][1]])
    np.testing.assert_allclose(seen[2:], points[:-2], rtol=0.0, atol=1e-12)  # two periods: nothing is interpolated
    np.testing.assert_allclose(block(quiet, runs[0][0], "second_sensed_position"), seen, rtol=1e-6, atol=1e-6)
    difference = np.array([info["second_sensed"] for info in runs[1][1]]) - seen
    assert difference.std(axis=0) == pytest.approx([0.05, 0.05], rel=0.1)
    assert np.abs(difference.mean(axis=0)).max() < 0.01
    assert abs(np.corrcoef(*difference.T)[0, 1]) < 0.15
    of_first = np.array([info["sensed"] for info in runs[0][1]]) - quiet.arm.tip(states[:, : quiet.arm.size])
    assert abs(np.corrcoef(difference[1:, 0], np.diff(of_first[:, 0]))[0, 1]) < 0.15


@pytest.mark.slow
@pytest.mark.parametrize(
    ("env_id", "options"),
    [
        (SQUARE, {"second_sensor_link": 2, "second_sensor_position": 2.0, **FORESHORTENED}),
        (RESIDUAL, {"randomisation": {"delay": (0.0, 0.05)}}),
        (GAIN, {"law_sensor": "sensor", "delay": 0.002, "gain_limit": 0.1, "noise": 0.01, "second_sensor_noise": 0.01}),
        (GAIN, {"sensor": "rigid"}),
    ],
    ids=str,
)
def test_alone_and_in_a_batch_to_the_last_bit(env_id: str, options: dict[str, Any]) -> None:
    options = ON_LINK_1 | {"second_sensor_delay": 0.0137, "start": "mix"} | options
    envs = vector(env_id, num_envs=3, **options)
    actions = (0.3 * actions_for(envs, 40)).astype(np.float32)
    together, steps = [envs.reset(seed=7)], [envs.step(action) for action in actions]
    assert not any(ended.any() for _, _, ended, _, _ in steps)
    together += [step[::4] for step in steps]
    for n in range(3):
        env = bare(env_id, **options)
        alone = [env.reset(seed=7 + n), *(env.step(action[n])[::4] for action in actions)]
        for (observation, info), (row, infos) in zip(alone, together, strict=True):
            assert env.observation_space.contains(observation)
            assert_same(row[n], observation)
            assert_same(infos["second_sensed"][n], info["second_sensed"])
