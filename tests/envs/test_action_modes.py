"""What an action does in each mode, against computations of the same motion by other means."""

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline, KroghInterpolator

from flexarm_env import SquareParameters, inverse_kinematics, square
from flexarm_env.envs.choices import DEFAULT_OBSERVATION
from flexarm_env.envs.single import FlexArmEnv
from tests.support.envs import FREE, GAIN, RESIDUAL, SQUARE, TORQUE_LIMITS, Array, bare, block, exact_actions, played
from tests.support.plain import KERNELS


def recorded(env: FlexArmEnv, actions: Array, **options: Any) -> tuple[Array, Array]:
    """Return the states at all instants, and the torque of each period."""
    _, infos = played(env, actions, 1, **options)
    return infos["state"], infos["torque"][1:]


@pytest.mark.parametrize(("period", "physics_step", "substeps"), [(0.02, 1e-3, 20), (0.01, 3e-4, 34), (0.001, None, 1)])
def test_torques_are_held(period: float, physics_step: float | None, substeps: int) -> None:
    """The same Runge-Kutta steps, as many as fill the period, from the same state; the start's rounding differs."""
    limits = {"torque_limit": (30.0, 20.0), "start": "moving"}
    env = bare(control_period=period, physics_step=physics_step, **limits, **FREE)
    states, torques = recorded(env, exact_actions(20))
    np.testing.assert_array_equal(torques, np.array([30.0, 20.0]) * exact_actions(20))
    run = env.arm.simulate(states[0], torques, 20 * period, step=period, substeps=substeps)
    np.testing.assert_allclose(states, run.state, rtol=0.0, atol=1e-12 * np.abs(states).max())
    assert np.abs(np.diff(states, axis=0)).max() > 0.01


@pytest.mark.parametrize("delay", [0.0003, 0.0137, 0.03, 0.0995])
def test_a_late_torque_acts_as_late_as_it_is(delay: float) -> None:
    """A command that changes within an integration step enters as the mean over that step."""
    env = bare(actuation_delay=delay, start="moving", physics_step=1e-3, **FREE)
    actions = exact_actions(40, size=0.25)
    states, torques = recorded(env, actions)
    fine = 100  # microseconds: the delays are whole multiples
    count = 400_000 // fine
    index = (np.arange(count) * fine - round(1e6 * delay)) // 10_000  # of the action that acts; before all, none
    acting = np.where(index[:, None] >= 0, (TORQUE_LIMITS * actions)[index], 0.0)
    means = acting.reshape(-1, 10, 2).mean(axis=1)
    coarse = env.arm.simulate(states[0], means, 0.4)
    # a switch is placed to within 1e-9 of a period, 1e-8 of an integration step, so that roundings cannot move it
    np.testing.assert_allclose(states, coarse.state[::10], rtol=0.0, atol=1e-8 * np.abs(states).max())
    np.testing.assert_allclose(torques, means[::10], rtol=0.0, atol=1e-8 * TORQUE_LIMITS[0])
    # The mean has the right impulse, a fraction of 1 ms early or late: little of what the joints do in a period.
    exact = env.arm.simulate(states[0], acting, 0.4, step=1e-4)
    late = np.abs(states[1:, :2] - exact.state[100::100, :2]).max() / np.abs(np.diff(states[:, :2], axis=0)).max()
    assert late < 0.01


@pytest.mark.parametrize(
    ("env_id", "mode"),
    [(SQUARE, "torque"), (SQUARE, "torque_rate"), (RESIDUAL, "residual"), (RESIDUAL, "reference"), (GAIN, "gain")],
)
@pytest.mark.usefixtures("uncompiled")
def test_a_delay_of_two_periods_is_the_action_before_the_last(env_id: str, mode: str) -> None:
    """Before the first has arrived there is no torque, and no gain, whose action is -1."""
    actions = exact_actions(12, size=0.3)[:, : 1 if mode == "gain" else 2]
    shifted = np.vstack([np.full_like(actions[:2], -1.0 if mode == "gain" else 0.0), actions[:-2]])
    late = recorded(bare(env_id, action_mode=mode, actuation_delay=0.02, start="corner", **FREE), actions)
    prompt = recorded(bare(env_id, action_mode=mode, start="corner", **FREE), shifted)
    np.testing.assert_array_equal(late[0], prompt[0])
    np.testing.assert_array_equal(late[1], prompt[1])


