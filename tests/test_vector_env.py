"""`FlexArmVectorEnv`: the single environment's bits, Gymnasium's rules of resets, memory."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from envs import IDS, PAPER, POOR_SENSOR, RANDOM, RESIDUAL, SQUARE, assert_same, in_fresh_process
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from refusals import refuses

from flexarm_env.vector_env import FlexArmVectorEnv

NEXT_STEP, SAME_STEP, DISABLED = AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP, AutoresetMode.DISABLED


def random_options(env_id: str) -> dict[str, Any]:
    return RANDOM | ({} if env_id == PAPER else POOR_SENSOR)


def vector(env_id: str = SQUARE, num_envs: int = 3, **options: Any) -> FlexArmVectorEnv:
    env = gym.make_vec(env_id, num_envs=num_envs, **options)
    assert type(env) is FlexArmVectorEnv
    return env


def several_singles(env_id: str, num_envs: int, mode: AutoresetMode, **options: Any) -> SyncVectorEnv:
    return SyncVectorEnv([lambda: gym.make(env_id, **options)] * num_envs, autoreset_mode=mode)


def actions_for(env: Any, steps: int, seed: int = 1) -> np.ndarray:
    """A little beyond [-1, 1]. Shape (steps, N, channels)."""
    shape = (steps, *env.action_space.shape)
    return np.random.default_rng(seed).uniform(-1.2, 1.2, shape).astype(np.float32)


def first(num_envs: int, value: Any) -> Any:
    """The part of a batch's answer that its first environments make."""
    if isinstance(value, dict):
        return {name: first(num_envs, part) for name, part in value.items()}
    return value[:num_envs]


# --- one alone and many together ----------------------------------------------------------------------------


@pytest.mark.parametrize("mode", [NEXT_STEP, SAME_STEP])
@pytest.mark.parametrize("env_id", IDS)
def test_single_environments_give_the_same_bits(env_id: str, mode: AutoresetMode) -> None:
    """Against Gymnasium's own vector environment: everything, masks and final infos included, over many episodes."""
    options = random_options(env_id) | {"max_episode_steps": 23, "error_limit": 0.4}
    together = vector(env_id, autoreset_mode=mode, **options)
    alone = several_singles(env_id, 3, mode, **options)
    assert_same(together.reset(seed=3), alone.reset(seed=3))
    assert_same(together.reset(seed=[4, 2**40, 9]), alone.reset(seed=[4, 2**40, 9]))
    assert_same(together.reset(), alone.reset())  # goes on with the generators it has
    ended = np.zeros(2, dtype=int)
    for k, actions in enumerate(actions_for(together, 250)):
        found, expected = together.step(actions), alone.step(actions)
        assert_same(found, expected, f"step {k}")
        ended += [found[2].sum(), found[3].sum()]
    assert ended[1] > 3  # truncations
    assert ended[0] > 3 or env_id == PAPER  # which starts at rest on the path and has 23 ms to leave it


def test_an_invalid_state_resets_alike() -> None:
    """A diverged neighbour changes nothing for the others, and leaves nothing behind for its own next episode."""
    options = {"gain_limit": 1e300, "max_episode_steps": 20}
    together, alone = vector(PAPER, 3, **options), several_singles(PAPER, 3, NEXT_STEP, **options)
    assert_same(together.reset(seed=0), alone.reset(seed=0))
    ended = 0
    for k in range(40):
        actions = np.array([[1.0], [-1.0], [-1.0 + 1e-6]], np.float32)
        found, expected = together.step(actions), alone.step(actions)
        np.testing.assert_equal(found, expected, err_msg=f"step {k}")  # counts NaN as equal to NaN
        ended += found[2].sum()
    assert ended >= 5


@pytest.mark.parametrize("env_id", [SQUARE, RESIDUAL, PAPER])
def test_an_environment_does_not_depend_on_how_many_there_are(env_id: str) -> None:
    """1, 3, 8 and 17 make blocks of 1, 4, 8 and 16 lanes, the last of them two, one nearly empty."""
    options = random_options(env_id) | {"max_episode_steps": 31, "error_limit": 0.6}
    runs = {}
    for num_envs in (17, 8, 3, 1):
        env = vector(env_id, num_envs, **options)
        runs[num_envs] = [env.reset(seed=5)]
        for actions in actions_for(vector(env_id, 17), 80):
            runs[num_envs].append(env.step(actions[:num_envs]))
    for num_envs in (8, 3, 1):
        for whole, part in zip(runs[17], runs[num_envs], strict=True):
            *arrays, infos = part
            assert_same(arrays, [value[:num_envs] for value in whole[:-1]], f"{num_envs}")
            expected = first(num_envs, whole[-1])
            for name, value in infos.items():  # what no environment of the part has is missing there
                assert_same(value, expected[name] if not isinstance(value, dict) else first_of(expected[name], value))


