"""`FlexArmVectorEnv`: the single environment's bits, Gymnasium's rules of resets, memory."""

import os
import signal
import tracemalloc
import warnings
from typing import Any

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from flexarm_env.envs.batch import block_lanes
from flexarm_env.envs.vector import FlexArmVectorEnv
from tests.support.envs import IDS, PAPER, SQUARE, actions_for, assert_same, make, random_options, vector
from tests.support.refusals import refuses

NEXT_STEP, SAME_STEP, DISABLED = AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP, AutoresetMode.DISABLED


def several_singles(env_id: str, num_envs: int, mode: AutoresetMode, **options: Any) -> SyncVectorEnv:
    return SyncVectorEnv([lambda: make(env_id, **options)] * num_envs, autoreset_mode=mode)


# Each program's blocks are compiled for this alone; those of the fast tests are the torques'.
OTHERS = [pytest.param(env_id, marks=pytest.mark.slow) for env_id in IDS if env_id != SQUARE]


@pytest.mark.parametrize("mode", [NEXT_STEP, SAME_STEP])
@pytest.mark.parametrize("env_id", [SQUARE, *OTHERS])
def test_single_environments_give_the_same_bits(env_id: str, mode: AutoresetMode) -> None:
    """Against Gymnasium's own vector environment: everything, masks and final infos included, over many episodes."""
    options = random_options(env_id) | {"max_episode_steps": 23, "error_limit": 0.4}
    together = vector(env_id, autoreset_mode=mode, **options)
    alone = several_singles(env_id, 3, mode, **options)
    assert_same(together.reset(seed=3), alone.reset(seed=3))
    assert_same(together.reset(seed=[4, 2**40, 9]), alone.reset(seed=[4, 2**40, 9]))
    assert together.np_random_seed == alone.np_random_seed == (4, 2**40, 9)
    assert_same(together.reset(), alone.reset())  # goes on with the generators it has
    ended = np.zeros(2, dtype=int)
    for k, actions in enumerate(actions_for(together, 250)):
        found, expected = together.step(actions), alone.step(actions)
        assert_same(found, expected, f"step {k}")
        ended += [found[2].sum(), found[3].sum()]
    assert ended[1] > 3  # truncations
    assert ended[0] > 0 or env_id == PAPER  # which starts at rest on the path and has 23 ms to leave it


def test_an_invalid_state_resets_alike() -> None:
    """A diverged neighbour changes nothing for the others, and leaves nothing behind for its own next episode."""
    options = {"gain_limit": 1e6, "proportional_gain": 1e9, "max_episode_steps": 20}
    together, alone = vector(PAPER, 3, **options), several_singles(PAPER, 3, NEXT_STEP, **options)
    assert_same(together.reset(seed=0), alone.reset(seed=0))
    ended = 0
    for k in range(40):
        actions = np.array([[1.0], [-1.0], [-1.0 + 1e-6]], np.float32)
        found, expected = together.step(actions), alone.step(actions)
        np.testing.assert_equal(found, expected, err_msg=f"step {k}")  # counts NaN as equal to NaN
        ended += found[2].sum()
    assert ended >= 5


@pytest.mark.parametrize(
    ("count", "lanes", "threads"), [(16, 8, 2), (3, 8, 4), pytest.param(688, 344, 2, marks=pytest.mark.slow)]
)
def test_threads_give_the_same_bits(count: int, lanes: int, threads: int) -> None:
    """Two blocks on two threads, one on four."""
    assert block_lanes(count, 1) == block_lanes(count, 2) == lanes
    one, many = (vector(SQUARE, count, threads=n, max_episode_steps=31, **random_options(SQUARE)) for n in (1, threads))
    assert_same(many.reset(seed=5), one.reset(seed=5))
    for actions in actions_for(one, 60):
        assert_same(many.step(actions), one.step(actions))
    many.close()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork on this system")
