"""`FlexArmVectorEnv`: the single environment's bits, Gymnasium's rules of resets, memory."""

from __future__ import annotations

import os
import signal
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from flexarm_env.envs.batch import block_lanes
from flexarm_env.envs.sensors import FURTHER
from flexarm_env.envs.vector import FlexArmVectorEnv
from tests.support.envs import (
    CALM,
    CASES,
    FORESHORTENED,
    GAIN,
    IDS,
    PAPER,
    POOR_SENSOR,
    RANDOM,
    RESIDUAL,
    SQUARE,
    actions_for,
    assert_same,
    in_fresh_process,
    make,
    same_as_alone,
    terms_of,
    vector,
)
from tests.support.plain import KERNELS
from tests.support.refusals import refuses

NEXT_STEP, SAME_STEP, DISABLED = AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP, AutoresetMode.DISABLED


def random_options(env_id: str) -> dict[str, Any]:
    """Return options with all that is random, as far as kernels have it that other tests compile."""
    return {PAPER: CALM, SQUARE: RANDOM | POOR_SENSOR | FORESHORTENED}.get(env_id, RANDOM | POOR_SENSOR)


def several_singles(env_id: str, num_envs: int, mode: AutoresetMode, **options: Any) -> SyncVectorEnv:
    return SyncVectorEnv([lambda: make(env_id, **options)] * num_envs, autoreset_mode=mode)


def first(num_envs: int, value: Any) -> Any:
    """Return the part of a batch's answer that its first environments make."""
    if isinstance(value, dict):
        return {name: first(num_envs, part) for name, part in value.items()}
    return value[:num_envs]


# --- one alone and many together ----------------------------------------------------------------------------


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
    assert_same(together.reset(), alone.reset())  # goes on with the generators it has
    ended = np.zeros(2, dtype=int)
    for k, actions in enumerate(actions_for(together, 250)):
        found, expected = together.step(actions), alone.step(actions)
        assert_same(found, expected, f"step {k}")
        ended += [found[2].sum(), found[3].sum()]
    assert ended[1] > 3  # truncations
    assert ended[0] > 0 or env_id == PAPER  # which starts at rest on the path and has 23 ms to leave it


FURTHER_SENSORS: dict[str, Any] = next(options for _, options in CASES if "imu_link" in options)
OF_FURTHER_SENSORS = [sensor.info for sensor in FURTHER]


@pytest.mark.parametrize(
    ("env_id", "options"),
    [
        (SQUARE, FURTHER_SENSORS | RANDOM | {"second_sensor_link": 2, "second_sensor_position": 2.0}),
        (RESIDUAL, FURTHER_SENSORS | {"imu_link": 1, "start": "moving"}),
        (GAIN, FURTHER_SENSORS | {"noise": 0.01, "law_sensor": "sensor", "delay": 0.002, "gain_limit": 0.1}),
        (GAIN, FURTHER_SENSORS | {"sensor": "rigid"}),
        (SQUARE, {"action_mode": "torque_rate"}),
        (SQUARE, {"action_mode": "torque_rate", "actuation_delay": 0.0137}),
    ],
    ids=str,
)
@pytest.mark.parametrize("kernels", KERNELS, indirect=True)
def test_options_of_other_kernels_act_the_same_alone_and_in_a_batch(
    env_id: str, options: dict[str, Any], kernels: str
) -> None:
    batch = vector(env_id, 3, max_episode_steps=23, **options)
    infos = OF_FURTHER_SENSORS if "imu_link" in options else []
    same_as_alone(batch, env_id, [options] * 3, 3 if kernels == "plain" else 60, infos)


@pytest.mark.usefixtures("uncompiled")
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


# Each program, and each width of a block, is a kernel of its own.
WIDE = [
    pytest.param(*case, marks=pytest.mark.slow) for case in ((PAPER, 11), (RESIDUAL, 11), (SQUARE, 250), (SQUARE, 1024))
]


@pytest.mark.parametrize(("env_id", "most"), [(SQUARE, 11), *WIDE])
def test_an_environment_does_not_depend_on_how_many_there_are(env_id: str, most: int) -> None:
    """In one lane, in blocks of 8, the last of them nearly empty, or in two and three large ones."""
    assert [block_lanes(count, 1) for count in (1, 3, 8, 11, 250, 1024)] == [1, 8, 8, 8, 8, 344]
    options = random_options(env_id) | {"max_episode_steps": 31, "error_limit": 0.6}
    runs = {}
    for num_envs in (most, 8, 3, 1):
        env = vector(env_id, num_envs, **options)
        runs[num_envs] = [env.reset(seed=5)]
        for actions in actions_for(vector(env_id, most), 80):
            runs[num_envs].append(env.step(actions[:num_envs]))
    for num_envs in (8, 3, 1):
        for whole, part in zip(runs[most], runs[num_envs], strict=True):
            *arrays, infos = part
            assert_same(arrays, [value[:num_envs] for value in whole[:-1]], f"{num_envs}")
            expected = first(num_envs, whole[-1])
            for name, value in infos.items():  # what no environment of the part has is missing there
                assert_same(value, expected[name] if not isinstance(value, dict) else first_of(expected[name], value))


