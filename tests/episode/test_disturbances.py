"""Pulses of force at the tip, outages of the late sensor and drift of gauges, in plain Python."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import simpson

from flexarm_env.codegen.declarations import plain_python
from flexarm_env.envs.hosted import HostedSimulator
from flexarm_env.envs.settings import Settings
from flexarm_env.episode.disturbances import push_tips
from flexarm_env.kernels.variants import block_at
from tests.support.plain import PlainEnvironment
from tests.support.refusals import refused, refuses

# Without damping, so that work and energy balance; the linear arm's kinematics have no foreshortening.
FREE = {"modes_per_link": 1, "damping_ratio": 0.0}
ARMS = [FREE, FREE | {"preset": "linear"}]
CORNER: dict[str, Any] = {"start": "corner", "elbow_branch": "negative", "observation": ("state",), "scaled": False}
STILL = (0.0, 0.0)
PULSE = {"pulse_force": (1.0, 0.0)}


@pytest.mark.parametrize("arm", ARMS)
def test_a_pulse_gives_its_impulse_and_its_work(arm: dict[str, Any]) -> None:
    """Its moment about the shoulder is the change of angular momentum, its work that of energy; motors are idle."""
    force = np.array([30.0, -55.0])
    options = CORNER | {"pulse_force": force.tolist(), "pulse_time": 0.02, "pulse_duration": 0.04}
    env = PlainEnvironment(arm=arm, **options, control_period=1e-3, physics_step=2e-4)
    made = env.simulator.settings.flexible_arm
    (state,) = env.follow([STILL] * 80, "STATE")
    tip = made.tip(state[:, :4])
    assert not state[:21, 4:].any()  # until it begins
    energy = [sum(made.energy(one)[:3]) for one in state]
    np.testing.assert_allclose(energy[60:], energy[60], rtol=1e-9)  # once it has ended
    assert energy[-1] == pytest.approx(force @ (tip[60] - tip[20]), rel=1e-7)
    moment = simpson((tip[:, 0] * force[1] - tip[:, 1] * force[0])[20:61], dx=1e-3)
    assert made.angular_momentum(state[-1]) == pytest.approx(moment, rel=1e-7)
    assert energy[-1] > 1.0


@settings(max_examples=10)
@given(st.floats(0.0, 0.05), st.floats(0.001, 0.03), st.floats(0.03, 0.06), st.booleans())
def test_pulses_last_as_long_as_they_say(first: float, duration: float, period: float, again: bool) -> None:
    """The mean forces of the steps add up to whole pulses, wherever their ends fall between two steps."""
    once: dict[str, Any] = {"pulse_force": (2.0, 3.0), "pulse_time": first, "pulse_duration": duration}
    env = PlainEnvironment(arm=ARMS[1], **CORNER, **once, pulse_period=period * again)
    h, total = env.simulator.settings.integration.step, np.zeros(2)
    count = round(0.14 / h)
    with plain_python(env.simulator._variant):
        for done in range(count):
            push_tips(block_at(env.simulator._memory, 0), done)
            total += h * env.row("TIP_FORCE")
    starts = first + period * np.arange(5) if again else np.array([first])
    lasted = np.clip(h * count - starts, 0.0, duration).sum()
    np.testing.assert_allclose(total, np.array([2.0, 3.0]) * lasted, rtol=1e-9, atol=1e-12)


def test_an_accelerometer_feels_the_force() -> None:
    """At rest it reads J M^-1 J^T F at the tip."""
    sensor = {"imu_link": 2, "observation": ("accelerometer",), "pulse_force": (0.0, 4.0)}
    env = PlainEnvironment(arm=ARMS[0], **CORNER | sensor, pulse_duration=1.0, control_period=1e-5)
    env.step(STILL)
    arm, q = env.simulator.settings.flexible_arm, env.result("STATE")[:4]
    jacobian = arm.point_jacobian(q, 2, arm.parameters.link_lengths[1])
    wanted = jacobian @ np.linalg.solve(arm.mass_matrix(q), jacobian.T @ [0.0, 4.0])
    assert np.linalg.norm(env.result("FURTHER_READING")[:2]) == pytest.approx(np.linalg.norm(wanted), rel=1e-3)


@pytest.mark.parametrize("clock", [{}, {"sensor_period": 0.01}])
def test_an_outage_freezes_the_reading(clock: dict[str, float]) -> None:
    """What was taken before it stays until what is taken after it arrives; the delay is 3 periods and a bit."""
    still: dict[str, Any] = {"arm": ARMS[0], "start": "corner", "delay": 0.0, "reference": "circle"} | clock
    env, other = PlainEnvironment(**still, outage_time=0.03, outage_duration=0.04), PlainEnvironment(**still)
    (read,), (whole,) = (one.follow([(0.5, 0.3)] * 11, "LINK_SENSOR") for one in (env, other))
    for n, reading in enumerate(read):
        taken = 2 if 3 <= n < 7 else n
        np.testing.assert_allclose(reading, whole[taken], atol=1e-12)
    assert np.linalg.norm(whole[6] - whole[2]) > 1e-4


def test_gauges_drift_and_the_state_does_not() -> None:
    names = ("modal_coordinates", "modal_rates", "state")
    options: dict[str, Any] = {"arm": {"modes_per_link": 2}, "observation": names, "start": "corner"}
    env = PlainEnvironment(**options, scaled=False, gauge_drift=(0.5, -0.25))
    coordinates, rates, states = env.follow([(0.4, 0.2)] * 3, *names)
    drift = np.array([0.5, 0.0, -0.25, 0.0])
    np.testing.assert_allclose(coordinates, states[:, 2:6] + np.outer(0.01 * np.arange(4), drift), atol=1e-6)
    np.testing.assert_allclose(rates, states[:, 8:12] + drift, atol=1e-5)


test_what_has_no_effect_or_does_not_fit_is_refused = refused(
    ({"pulse_time": 1.0}, "pulse_time.*with pulse_force other than 0"),
    ({"outage_time": 1.0}, "outage_time.*with outage_duration other than 0"),
    ({"gauge_drift": (0.1, 0.0), "observation": ("state",)}, "gauge_drift.*block of the strain gauges"),
    ({**PULSE, "pulse_duration": 0.5, "pulse_period": 0.2}, "pulse_.*at least pulse_duration"),
    ({**PULSE, "action_mode": "gain"}, "pulse_force.*no effect with action_mode = 'gain'"),
    ({"outage_duration": 0.5, "action_mode": "gain", "feedback_source": "sensor"}, "outage_.*in continuous time"),
    by=Settings.of,
)


def test_a_hosted_arm_takes_no_pulse() -> None:
    with refuses(ValueError, "pulse_force", "compiled arm"):
        HostedSimulator(Settings.of(PULSE), None)  # type: ignore[arg-type]
