"""What episodes draw: distributions, the arm and sensors that follow, batches, states, and what is refused."""

from statistics import NormalDist
from typing import Any

import numpy as np
import pytest

from flexarm_baselines.task import Task
from flexarm_env.envs.distributions import checked_distribution, quantiles
from flexarm_env.envs.options import DRAWABLE, Options
from flexarm_env.envs.settings import Settings
from flexarm_env.kernels.entries import DRAWN
from flexarm_env.parameters import CLAMPED_ONE_PERCENT
from flexarm_env.simulation.step_error import TOLERANCE, expected_error
from tests.support.envs import RESIDUAL, SQUARE, WITHOUT_ERRORS, assert_same, bare, exact_actions, same_as_alone, vector
from tests.support.refusals import refused, refuses

ARM: dict[str, Any] = {
    "flexural_rigidities": ((1500.0, 1800.0), ("log_uniform", 1200.0, 2400.0)),
    "masses_per_length": ((0.3, 0.4), ("normal", 0.335, 0.02, 0.3, 0.4)),
    "shoulder_hub_inertia": (0.0, 2.0),
    "elbow_hub_inertia": (0.0, 0.2),
    "elbow_mass": ("choice", [0.0, 0.3]),
    "payload_inertia": (0.0, 0.1),
    "joint_friction": ((0.0, 2.0), (0.0, 0.5)),
}
SENSORS: dict[str, Any] = {
    "sensor_position": ("choice", [3.0, 4.5]),
    "wave_speed": (100.0, 300.0),
    "jitter": (0.0, 0.01),
    "sensor_period": (0.005, 0.02),
    "dropout": (0.0, 0.3),
    "encoder_noise": ((0.0, 1e-3), (0.0, 1e-2)),
}
TORQUES = {"torque_limit": ((90.0, 180.0), (30.0, 60.0))}
INNER_LAW = {"inner_stiffness": ((8e2, 1e3), (1e2, 130.0)), "inner_damping": ((9.0, 9.5), (3.0, 4.0))}
MOTORS: dict[str, Any] = {
    "motor_time_constant": ((0.0, 0.01), (0.0, 0.02)),
    "torque_speed_limit": ((20.0, 30.0), (90.0, 100.0)),
    "torque_resolution": ((0.0, 3.0), ("choice", [0.0, 1.0])),
    "coulomb_friction": ((0.0, 2.0), (0.0, 0.2)),
    "breakaway_excess": ((0.0, 1.0), (0.0, 0.1)),
    "stribeck_velocity": (0.3, 0.5),
    "friction_smoothing": (0.8, 1.0),
}
DISTURBANCES: dict[str, Any] = {"pulse_force": ((0.0, 50.0),) * 2, "pulse_time": (0.0, 0.05)}
DISTURBANCES |= {"gauge_drift": ((-0.1, 0.1),) * 2}
PATH: dict[str, Any] = {"side": (10.0, 12.6), "lap_time": ("choice", [8.0, 16.0])}
EITHER: dict[str, Any] = {"reference": ("square", "circle"), "direction": "either"}
OF_KERNELS: dict[str, Any] = {"delay": (0.02, 0.06), "noise": (0.01, 0.02), "actuation_delay": (0.0, 0.03)}
SMALL = [(5.0, 5.0), (5.0, 5.02), (5.02, 5.02), (5.02, 5.0)]
ALL = ARM | SENSORS | TORQUES | PATH | {"payload_mass": ("log_uniform", 0.05, 1.0), "noise": ("choice", [0.0, 0.01])}
STEP = {"physics_step": 1e-3}


