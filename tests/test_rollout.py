"""Recording of policies: one environment and a batch tell the same story."""

import gymnasium
import numpy as np
import pytest

from flexarm_baselines import FLSAC, IFDC
from flexarm_env import ClosedLoop, LawParameters, LoopCase, SensorParameters, SquareParameters, square
from flexarm_env.env import rest_state, state_limits
from flexarm_env.rollout import run_batch, run_policy

STEPS = 300


def make(**options: object) -> gymnasium.Env:
    return gymnasium.make("flexarm_env:FlexArm/Paper-v0", max_episode_steps=STEPS, **options)


def batch(env: gymnasium.Env, cases: list[LoopCase]) -> tuple[ClosedLoop, np.ndarray]:
    arm = env.unwrapped.arm
    path = square(SquareParameters())
    loop = ClosedLoop(arm, cases, path, state_limits=state_limits(arm))
    return loop, np.tile(rest_state(arm, path.table[0, 1:], "positive"), (len(cases), 1))


def test_environment_and_batch_give_the_same_bits() -> None:
    """Policies included: what FLSAC sees and does is the same float32 either way."""
    env = make()
    ifdc, flsac = IFDC.for_env(env), FLSAC.for_env(env)
    collocated = SensorParameters(model="collocated")
    cases = [LoopCase(SensorParameters(), LawParameters()), LoopCase(collocated, LawParameters())] * 2
    loop, states = batch(env, cases)
    together = run_batch(loop, states, [ifdc, ifdc, flsac, flsac], 1.0, STEPS)
    for run, policy, sensor in zip(together, (ifdc, ifdc, flsac, flsac), ("rigid", "collocated") * 2, strict=True):
        alone = run_policy(make(sensor=sensor), policy)
        for name in ("state", "torque", "gain", "tip", "rigid_tip", "reward"):
            np.testing.assert_array_equal(getattr(run, name), getattr(alone, name), err_msg=name)
        assert run.notes == alone.notes == {"ended": "truncated"}


def test_record_holds_one_instant_a_step_and_the_start() -> None:
    run = run_policy(make(), IFDC())
    assert len(run) == STEPS + 1
    assert run.time[-1] == pytest.approx(0.3)
    assert run.gain is not None
    assert np.all(run.gain == 1.0)
    assert run.reward is not None
    assert run.reward[0] == 0.0


def test_an_unstable_arm_ends_and_the_others_go_on() -> None:
    """Late rates make the loop unstable within 50 ms; its record ends before the invalid state."""
    env = make()
    late = LoopCase(SensorParameters(delayed="position+rate"), LawParameters())
    fine = LoopCase(SensorParameters(), LawParameters())
    loop, states = batch(env, [late, fine, late])
    flsac = FLSAC.for_env(env)
    unstable, stable, again = run_batch(loop, states, [flsac] * 3, 1.0, STEPS)
    assert unstable.notes["ended"] in ("deflection", "angle", "rate")
    assert 1 < len(unstable) < 100
    assert np.all(np.isfinite(unstable.state))
    assert np.all(np.abs(unstable.state) <= state_limits(env.unwrapped.arm))
    assert len(stable) == STEPS + 1
    assert stable.notes["ended"] == "truncated"
    np.testing.assert_array_equal(unstable.state, again.state)
    alone = run_policy(make(delayed="position+rate"), flsac)
    np.testing.assert_array_equal(unstable.state, alone.state)
    assert alone.notes == unstable.notes


def test_bad_input() -> None:
    with pytest.raises(TypeError, match="FlexArmEnv"):
        run_policy(gymnasium.make("CartPole-v1"), IFDC())
    env = make()
    loop, states = batch(env, [LoopCase(SensorParameters(), LawParameters())] * 2)
    with pytest.raises(ValueError, match="policies: must be 2"):
        run_batch(loop, states, [IFDC()], 1.0, 10)
    with pytest.raises(ValueError, match="steps = 0"):
        run_batch(loop, states, [IFDC()] * 2, 1.0, 0)


def test_progress_counts_every_period() -> None:
    env = make()
    loop, states = batch(env, [LoopCase(SensorParameters(), LawParameters())])
    seen: list[int] = []
    run_batch(loop, states, [IFDC()], 1.0, 25, progress=seen.append)
    assert sum(seen) == 25