def first_of(whole: dict[str, Any], part: dict[str, Any]) -> dict[str, Any]:
    return {name: whole[name] for name in part}


def test_threads_give_the_same_bits() -> None:
    """Three blocks on two threads."""
    options = random_options(SQUARE) | {"max_episode_steps": 31}
    one, two = (vector(SQUARE, 40, threads=threads, **options) for threads in (1, 2))
    assert_same(two.reset(seed=5), one.reset(seed=5))
    for actions in actions_for(one, 60):
        assert_same(two.step(actions), one.step(actions))
    two.close()
    one.close()


def test_more_threads_than_blocks() -> None:
    one, many = vector(SQUARE, 3), vector(SQUARE, 3, threads=4)
    assert_same(many.reset(seed=5), one.reset(seed=5))
    for actions in actions_for(one, 5):
        assert_same(many.step(actions), one.step(actions))
    many.close()


# --- the end of episodes ------------------------------------------------------------------------------------


def test_the_registered_time_limit_reaches_the_batch() -> None:
    """At rest without torque and without limits nothing else ends an episode: 800 steps, not one more or less."""
    env = vector("FlexArm/Reach-v0", 3, error_limit=None, deflection_limit=None)
    env.reset(seed=0)
    still = np.zeros((3, 2), np.float32)
    for k in range(1, 804):
        _, reward, terminated, truncated, infos = env.step(still)
        assert not terminated.any()
        assert truncated.all() == truncated.any() == (k == 800)
        if k == 801:  # the step that begins the next episode
            assert not reward.any()
            assert not infos["time"].any()
            assert infos["_parameters"].all()
            assert "reward_terms" not in infos
    np.testing.assert_allclose(infos["time"], 0.02, rtol=1e-12)


def test_without_a_limit_nothing_is_truncated() -> None:
    env = FlexArmVectorEnv(2, start="corner", error_limit=None)
    env.reset(seed=0)
    assert not any(env.step(np.zeros((2, 2), np.float32))[3].any() for _ in range(1700))


def test_reset_mask_restarts_only_what_it_names() -> None:
    """As Gymnasium's own does; the others keep their bits."""
    options = random_options(SQUARE) | {"max_episode_steps": 12}
    together, alone = (
        vector(SQUARE, 4, autoreset_mode=DISABLED, **options),
        several_singles(SQUARE, 4, DISABLED, **options),
    )
    assert_same(together.reset(seed=8), alone.reset(seed=8))
    undisturbed = vector(SQUARE, 4, autoreset_mode=DISABLED, **(options | {"max_episode_steps": 60}))
    undisturbed.reset(seed=8)
    left = np.array([False, True, True, False])
    for k, actions in enumerate(actions_for(together, 40)):
        found, expected = together.step(actions), alone.step(actions)
        assert_same(found, expected, f"step {k}")
        if k < 12:
            assert_same(found[0][left], undisturbed.step(actions)[0][left])
        ended = found[2] | found[3]
        if k == 4:
            mask, seed = ~left, [31, None, 33, None]
        elif ended.any():
            mask, seed = ended, None
        else:
            continue
        parts = [env.reset(seed=seed, options={"reset_mask": mask.copy()}) for env in (together, alone)]
        assert_same(parts[0], parts[1], f"reset after step {k}")


def test_a_finished_environment_must_be_reset_where_nothing_else_does() -> None:
    env = vector(SQUARE, 2, autoreset_mode=DISABLED, max_episode_steps=2)
    env.reset(seed=0)
    still = np.zeros((2, 2), np.float32)
    env.step(still)
    assert env.step(still)[3].all()
    with refuses(RuntimeError, "step() after the end of episode 0", "reset_mask"):
        env.step(still)
    env.reset(options={"reset_mask": np.array([True, False])})
    with refuses(RuntimeError, "step() after the end of episode 1"):
        env.step(still)


def test_the_action_of_an_environment_that_begins_an_episode_is_not_read() -> None:
    env, twin = (vector(SQUARE, 2, max_episode_steps=3) for _ in range(2))
    env.reset(seed=0)
    twin.reset(seed=0)
    still = np.zeros((2, 2), np.float32)
    for k in range(8):
        begins = k == 3
        assert_same(env.step(np.full((2, 2), np.nan) if begins else still), twin.step(still))


# --- options of a reset -------------------------------------------------------------------------------------


