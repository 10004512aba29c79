"""`FlexArmVectorEnv`: options of a reset, what is refused, also by a single environment, and what is handed out."""

import copy
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from flexarm_env.envs.single import FlexArmEnv
from flexarm_env.envs.vector import FlexArmVectorEnv
from tests.support.envs import IDS, SQUARE, actions_for, assert_same, bare, calling, make, vector
from tests.support.refusals import refused, refuses


def test_each_environment_may_have_its_own_options() -> None:
    """And is then the single environment with those."""
    made: dict[str, Any] = {"reference": ["square", "circle"], "error_limit": None}
    made["randomisation"] = {"stiffness": (0.5, 2.0), "delay": (0.0, 0.1)}
    env = vector(SQUARE, 3, **made)
    state = np.zeros((3, 12))
    state[:, :2] = [(0.3, 1.0), (-0.2, 2.0), (1.0, 0.5)]
    parameters: dict[str, Any] = {"payload_mass": [0.0, 0.2, 0.4], "delay": np.array([0.0, 0.03, 0.1])}
    options: dict[str, Any] = {
        "start": ["moving", "corner", "mix"],
        "time": [0.0, 3.0, 15.9],
        "path": ["circle", "square", "circle"],
        "elbow_branch": ["positive", "negative", "either"],
        "direction": ["counterclockwise", "clockwise", "either"],
        "parameters": parameters | {"stiffness": 1.3},
        "state": state,
    }
    found = [env.reset(seed=1, options=options)]
    described = env.episode
    actions = actions_for(env, 10)
    found += [env.step(each) for each in actions]
    for i in range(3):
        single = make(SQUARE, **made)
        own = {name: options[name][i] for name in options if name != "parameters"}
        own["parameters"] = {"stiffness": 1.3} | {name: values[i] for name, values in parameters.items()}
        observation, info = single.reset(seed=1 + i, options=own)
        np.testing.assert_array_equal(info["state"], state[i])
        np.testing.assert_array_equal(found[0][0][i], observation)
        assert described.one(i) == single.unwrapped.episode
        assert described.elbow_branch[i] == options["elbow_branch"][i] or i == 2
        assert described.direction[i] == options["direction"][i] or i == 2
        for whole, action in zip(found[1:], actions[:, i], strict=True):
            observation, reward, *_ = single.step(action)
            np.testing.assert_array_equal(whole[0][i], observation)
            assert whole[1][i] == reward


def test_resets_that_cannot_be() -> None:
    env = vector(SQUARE)
    with refuses(ValueError, "the first reset must begin an episode in every environment"):
        env.reset(options={"reset_mask": np.array([True, False, False])})
    with refuses(AttributeError, "gain_limit: the action is 'torque', not the gain"):
        _ = FlexArmEnv().gain_limit


test_wrong_seeds_are_refused_and_nothing_moves = refused(
    (1.5, "TypeError: seed = 1.5: must be an integer >= 0"),
    ("5", "TypeError: seed = '5'"),
    (True, "TypeError: seed = True"),
    (-1, "seed = -1: must be an integer >= 0"),
    ([1, 2], "seed: must be one number or 3, got 2"),
    ([0.7, 1.2, 2.9], r"TypeError: seed\[0\] = 0.7"),
    ([1, None, "3"], r"TypeError: seed\[2\] = '3'"),
    ([7, 8, -1], r"seed\[2\] = -1"),
    by=calling(vector, "reset", "seed"),
)
test_a_wrong_argument_names_itself = refused(
    ({"num_envs": 0}, "num_envs = 0.*from 1 to"),
    ({"num_envs": 10**9}, "num_envs = 1000000000: would take.*GB at least; must be at most"),
    ({"num_envs": 10**400}, "num_envs = 1000.*must be an integer from 1 to"),
    ({"num_envs": 2.0}, "TypeError: num_envs = 2.0.*integer"),
    ({"max_episode_steps": 0}, "max_episode_steps = 0.*from 1 to"),
    ({"max_episode_steps": 10**400}, "max_episode_steps = 1000.*from 1 to"),
    ({"threads": 0}, "threads = 0.*>= 1"),
    ({"autoreset_mode": "Sometimes"}, "autoreset_mode = 'Sometimes'.*'NextStep'.*'SameStep'"),
    ({"render_mode": "human"}, "render_mode = 'human'.*'rgb_array'"),
    by=lambda options: FlexArmVectorEnv(**options),
)
test_wrong_actions_are_refused_and_nothing_moves = refused(
    ([np.nan, 0.0], r"action\[0\] = nan: must be finite"),
    ([0.0, -np.inf], r"action\[1\] = -inf: must be finite"),
    ([0.0], r"action: must have shape \(2,\), got \(1,\)"),
    (0.0, r"action: must have shape \(2,\), got \(\)"),
    ([[0.0, 0.0]], r"action: must have shape \(2,\), got \(1, 2\)"),
    by=calling(make, "step", "action"),
)
test_wrong_actions_of_a_batch_are_refused_and_nothing_moves = refused(
    (np.zeros(2), r"actions: must have shape \(3, 2\), got \(2,\)"),
    (np.zeros((3, 1)), r"actions: must have shape \(3, 2\), got \(3, 1\)"),
    (np.full((3, 2), np.nan), r"actions\[0, 0\] = nan: must be finite"),
    ([[0.0, 0.0], [0.0, np.inf], [0.0, 0.0]], r"actions\[1, 1\] = inf: must be finite"),
    (np.zeros((3, 2), bool), "must be an array of real numbers"),
    ([[0.0, 0.0], [0.0], [0.0, 0.0]], "must be an array of real numbers"),
    by=calling(vector, "step", "actions"),
)