@pytest.mark.parametrize("steps", [0, 2])
def test_a_forked_child_steps_with_threads_of_its_own(steps: int) -> None:
    env, one = (vector(SQUARE, 16, seed=5, threads=threads) for threads in (2, 1))
    actions = list(actions_for(one, 4))
    for t in range(2):
        assert_same(env.step(actions[t]), one.step(actions[t]))
    with warnings.catch_warnings():
        # Python's general warning about forks of a process with threads
        warnings.filterwarnings("ignore", ".*multi-threaded.*", DeprecationWarning)
        child = os.fork()
    if child == 0:
        try:
            signal.alarm(60)  # which ends a child that waits for threads for ever
            for t in range(2, 2 + steps):
                assert_same(env.step(actions[t]), one.step(actions[t]))
            env.close()
            os._exit(0)
        finally:
            os._exit(1)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
    for t in (2, 3):
        assert_same(env.step(actions[t]), one.step(actions[t]))
    env.close()


def test_only_the_registered_time_limit_truncates() -> None:
    """At rest without torque and without limits nothing else ends an episode: 1600 steps, not one more or less."""
    options: dict[str, Any] = {"start": "corner", "error_limit": None, "deflection_limit": None}
    for env, last in ((vector(SQUARE, 2, **options), [1600]), (FlexArmVectorEnv(2, arm="linear", **options), [])):
        env.reset(seed=0)
        steps = [env.step(np.zeros((2, 2), np.float32)) for _ in range(1700)]
        assert not any(terminated.any() for _, _, terminated, _, _ in steps)
        ends = [k for k, (*_, truncated, _) in enumerate(steps, start=1) if truncated.any()]
        assert ends == [k for k, (*_, truncated, _) in enumerate(steps, start=1) if truncated.all()] == last


def test_reset_mask_restarts_only_what_it_names() -> None:
    """As Gymnasium's own does; the others keep their bits."""
    options = random_options(SQUARE) | {"max_episode_steps": 12}
    together, alone = (
        vector(SQUARE, 4, autoreset_mode=DISABLED, **options),
        several_singles(SQUARE, 4, DISABLED, **options),
    )
    assert_same(together.reset(seed=8), alone.reset(seed=8))
    undisturbed = vector(SQUARE, 4, seed=8, autoreset_mode=DISABLED, **(options | {"max_episode_steps": 60}))
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
    env = vector(SQUARE, 2, seed=0, autoreset_mode=DISABLED, max_episode_steps=2)
    still = np.zeros((2, 2), np.float32)
    env.step(still)
    assert env.step(still)[3].all()
    with refuses(RuntimeError, "step() after the end of episode 0", "reset_mask"):
        env.step(still)
    env.reset(options={"reset_mask": np.array([True, False])})
    with refuses(RuntimeError, "step() after the end of episode 1"):
        env.step(still)


@pytest.mark.parametrize("num_envs", [1, 2])
def test_the_action_of_an_environment_that_begins_an_episode_is_not_read(num_envs: int) -> None:
    env, twin = (vector(SQUARE, num_envs, seed=0, max_episode_steps=3) for _ in range(2))
    still = np.zeros((num_envs, 2), np.float32)
    for k in range(8):
        begins = k == 3
        assert_same(env.step(np.full_like(still, np.nan) if begins else still), twin.step(still))


def test_many_environments_are_small() -> None:
    """Also where each arm has a path of its own."""
    for options in ({}, {"reference": "moves", "start": "corner"}):
        tracemalloc.start()
        batch = FlexArmVectorEnv(4096, 50, arm="linear", **options)
        taken = tracemalloc.get_traced_memory()[0]
        tracemalloc.stop()
        batch.close()
        assert taken < 200e6


def test_what_could_not_be_made_can_be_let_go_of() -> None:
    """Gymnasium calls `close` for it, in some versions when it is let go of."""
    batch = FlexArmVectorEnv.__new__(FlexArmVectorEnv)
    with pytest.raises(ValueError, match="noise"):
        batch.__init__(2, noise=-1.0)  # type: ignore[misc]
    batch.close()