RATE: dict[str, Any] = {"action_mode": "torque_rate", "observation": [*DEFAULT_OBSERVATION, "torque"]}


@pytest.mark.parametrize("kernels", KERNELS)
def test_torque_rates_add_up(kernels: str) -> None:
    """Held over each period, within the motors' limits, observed; and from 0 again after a reset."""
    env = bare(start="moving", physics_step=1e-3, **RATE, **FREE)
    actions = np.clip(exact_actions(60) + 0.3125, -1.0, 1.0)
    changes, expected = actions * (30.0, 10.0), [np.zeros(2)]
    for change in changes:
        expected.append(np.clip(expected[-1] + change, -TORQUE_LIMITS, TORQUE_LIMITS))
    for _ in range(2):
        observations, infos = played(env, actions, 1)
        states, torques = infos["state"], infos["torque"]
        assert (np.abs(expected) == TORQUE_LIMITS).any(axis=0).all()
        np.testing.assert_allclose(torques, expected, rtol=1e-14)
        np.testing.assert_allclose(block(env, observations, "torque"), torques, rtol=1e-6)
        run = env.arm.simulate(states[0], np.repeat(torques[1:], 10, axis=0), 0.6)
        np.testing.assert_allclose(states, run.state[::10], rtol=0.0, atol=1e-12 * np.abs(states).max())