@pytest.mark.parametrize(
    "convert",
    [
        lambda actions: actions,
        lambda actions: actions.astype(np.longdouble),
        lambda actions: actions.tolist(),
        lambda actions: actions.astype(np.float32).astype(">f4"),
        lambda actions: np.repeat(actions.astype(np.float32), 2, axis=-1)[..., ::2],
        lambda actions: actions.view(np.matrix) if actions.ndim == 2 else actions,
    ],
    ids=["float64", "long double", "list", "other byte order", "not contiguous", "matrix"],
)
def test_actions_of_another_type_are_rounded_to_the_spaces(convert: Callable[[Any], Any]) -> None:
    env, twin, single, other = vector(seed=0), vector(seed=0), bare(), bare()
    for actions in np.random.default_rng(0).uniform(-1.0, 1.0, (5, 3, 2)):
        nearest = actions.astype(np.float32)
        assert (nearest != actions).all()
        assert_same(env.step(convert(actions)), twin.step(nearest))
        assert_same(single.step(convert(actions[0])), other.step(nearest[0]))


def test_a_refused_action_is_the_only_error() -> None:
    with pytest.raises(ValueError, match="action: must have shape") as caught:
        bare().step([0.0, 0.0, 0.0])
    assert caught.value.__context__ is None


def test_actions_beyond_the_range_of_float32_are_limited() -> None:
    env, twin, single, other = vector(seed=0), vector(seed=0), bare(), bare()
    assert_same(env.step(np.full((3, 2), -1e300)), twin.step(np.full((3, 2), -1.0, np.float32)))
    assert_same(single.step(np.full(2, 1e300)), other.step(np.full(2, 1.0, np.float32)))
    assert_same(env.step(np.full((3, 2), 1e30, np.float32)), twin.step(np.ones((3, 2), np.float32)))


def test_masks_that_keys_share_cannot_be_written() -> None:
    env, actions = vector(SQUARE, 3), np.zeros((3, 2), np.float32)
    for infos in (env.reset(seed=0)[1], env.step(actions)[4], copy.deepcopy(env).step(actions)[4]):
        for name, mask in infos.items():
            if name.startswith("_"):
                assert not mask.flags.writeable, name
                with pytest.raises(ValueError, match="read-only"):
                    mask[0] = False


@pytest.mark.parametrize("env_id", IDS)
def test_spaces_and_metadata(env_id: str) -> None:
    options = {"noise": 0.01}
    env, single = vector(env_id, 3, autoreset_mode="SameStep", **options), make(env_id, **options)
    assert env.single_observation_space == single.observation_space
    assert env.single_action_space == single.action_space
    assert env.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    assert env.observation_blocks == single.unwrapped.observation_blocks
    assert getattr(env.spec, "id", None) == env_id
    observations, _ = env.reset(seed=0)
    assert env.observation_space.contains(observations)