@pytest.mark.parametrize(
    ("distribution", "share"),
    [
        ((2.0, 5.0), lambda x: (x - 2.0) / 3.0),
        (("log_uniform", 0.1, 10.0), lambda x: np.log(x / 0.1) / np.log(100.0)),
        (("normal", 1.0, 2.0, 0.0, 2.0), lambda x: (NormalDist(1.0, 2.0).cdf(x) - 0.30853753872598694) / 0.3829249225),
        (("normal", 0.0, 1.0, 4.0, 5.0), lambda x: (NormalDist().cdf(-4.0) - NormalDist().cdf(-x)) / 3.1384589e-05),
    ],
)
def test_values_invert_the_distribution_function(distribution: tuple[Any, ...], share: Any) -> None:
    """To 1e-6, as many digits as the shares above have."""
    shares = np.linspace(0.0, 1.0 - 2**-53, 101)
    found = quantiles(checked_distribution("x", distribution, DRAWABLE["payload_mass"]), shares)
    np.testing.assert_allclose([share(x) for x in found.tolist()], shares, atol=1e-6)
    assert (np.diff(found) > 0.0).all()


def test_each_number_has_its_own_share_of_an_episode() -> None:
    """Shares of 4096 episodes, uniform and independent.

    By the inequality of Dvoretzky, Kiefer and Wolfowitz the distribution function of uniform numbers is off by more
    than 0.056 with a probability of 2 exp(-2 n 0.056^2) = 1.4e-11. A correlation of independent numbers has a standard
    deviation of 1/64, and is above six of them with a probability of 2e-9.
    """
    ranges = {"stiffness": (0.8, 1.3), "damping": (0.0, 0.05), "payload_mass": (0.1, 0.5), **OF_KERNELS}
    ranges = {name: ranges[name] for name in DRAWN} | {"jitter": (0.0, 1.0), "dropout": (0.5, 1.0)}
    batch = vector(SQUARE, 4096, randomisation=ranges)
    everyone, requests = np.arange(4096), batch.simulator.usual_requests.copy()
    batch._seed(0, np.ones(4096, dtype=bool))
    found = batch.simulator.draws.completed(requests, batch._keys.take(everyone), everyone)
    low, high = np.array(list(ranges.values())).T
    shares = (found[:, batch.simulator.draws._plans[0].columns] - low) / (high - low)
    assert np.abs(np.sort(shares, axis=0) - everyone[:, None] / 4096.0).max() < 0.056
    shares = np.column_stack([shares, everyone / 4096.0])
    assert np.abs(np.corrcoef(shares.T) - np.eye(len(ranges) + 1)).max() < 6.0 / 64.0
    usual = {"delay": 9.0 / 288.33, "payload_mass": 0.0, "stiffness": 1.0, "damping": CLAMPED_ONE_PERCENT}
    assert bare().episode.parameters == usual | {"noise": 0.0, "actuation_delay": 0.0}


def test_a_batch_draws_as_single_environments() -> None:
    ranges = [ALL, ALL | {"elbow_mass": (0.0, 0.1)}]
    own = {"randomisation": ranges, "arm": [{"payload_mass": 0.1}, {"payload_mass": 0.2, "joint_friction": (1.0, 0.5)}]}
    same_as_alone(SQUARE, 2, STEP | EITHER, 8, per_env=own, limit=5)


