"""Environments of a batch with options of their own; and elbow branch and direction drawn or requested."""

from typing import Any

import numpy as np
import pytest

from flexarm_env.envs.batch import BatchSimulator
from flexarm_env.envs.per_env import OPTIONS, settings_of_each
from flexarm_env.laps import LAPS
from tests.support.envs import GAIN, IDS, RESIDUAL, SQUARE, assert_same, bare, same_as_alone, vector
from tests.support.plain import KERNELS
from tests.support.refusals import refused, refuses

# What each environment has for itself, in two sets of kernels that the blocks' tests compile, too.
ARMS = [
    {"preset": "default", **changes}
    for changes in (
        {},
        {"masses_per_length": (0.4, 0.3)},
        {"payload_mass": 0.5},
        {"flexural_rigidities": (1500.0, 1800.0)},
        {"damping_ratio": 0.03, "joint_friction": (0.1, 0.2)},
    )
]
TORQUE_LANES: dict[str, list[Any]] = {
    "arm": [*ARMS, *ARMS[:4]],
    "jitter": [0.0, 0.02, 0.0, 0.0, 0.0, 0.0, 0.0, 0.01, 0.02],
    "sensor_period": [0.0, 0.0, 0.03, 0.0, 0.0, 0.0, 0.0, 0.015, 0.0],
    "dropout": [0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.1, 0.0],
    "encoder_noise": [(0.0, 0.0)] * 4 + [(0.01, 0.0), (0.0, 0.02)] + [(0.0, 0.0)] * 2 + [(0.01, 0.01)],
    "sensor_position": [4.5, 4.5, 2.0, 4.5, 4.5, 4.5, 0.5, 4.5, 3.0],
    "delay": [None, None, 0.0372, 0.0, 0.1, None, None, 0.02, 0.02],
    "wave_speed": [288.33, 100.0, 288.33, 288.33, 288.33, 500.0, 288.33, 288.33, 288.33],
    "noise": [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.05, 0.0, 0.01],
    "actuation_delay": [0.0, 0.0, 0.013, 0.0, 0.0, 0.0, 0.0, 0.03, 0.0],
    "direction": ["clockwise", "counterclockwise", "either"] * 3,
    "elbow_branch": ["positive", "negative", "either", "either", "negative"] + ["positive", "negative"] * 2,
    "randomisation": [{}] * 7 + [{"payload_mass": (0.0, 0.5), "noise": (0.0, 0.02)}, {"delay": (0.0, 0.05)}],
}
SENSOR_LANES: dict[str, list[Any]] = {
    "sensor": ["rigid", "collocated", "rigid"] * 3,
    "delay": [0.0372, None, (0.02, 0.0113)] * 3,
    "sensor_position": [4.5, 4.5, 2.0] * 3,
}
FURTHER_LANES: dict[str, list[Any]] = {
    "second_sensor_position": [4.5, 2.0, 1.0] * 3,
    "second_sensor_delay": [0.0, 0.0237, 0.01] * 3,
    "second_sensor_noise": [0.01, 0.0, 0.02] * 3,
    "imu_position": [None, 3.0, 1.0] * 3,
    "imu_delay": [0.0, 0.0042, 0.02] * 3,
    "imu_noise": [(0.0, 0.0), (0.2, 0.01), (0.1, 0.0)] * 3,
    "imu_bias": [(0.1, 0.005), (0.0, 0.0), (0.1, 0.0)] * 3,
    "imu_range": [(80.0, 17.0), (160.0, 35.0), (1.0, 0.1)] * 3,
}
MOTOR_LANES: dict[str, list[Any]] = {
    "motor_time_constant": [(0.0, 0.01), (0.004, 0.0), (0.03, 0.02)] * 3,
    "torque_speed_limit": [None, (9.0, 90.0), (20.0, 100.0)] * 3,
    "torque_resolution": [(0.0, 0.0), (7.0, 0.0), (1.0, 3.0)] * 3,
    "actuation_delay": [0.0, 0.013, 0.0] * 3,
    "arm": [{"coulomb_friction": (2.0, x), "friction_smoothing": 1.0} for x in (0.1, 0.2, 0.0)] * 3,
}
DISTURBED_LANES: dict[str, list[Any]] = {
    "pulse_force": [(20.0, 0.0), (0.0, -30.0), (5.0, 5.0)] * 3,
    "pulse_time": [0.0, 0.013, 0.02] * 3,
    "pulse_duration": [0.01, 0.2, 0.005] * 3,
    "pulse_period": [0.02, 0.0, 0.0] * 3,
    "outage_time": [0.0, 0.02, 0.0] * 3,
    "outage_duration": [0.0, 0.03, 0.02] * 3,
    "gauge_drift": [(0.1, 0.0), (0.0, -0.2), (1.0, 1.0)] * 3,
}
GAIN_LANES: dict[str, list[Any]] = {
    "gain_limit": [1.0, 5.0, 0.3] * 3,
    "proportional_gain": [150.79, 100.0, 200.0] * 3,
    "derivative_gain": [17.364, 30.0, 17.364] * 3,
    "torque_limit": [None, (300.0, 200.0), None] * 3,
    "compensation": ["none", "shared", "per_joint"] * 3,
    "delayed": ["position"] * 4 + ["position+rate"] * 5,
    "delay": [None, 0.0372, 0.002] * 3,
    "sensor_position": [4.5, 2.0, 4.5] * 3,
    "arm": [*ARMS, *ARMS[:4]],
}


