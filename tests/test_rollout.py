"""Recording of policies: one environment and a batch tell the same story."""

from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import pytest

from flexarm_agents import load_policy
from flexarm_baselines import FLSAC, IFDC
from flexarm_env import run_batch, run_policy, state_limits
from flexarm_env.reference_episode import ReferenceEpisode
from tests.support.refusals import refused

STEPS = 300


def make(**options: object) -> gymnasium.Env:
    return gymnasium.make("flexarm_env:FlexArm/Paper-v0", max_episode_steps=STEPS, **options)


def batch(count: int, per_env: dict[str, list] | None = None, **options: object) -> gymnasium.vector.VectorEnv:
    made = {"max_episode_steps": STEPS, "per_env": per_env, **options}
    return gymnasium.make_vec("flexarm_env:FlexArm/Paper-v0", num_envs=count, **made)


def test_environment_and_batch_give_the_same_bits() -> None:
    """Policies included: what FLSAC sees and does is the same float32 either way."""
    env = make()
    ifdc, flsac = IFDC.for_env(env), FLSAC.for_env(env)
    envs = batch(4, {"sensor": ["rigid", "collocated"] * 2})
    together = run_batch(envs, [ifdc, ifdc, flsac, flsac], seed=0)
    for run, policy, sensor in zip(together, (ifdc, ifdc, flsac, flsac), ("rigid", "collocated") * 2, strict=True):
        alone = run_policy(make(sensor=sensor), policy)
        for name, values in alone.arrays().items():
            np.testing.assert_array_equal(run.arrays()[name], values, err_msg=name)
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
    envs = batch(3, {"delayed": ["position+rate", "position", "position+rate"]})
    flsac = FLSAC.for_env(env)
    unstable, stable, again = run_batch(envs, [flsac] * 3)
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


@pytest.mark.parametrize("steps", [60, 20])
def test_a_batch_that_begins_anew_in_the_same_step_gives_the_same_records(steps: int) -> None:
    """Episodes that terminate, and that are truncated."""
    own = {"delayed": ["position+rate", "position"]}
    found = [
        run_batch(batch(2, own, autoreset_mode=mode, max_episode_steps=steps), [IFDC()] * 2, max_steps=steps + 5)
        for mode in ("SameStep", "NextStep")
    ]
    assert found[0][1].notes["ended"] == "truncated"
    assert (found[0][0].notes["ended"] == "truncated") == (steps == 20)
    for run, same in zip(*found, strict=True):
        assert run.notes == same.notes
        for name, values in same.arrays().items():
            np.testing.assert_array_equal(run.arrays()[name], values, err_msg=name)


test_bad_input = refused(
    (lambda: run_policy(gymnasium.make("CartPole-v1"), IFDC()), "TypeError: FlexArmEnv"),
    (lambda: run_batch(make(), [IFDC()]), "TypeError: must be a FlexArmVectorEnv"),  # type: ignore[arg-type]
    (lambda: run_batch(batch(2), [IFDC()]), "policies: must be 2"),
    (lambda: run_batch(batch(2), [IFDC()] * 2, max_steps=0), "max_steps = 0"),
    (lambda: run_policy(make(), IFDC(), max_steps=0), "max_steps = 0: must be an integer >= 1"),
    (lambda: run_policy(make(), IFDC(), max_steps=2.5), "TypeError: max_steps = 2.5"),  # type: ignore[arg-type]
    (lambda: run_policy(make(gain_limit=20.0), IFDC()), r"policy\.gain_limit = 1\.0: .* 20\.0"),
    (lambda: run_policy(make(), IFDC(), lap="first"), "lap = 'first': .* 'swing', 'plain'"),
    (lambda: run_policy(make(), IFDC(), lap="swing", options={"time": 1.0}), "lap = 'swing' beside"),
)


def test_torque_is_the_one_that_acts_just_after_the_instant() -> None:
    """At the start nothing moves: lambda J^T Kd r', with r' = (0, 3.15) m/s. The paper's IFDC peaks there."""
    run = run_policy(make(sensor="collocated"), IFDC())
    theta1, theta2 = run.state[0, :2]
    x, y = run.rigid_tip[0]
    assert (x, y) == pytest.approx((-6.3, -6.3))
    expected = 17.364 * 3.15 * np.array([x, 4.5 * np.cos(theta1 + theta2)])  # row 2 of J (13)
    assert run.torque[0] == pytest.approx(expected, rel=1e-9)
    half = run_policy(make(sensor="collocated"), IFDC(gain=0.5))
    assert half.torque[0] == pytest.approx(0.5 * expected, rel=1e-9)