@pytest.mark.parametrize(
    ("env_id", "randomisation", "options"),
    [
        (SQUARE, ARM, {"elbow_branch": "either"}),
        (SQUARE, SENSORS, {"noise": 0.01, "observation": WITHOUT_ERRORS}),
        (SQUARE, OF_KERNELS, {"observation": WITHOUT_ERRORS}),
        (SQUARE, DISTURBANCES, {"pulse_duration": 0.02, "outage_duration": 0.05}),
        (SQUARE, TORQUES | MOTORS, {}),
        (RESIDUAL, INNER_LAW, {}),
        (SQUARE, PATH, EITHER | {"observation": ("previews", "lap_phase", "sensor_error", "reference_velocity")}),
        (SQUARE, {"lap_time": (0.15, 0.25)}, {"reference": "waypoints", "waypoints": SMALL, "start": "corner"}),
        (
            SQUARE,
            {"lap_time": (0.15, 0.25)},
            {"reference": "drawn", "start": "corner", "waypoints": lambda draw: SMALL + draw.normal(0.0, 1e-3, 2)},
        ),
        (SQUARE, {"lap_time": (8.0, 20.0)}, {"reference": "moves"}),
    ],
)
def test_an_episode_is_that_of_an_environment_made_with_what_it_drew(
    env_id: str, randomisation: dict[str, Any], options: dict[str, Any]
) -> None:
    """To the last bit: observations, rewards and infos."""
    env = bare(env_id, randomisation=randomisation, **options, **STEP)
    steps = 26 if options.get("start") == "corner" else 10  # beyond the shortest laps
    for seed in range(2):
        found = [env.reset(seed=seed)]
        drawn = {name: env.episode.parameters[name] for name in randomisation}
        own = {name: x for name, x in drawn.items() if hasattr(Options, name)}
        of_arm = {name: x for name, x in drawn.items() if name not in own}
        twin = bare(env_id, arm={"preset": "linear", **of_arm}, **own, **options, **STEP)
        expected = [twin.reset(seed=seed)]
        for action in exact_actions(steps).astype(np.float32):
            found.append(env.step(action))  # type: ignore[arg-type]
            expected.append(twin.step(action))  # type: ignore[arg-type]
        assert_same(found, expected)


def test_the_step_is_short_enough_for_every_arm_in_the_range() -> None:
    """The rule of `physics_step` for the arms of 40 episodes."""
    settings = Settings.of({"arm": "linear", "randomisation": ARM})
    batch = vector(SQUARE, 40, seed=0, randomisation=ARM)
    for i in range(40):
        values = batch.episode.one(i).parameters
        arm = settings.having({name: values[name] for name in ARM}).flexible_arm.parameters
        assert expected_error(arm, settings.motor_limit, settings.integration.step) <= TOLERANCE


def test_ranges_of_a_running_batch_are_narrowed_and_values_requested() -> None:
    batch = vector(SQUARE, 2, randomisation={"payload_mass": (0.0, 1.0), "joint_friction": ((0.0, 1.0), (0.0, 1.0))})
    ranges = {"payload_mass": (0.2, 0.3), "joint_friction": [[0.5, 0.5], ("choice", [0.25])]}
    batch.set_options({"randomisation": ranges})
    batch.reset(seed=0)
    drawn = batch.episode.parameters
    assert 0.2 <= drawn["payload_mass"][0] != drawn["payload_mass"][1] <= 0.3
    np.testing.assert_array_equal(drawn["joint_friction"], [[0.5, 0.25]] * 2)
    for bad, word in (
        ({"payload_mass": (0.0, 1.1)}, "must be from 0.0 to 1.0"),
        ({"noise": (0.0, 0.1)}, "was not drawn at make"),
    ):
        with refuses(ValueError, *bad, word):
            batch.set_options({"randomisation": bad})
    batch.reset(options={"parameters": {"joint_friction": [[0.1, 0.2], [0.3, 0.4]]}})
    np.testing.assert_array_equal(batch.episode.parameters["joint_friction"], [[0.1, 0.2], [0.3, 0.4]])
    for wrong, word in (
        ({"joint_friction": (0.5, 1.1)}, "from 0 to 1"),
        ({"joint_friction": 0.5}, "shape (2,)"),
        ({"elbow_mass": 0.5}, "not drawn"),
    ):
        with refuses(ValueError, *wrong, word):
            batch.reset(options={"parameters": wrong})


