"""What a user meets beyond one default lap: many laps, moved sensors, slow and lossy clocks, ranges and options."""

from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import pytest

from flexarm_agents import load_policy
from flexarm_env.laps import LAPS
from tests.support.envs import FREE, GAIN, RESIDUAL, SQUARE, bare


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
    """theta1 winds once a lap around the shoulder; the shipped policy is as good in the third as in the second."""
    agent = load_policy("square")
    act = agent.policy.predict
    errors, info = followed(agent.make_env(max_episode_steps=4800), lap, lambda o: act(o, deterministic=True)[0])
    laps = np.sqrt(np.mean(np.square(errors).reshape(3, 1600), axis=1))
    assert info["state"][0] < -4.0 * np.pi
    np.testing.assert_allclose(laps[2], laps[1], rtol=0.2)


@pytest.mark.parametrize("lap", LAPS)
def test_the_inner_law_alone_keeps_within_two_metres(lap: str) -> None:
    """A lap with action 0, as docs/model.md and the id's text tell it; 1.83 m found on the swing lap, at its start."""
    errors, info = followed(gymnasium.make(RESIDUAL, arm="linear"), lap, lambda observation: np.zeros(2, np.float32))
    assert len(errors) == 1600
    assert info["time"] == pytest.approx(16.0, rel=1e-12)
    assert 0.0 < max(errors) < 2.0


def changes(steps: int, **options: Any) -> np.ndarray:
    """Return the control instants at which the sensor of a moving arm says something new. Shape (n,) [s]."""
    env = gymnasium.make(SQUARE, max_episode_steps=steps, **FREE, **options)
    env.reset(seed=3, options={"start": "moving", "time": 0.5})
    sensed = np.array([env.step(np.zeros(2, np.float32))[4]["sensed"] for _ in range(steps)])
    return 0.01 * (2 + np.flatnonzero(np.any(np.diff(sensed, axis=0) != 0.0, axis=1)))


@pytest.mark.parametrize(("period", "dropout"), [(0.1, 0.0), (0.1, 0.5), (0.1, 0.9), (0.0, 0.4), (0.0, 1.0)])
def test_a_reading_is_lost_once(period: float, dropout: float) -> None:
    """Ticks of a slow clock in 8 s, or readings of each control period in 0.8 s; none is drawn again."""
    new = len(changes(800 if period else 80, sensor_period=period, dropout=dropout))
    expected = 80.0 * (1.0 - dropout)
    assert abs(new - expected) <= 1.0 + 4.0 * np.sqrt(80.0 * dropout * (1.0 - dropout))  # four deviations


def test_jitter_of_a_slow_clock_is_even() -> None:
    """Ticks 50 ms apart arrive 31.2 to 71.2 ms late; a control instant sees them up to 10 ms later."""
    instants = changes(4000, sensor_period=0.05, jitter=0.04)
    # (arrival - delay) mod hold is even over the jitter, then rounded up to a control instant
    counts, _ = np.histogram(np.mod(instants - 9.0 / 288.33, 0.05), bins=5, range=(0.0, 0.05))
    assert len(instants) == pytest.approx(800, abs=5)
    assert counts.max() < 0.32 * len(instants)  # a minimum of several draws would put half into the first bin


@pytest.mark.parametrize("env_id", [SQUARE, RESIDUAL, GAIN])
def test_a_strong_drawn_damping_is_stepped_finely_enough(env_id: str) -> None:
    env = bare(env_id, start="corner", randomisation={"damping": (0.5, 0.5)}, physics_step=None, **FREE)
    for _ in range(6):
        assert not env.step(np.zeros(env.action_space.shape, np.float32))[2]