def test_each_environment_may_have_its_own_options() -> None:
    """And is then the single environment with those."""
    made: dict[str, Any] = {"reference": ["square", "circle"], "error_limit": None}
    made["randomisation"] = {"stiffness": (0.5, 2.0), "delay": (0.0, 0.1)}
    env = vector(SQUARE, 3, **made)
    state = np.zeros((3, 12))
    state[:, :2] = [(0.3, 1.0), (-0.2, 2.0), (1.0, 0.5)]
    parameters: dict[str, Any] = {
        "payload_mass": [0.0, 0.2, 0.4],
        "stiffness": 1.3,
        "delay": np.array([0.0, 0.03, 0.1]),
    }
    options = {
        "start": ["moving", "corner", "mix"],
        "time": [0.0, 3.0, 15.9],
        "path": ["circle", "square", "circle"],
        "parameters": parameters,
        "state": state,
    }
    found = [env.reset(seed=1, options=options)]
    actions = actions_for(env, 10)
    found += [env.step(each) for each in actions]
    for i in range(3):
        single = gym.make(SQUARE, **made)
        own = {name: options[name][i] for name in ("start", "time", "path", "state")}
        own["parameters"] = {"payload_mass": parameters["payload_mass"][i], "stiffness": 1.3}
        own["parameters"]["delay"] = parameters["delay"][i]
        observation, info = single.reset(seed=1 + i, options=own)
        np.testing.assert_array_equal(info["state"], state[i])
        np.testing.assert_array_equal(found[0][0][i], observation)
        assert {name: found[0][1]["parameters"][name][i] for name in info["parameters"]} == info["parameters"]
        for whole, action in zip(found[1:], actions[:, i], strict=True):
            observation, reward, *_ = single.step(action)
            np.testing.assert_array_equal(whole[0][i], observation)
            assert whole[1][i] == reward


MASKED = {"reset_mask": np.array([True, False, False])}


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        ({"reset_mask": [True, False]}, ValueError, ("reset_mask", "shape (3,)")),
        ({"reset_mask": np.ones(3)}, ValueError, ("reset_mask", "bool")),
        ({"reset_mask": np.zeros(3, bool)}, ValueError, ("reset_mask", "one True at least")),
        ({"wind": 1.0}, ValueError, ("'wind'", "start", "parameters")),
        ({"start": ["corner"] * 2}, ValueError, ("one value or 3",)),
        ({"start": ["corner", "corner", "side"]}, ValueError, ("start", "'side'", "'corner'")),
        ({"time": [0.0, 16.0, 0.0]}, ValueError, ("time", "16.0", "from 0 to 16")),
        ({"time": np.zeros((3, 1))}, ValueError, ("time", "(3, 1)")),
        ({"parameters": {"payload_mass": [0.0, -1.0, 0.0]}}, ValueError, ("payload_mass", "-1.0")),
        ({"state": np.zeros((2, 12))}, ValueError, ("state", "(12,)", "(2, 12)")),
    ],
    ids=lambda value: next(iter(value)) if isinstance(value, dict) else "",
)
def test_bad_options_are_refused_and_nothing_moves(
    options: dict[str, Any], error: type[Exception], words: tuple[str, ...]
) -> None:
    env, twin = vector(SQUARE), vector(SQUARE)
    env.reset(seed=0)
    twin.reset(seed=0)
    with refuses(error, *words):
        env.reset(seed=7, options=options)
    for actions in actions_for(env, 3):
        assert_same(env.step(actions), twin.step(actions))
    assert_same(env.reset(), twin.reset())


def test_resets_that_cannot_be() -> None:
    env = vector(SQUARE)
    with refuses(ValueError, "the first reset must begin an episode in every environment"):
        env.reset(options=dict(MASKED))
    with refuses(ValueError, "seed: must be one number or 3, got 2"):
        env.reset(seed=[1, 2])
    with refuses(RuntimeError, "step() before reset()"):
        env.step(np.zeros((3, 2), np.float32))


# --- bad arguments ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        ({"num_envs": 0}, ValueError, ("num_envs = 0", ">= 1")),
        ({"num_envs": 2.0}, TypeError, ("num_envs = 2.0", "integer")),
        ({"max_episode_steps": 0}, ValueError, ("max_episode_steps = 0", ">= 1")),
        ({"threads": 0}, ValueError, ("threads = 0", ">= 1")),
        ({"autoreset_mode": "Sometimes"}, ValueError, ("autoreset_mode = 'Sometimes'", "'NextStep'", "'SameStep'")),
        ({"render_mode": "human"}, ValueError, ("render_mode = 'human'", "'rgb_array'")),
        ({"delays": 0.1}, TypeError, ("delays: no such option; did you mean 'delay'?",)),
        ({"noise": -1.0}, ValueError, ("noise = -1.0", ">= 0.0")),
    ],
    ids=lambda value: next(iter(value)) if isinstance(value, dict) else "",
)
def test_a_wrong_argument_names_itself(options: dict[str, Any], error: type[Exception], words: tuple[str, ...]) -> None:
    with refuses(error, *words):
        FlexArmVectorEnv(**options)