def test_paths_that_are_drawn_can_be_requested_and_have_room() -> None:
    """The fastest is the largest square in the shortest lap, 3.15 m/s the scale of velocities."""
    batch = vector(SQUARE, 2, randomisation=PATH, observation=["reference_velocity"], start="corner", **EITHER)
    assert batch.lap_steps == 1600
    assert 1.0 <= batch.single_observation_space.high.min() / (4.0 * 12.6 / 8.0 / 3.15) <= 1.0 + 1e-6
    asked = {"path": ["circle", "square"], "direction": ["clockwise", "counterclockwise"]}
    batch.reset(seed=0, options={"parameters": {"lap_time": [8.0, 16.0], "side": 11.0}, **asked})
    for name, values in asked.items():
        assert getattr(batch.episode, name).tolist() == values
    found = batch.step(np.zeros((2, 2), dtype=np.float32))[0] * 3.15
    np.testing.assert_allclose(np.hypot(*found.T), [np.pi * 11.0 / 8.0, 4.0 * 11.0 / 16.0], rtol=1e-5)
    with refuses(ValueError, "options['time'] = 8.0", "to 8"):
        batch.reset(options={"time": 8.0})


test_laps_that_cannot_be_drawn_are_refused = refused(
    ({"reference": "waypoints", "waypoints": [(0.0, 5.0, 5.0), (16.0, 5.0, 6.0)]}, "lap_time.*have times"),
    ({"reference": "target", "waypoints": [(5.0, 5.0)]}, "lap_time.*no lap"),
    ({"reference": "moves"}, r"lap_time.*at least 800 control periods \(8 s\)"),
    ({"start": "moving", "lap_time": 100.0}, "lap_time.*end an episode"),
    by=lambda options: bare(SQUARE, randomisation={"lap_time": (0.05, 16.0)}, **options),
)
test_what_cannot_be_drawn_is_refused = refused(
    (("joint_frictions", (0.0, 1.0)), "joint_frictions.*did you mean 'joint_friction'"),
    (("joint_friction", (0.0, 1.0)), "joint_friction.*must be two distributions"),
    (("jitter", ("uniform", 0.0, 1.0)), "jitter.*'log_uniform', 'normal', 'choice'"),
    (("jitter", ("log_uniform", 0.0, 1.0)), "jitter.*must be a finite number and > 0"),
    (("jitter", ("log_uniform", 0.5)), "jitter.*2 entries after 'log_uniform'"),
    (("jitter", ("choice", [])), "jitter.*a number at least"),
    (("jitter", ("choice", [0.1, 11.0])), r"jitter.*\[1\]\[1\] = 11.0"),
    (("jitter", ("normal", 0.0, 0.1, 5.0, 6.0)), "jitter.*1e-06 of the distribution"),
    (("jitter", ("normal", 0.0, 0.0, 0.0, 1.0)), r"jitter.*\[2\] = 0.0"),
    (("sensor_period", (0.0, 0.1)), "sensor_period.*must be a finite number and >= 1e-06"),
    (("sensor_position", (4.0, 5.0)), "the largest of what is drawn, sensor_position = 5.0 m"),
    (("inner_stiffness", ((1.0, 2.0), (1.0, 2.0))), "inner_stiffness.*no effect with action_mode = 'torque'"),
    (("sensor_period", (2e-6, 0.1)), "of the sensor's ticks in jitter = 0.05 s"),
    (("side", (0.1, 13.0)), "the largest of what is drawn, side = 13.0 m"),
    (("link_lengths", ((4.0, 5.0), (4.0, 5.0))), "link_lengths.*no such quantity"),
    by=lambda given: bare(SQUARE, randomisation={"jitter": (0.0, 0.05), given[0]: given[1]}),
    kind=(TypeError, ValueError),
)


def test_environments_of_a_batch_draw_paths_together_and_no_controller_takes_one_for_granted() -> None:
    with refuses(ValueError, "environment 1: reference = ('square',)", "all draw side or lap_time or none"):
        vector(SQUARE, 2, per_env={"randomisation": [{}, PATH]})
    with refuses(ValueError, "one reference", "lap_time"):
        Task.of(bare(SQUARE, frame="world", randomisation=PATH))
