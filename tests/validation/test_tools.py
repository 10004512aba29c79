"""What the checks measure with, where no threshold of theirs would show a mistake."""

import numpy as np
import pytest

from flexarm_env import SquareParameters, square
from flexarm_env.extras import install_command
from tests.validation.motion import Motion, extrapolated, low_passed

pytest.importorskip("mujoco", reason=f"run `{install_command('validate')}`")

from tests.validation.arms import Modal
from tests.validation.engine.study import crossing
from tests.validation.laps import HostedEnv, Lap


def test_extrapolation_removes_the_second_order() -> None:
    def motion(elements: int) -> Motion:
        return Motion(*(np.full((3, 2), value + 7.0 / elements**2) for value in (1.0, 2.0, 3.0)))

    for found, value in zip(extrapolated(motion(10), motion(20)), (1.0, 2.0, 3.0), strict=True):
        np.testing.assert_allclose(found, value, rtol=1e-13)


def test_low_pass_keeps_what_is_slow() -> None:
    time = np.arange(0.0, 2.0, 1e-3)
    slow = np.column_stack([np.sin(2.0 * np.pi * time), np.cos(2.0 * np.pi * time)])
    fast = np.sin(2.0 * np.pi * 60.0 * time)[:, None]
    np.testing.assert_allclose(low_passed(slow + fast)[300:-300], slow[300:-300], atol=5e-3)


def test_a_limit_lies_where_the_error_passes_the_tolerance() -> None:
    curve = [(bend, 40.0 * bend**2) for bend in (0.005, 0.02, 0.08)]
    assert crossing(curve, 0.01) == pytest.approx(np.sqrt(0.01 / 40.0))
    assert crossing(curve, 0.0001) == pytest.approx(0.005 * 0.0001 / 0.001)  # below all, of first order
    assert crossing(curve, 1.0) is None
    assert crossing([(0.01, 0.001), (0.1, np.inf)], 0.01) == 0.01


def test_a_lap_is_scored_as_the_benchmark_scores_it() -> None:
    reference = square(SquareParameters()).position(1e-3 * np.arange(3001))
    torque = np.tile([[3.0, 0.0], [-3.0, 0.0]], (150, 1))
    near = Lap(reference + np.array([0.0, 0.02]), torque, [])
    assert near.score == pytest.approx(20.0)
    assert near.score_after_2s == pytest.approx(20.0)
    assert near.torque_change == pytest.approx(6.0)


def test_an_agent_sees_a_hosted_model_as_it_sees_its_own_arm() -> None:
    """On the environment's own arm: what differs is the error of its step after jumps (0.29 at 2 ms, 0.013 at 1 ms)."""
    from flexarm_agents import load_policy
    from flexarm_env.laps import LAPS

    trained = load_policy("square")
    env = trained.make_env(physics_step=1e-3)
    start = LAPS["plain"].reset_options()
    expected, info = env.reset(seed=0, options=start)
    model = Modal(env.unwrapped.arm)
    model.state = info["state"].copy()
    hosted = HostedEnv(model, physics_step=1e-3)
    observation, _ = hosted.reset(seed=0, options=start)
    for _ in range(60):
        np.testing.assert_allclose(observation, expected, atol=2e-2)
        action = np.clip(trained.policy.predict(expected, None, np.ones(1, dtype=bool), True)[0], -1.0, 1.0)
        (expected, *_), (observation, *_) = env.step(action), hosted.step(action)
        assert hosted.host.taken().shape == (10, 2)
