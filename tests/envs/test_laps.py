"""What a user meets beyond one default lap: many laps, moved sensors, slow and lossy clocks, ranges and options."""

from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import pytest

from flexarm_agents import load_policy
from flexarm_env.laps import LAPS

SQUARE, GAIN, RESIDUAL = (f"flexarm_env:FlexArm/Square{name}-v0" for name in ("", "Gain", "Residual"))


def followed(env: Any, lap: str, act: Callable[[Any], Any]) -> tuple[list[float], dict[str, Any]]:
    """Follow a lap until the time limit; return the tip's error at each instant [m], and the last info."""
    observation, info = env.reset(seed=0, options=LAPS[lap].reset_options())
    errors = []
    truncated = False
    while not truncated:
        observation, _, terminated, truncated, info = env.step(act(observation))
        assert not terminated, info
        errors.append(info["tip_error"])
    return errors, info


@pytest.mark.parametrize("lap", LAPS)
def test_laps_follow_each_other(lap: str) -> None:
    """theta1 winds once a lap around the shoulder; the shipped policy is as good in the fifth as in the second."""
    agent = load_policy("square")
    act = agent.policy.predict
    errors, info = followed(agent.make_env(max_episode_steps=8000), lap, lambda o: act(o, deterministic=True)[0])
    laps = np.sqrt(np.mean(np.square(errors).reshape(5, 1600), axis=1))
    assert info["state"][0] < -8.0 * np.pi
    np.testing.assert_allclose(laps[2:], laps[1], rtol=0.2)


@pytest.mark.parametrize("lap", LAPS)
def test_the_inner_law_alone_keeps_within_two_metres(lap: str) -> None:
    """A lap with action 0, as docs/model.md and the id's text tell it; 1.83 m found on the swing lap, at its start."""
    errors, _ = followed(gymnasium.make(RESIDUAL, arm="linear"), lap, lambda observation: np.zeros(2, np.float32))
    assert len(errors) == 1600
    assert 0.0 < max(errors) < 2.0


def readings(steps: int, **options: Any) -> np.ndarray:
    """Return what the sensor says at each control instant of a moving arm. Shape (steps, 2)."""
    env = gymnasium.make(SQUARE, max_episode_steps=steps, error_limit=None, deflection_limit=None, **options)
    env.reset(seed=3, options={"start": "moving", "time": 0.5})
    return np.array([env.step(np.zeros(2, np.float32))[4]["sensed"] for _ in range(steps)])


@pytest.mark.parametrize("dropout", [0.0, 0.5, 0.9])
def test_a_tick_of_a_slow_clock_is_lost_once(dropout: float) -> None:
    """80 ticks in 8 s; what is lost stays lost, and is not drawn again at each control instant."""
    sensed = readings(800, sensor_period=0.1, dropout=dropout)
    new = np.any(np.diff(sensed, axis=0) != 0.0, axis=1).sum()
    expected = 80.0 * (1.0 - dropout)
    assert abs(new - expected) <= 1.0 + 4.0 * np.sqrt(80.0 * dropout * (1.0 - dropout))  # four deviations


def test_jitter_of_a_slow_clock_is_even() -> None:
    """Ticks 50 ms apart arrive 31.2 to 71.2 ms late; a control instant sees them up to 10 ms later."""
    limits = {"error_limit": None, "deflection_limit": None}
    env = gymnasium.make(SQUARE, max_episode_steps=4000, sensor_period=0.05, jitter=0.04, **limits)
    env.reset(seed=1, options={"start": "moving"})  # without torque the arm goes on moving
    before, instants = None, []
    for _ in range(4000):
        info = env.step(np.zeros(2, np.float32))[4]
        if before is not None and (info["sensed"] != before).any():
            instants.append(info["time"])
        before = info["sensed"]
    # (arrival - delay) mod hold is even over the jitter, then rounded up to a control instant
    phase = np.mod(np.array(instants) - 9.0 / 288.33, 0.05)
    counts, _ = np.histogram(phase, bins=5, range=(0.0, 0.05))
    assert len(instants) == pytest.approx(800, abs=5)
    assert counts.max() < 0.32 * len(instants)  # a minimum of several draws would put half into the first bin


@pytest.mark.parametrize("env_id", [SQUARE, RESIDUAL, GAIN])
def test_a_strong_drawn_damping_is_stepped_finely_enough(env_id: str) -> None:
    limits = {"error_limit": None, "deflection_limit": None, "physics_step": None}
    env = gymnasium.make(env_id, arm="linear", randomisation={"damping": (0.5, 0.5)}, **limits)
    env.reset(seed=0, options={"start": "corner"})
    for _ in range(20):
        assert not env.step(np.zeros(env.action_space.shape, np.float32))[2]
