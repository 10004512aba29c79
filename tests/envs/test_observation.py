"""Every block of an observation against its definition, from the true states that infos hold."""

from typing import Any, NamedTuple

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from flexarm_env import SquareParameters, inverse_kinematics, square
from flexarm_env.envs.single import FlexArmEnv
from flexarm_env.physics.inverse_kinematics import elbow_side
from flexarm_env.physics.paths import ReferencePath
from tests.support.envs import EVERYWHERE, FORESHORTENED, GAIN, PAPER, RESIDUAL, SQUARE, Array, bare, block, played

STEPS = 40
ALL: dict[str, Any] = {"observation": EVERYWHERE, "error_limit": None, "deflection_limit": None}
FINE = ALL | {"physics_step": 1e-3}
FLOAT = 3e-7  # rounding to float32, relative


class Run(NamedTuple):
    """One entry for each instant, the start included; actions one less."""

    env: FlexArmEnv
    observations: Array
    states: Array
    sensed: Array
    times: Array  # of the lap
    actions: Array

    def block(self, name: str) -> Array:
        return block(self.env, self.observations, name)


def recorded(env: FlexArmEnv, time: float = 3.85, size: float = 0.2, seen: str = "sensed") -> Run:
    """Run an episode with random actions that passes the corner at 4 s; `seen`: the info that is `Run.sensed`."""
    actions = np.random.default_rng(2).uniform(-size, size, (STEPS, *env.action_space.shape)).astype(np.float32)
    observations, infos = played(env, actions, 2, time=time)
    return Run(env, observations, infos["state"], infos[seen], time + infos["time"], actions)


def in_frame(run: Run, vectors: Array) -> Array:
    """Components in the observation's frame: the world's, or turned by -theta1. Shape (n, 2)."""
    if run.env.settings.frame == "world":
        return vectors
    cos, sin = np.cos(run.states[:, 0]), np.sin(run.states[:, 0])
    turned = np.stack([cos * vectors[:, 0] + sin * vectors[:, 1], cos * vectors[:, 1] - sin * vectors[:, 0]], axis=1)
    return np.asarray(turned)


def rigid_angles(run: Run, path: ReferencePath, times: Array) -> Array:
    branch = run.env.episode.elbow_branch
    return np.array([inverse_kinematics(run.env.arm.parameters, point, branch) for point in path.position(times)])


def within_half_a_turn(angle: Array) -> Array:
    return np.asarray(np.angle(np.exp(1j * angle)))