@pytest.mark.parametrize(
    ("actions", "words"),
    [
        (np.zeros(2), ("actions: must have shape (3, 2), got (2,)",)),
        (np.zeros((3, 1)), ("actions: must have shape (3, 2), got (3, 1)",)),
        (np.full((3, 2), np.nan), ("actions[0, 0] = nan: must be finite",)),
        ([[0.0, 0.0], [0.0, np.inf], [0.0, 0.0]], ("actions[1, 1] = inf: must be finite",)),
        (np.zeros((3, 2), bool), ("actions", "must be an array of real numbers")),
    ],
)
def test_wrong_actions_are_refused_and_nothing_moves(actions: Any, words: tuple[str, ...]) -> None:
    env, twin = vector(SQUARE), vector(SQUARE)
    env.reset(seed=0)
    twin.reset(seed=0)
    with refuses(ValueError, *words):
        env.step(actions)
    for good in actions_for(env, 3):
        assert_same(env.step(good), twin.step(good))


# --- what is handed out -------------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", [NEXT_STEP, SAME_STEP])
def test_what_is_handed_out_is_new(mode: AutoresetMode) -> None:
    env, twin = (vector(SQUARE, 3, autoreset_mode=mode, max_episode_steps=4) for _ in range(2))
    spoil(env.reset(seed=0))
    twin.reset(seed=0)
    for actions in actions_for(env, 12):
        found = env.step(actions)
        assert_same(found, twin.step(actions))
        spoil(found)


def spoil(value: Any) -> None:
    """Overwrite every array of an answer."""
    if isinstance(value, tuple):
        for part in value:
            spoil(part)
    elif isinstance(value, dict):
        for part in value.values():
            spoil(part)
    elif value.dtype == bool:
        value[:] = ~value
    elif value.dtype != object:
        value[:] = 99.0


@pytest.mark.parametrize("env_id", IDS)
def test_spaces_and_metadata(env_id: str) -> None:
    env, single = vector(env_id, 3, autoreset_mode="SameStep"), gym.make(env_id)
    assert env.single_observation_space == single.observation_space
    assert env.single_action_space == single.action_space
    assert env.metadata["autoreset_mode"] is SAME_STEP
    assert env.observation_blocks == single.unwrapped.observation_blocks
    assert env.spec is not None
    assert env.spec.id == env_id
    observations, _ = env.reset(seed=0)
    assert env.observation_space.contains(observations)


def test_pictures() -> None:
    pytest.importorskip("pygame")
    assert vector(SQUARE).render() is None
    env = vector(SQUARE, 2, render_mode="rgb_array", max_episode_steps=5)
    env.reset(seed=[0, 0])
    actions = np.array([[0.0, 0.0], [0.0, 1.0]], np.float32)
    for _ in range(3):
        env.step(actions)
    left, right = env.render()
    single = gym.make(SQUARE, render_mode="rgb_array")
    single.reset(seed=0)
    for _ in range(3):
        single.step(actions[1])
    np.testing.assert_array_equal(right, single.render())
    assert left.shape == right.shape
    assert left.dtype == np.uint8
    assert np.any(left != right)
    env.close()
    single.close()


# --- memory -------------------------------------------------------------------------------------------------

MEMORY = """
import sys
import numpy as np
from flexarm_env.vector_env import FlexArmVectorEnv

def resident():
    with open("/proc/self/status") as file:
        return next(int(line.split()[1]) for line in file if line.startswith("VmRSS")) / 1024.0  # [MiB]

def run(env, steps):
    env.reset(seed=0)
    rng = np.random.default_rng(0)
    for _ in range(steps):
        env.step(rng.uniform(-1.0, 1.0, (env.num_envs, 2)).astype(np.float32))

small = FlexArmVectorEnv(64, 50, start="mix", noise=0.01, threads=2)
run(small, 300)
"""
GROWTH = MEMORY + "before = resident()\nrun(small, int(sys.argv[1]))\nprint(resident() - before)"
SIZE = MEMORY + "before = resident()\nlarge = FlexArmVectorEnv(4096, 50)\nrun(large, 5)\nprint(resident() - before)"
needs_proc = pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="reads the process's memory from /proc")


@needs_proc
@pytest.mark.parametrize("steps", [3200, pytest.param(160_000, marks=pytest.mark.slow)])
def test_memory_stays_flat(steps: int) -> None:
    """Steps of 64 environments, with a reset every 50: a leak of 8 bytes a step and environment would show."""
    assert float(in_fresh_process(GROWTH, str(steps))) < (1.5 if steps < 10_000 else 8.0)


@needs_proc
def test_many_environments_are_small() -> None:
    assert float(in_fresh_process(SIZE)) < 200.0
