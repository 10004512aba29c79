"""What Gymnasium and stable-baselines3 ask of every id, over a grid of all options."""

import copy
import warnings
from dataclasses import fields
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from flexarm_env import end_reason, register_environments
from flexarm_env.envs.blocks import BLOCKS
from flexarm_env.envs.info import KEYS, info_keys
from flexarm_env.envs.settings import Settings
from flexarm_env.envs.termination import END_CODES
from flexarm_env.envs.vector import FlexArmVectorEnv
from tests.support.envs import (
    CASE_NAMES,
    CASES,
    IDS,
    PAPER,
    POOR_SENSOR,
    RANDOM,
    SQUARE,
    actions_for,
    assert_same,
    bare,
    in_fresh_process,
    kinds_of,
    make,
    terms_of,
    vector,
)
from tests.support.plain import KERNELS
from tests.support.refusals import label

# Any warning is an error (pyproject.toml), also those of the checkers.


def test_the_grid_holds_every_option() -> None:
    used = {name for _, options in CASES for name in options}
    registered = {name for env_id in IDS for name in gym.spec(env_id).kwargs}
    assert used | registered == {one.name for one in fields(Settings)}
    assert registered - used <= {"feedback_source", "action_mode", "physics_step", "reference"}


@pytest.mark.parametrize("env_id", [SQUARE, PAPER])
@pytest.mark.usefixtures("pygame")  # the checker opens a window
def test_gymnasiums_checker_with_pictures_and_closing(env_id: str) -> None:
    check_env(make(env_id).unwrapped)


def test_registering_again_is_harmless() -> None:
    before = dict(gym.registry)
    register_environments()  # Gymnasium warns of overwritten ids, and a warning is an error
    register_environments()
    assert dict(gym.registry) == before


@pytest.mark.parametrize("env_id", IDS)
def test_the_registered_limit_is_one_lap(env_id: str) -> None:
    """The registry holds a number; lap time and control period are options."""
    env = bare(env_id)
    lap = 60.0 if env.settings.mode.races else env.settings.lap_time
    assert gym.spec(env_id).max_episode_steps == lap / env.control_period == env.lap_steps
    assert env.control_period == {PAPER: 1e-3, "FlexArm/Lab-v0": 2e-3}.get(env_id, 1e-2)
    if not env.settings.mode.races:
        assert bare(env_id, lap_time=4.0).lap_steps == round(4.0 / env.control_period)


POLICIES = ("random", "bang-bang", "spin", "none")