@pytest.mark.parametrize("frame", ["link", "world"])
@pytest.mark.parametrize("scaled", [True, False])
@pytest.mark.parametrize("env_id", [SQUARE, RESIDUAL, GAIN, PAPER])
def test_blocks_hold_what_they_say(env_id: str, frame: str, scaled: bool) -> None:
    gains = env_id in (GAIN, PAPER)
    options = {"elbow_branch": "positive", "last_actions": 3, "previews": (0.05, 0.33, 15.9)}
    options |= ALL | {"observation": [*EVERYWHERE, *["inner_gain"] * gains]}
    env = bare(env_id, frame=frame, scaled=scaled, start="moving", **options)
    corner = 4.0 if scaled else 16.0  # within the lap, or where it ends
    run = recorded(env, time=corner - 15.0 * env.control_period)
    m = env.arm.parameters.modes_per_link
    theta, q = run.states[:, :2], run.states[:, : env.arm.size]
    path, now = square(SquareParameters()), run.times + 1e-9  # at a corner the side that begins there
    aim, soon = rigid_angles(run, path, now), rigid_angles(run, path, now + 1e-5)
    position = path.position(now)
    past = np.pad(run.actions, ((3, 0), (0, 0)), constant_values=-1.0 if gains else 0.0)
    ahead = [in_frame(run, path.position(now + horizon) - position) for horizon in (0.05, 0.33, 15.9)]
    expected = {
        "joint_angles": theta,
        "elbow_direction": np.stack([np.cos(theta[:, 1]), np.sin(theta[:, 1])], axis=1),
        "shoulder_direction": np.stack([np.cos(theta[:, 0]), np.sin(theta[:, 0])], axis=1),
        "joint_rates": run.states[:, env.arm.size : env.arm.size + 2],
        "joint_error": within_half_a_turn(aim - theta),
        "encoder_error": in_frame(run, position - env.arm.rigid_tip(q)),
        "sensed_position": in_frame(run, run.sensed),
        "modal_coordinates": run.states[:, 2 : 2 + 2 * m],
        "modal_rates": run.states[:, 4 + 2 * m :],
        "reference_position": in_frame(run, position),
        "reference_velocity": in_frame(run, path.velocity(now)),
        "previews": np.hstack(ahead),
        "last_actions": np.hstack([past[2 - n : len(past) - n] for n in range(3)])[: STEPS + 1],
        "lap_phase": np.stack([f(2.0 * np.pi * run.times / 16.0) for f in (np.cos, np.sin)], axis=1),
        "time": run.times[:, None] - run.times[0],
        "state": run.states,
        "reading_age": np.full((len(run.times), 1), env.episode.parameters["delay"]),
        "episode_parameters": np.tile([*env.episode.parameters.values()], (len(run.times), 1)),
    }
    if gains:
        expected["inner_gain"] = np.pad(0.5 * (run.actions[:, :1] + 1.0), ((1, 0), (0, 0)))
    for name, values in expected.items():
        atol = 1e-6 * max(1.0, np.abs(values).max())  # float32, and now's 1 ns at 3 m/s
        np.testing.assert_allclose(run.block(name), values, rtol=FLOAT, atol=atol, err_msg=name)
    rates = (soon - aim) / 1e-5 - expected["joint_rates"]  # a difference quotient: its own error, 1e-5 s of change
    np.testing.assert_allclose(run.block("joint_error_rate"), rates, atol=2e-4 * np.abs(rates).max())
    swung = np.minimum.accumulate(np.where(elbow_side(theta[:, 1]) < 0.0, -1.0, 1.0)) < 0.0  # and stays there
    mirrored = np.array([inverse_kinematics(env.arm.parameters, point, "negative") for point in position])
    present = np.where(swung[:, None], mirrored, aim)
    np.testing.assert_allclose(run.block("present_joint_error"), within_half_a_turn(present - theta), atol=1e-6)
    rates = run.block("joint_error_rate")
    np.testing.assert_array_equal(run.block("present_joint_error_rate")[~swung], rates[~swung])
    others = {"sensor_error", "sensor_error_rate", "present_joint_error", "present_joint_error_rate"}
    assert set(expected) - {"inner_gain"} | others | {"joint_error_rate"} == set(EVERYWHERE)
    assert np.ptp(run.block("reference_velocity"), axis=0).max() > 1.0  # the corner was met


def test_the_joint_error_is_within_half_a_turn() -> None:
    env = bare(start="corner", **ALL)
    state = env.reset()[1]["state"]
    for offset, expected in ((0.1, -0.1), (np.pi - 0.1, 0.1 - np.pi), (np.pi + 0.1, np.pi - 0.1), (4.0 * np.pi, 0.0)):
        turned = state.copy()
        turned[0] += offset
        observation, info = env.reset(options={"state": turned})
        assert info["state"][0] == pytest.approx(turned[0])
        assert block(env, observation, "joint_error")[0] == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize(("own", "other", "sign"), [("positive", "negative", 1.0), ("negative", "positive", -1.0)])
def test_the_present_joint_error_is_on_the_elbows_side(own: str, other: str, sign: float) -> None:
    """Within the dead band on the side of `elbow_branch`, until the elbow is bent; by turns in one environment."""
    env = bare(start="corner", elbow_branch=own, **ALL)
    arm, state = env.arm, env.reset()[1]["state"]
    point, soon = square(SquareParameters()).position([0.0, 1e-6])
    for theta2, branch in ((state[1], own), (-state[1], other), (-0.06 * sign, other), (-0.04 * sign, own)):
        state[1] = theta2
        observation, info = env.reset(options={"start": "corner", "state": state})
        aim = inverse_kinematics(arm.parameters, point, branch)
        found = block(env, observation, "present_joint_error")
        np.testing.assert_allclose(found, within_half_a_turn(aim - state[:2]), atol=1e-6)
        rates = (inverse_kinematics(arm.parameters, soon, branch) - aim) / 1e-6  # the arm rests
        np.testing.assert_allclose(block(env, observation, "present_joint_error_rate"), rates, rtol=1e-4, atol=1e-4)
        usual = within_half_a_turn(inverse_kinematics(arm.parameters, point, own) - state[:2])
        np.testing.assert_allclose(block(env, observation, "joint_error"), usual, atol=1e-6)
        assert info["elbow_side"] == (0.0 if abs(theta2) == 0.04 else np.sign(theta2))


