"""States: what is set to one goes on to the same bits, alone or among others; other states are refused."""

from functools import partial
from typing import Any

import numpy as np
import pytest

from flexarm_env.envs.single import FlexArmEnv
from flexarm_env.envs.vector import FlexArmVectorEnv
from tests.envs.test_draws import ALL, EITHER
from tests.envs.test_seeds import NOISY, digest, noisy
from tests.support.envs import PAPER, RACE, REACH, RESIDUAL, SQUARE, bare, vector
from tests.support.refusals import label, refuses

ONE_MODE = {"modes_per_link": 1}
DRAWN = {"joint_friction": ((0.0, 5.0),) * 2, "payload_mass": (0.2, 1.5)}
CHANGES = ((0.03 / 16, None), (0.14 / 16, 0.0))  # one before the state, one after it
CASES: list[tuple[str, dict[str, Any]]] = [(name, noisy(name)) for name in (SQUARE, RESIDUAL, PAPER, REACH, RACE)]
CASES.append((SQUARE, {"arm": ONE_MODE, "randomisation": ALL, **EITHER}))
CASES.append((SQUARE, {"arm": ONE_MODE, "motor_time_constant": (0.013, 0.004)}))
CASES.append((SQUARE, {"arm": ONE_MODE, "randomisation": DRAWN, "payload_changes": CHANGES, "start": "corner"}))


def run(env: FlexArmEnv, steps: int) -> list[Any]:
    """Step, with a reset in the place of the eighth step, and return all that is seen."""
    seen: list[Any] = []
    for k in range(steps):
        action = np.full(env.action_space.shape or (), 0.4 * (k % 3 - 1.0), np.float32)
        seen.append(env.reset() if k == 8 else env.step(action))
    return seen


@pytest.mark.parametrize(("env_id", "options"), CASES, ids=label)
def test_an_environment_goes_back_to_a_state(env_id: str, options: dict[str, Any]) -> None:
    """And another one goes on from it, though its own episode has drawn another arm."""
    env, other = bare(env_id, 3, **options), bare(env_id, 4, **options)
    digest(env, 12)
    state, seen = env.get_state(), (env.simulator.single_observation.copy(), env._infos.read())
    expected = run(env, 11)
    np.testing.assert_equal(env.set_state(state), seen)
    np.testing.assert_array_equal(env.get_state(), state)
    np.testing.assert_equal(other.set_state(state), seen)
    np.testing.assert_equal((other.simulator.single_observation, other._infos.read()), seen)
    assert other.episode == env.episode
    np.testing.assert_equal(run(env, 11), expected)
    np.testing.assert_equal(run(other, 8), expected[:8])  # until it begins an episode of its own
    if "payload_changes" in options:
        assert {step[-1]["payload"] == 0.0 for step in expected[:8]} == {True, False}


def test_another_environment_goes_on_in_its_place() -> None:
    """Into some rows of a batch of several blocks, which is elsewhere in its delay line, and back into one alone."""
    env, other, envs = bare(seed=3, **NOISY), bare(seed=1, **NOISY), vector(SQUARE, 11, seed=5, **NOISY)
    digest(env, 23)
    digest(envs, 7)
    rows = [9, 1]
    others = np.delete(np.arange(11), rows)
    before = envs.get_state(others)
    observations, infos = envs.set_state(env.get_state(), rows)
    np.testing.assert_array_equal(envs.get_state(others), before)
    observation, info = other.set_state(envs.get_state([9])[0])
    np.testing.assert_array_equal(observations[rows], [observation] * 2)
    np.testing.assert_array_equal(infos["tip_error"][rows], info["tip_error"])
    for _ in range(30):
        action = np.array([0.3, -0.1], np.float32)
        seen, many = env.step(action), envs.step(np.tile(action, (11, 1)))
        np.testing.assert_equal(other.step(action), seen)
        np.testing.assert_array_equal(many[0][rows], [seen[0]] * 2)
        np.testing.assert_array_equal(many[1][rows], seen[1])
    envs.reset(options={"reset_mask": np.isin(np.arange(11), rows)})
    np.testing.assert_array_equal(envs.simulator.observations[rows], [env.reset()[0]] * 2)


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_a_batch_goes_back_across_the_ends_of_episodes(mode: str) -> None:
    envs = vector(SQUARE, 11, seed=3, max_episode_steps=6, autoreset_mode=mode, **NOISY)
    digest(envs, 6)  # with the next-step mode all have ended, and begin at the next step
    states = envs.get_state()
    found = digest(envs, 15)
    envs.set_state(states)
    assert digest(envs, 15) == found
    envs.set_state(states[:4], [7, 6, 5, 4])
    np.testing.assert_array_equal(envs.get_state([4, 5, 6, 7]), states[3::-1])
    begun = envs.reset(seed=3)[0]
    envs.set_state(states)
    np.testing.assert_array_equal(envs.reset(seed=3)[0], begun)  # the seed counts, not the state's generator


