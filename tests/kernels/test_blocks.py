"""What kernels take together or leave out: to the last bit what each lane alone, with everything, would work out."""

from typing import Any

import numpy as np
import pytest

from flexarm_env.envs.batch import block_lanes
from flexarm_env.envs.settings import Settings
from tests.support import envs
from tests.support.envs import FORESHORTENED, GAIN, PAPER, REACH, RESIDUAL, SQUARE, same_as_alone, vector
from tests.support.plain import KERNELS

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
    (GAIN, {"feedback_source": "sensor", "compensation": "shared", "delay": 0.0372}),
    (GAIN, {"feedback_source": "sensor", "compensation": "per_joint"}),
    (GAIN, {"lap_time": 8.0}),
]
FURTHER_SENSORS: dict[str, Any] = next(options for _, options in envs.CASES if "imu_link" in options)
CARRYING: dict[str, Any] = {"arm": {"preset": "linear", "modes_per_link": 1}, "start": "corner"}
CARRYING |= {"randomisation": {"payload_mass": (0.2, 1.5)}, "payload_changes": ((0.03 / 16, None), (0.06 / 16, 0.1))}
OTHER_KERNELS: list[tuple[str, dict[str, Any]]] = [
    (SQUARE, FURTHER_SENSORS | envs.RANDOM | {"second_sensor_link": 2, "second_sensor_position": 2.0}),
    (RESIDUAL, FURTHER_SENSORS | {"imu_link": 1, "start": "moving"}),
    (GAIN, FURTHER_SENSORS | {"noise": 0.01, "feedback_source": "sensor", "delay": 0.002, "gain_limit": 0.1}),
    (GAIN, FURTHER_SENSORS | {"sensor": "rigid"}),
    (SQUARE, {"action_mode": "torque_rate"}),
    (SQUARE, {"action_mode": "torque_rate", "actuation_delay": 0.0137}),
    *((env_id, CARRYING) for env_id in (SQUARE, RESIDUAL)),
]


@pytest.mark.parametrize(("env_id", "options"), ALIKE, ids=str)
@pytest.mark.parametrize("count", [8, 11])
def test_lanes_that_are_alike(count: int, env_id: str, options: dict[str, Any]) -> None:
    """A full block, and one with lanes of no environment."""
    same_as_alone(env_id, count, options, 30)


OTHERS = [(8, case) for case in ALIKE_OF_OTHER_KERNELS] + [(3, case) for case in OTHER_KERNELS]


@pytest.mark.parametrize(("count", "case"), OTHERS, ids=str)
@pytest.mark.parametrize("kernels", KERNELS)
def test_lanes_of_other_kernels(kernels: str, count: int, case: tuple[str, dict[str, Any]]) -> None:
    env_id, options = case
    steps = 6 if count == 8 else 7 if "payload_changes" in options else 3  # both changes
    chosen = (0, count - 1) if kernels == "plain" else None
    same_as_alone(env_id, count, options, steps if kernels == "plain" else 60, chosen=chosen)


# Each program, and each width of a block, is a kernel of its own.
WIDE = [
    pytest.param(*case, marks=pytest.mark.slow) for case in ((PAPER, 11), (RESIDUAL, 11), (SQUARE, 250), (SQUARE, 1024))
]


@pytest.mark.parametrize(("env_id", "count"), [(SQUARE, 11), *WIDE])
def test_lanes_of_blocks_of_any_width(env_id: str, count: int) -> None:
    """In blocks of 8, the last of them nearly empty, or in three large ones; with all that is random."""
    assert [block_lanes(many, 1) for many in (1, 3, 8, 11, 250, 1024)] == [1, 8, 8, 8, 8, 344]
    options = envs.random_options(env_id) | {"error_limit": 0.6}
    same_as_alone(env_id, count, options, 30, chosen=[*range(0, count, count // 10), 7, 8, count - 1])


def test_lanes_of_no_environment_rest_and_are_like_the_others() -> None:
    batch = vector(SQUARE, 11)
    batch.reset(seed=0)
    simulator = batch.simulator
    for actions in envs.actions_for(batch, 300):
        batch.step(actions)
    delays, rates = (
        simulator._arenas[:, first : first + count] for first, count in map(simulator._rows.get, ("SENSOR_DELAY", "V"))
    )
    np.testing.assert_array_equal(delays, np.broadcast_to(delays[:1, :, :1], delays.shape))
    assert rates[1, :, 3:].size > 0
    assert not rates[1, :, 3:].any()


@pytest.mark.parametrize("count", [1, 7, 8, 9, 16])
def test_observations_of_any_length(count: int) -> None:
    """Eight numbers of eight lanes are written at once: fewer, just as many, and some more."""
    blocks = ["time"] * (count % 2) + ["last_actions"] * (count > 1)  # one number, and two an action
    options = {"observation": blocks, **({"last_actions": count // 2} if count > 1 else {})}
    assert envs.bare(**options).observation_space.shape == (count,)
    same_as_alone(SQUARE, 8, options, 30)


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
        *({"noise": 0.05}, {"encoder_noise": (0.05, 0.0)}, {"encoder_noise": (0.0, 0.05)}, {"jitter": 0.02}),
        *({"dropout": 0.5}, {"sensor_period": 0.03}, {"actuation_delay": 0.013}),
        *({"randomisation": {"noise": (0.05, 0.1)}}, {"randomisation": {"actuation_delay": (0.01, 0.02)}}),
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
    for actions in envs.actions_for(exact, 12):
        found, expected = (env.step(actions)[0] * env.observation_scale for env in (disturbed, exact))
        farthest = np.maximum(farthest, np.abs(found - expected).max(axis=1))
    assert (farthest > 1e-4).all()