FURTHER = {"second_sensor_link": 1, "imu_link": 2, "observation": ["second_sensor_error", "accelerometer", "gyro"]}
# Options that all have, those of each, steps in plain Python.
TABLES: list[tuple[dict[str, Any], dict[str, list[Any]], int]] = [
    ({}, SENSOR_LANES, 6),
    (FURTHER, FURTHER_LANES, 6),
    ({"physics_step": 5e-4}, MOTOR_LANES, 5),
    ({}, DISTURBED_LANES, 5),
    ({"feedback_source": "sensor"}, GAIN_LANES, 6),
]


def test_each_environment_is_the_single_one_with_its_options() -> None:
    """A full block and one with lanes of no environment."""
    same_as_alone(SQUARE, 9, {}, 30, per_env=TORQUE_LANES)


@pytest.mark.parametrize("table", TABLES, ids=lambda table: next(iter(table[1])))
@pytest.mark.parametrize("kernels", KERNELS)
def test_each_environment_is_so_on_other_kernels(kernels: str, table: Any) -> None:
    options, lanes, steps = table
    env_id = GAIN if "gain_limit" in lanes else SQUARE
    count, steps = (6, steps) if kernels == "plain" else (9, 60)
    same_as_alone(env_id, count, options, steps, per_env={name: values[:count] for name, values in lanes.items()})


def test_the_tests_have_every_option() -> None:
    tables = (TORQUE_LANES, *(lanes for _, lanes, _ in TABLES))
    others = {"inner_stiffness", "inner_damping", "reference", "waypoints"}  # below, and in `test_own_tasks.py`
    assert {name for table in tables for name in table} | others == set(OPTIONS)


def test_gains_of_the_joint_space_law() -> None:
    stiffness, resistance = [(500.0, 100.0), (1000.0, 130.0), (900.0, 90.0)], [(40.0, 30.0), (30.0, 20.0), (40.0, 30.0)]
    gains = {"inner_stiffness": stiffness, "inner_damping": resistance}
    with refuses(ValueError, "environment 1", "physics_step"):  # stiffer gains ask for shorter steps
        vector(RESIDUAL, 3, per_env=gains)
    batch = vector(RESIDUAL, 3, per_env=gains, physics_step=5e-4)
    for name, values in (("STIFFNESS", stiffness), ("RESISTANCE", resistance)):
        first, _ = batch.simulator._rows[name]
        np.testing.assert_array_equal(batch.simulator._arenas[0, first : first + 2, :3].T, values)