def test_a_state_brings_the_arm_and_leaves_the_options() -> None:
    env = bare(seed=3, randomisation={"payload_mass": (0.0, 0.5)})
    strict = bare(seed=1, deflection_limit=0.01, reward_weights={"tracking_wide": 3.0})
    _, info = strict.set_state(env.get_state())
    assert strict.episode.parameters["payload_mass"] == env.episode.parameters["payload_mass"] > 0.0
    assert info["end_code"] == 0.0
    action = np.ones(2, np.float32)
    ended = going = False
    while not (ended or going):
        (_, reward, ended, _, _), (_, usual, going, _, _) = strict.step(action), env.step(action)
    assert (ended, going) == (True, False)
    assert reward != usual
    assert strict.set_state(strict.get_state())[1]["end_code"] > 0.0


@pytest.mark.parametrize(
    ("options", "change", "message"),
    [
        ({"delay": 0.05}, None, "is of an environment with other options"),
        ({"reference": "circle"}, None, "is of an environment with other options"),
        ({"sensor": "rigid"}, None, "is of an environment with other options"),
        ({"arm": {"preset": "linear", "mode_shapes": "polynomial"}}, None, "is of an environment with other options"),
        ({"arm": {"preset": "linear", "link_lengths": (4.5, 4.6)}}, None, "is of an environment with other options"),
        ({"arm": {"preset": "linear", "velocity_forces": "rigid"}}, None, "is of an environment with other options"),
        ({"sensor_position": 4.4, "delay": 0.031}, None, "is of an environment with other options"),
        ({"delay": 0.0311}, None, "is of an environment with other options"),
        ({"scaled": False}, None, "is of an environment with other options"),
        ({"previews": (0.1, 0.2, 0.4, 0.9)}, None, "is of an environment with other options"),
        ({}, lambda state: state[:-1], "is of an environment with other options"),
        ({}, lambda state: state ^ (np.arange(len(state)) == 99).astype(np.uint64), "its check sum is wrong"),
        ({}, lambda state: state[None, None], r"must have shape \(k,\), got \(1, 1"),
        ({}, lambda state: np.stack([state, state]), r"must have shape \(k,\), got \(2"),
        ({}, lambda state: state.astype(float), "must be an array of uint64 that get_state"),
        ({}, list, "must be an array of uint64"),
    ],
)
def test_other_states_are_refused_and_change_nothing(options: dict[str, Any], change: Any, message: str) -> None:
    source, env = bare(**options), bare(seed=1)
    before = env.get_state()
    state = source.get_state()
    with pytest.raises((TypeError, ValueError), match=message):
        env.set_state(change(state) if change else state)
    np.testing.assert_array_equal(env.get_state(), before)


def test_environments_of_a_batch_that_read_differently_have_other_states() -> None:
    envs = vector(SQUARE, 4, seed=0, per_env={"sensor_position": [4.5, 4.5, 2.0, 2.0], "delay": [0.03] * 4})
    states = envs.get_state()
    envs.set_state(states, [1, 0, 3, 2])
    np.testing.assert_array_equal(envs.get_state([1, 0, 3, 2]), states)
    for given, rows in ((states[0], [0, 2]), (states[:2], [1, 3])):
        with refuses(ValueError, "is of an environment with other options"):
            envs.set_state(given, rows)


@pytest.mark.parametrize("rows", [[3], [-1], [0, 0], [], [0.0], 1, [True, False, True]])
def test_rows_are_indices(rows: Any) -> None:
    envs = vector(SQUARE, 3, seed=0)
    for call in (envs.get_state, lambda rows: envs.set_state(envs.get_state([0])[0], rows)):
        with refuses(ValueError, "rows = "):
            call(rows)


@pytest.mark.parametrize("made", [partial(FlexArmEnv, render_mode="rgb_array"), partial(FlexArmVectorEnv, 2)])
def test_what_needs_a_reset_first(made: Any) -> None:
    env = made()
    assert not hasattr(env, "episode")
    with refuses(AttributeError, "episode", "reset()"):
        _ = env.episode
    action = np.zeros(env.action_space.shape, np.float32)
    calls = {"get_state": (), "set_state": (np.zeros(3, np.uint64),), "step": (action,), "render": ()}
    for name, given in calls.items():
        if name != "render" or env.render_mode:
            with refuses(RuntimeError, f"{name}() before reset()"):
                getattr(env, name)(*given)


def test_another_generator_is_refused() -> None:
    env = bare()
    env.np_random = np.random.Generator(np.random.MT19937(0))
    with refuses(TypeError, "np_random: its bit generator is MT19937; must be PCG64"):
        env.get_state()