def motion_of_the_point(
    env: FlexArmEnv, options: dict[str, Any], run: Run, link: int = 2, place: float | None = None
) -> CubicHermiteSpline:
    """Where the sensor's point is as a function of the lap's time, from a run that is recorded every millisecond.

    Its steps are the environment's. Before the start the arm stood still.
    """
    place = place or env.settings.sensor_position
    fine = bare(**(options | {"control_period": 1e-3}))
    states = played(fine, run.actions.repeat(10, axis=0), 2, time=run.times[0], state=run.states[0])[1]["state"]
    np.testing.assert_allclose(states[::10], run.states, rtol=1e-9, atol=1e-9)
    points, velocities = env.arm.position(states[:, : env.arm.size], link, place), env.arm.velocity(states, link, place)
    times = run.times[0] + 1e-3 * np.arange(-100, len(states))
    points = np.vstack([np.tile(points[:1], (100, 1)), points])
    velocities = np.vstack([np.zeros((100, 2)), velocities])
    return CubicHermiteSpline(times, points, velocities)


def reference(run: Run, times: Array) -> Array:
    """Of an episode that starts at rest: before that the reference rested too."""
    return square(SquareParameters()).position(np.maximum(times, run.times[0]))


@pytest.mark.parametrize(
    ("options", "latest"),
    [
        ({"delay": 0.02}, 0.02),
        ({"delay": 0.0}, 0.0),
        ({"delay": 0.00037}, 0.00037),
        ({"delay": 0.0135, "sensor_position": 2.0}, 0.0135),
        ({}, 9.0 / 288.33),
        ({"actuation_delay": 0.0, "wave_speed": 100.0, "sensor_position": 1.0}, 0.055),
    ],
    ids=str,
)
def test_the_reading_is_as_late_as_it_is(options: dict[str, Any], latest: float) -> None:
    """The physical point, with deflection, that long ago; and the error of it, and its change."""
    options = FINE | {"start": "corner", "frame": "world"} | options
    env = bare(**options)
    run = recorded(env)
    point = motion_of_the_point(env, options, run)
    taken = run.times - latest
    np.testing.assert_allclose(run.sensed, point(taken), rtol=0.0, atol=1e-9)
    error = reference(run, taken) - point(taken)
    np.testing.assert_allclose(run.block("sensor_error"), error, rtol=0.0, atol=2e-6)
    before = taken - 0.01
    change = (error - reference(run, before) + point(before)) / 0.01
    np.testing.assert_allclose(run.block("sensor_error_rate"), change, rtol=0.0, atol=2e-6 * np.abs(change).max())
    present = env.arm.position(run.states[:, : env.arm.size], 2, env.settings.sensor_position)
    assert latest == 0.0 or np.abs(run.sensed - present).max() > 1e-4