def integrated(env: FlexArmEnv, start: Array, time: float, actions: Array) -> tuple[Array, Array]:
    """States and first torques by an adaptive integrator.

    The law's reference is, in each period, the cubic that has the joint angles and rates of the rigid arm on the path
    at the period's ends: off by 2e-6 rad at most. Corners lie between periods.
    """
    settings, arm, path = env.settings, env.arm, square(SquareParameters())
    period = env.control_period
    ends, nodes = [0.0, period], np.linspace(0.0, period, 9)
    stiffness, resistance = np.array(settings.inner_stiffness), np.array(settings.inner_damping)
    limit = np.array(settings.torque_limit or TORQUE_LIMITS)
    moves = settings.action_mode == "reference"  # else actions are torques
    shifts = np.vstack([np.zeros((1, 2)), moves * np.array(settings.shift_limit) * actions])
    states, torques = [start], []
    for k, residual in enumerate((not moves) * TORQUE_LIMITS * actions):
        places = path.position(time + k * period + nodes)
        angles = np.unwrap([inverse_kinematics(arm.parameters, at, "positive") for at in places], axis=0)
        exact = KroghInterpolator(nodes, angles)
        aim = CubicHermiteSpline(ends, exact(ends), exact.derivative(ends))
        assert np.abs(aim(nodes) - angles).max() < 2e-6
        turn = 2.0 * np.pi * np.round((states[-1][0] - angles[0, 0]) / (2.0 * np.pi))
        offset, slope = shifts[k] + (turn, 0.0), (shifts[k + 1] - shifts[k]) / period

        def torque(
            u: float, state: Array, aim: Any = aim, offset: Array = offset, slope: Array = slope, more: Array = residual
        ) -> Array:
            wanted = more + stiffness * (aim(u) + offset + slope * u - state[:2])
            wanted += resistance * (aim(u, 1) + slope - state[arm.size : arm.size + 2])
            return np.clip(wanted, -limit, limit)

        def rate(u: float, state: Array, torque: Any = torque) -> Array:
            return np.concatenate([state[arm.size :], arm.acceleration(state, torque(u, state))])

        torques.append(torque(0.0, states[-1]))
        found = solve_ivp(rate, (0.0, period), states[-1], rtol=1e-9, atol=1e-11)
        states.append(found.y[:, -1])
    return np.array(states), np.array(torques)


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"action_mode": "reference", "shift_limit": (0.2, 0.1)},
        {"torque_limit": (150.0, 50.0), "inner_stiffness": (500.0, 100.0), "inner_damping": (50.0, 3.0)},
    ],
    ids=["residual", "reference", "stiff"],
)
def test_the_inner_law_acts_in_continuous_time(options: dict[str, Any]) -> None:
    """Around the corner at 4 s, with actions; steps so fine that the torque limit may be met anywhere within one."""
    env = bare(RESIDUAL, physics_step=1e-5, start="moving", **(FREE | options))
    actions = exact_actions(4, size=0.25)
    states, torques = recorded(env, actions, time=3.98)
    expected, expected_torques = integrated(env, states[0], 3.98, actions)
    scale = np.abs(expected).max(axis=0)
    np.testing.assert_allclose(states / scale, expected / scale, rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(torques, expected_torques, rtol=0.0, atol=1e-6 * TORQUE_LIMITS[0])
    assert np.abs(np.diff(expected_torques, axis=0)).max() > 1.0


def test_torque_limits_hold() -> None:
    limit = np.array([20.0, 5.0])
    for env_id, options in ((RESIDUAL, {}), (SQUARE, {}), (GAIN, {"arm": "default", "gain_limit": 20.0})):
        env = bare(env_id, torque_limit=(20.0, 5.0), start="corner", **(FREE | options))
        torques = [env.step(np.full(env.action_space.shape, 1.0 - k % 3))[4]["torque"] for k in range(30)]
        np.testing.assert_array_equal(np.abs(torques).max(axis=0), limit)


def test_the_same_law_held_over_a_period_is_unstable() -> None:
    """Without hub inertia the elbow has next to no inertia of its own: held for 10 ms, its damping overshoots.

    Inside the integrator the same law keeps the resting arm at rest.
    """
    stiffness, resistance = np.array([60.0, 20.0]), np.array([20.0, 6.0])
    start = np.zeros(12)
    start[:2] = inverse_kinematics(bare().arm.parameters, (-6.3, -6.3), "positive")
    start[6:8] = 1e-3
    still = {"reference": "waypoints", "waypoints": [(-6.3, -6.3), (-6.3, -6.3 + 1e-9)]}
    inner, outer = bare(RESIDUAL, **still), bare(SQUARE, **still)
    inner.reset(options={"state": start})
    state = outer.reset(options={"state": start})[1]["state"]
    fastest = 0.0
    for _ in range(200):
        torque = stiffness * (start[:2] - state[:2]) - resistance * state[6:8]
        state = outer.step(torque / TORQUE_LIMITS)[4]["state"]
        fastest = max(fastest, np.abs(state[6:8]).max())
        assert np.abs(inner.step(np.zeros(2))[4]["state"][6:8]).max() < 2e-3
    assert fastest > 10.0


@pytest.mark.parametrize("sensor", ["rigid", "true"])
def test_the_law_on_the_joints_is_that_on_a_collocated_sensor(sensor: str) -> None:
    """To the last bit, with a gain that changes, wherever the sensor is."""
    on_joints, on_sensor = (
        bare(GAIN, arm="linear", start="corner", gain_limit=2.0, **o)
        for o in ({"sensor": sensor, "sensor_position": 0.5}, {"sensor": "collocated", "feedback_source": "sensor"})
    )
    for k in range(4):
        action = np.array([(k % 5 - 2.0) / 2.0])
        info, other = on_joints.step(action)[4], on_sensor.step(action)[4]
        assert info["gain"] == other["gain"] == action[0] + 1.0
        np.testing.assert_array_equal(info["state"], other["state"])
        np.testing.assert_array_equal(info["torque"], other["torque"])