def actions_of(policy: str, shape: tuple[int, ...], steps: int, seed: int) -> np.ndarray:
    """Make the worst actions: full torques that change at random, or never, beyond the range now and then."""
    rng = np.random.default_rng(seed)
    if policy == "random":
        return rng.uniform(-1.5, 1.5, (steps, *shape)).astype(np.float32)
    if policy == "bang-bang":
        return np.repeat(rng.choice([-1.0, 1.0], (steps // 3 + 1, *shape)), 3, axis=0)[:steps]
    return np.full((steps, *shape), 1.0 if policy == "spin" else 0.0, np.float32)


def play(env: Any, policy: str, steps: int, seed: int) -> None:
    """Play episodes until so many steps are done: observations within their space, rewards within their range."""
    largest = sum(env.unwrapped.settings.reward_weights.values()) * (1.0 + 1e-9)
    observation, _ = env.reset(seed=seed)
    assert env.observation_space.contains(observation)
    for action in actions_of(policy, env.action_space.shape, steps, seed):
        observation, reward, terminated, truncated, info = env.step(action)
        assert env.observation_space.contains(observation), observation
        assert 0.0 <= reward <= largest
        assert sum(terms_of(info).values()) == pytest.approx(reward, rel=1e-12, abs=1e-12)
        assert min(terms_of(info).values()) >= 0.0
        assert (end_reason(info["end_code"]) != "none") == terminated
        if terminated or truncated:
            observation, _ = env.reset()
            assert env.observation_space.contains(observation)


@pytest.mark.parametrize(("env_id", "options"), CASES, ids=CASE_NAMES)
@pytest.mark.parametrize("kernels", KERNELS)
def test_every_case(env_id: str, options: dict[str, Any], kernels: str) -> None:
    """Its blocks, its spec, the checkers of Gymnasium and stable-baselines3, and bounds that no policy leaves.

    In plain Python a policy for each case, compiled all of them, and for longer.
    """
    env = make(env_id, max_episode_steps=12 if kernels == "plain" else 150, **options)
    check_blocks(env)
    if not any(map(callable, options.values())):  # which JSON has not
        check_that_the_spec_survives_json(env)
    check_env(env.unwrapped, skip_render_check=True, skip_close_check=True)
    pytest.importorskip("stable_baselines3.common.env_checker").check_env(env, warn=True)
    if kernels == "plain":
        play(env, POLICIES[CASES.index((env_id, options)) % 4], 15, seed=4)
    else:
        for policy in POLICIES:
            play(env, policy, 200, seed=4)


def check_blocks(env: gym.Env[Any, Any]) -> None:
    """They cover the observation in their order."""
    inner: Any = env.unwrapped
    places = inner.observation_blocks
    assert list(places) == list(inner.settings.observation)
    assert set(places) <= set(BLOCKS)
    ends = [0, *(part.stop for part in places.values())]
    assert [part.start for part in places.values()] == ends[:-1]
    assert inner.observation_space.shape == (ends[-1],) == inner.observation_scale.shape
    assert np.all(inner.observation_scale > 0.0)
    assert inner.settings.scaled or np.all(inner.observation_scale == 1.0)
    assert np.isfinite(inner.observation_space.high).all()


def check_that_the_spec_survives_json(env: gym.Env[Any, Any]) -> None:
    assert env.spec is not None
    twin = gym.make(gym.envs.registration.EnvSpec.from_json(env.spec.to_json()))
    assert_same(twin.reset(seed=4), env.reset(seed=4))
    action = np.full(env.action_space.shape, 0.5, np.float32)
    assert_same(twin.step(action), env.step(action))


def test_make_imports_the_package_by_itself() -> None:
    code = (
        "import gymnasium as gym, sys\n"
        "assert not [name for name in sys.modules if name.startswith('flexarm')]\n"
        "env = gym.make('flexarm_env:FlexArm/Square-v0', noise=0.01)\n"
        "env.reset(seed=0)\n"
        "print(*env.step(env.action_space.sample())[2:4])\n"
        "heavy = {'torch', 'stable_baselines3', 'matplotlib', 'pygame', 'scipy.optimize', 'scipy.special'}\n"
        "assert not heavy & set(sys.modules), heavy & set(sys.modules)\n"
    )
    assert in_fresh_process(code) == "False False"


@pytest.mark.parametrize("env_id", IDS)
def test_keys_of_infos(env_id: str) -> None:
    """As declared, which the documentation is made from."""
    path = {} if env_id == "FlexArm/Lab-v0" else {"reference": "square"}
    free = {"error_limit": 0.05, "deflection_limit": None}
    env = make(env_id, start="corner", max_episode_steps=400, **free, **path)
    begun = env.reset(seed=0)[1]
    assert tuple(begun) == info_keys(env.unwrapped.settings)
    for value in begun.values():
        assert value.dtype == np.float64  # TorchRL asks each for it
        assert isinstance(value, np.float64 if value.ndim == 0 else np.ndarray)
    for _ in range(400):
        action = -np.ones(env.action_space.shape, np.float32)
        _, reward, terminated, _, info = env.step(action)
        assert type(reward) is float
        assert kinds_of(info) == kinds_of(begun)
        assert info["end_code"] == (END_CODES["error"] if terminated else 0.0)
        if terminated:
            break
    assert terminated
    assert set(begun) <= set(KEYS)


def spoil(value: Any, name: str = "") -> None:
    """Overwrite all of an answer but the masks of a batch's infos, which refuse it, since keys share them."""
    if isinstance(value, tuple):
        for part in value:
            spoil(part)
    elif isinstance(value, dict):
        for key, part in value.items():
            spoil(part, key)
        value.clear()
    elif isinstance(value, np.ndarray) and not (name.startswith("_") and value.dtype == bool):
        value[...] = ~value if value.dtype == bool else 99.0


MADE = [*(partial(bare, env_id) for env_id in IDS)]
MADE += [partial(vector, autoreset_mode=mode, max_episode_steps=4) for mode in ("NextStep", "SameStep")]


@pytest.mark.parametrize("made", MADE, ids=label)
def test_what_is_handed_out_is_new(made: Any) -> None:
    env, twin = made(), made()
    action = np.full(env.action_space.shape, 0.1, np.float32)
    earlier = kept = None
    for k in range(8):
        answer = env.reset(seed=3) if k == 0 else env.step(action)
        assert_same(earlier, kept)
        assert_same(answer, twin.reset(seed=3) if k == 0 else twin.step(action))
        if k % 2 == 0:
            spoil(answer)
        earlier, kept = answer, copy.deepcopy(answer)
    action[:] = np.nan  # the caller's own, and not looked at again
    assert_same(env.step(np.zeros_like(action)), twin.step(np.zeros_like(action)))


OPTIONS = RANDOM | POOR_SENSOR | {"max_episode_steps": 7}


@pytest.mark.slow  # each worker imports torch
def test_stable_baselines3s_worker_processes() -> None:
    env_util = pytest.importorskip("stable_baselines3.common.env_util")
    vec_env = pytest.importorskip("stable_baselines3.common.vec_env")
    kinds = (vec_env.SubprocVecEnv, vec_env.DummyVecEnv)
    runs = []
    for kind in kinds:
        env = env_util.make_vec_env(f"flexarm_env:{SQUARE}", 2, seed=1, env_kwargs=OPTIONS, vec_env_cls=kind)
        rows = [env.reset()]
        for action in np.random.default_rng(0).uniform(-1.0, 1.0, (20, 2, 2)).astype(np.float32):
            observation, reward, done, infos = env.step(action)
            rows += [observation, reward.astype(np.float32), done, np.array([info["state"] for info in infos])]
        env.close()
        runs.append(rows)
    assert_same(*runs)


@pytest.mark.parametrize("context", ["fork", pytest.param("spawn", marks=pytest.mark.slow)])
def test_gymnasiums_worker_processes(context: str) -> None:
    with warnings.catch_warnings():
        # Python's general warning: this process has threads, of numpy and of others, that a fork does not copy
        warnings.filterwarnings("ignore", ".*multi-threaded.*", DeprecationWarning)
        functions = [partial(gym.make, f"flexarm_env:{SQUARE}", **OPTIONS)] * 2
        env, twin = gym.vector.AsyncVectorEnv(functions, context=context), FlexArmVectorEnv(2, **OPTIONS)
    assert_same(env.reset(seed=2), twin.reset(seed=2))
    for action in actions_for(twin, 20):
        assert_same(env.step(action), twin.step(action))
    env.close()


@pytest.mark.slow
@pytest.mark.filterwarnings("default")  # the library's own warnings
def test_torchrl_reads_infos() -> None:
    """It lays out its memory by the first one; the recipe runs it without infos, and a batch."""
    envs = pytest.importorskip("torchrl.envs", reason="the extra `recipes` brings it")
    env = envs.GymEnv(f"flexarm_env:{SQUARE}")
    env.auto_register_info_dict()
    envs.check_env_specs(env)
    assert "tip_error" in env.rollout(5)["next"].keys()  # noqa: SIM118  (a TensorDict)