def test_environments_with_the_same_options_share_their_settings() -> None:
    each = settings_of_each({}, {"jitter": [0.0, 0.01, 0, np.float64(0.01)]}, 4, "Batch")
    assert each[0] is each[2]
    assert each[1] is each[3]
    assert each[0] is not each[1]
    arms = settings_of_each({}, {"arm": ["default", {}, {"preset": "default", "payload_mass": 0.0}]}, 3, "Batch")
    assert arms[0] is arms[1] is arms[2]
    assert BatchSimulator(settings_of_each({}, {}, 3, "Batch"), 3)._parts["LANE_SETTINGS"].shape[0] == 1


def test_a_batch_bounds_what_its_widest_environment_observes() -> None:
    noisy = bare(noise=0.5).observation_space
    space = vector(SQUARE, 2, per_env={"noise": [0.0, 0.5]}).single_observation_space
    assert space == noisy
    assert (noisy.high >= bare().observation_space.high).all()  # type: ignore[attr-defined]


test_a_bad_option_of_one_environment_is_refused = refused(
    ([0.1], r"TypeError: per_env = \[0.1\].*mapping"),
    ({"jitters": [0, 0]}, r"per_env\['jitters'\].*no option.*jitter, sensor_period"),
    ({"control_period": [0.01, 0.02]}, r"per_env\['control_period'\].*the batch's"),
    ({"sensor": ["true", "rigid"]}, "environment 1.*sensor = 'rigid'.*beside that: 'true'"),
    ({"jitter": 0.01}, r"per_env\['jitter'\] = 0.01.*list of 2"),
    ({"jitter": [0.0] * 3}, r"per_env\['jitter'\] = \[0.0, 0.0, 0.0\].*list of 2"),
    ({"direction": "clockwise"}, r"per_env\['direction'\] = 'clockwise'.*list of 2"),
    ({"jitter": [0.0, -0.1]}, "environment 1.*jitter = -0.1.*>= 0"),
    ({"jitter": [0.0, "a"]}, "TypeError: environment 1.*jitter = 'a'"),
    ({"elbow_branch": ["up", "either"]}, "environment 0.*elbow_branch = 'up'.*'either'"),
    ({"sensor_position": [4.5, 5.0]}, "environment 1.*sensor_position = 5.0.*4.5"),
    ({"delay": [0.0, (0.1, 0.2)]}, r"environment 1.*delay = \(0.1, 0.2\).*one number"),
    ({"proportional_gain": [150.79, 1.0]}, "environment 1.*no effect.*'gain'"),
    ({"arm": ["default", "paper"]}, "environment 1.*arm = 'paper'.*modes_per_link = 1.*3"),
    ({"arm": [{}, {"link_lengths": (5.0, 5.0)}]}, r"environment 1.*link_lengths = \(5.0, 5.0\).*\(4.5, 4.5\)"),
    ({"torque_limit": [None, (80.0, 30.0)]}, r"environment 1.*torque_limit = \(80.0, 30.0\)"),
    ({"torque_resolution": [(0.0, 0.0), (0.1, 0.1)]}, "environment 1.*or none"),
    ({"arm": ["default", MOTOR_LANES["arm"][0]]}, "environment 1.*or none"),
    ({"pulse_force": [(0.0, 0.0), (1.0, 0.0)]}, "environment 1.*or none"),
    ({"gauge_drift": [(0.0, 0.0), (1.0, 0.0)]}, "environment 1.*or none"),
    by=lambda per_env: vector(SQUARE, 2, per_env=per_env),
)


def test_a_scaled_gain_has_one_scale() -> None:
    observed = {"observation": ["inner_gain"], "per_env": {"gain_limit": [1.0, 2.0]}}
    with refuses(ValueError, "environment 1", "gain_limit = 2.0", "scaled = False"):
        vector(GAIN, 2, **observed)
    vector(GAIN, 2, scaled=False, **observed)


