"""A seed's episode: the same in other processes, from copies, and whatever others do with random numbers."""

import copy
import hashlib
import pickle
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from flexarm_env.envs.single import FlexArmEnv
from tests.envs.test_draws import ALL, EITHER
from tests.envs.test_per_env import TORQUE_LANES
from tests.support.envs import (
    CALM,
    IDS,
    PAPER,
    RANDOM,
    RESIDUAL,
    SQUARE,
    assert_same,
    bare,
    in_fresh_process,
    make,
    random_options,
    vector,
)
from tests.support.programs import ROOT
from tests.support.refusals import label

NOISY = random_options(SQUARE)


def noisy(env_id: str) -> dict[str, Any]:
    return RANDOM if env_id == PAPER else random_options(env_id)


def digest(env: Any, steps: int = 10) -> str:
    """Of all that an episode gives out, of one environment or several."""
    bits = hashlib.sha256()
    for k in range(steps):
        observation, reward, _, _, info = env.step(np.full(env.action_space.shape, 0.5 * (k % 3 - 1.0), np.float32))
        for part in (observation, np.float64(reward), info["state"], info["torque"], info["sensed"]):
            bits.update(part.tobytes())
    return bits.hexdigest()


def seeded(seed: int | None, env: gym.Env[Any, Any], steps: int = 10) -> str:
    return f"{env.reset(seed=seed)[0].tobytes().hex()} {digest(env, steps)}"


def test_another_process_repeats_seeds_and_goes_on_from_pickles_and_states(tmp_path: Path) -> None:
    """Whatever others seed. It has other hashes of strings, and therefore sets of them in another order."""
    env, other = bare(**NOISY), bare(seed=3)
    digest(env, 30)
    data, state = pickle.dumps(env), other.get_state()
    assert len(data) < 100_000
    assert b"flexarm_torque" not in data  # the kernel modules' names
    (tmp_path / "env.pickle").write_bytes(data)
    np.save(tmp_path / "state.npy", state)
    cases = [(SQUARE, NOISY), (PAPER, CALM)]
    found = in_fresh_process(
        f"import sys; sys.path.insert(0, {str(ROOT)!r}); from tests.envs.test_seeds import *; "
        f"np.random.seed(1); print(*(seeded(7, make(name, **options)) for name, options in {cases!r}), "
        "digest(pickle.load(open(sys.argv[1] + '/env.pickle', 'rb'))), "
        "bare().set_state(np.load(sys.argv[1] + '/state.npy'))[1]['state'].tolist(), sep='\\n')",
        str(tmp_path),
    )
    expected = [*(seeded(7, make(name, **options)) for name, options in cases), digest(env)]
    assert found.split("\n") == [*expected, str(other.set_state(state)[1]["state"].tolist())]


@pytest.mark.parametrize("env_id", IDS)
def test_seeds(env_id: str) -> None:
    """Each has an episode of its own; without one the next follow, and their sequence repeats."""
    env, twin = make(env_id, **noisy(env_id)), make(env_id, **noisy(env_id))
    runs = [seeded(seed, env, 2) for seed in (7, None, None, 8)]
    assert len({*runs, seeded(None, twin, 2)}) == 5
    assert [seeded(seed, twin, 2) for seed in (7, None, None, 8)] == runs
    assert seeded(7, env, 2) == runs[0]


def test_the_global_generator_is_neither_read_nor_moved() -> None:
    np.random.seed(0)  # noqa: NPY002  (the thing under test)
    before = pickle.dumps(np.random.get_state())  # noqa: NPY002
    first = seeded(7, make(**NOISY))
    assert pickle.dumps(np.random.get_state()) == before  # noqa: NPY002
    np.random.seed(1)  # noqa: NPY002
    assert seeded(7, make(**NOISY)) == first


def test_an_episode_takes_one_number_from_the_generator() -> None:
    """So that whatever is random within one, the next is the same."""
    calm, wild = bare(seed=3), bare(seed=3, **NOISY)
    for env in (calm, wild):
        digest(env, 9)
        env.reset()
    assert calm.np_random.bit_generator.state == wild.np_random.bit_generator.state


def test_observing_more_changes_nothing() -> None:
    blocks = ["sensed_position", "joint_rates"]
    few, many = bare(observation=blocks, **NOISY), bare(**NOISY)
    for _ in range(30):
        info, other = few.step(np.zeros(2))[4], many.step(np.zeros(2))[4]
        assert_same(info, other)


def pickled(env: Any) -> Any:
    return pickle.loads(pickle.dumps(env))


# Pickle refuses more than `deepcopy` does; a batch has a pool of threads that no pickle holds.
COPIED = [
    *((partial(bare, name, **noisy(name)), 12, pickled) for name in (RESIDUAL, PAPER)),
    *((partial(make, **NOISY), 12, how) for how in (pickled, copy.deepcopy)),
    (partial(bare, arm={"modes_per_link": 1}, randomisation=ALL, **EITHER), 5, pickled),
    (partial(vector, SQUARE, 11, max_episode_steps=22, threads=2, **NOISY), 20, pickled),
    (partial(vector, SQUARE, 9, max_episode_steps=22, per_env=TORQUE_LANES), 20, pickled),
]


@pytest.mark.parametrize(("made", "steps", "how"), COPIED, ids=label)
def test_a_copy_continues_identically(made: Any, steps: int, how: Any) -> None:
    env = made()
    env.reset(seed=3)
    digest(env, steps)
    twin = how(env)
    found = digest(twin, steps + 2)
    assert digest(env, steps + 2) == found
    assert seeded(None, twin, 4) == seeded(None, env, 4)
    env.close()
    twin.close()


def test_a_copy_before_the_first_reset() -> None:
    twin = copy.deepcopy(FlexArmEnv(**NOISY))
    assert seeded(5, twin) == seeded(5, FlexArmEnv(**NOISY))