def test_a_bare_environment_runs_one_lap() -> None:
    env = gymnasium.make("flexarm_env:FlexArm/Paper-v0", lap_time=0.4, side=0.4).unwrapped
    assert len(run_policy(env, IFDC())) == 401
    assert len(run_policy(env, IFDC(), max_steps=7)) == 8


@pytest.mark.parametrize(("lap", "side"), [("swing", 1.0), ("plain", -1.0)])
def test_a_lap_has_its_side_of_the_elbow(lap: str, side: float) -> None:
    env = gymnasium.make("flexarm_env:FlexArm/Square-v0", arm="linear", max_episode_steps=2)
    for seed in range(3):
        assert np.sign(run_policy(env, lambda observation: np.zeros(2), seed=seed, lap=lap).state[0, 1]) == side


def test_in_a_batch_each_lap_has_the_side_of_its_direction() -> None:
    own = {"direction": ["counterclockwise", "either", "clockwise"]}
    envs = gymnasium.make_vec("flexarm_env:FlexArm/Square-v0", num_envs=3, arm="linear", per_env=own)
    for lap, side in (("swing", 1.0), ("plain", -1.0)):
        runs = run_batch(envs, [lambda observation: np.zeros((3, 2))] * 3, max_steps=1, lap=lap)
        np.testing.assert_array_equal([np.sign(run.state[0, 1]) for run in runs], [-side, side, side])
        assert envs.unwrapped.episode.direction.tolist() == ["counterclockwise", "clockwise", "clockwise"]


def test_wrapped_observations_do_not_reach_the_record() -> None:
    env = gymnasium.wrappers.TransformObservation(make(), lambda o: 0.1 * o, None)
    run = run_policy(env, IFDC())
    assert run.reference is not None
    assert run.reference[0] == pytest.approx([-6.3, -6.3])


def test_each_environment_has_its_gain_limit() -> None:
    """Whatever the policy was made for; noise is drawn by the seed."""
    options = {"gain_limit": [1.0, 0.5], "noise": [0.05, 0.0]}
    first, again, other = (run_batch(batch(2, options), [IFDC()] * 2, seed, max_steps=3) for seed in (1, 1, 2))
    np.testing.assert_array_equal([run.gain[0] for run in first], [1.0, 0.5])
    np.testing.assert_array_equal(first[0].state, again[0].state)
    assert np.abs(first[0].state - other[0].state).max() > 0.0
    np.testing.assert_array_equal(first[1].state, other[1].state)  # the quiet sensor


def test_actions_beyond_the_range_are_clipped() -> None:
    (run,) = run_batch(batch(1), [lambda observations: np.full((len(observations), 1), 1.5)], max_steps=20)
    assert len(run) == 21
    np.testing.assert_array_equal(run.gain, 1.0)


# --- the episode in plain Python -------------------------------------------------------------------------------------


def compare(branch: str, act: Callable[[Any], Any]) -> tuple[bool, bool, int]:
    """Follow both to the end of the episode; return terminated, truncated and the number of steps."""
    env = gymnasium.make("FlexArm/Square-v0")
    observation, _ = env.reset(options={"start": "corner", "elbow_branch": branch})
    plain = ReferenceEpisode(branch)
    found, ended, steps = plain.reset(), (False, False), 0
    while not any(ended):
        np.testing.assert_allclose(found, observation, rtol=2e-7, atol=1e-7)
        action = act(observation)
        observation, reward, *ended, info = env.step(action)
        found, same_reward, *same_ended = plain.step(action)
        steps += 1
        assert same_ended == ended
        assert same_reward == pytest.approx(reward, abs=1e-9)
        np.testing.assert_allclose(plain.state, info["state"], rtol=0.0, atol=1e-9 * np.abs(info["state"]).max())
    return *ended, steps


def test_a_random_episode_is_the_compiled_one_until_it_terminates() -> None:
    rng = np.random.default_rng(0)
    terminated, truncated, steps = compare("positive", lambda observation: rng.uniform(-1.2, 1.2, 2))
    assert (terminated, truncated) == (True, False)
    assert steps > 50


@pytest.mark.slow
def test_a_lap_is_the_compiled_one() -> None:
    policy = load_policy("square").policy
    ends = compare("positive", lambda observation: policy.predict(observation, deterministic=True)[0])
    assert ends == (False, True, 1600)