def test_one_physics_step_serves_arms_of_different_stiffness() -> None:
    arms = {"arm": ["linear", {"preset": "linear", "flexural_rigidities": (1e5, 1e5)}]}
    with refuses(ValueError, "environment 1", "physics_step = None", "0.0007143 s", "0.001429 s"):
        vector(SQUARE, 2, per_env=arms)
    assert {one.substeps for one in vector(SQUARE, 2, per_env=arms, physics_step=2e-4).simulator.each} == {50}


@pytest.mark.parametrize("branch", ["positive", "negative"])
@pytest.mark.parametrize("direction", ["clockwise", "counterclockwise"])
def test_a_reset_orders_elbow_branch_and_direction(branch: str, direction: str) -> None:
    options = {"elbow_branch": branch, "direction": direction}
    requested, made = bare(start="corner", elbow_branch="positive"), bare(start="corner", **options)
    assert_same(requested.reset(seed=3, options=options), made.reset(seed=3))
    assert (requested.episode.elbow_branch, requested.episode.direction) == (branch, direction)
    assert_same(requested.step(np.zeros(2, np.float32)), made.step(np.zeros(2, np.float32)))
    requested.reset()  # options are of one episode
    assert (requested.episode.elbow_branch, requested.episode.direction) == ("positive", "clockwise")


@pytest.mark.parametrize("env_id", IDS)
def test_which_ids_draw_the_branch(env_id: str) -> None:
    """All but the moves, whose other branch is a mirror image, the paper's set-up, races; a seed decides the draw."""
    env = bare(env_id, start="corner")
    drawn = [(env.reset(seed=seed), env.episode.elbow_branch)[1] for seed in (*range(5), *range(5))]
    assert drawn[:5] == drawn[5:]
    one_side = {"FlexArm/Reach-v0": "positive", "FlexArm/Paper-v0": "positive", "FlexArm/Race-v0": "negative"}
    assert set(drawn) == ({one_side[env_id]} if env_id in one_side else {"positive", "negative"})


@pytest.mark.parametrize("direction", ["clockwise", "counterclockwise", "either"])
@pytest.mark.parametrize(("lap", "clockwise"), [("swing", 1.0), ("plain", -1.0)])
def test_the_standard_laps(lap: str, clockwise: float, direction: str) -> None:
    """theta2 > 0 at the start of the clockwise swing lap; where the direction is drawn, a lap is clockwise."""
    env = bare(direction=direction)
    state = env.reset(options=LAPS[lap].reset_options(direction))[1]["state"]
    other = direction == "counterclockwise"
    assert np.sign(state[1]) == (-clockwise if other else clockwise)
    assert env.episode.direction == ("counterclockwise" if other else "clockwise")
    assert (env.episode.start_time, np.abs(state[2:]).max()) == (0.0, 0.0)


def test_another_direction_of_a_lap_is_refused() -> None:
    with refuses(ValueError, "direction = 'up'", "'clockwise', 'counterclockwise', 'either'"):
        LAPS["swing"].reset_options("up")


def test_either_is_drawn_for_each_episode() -> None:
    env = bare(elbow_branch="either", direction="either", start="corner")
    seen = set()
    for seed in range(20):
        info = env.reset(seed=seed)[1]
        branch, direction = env.episode.elbow_branch, env.episode.direction
        assert (branch == "positive") == (info["state"][1] > 0.0)
        x, y = env.step(np.zeros(2, np.float32))[4]["reference"]  # from the lower left corner on
        assert (direction == "clockwise") == (y > x)
        seen.add((branch, direction))
    assert len(seen) == 4


def test_what_is_drawn_does_not_depend_on_what_else_is() -> None:
    drawn = {"randomisation": {"payload_mass": (0.0, 1.0)}}
    fixed, either = bare(**drawn), bare(**drawn, elbow_branch="either", direction="either")
    for seed in range(3):
        fixed.reset(seed=seed)
        either.reset(seed=seed)
        assert fixed.episode.parameters == either.episode.parameters
        assert fixed.episode.start_time == either.episode.start_time