def test_a_slower_sensor_holds_its_reading() -> None:
    """Ticks every 25 ms; between them nothing new is known, and the change per second is that between the ticks."""
    options = FINE | {"start": "corner", "frame": "world", "delay": 0.013, "sensor_period": 0.025}
    env = bare(**options)
    run = recorded(env)
    point = motion_of_the_point(env, options, run)
    taken = 0.025 * np.floor((run.times - 0.013) / 0.025 + 1e-9)
    np.testing.assert_allclose(run.sensed, point(taken), rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(run.block("sensor_error"), reference(run, taken) - point(taken), rtol=0.0, atol=2e-6)
    new = np.flatnonzero(np.diff(taken) > 0.0) + 1
    errors = reference(run, taken) - point(taken)
    for k, first in zip(new[1:], new[:-1], strict=True):
        change = (errors[k] - errors[first]) / (taken[k] - taken[first])
        np.testing.assert_allclose(run.block("sensor_error_rate")[k], change, rtol=1e-4, atol=1e-4)
    same = np.setdiff1d(np.arange(1, STEPS + 1), new)
    np.testing.assert_array_equal(run.sensed[same], run.sensed[same - 1])


@pytest.mark.parametrize("sensor", ["collocated", "rigid"])
def test_sensors_that_see_the_joints_only(sensor: Any) -> None:
    """The point by rigid kinematics of the present angles, or of angles 40 and 20 ms old."""
    delay = (0.04, 0.02) if sensor == "rigid" else None
    env = bare(PAPER, sensor=sensor, sensor_position=3.0, delay=delay, control_period=0.01, start="corner", **ALL)
    run = recorded(env, time=0.0)
    index = np.arange(STEPS + 1)
    theta1 = run.states[np.maximum(index - (4 if sensor == "rigid" else 0), 0), 0]
    both = theta1 + run.states[np.maximum(index - (2 if sensor == "rigid" else 0), 0), 1]
    expected = np.stack([4.5 * np.cos(theta1) + 3.0 * np.cos(both), 4.5 * np.sin(theta1) + 3.0 * np.sin(both)], 1)
    np.testing.assert_allclose(run.sensed, expected, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("place", [4.5, 2.0])
@pytest.mark.parametrize("time", [1.0, 4.02, 8.5])
def test_a_start_on_the_move_has_a_past(place: float, time: float) -> None:
    """The delay line holds the motion of a rigid arm on the reference, moved to where the arm is."""
    env = bare(start="moving", sensor_position=place, delay=0.05, frame="world", start_spread=(0.02, 0.02), **ALL)
    run = recorded(env, time=time, size=0.0)
    path = square(SquareParameters())

    def sensed(times: Array) -> Array:
        theta = rigid_angles(run, path, times)
        both = theta.sum(axis=1)
        cos, sin = (4.5 * f(theta[:, 0]) + place * f(both) for f in (np.cos, np.sin))
        return np.stack([cos, sin], axis=1)

    taken = np.array([time - 0.05, time - 0.06])
    offset = env.arm.position(run.states[0, :6], 2, place) - sensed(np.array([time]))[0]
    error = path.position(taken) - sensed(taken) - offset
    # between the steps of 1 ms the motion is interpolated, here over the corner's kink too
    np.testing.assert_allclose(run.block("sensor_error")[0], error[0], rtol=0.0, atol=1e-5)
    rate = (error[0] - error[1]) / 0.01
    np.testing.assert_allclose(run.block("sensor_error_rate")[0], rate, rtol=0.0, atol=2e-3)


def test_noise_has_the_size_it_says() -> None:
    """White, fresh each period, and of the measurements only; 1000 draws: deviations known to 3 %."""
    still = {"reference": "waypoints", "waypoints": [(5.0, 0.0), (5.0, 1e-9)], "start": "corner", "frame": "world"}
    still |= FORESHORTENED  # whose kernels with noise other tests compile, too
    noisy, clean = bare(**ALL, **still, noise=0.02, encoder_noise=(0.01, 0.3)), bare(**ALL, **still)
    rows = []
    for _ in range(1000):
        (first, *_, one), (second, *_, other) = noisy.step(np.zeros(2)), clean.step(np.zeros(2))
        np.testing.assert_array_equal(one["state"], other["state"])  # noise moves nothing
        rows.append(first - second.astype(float))
    difference = np.array(rows)
    for name, size in (("sensed_position", 0.02), ("joint_angles", 0.01), ("joint_rates", 0.3)):
        draws = block(noisy, difference, name)
        assert draws.std(axis=0) == pytest.approx([size, size], rel=0.1)
        assert np.abs(draws.mean(axis=0)).max() < 0.13 * size
        assert abs(np.corrcoef(draws[1:, 0], draws[:-1, 0])[0, 1]) < 0.12
        assert abs(np.corrcoef(draws[:, 0], draws[:, 1])[0, 1]) < 0.12
    sensor, joint = block(noisy, difference, "sensed_position"), block(noisy, difference, "joint_angles")
    assert abs(np.corrcoef(sensor[:, 0], joint[:, 0])[0, 1]) < 0.12
    np.testing.assert_allclose(block(noisy, difference, "sensor_error"), -sensor, atol=2e-6)
    change = -np.diff(sensor, axis=0) / 0.01
    np.testing.assert_allclose(block(noisy, difference, "sensor_error_rate")[1:], change, atol=1e-3)
    np.testing.assert_allclose(block(noisy, difference, "joint_error"), -joint, atol=1e-6)
    for name in ("state", "modal_coordinates", "modal_rates", "reference_position", "lap_phase", "previews"):
        assert not block(noisy, difference, name).any()
    assert not block(noisy, difference, "last_actions").any()