def first_of(whole: dict[str, Any], part: dict[str, Any]) -> dict[str, Any]:
    return {name: whole[name] for name in part}


@pytest.mark.parametrize(("count", "lanes"), [(16, 8), pytest.param(688, 344, marks=pytest.mark.slow)])
def test_threads_give_the_same_bits(count: int, lanes: int) -> None:
    """Two blocks on two threads."""
    options = random_options(SQUARE) | {"max_episode_steps": 31}
    assert block_lanes(count, 1) == block_lanes(count, 2) == lanes
    one, two = (vector(SQUARE, count, threads=threads, **options) for threads in (1, 2))
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


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork on this system")
@pytest.mark.parametrize("steps", [0, 2])
def test_a_forked_child_steps_with_threads_of_its_own(steps: int) -> None:
    env, one = (vector(SQUARE, 16, threads=threads) for threads in (2, 1))
    for each in (env, one):
        each.reset(seed=5)
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


# --- the end of episodes ------------------------------------------------------------------------------------


def test_the_registered_time_limit_reaches_the_batch() -> None:
    """At rest without torque and without limits nothing else ends an episode: 1600 steps, not one more or less."""
    env = vector(SQUARE, 3, start="corner", error_limit=None, deflection_limit=None)
    env.reset(seed=0)
    still = np.zeros((3, 2), np.float32)
    for k in range(1, 1604):
        _, reward, terminated, truncated, infos = env.step(still)
        assert not terminated.any()
        assert truncated.all() == truncated.any() == (k == 1600)
        if k == 1601:  # the step that begins the next episode
            assert not reward.any()
            assert not infos["time"].any()
            assert not any(values.any() for values in terms_of(infos).values())
    np.testing.assert_allclose(infos["time"], 0.02, rtol=1e-12)


def test_without_a_limit_nothing_is_truncated() -> None:
    env = FlexArmVectorEnv(2, arm="linear", start="corner", error_limit=None)
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


@pytest.mark.parametrize("num_envs", [1, 2])
def test_the_action_of_an_environment_that_begins_an_episode_is_not_read(num_envs: int) -> None:
    env, twin = (vector(SQUARE, num_envs, max_episode_steps=3) for _ in range(2))
    env.reset(seed=0)
    twin.reset(seed=0)
    still = np.zeros((num_envs, 2), np.float32)
    for k in range(8):
        begins = k == 3
        assert_same(env.step(np.full_like(still, np.nan) if begins else still), twin.step(still))


# --- memory -------------------------------------------------------------------------------------------------

MEMORY = """
import sys
import numpy as np
from flexarm_env.envs.vector import FlexArmVectorEnv

def resident():
    with open("/proc/self/status") as file:
        return next(int(line.split()[1]) for line in file if line.startswith("VmRSS")) / 1024.0  # [MiB]

def run(env, steps):
    env.reset(seed=0)
    rng = np.random.default_rng(0)
    for _ in range(steps):
        env.step(rng.uniform(-1.0, 1.0, (env.num_envs, 2)).astype(np.float32))

small = FlexArmVectorEnv(64, 50, arm="linear", start="mix", noise=0.01, threads=2)
run(small, 300)
"""
GROWTH = MEMORY + "before = resident()\nrun(small, int(sys.argv[1]))\nprint(resident() - before)"
SIZE = (
    MEMORY
    + "before = resident()\nlarge = FlexArmVectorEnv(4096, 50, arm='linear')\nrun(large, 5)\nprint(resident() - before)"
)
needs_proc = pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="reads the process's memory from /proc")


@needs_proc
@pytest.mark.slow
@pytest.mark.parametrize("steps", [3200, 160_000])
def test_memory_stays_flat(steps: int) -> None:
    """Steps of 64 environments, with a reset every 50: a leak of 8 bytes a step and environment would show."""
    assert float(in_fresh_process(GROWTH, str(steps))) < (1.5 if steps < 10_000 else 8.0)


@needs_proc
@pytest.mark.slow
def test_many_environments_are_small() -> None:
    assert float(in_fresh_process(SIZE)) < 200.0


def test_what_could_not_be_made_can_be_let_go_of() -> None:
    """Gymnasium calls `close` for it, in some versions when it is let go of."""
    batch = FlexArmVectorEnv.__new__(FlexArmVectorEnv)
    with pytest.raises(ValueError, match="noise"):
        batch.__init__(2, noise=-1.0)  # type: ignore[misc]
    batch.close()
