"""The baselines as policies: what `predict` takes and gives, and how they read an environment."""

import inspect
from types import SimpleNamespace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flexarm_baselines import FLSAC, IFDC, GainPolicy, Policy, paper_system
from flexarm_env.actions import gain_from_action
from tests.support.refusals import refused

# Two modes a link, A = 0.1: tip deflection = 0.2 q_1 - 0.2 q_2. One value before them, one after.
TWO_MODES = {"modal_slice": slice(1, 5), "tip_weights": np.array([0.2, -0.2])}
OBSERVATION = np.array([9.0, 0.75, 0.25, -0.5, -0.5, 9.0], dtype=np.float32)  # delta = (0.5, 0)


class OneGain(gym.Env[Any, Any]):
    """What a baseline reads of an environment."""

    def __init__(self, gain_limit: float = 4.0, actions: int = 1, block: str = "modal_coordinates") -> None:
        self.action_space = gym.spaces.Box(-1.0, 1.0, (actions,))
        self.gain_limit = gain_limit
        self.observation_blocks = {"clock": slice(0, 1), block: slice(1, 5)}
        self.observation_scale = np.array([1.0, 0.5, 0.5, 2.0, 2.0, 1.0])
        weights = np.array([0.2, -0.2])
        # link 2 twice as flexible at its tip: a policy that mixes the links up is seen
        self.arm = SimpleNamespace(modes=(SimpleNamespace(tip_values=weights), SimpleNamespace(tip_values=2 * weights)))


@pytest.mark.parametrize("policy", [IFDC(gain=0.35, gain_limit=2.0), FLSAC(**TWO_MODES)], ids=repr)
def test_one_observation_or_a_batch(policy: Policy) -> None:
    """What is given is left as it is, answers are new, and a memory comes back; all else is refused."""
    batch, memory = np.random.default_rng(2).normal(size=(7, 6)).astype(np.float32), (np.array([1.0]),)
    before = batch.copy()
    actions, state = policy.predict(batch, state=memory, episode_start=np.ones(7, bool), deterministic=True)
    assert (actions.shape, actions.dtype, state) == ((7, 1), np.float32, memory)
    assert np.all(np.abs(actions) <= 1.0)
    for row, expected in zip(batch, actions.copy(), strict=True):
        actions[:] = 7.0
        action, state = policy.predict(row)
        assert (action.shape, action.dtype, state) == ((1,), np.float32, None)
        np.testing.assert_array_equal(action, expected)
    np.testing.assert_array_equal(batch, before)
    with pytest.raises(TypeError, match=r"observation must be an array, got a dict with keys \['modal'\]"):
        policy.predict({"modal": OBSERVATION})
    for shape in ((), (2, 3, 6)):
        with pytest.raises(ValueError, match=r"observation must have shape \(k,\) or \(n, k\), got \("):
            policy.predict(np.zeros(shape))


def test_the_signature_is_that_of_stable_baselines3() -> None:
    base = pytest.importorskip("stable_baselines3.common.base_class").BaseAlgorithm
    theirs = inspect.signature(base.predict).parameters
    for ours in (Policy.predict, GainPolicy.predict):
        parameters = inspect.signature(ours).parameters
        assert [(p.name, p.kind) for p in parameters.values()] == [(p.name, p.kind) for p in theirs.values()]
        differ = {name for name, p in parameters.items() if p.default != theirs[name].default}
        assert differ == {"deterministic"}  # which theirs must be told


@pytest.mark.parametrize(
    ("policy", "action"),
    [
        (IFDC(), 1.0),  # gain 1 of at most 1
        (IFDC(gain_limit=4.0), -0.5),  # a quarter of the way from -1 to 1
        (IFDC(gain=0.0), -1.0),
    ],
)
def test_the_constant_gain(policy: IFDC, action: float) -> None:
    assert policy.predict(OBSERVATION)[0] == np.float32([action])
    np.testing.assert_array_equal(policy.predict(np.full((3, 6), np.nan))[0], np.float32([[action]] * 3))


test_impossible_constants = refused(
    ({"gain": 1.5}, "gain = 1.5: must be a finite number and >= 0.0 and <= 1.0"),
    ({"gain_limit": 0.5}, "gain = 1.0: must be .* <= 0.5"),
    ({"gain_limit": 0.0}, "gain_limit = 0.0: must be a finite number and > 0.0"),
    ({"gain": "1"}, "TypeError: gain = '1': must be"),
    by=lambda options: IFDC(**options),
)


def flsac_gain(observation: Any, **options: Any) -> float:
    policy = FLSAC(**({**TWO_MODES, **options}))
    return float(gain_from_action(policy.predict(np.asarray(observation))[0], policy.gain_limit)[0])


def test_the_fuzzy_gain_by_hand() -> None:
    # delta_1 = (0.2 * 0.75 - 0.2 * 0.25) / 0.2 = 0.5 and delta_2 = 0; times K_n = 5: (2.5, 0), which gives
    # 37/84 in fractions (as all of them: test_fuzzy).
    action, _ = FLSAC(**TWO_MODES).predict(OBSERVATION)
    assert action[0] == pytest.approx(2 * 37 / 84 - 1, abs=1e-7)
    assert flsac_gain(OBSERVATION, K_n=2.0) == pytest.approx(167 / 510, abs=1e-7)  # (1, 0)
    assert flsac_gain(OBSERVATION, K_s=2.0, gain_limit=2.0) == pytest.approx(37 / 42, abs=1e-7)
    # Twice the width at rest: 49/108. As width scale, K_s leaves the output as it is.
    rest = [9.0, 0.5, 0.5, -1.0, -1.0, 9.0]
    assert flsac_gain(rest, K_s=2.0, scale="width") == pytest.approx(49 / 108, abs=1e-7)
    # Far out, the inputs end at the universe.
    assert flsac_gain([0, 100, 0, -100, 0, 0]) == pytest.approx(5 / 6, abs=1e-7)
    assert flsac_gain([0, 0, 0, 100, 0, 0]) == pytest.approx(1 / 2, abs=1e-7)


def test_the_links_have_tip_weights_of_their_own() -> None:
    weights = np.array([[0.2, -0.2], [0.4, 0.6]])
    policy = FLSAC(modal_slice=slice(0, 4), tip_weights=weights)
    weights[:] = 0.0  # the policy has a copy
    delta = policy.deflections(np.array([[1.0, 2.0, 3.0, 4.0], [0.5, 0.0, 0.0, -1.0]]))
    # (0.2 - 0.4) / 0.2, (1.2 + 2.4) / 0.2; 0.1 / 0.2, -0.6 / 0.2
    np.testing.assert_allclose(delta, [[-1.0, 18.0], [0.5, -3.0]], rtol=1e-15)
    equal = FLSAC(modal_slice=slice(0, 4), tip_weights=np.array([0.2, -0.2]))
    np.testing.assert_allclose(equal.deflections(np.array([[1.0, 2.0, 3.0, 4.0]])), [[-1.0, -1.0]], rtol=1e-15)


@given(st.floats(1e-3, 1e3))
def test_the_largest_scale_that_the_limit_allows_works(gain_limit: float) -> None:
    gain = flsac_gain([0, 100, 0, 100, 0, 0], K_s=gain_limit * 6 / 5, gain_limit=gain_limit)
    assert gain == pytest.approx(gain_limit, rel=1e-7)


test_impossible_fuzzy_gains = refused(
    ({"K_s": 1.3}, r"K_s = 1.3: .* the gain reaches 1.08333, but .* gain_limit = 1.0"),
    ({"gain_limit": 0.8, "scale": "width"}, "scale = 'width' the gain reaches 0.833333"),
    ({"K_s": 0.0}, "K_s = 0.0: must be a finite number and > 0"),
    ({"K_s": 0.5, "scale": "width"}, "K_s = 0.5: must be a finite number and > 0.5"),
    ({"K_n": -5.0}, "K_n = -5.0: must be a finite number and > 0"),
    ({"gain_limit": -1.0}, "gain_limit = -1.0: must be"),
    ({"scale": "input"}, "scale = 'input': must be one of 'output', 'width'"),
    ({"tip_weights": np.zeros((3, 2))}, r"tip_weights: must have shape .* got \(3, 2\)"),
    ({"tip_weights": np.array([0.2, np.inf])}, r"tip_weights\[1\] = inf: must be finite"),
    ({"tip_weights": 0.2}, "tip_weights: must have shape"),
    ({"tip_weights": np.array([])}, "number of tip_weights of both links, which must be > 0"),
    ({"modal_slice": slice(1, 4)}, r"modal_slice = slice\(1, 4, None\): .* stop - start = 4"),
    ({"modal_slice": (1, 5)}, r"TypeError: modal_slice = \(1, 5\): must be a slice"),
    ({"modal_slice": slice(None, 4)}, "modal_slice = "),
    ({"modal_slice": slice(-5, -1)}, "modal_slice = .* start >= 0"),
    ({"modal_slice": slice(0, 4, 2)}, "modal_slice = "),
    by=lambda options: FLSAC(**{**TWO_MODES, **options}),
)
test_impossible_deflections = refused(
    (np.zeros(4), "observation must hold at least 5 values, got 4"),
    (np.array([0.0, np.nan, 0.0, 0.0, 0.0]), "inputs hold nan: must be finite"),
    by=FLSAC(**TWO_MODES).predict,
)


def test_a_policy_reads_its_environment_through_wrappers_and_that_of_a_batch() -> None:
    env = gym.wrappers.TimeLimit(OneGain(gain_limit=4.0), 10)
    assert IFDC.for_env(env) == IFDC(gain=1.0, gain_limit=4.0)
    assert IFDC.for_env(env, gain=2.5) == IFDC(gain=2.5, gain_limit=4.0)
    policy = FLSAC.for_env(env, K_n=1.0, K_s=3.0)
    assert (policy.K_n, policy.K_s, policy.gain_limit) == (1.0, 3.0, 4.0)
    assert policy.modal_slice == slice(1, 5)
    np.testing.assert_array_equal(policy.tip_weights, [[0.1, -0.1], [0.8, -0.8]])
    envs = gym.make_vec("flexarm_env:FlexArm/SquareGain-v0", num_envs=3, gain_limit=4.0)
    assert IFDC.for_env(envs).gain_limit == 4.0
    assert FLSAC.for_env(envs).predict(envs.observation_space.sample())[0].shape == (3, 1)


@pytest.mark.parametrize(("name", "signs"), [("Paper", [1.0]), ("SquareGain", [1.0, -1.0, 1.0])])
def test_the_own_environment_gets_the_gain_of_its_deflections(name: str, signs: list[float]) -> None:
    env = gym.make(f"flexarm_env:FlexArm/{name}-v0", scaled=False, gain_limit=2.0)
    policy = FLSAC.for_env(env, K_n=1.0, K_s=2.0)
    observation, _ = env.reset(seed=0, options={"start": "corner"})
    gains = []
    for _ in range(300):
        modal = observation[env.unwrapped.observation_blocks["modal_coordinates"]].astype(float)
        deltas = modal.reshape(2, -1) @ signs  # with A = 0.1 a mode's tip value is 0.2 m, signs alternate
        observation, *_, info = env.step(policy.predict(observation)[0])
        assert info["gain"] == pytest.approx(2.0 * paper_system().evaluate(deltas), rel=1e-6)
        gains.append(info["gain"])
    assert gains[0] == pytest.approx(2 / 6, rel=1e-6)  # straight links
    assert max(gains) > 1.5 * gains[0]  # bent ones


UNFIT = (
    (lambda: gym.make("CartPole-v1"), "TypeError: must be a FlexArm environment, but .*CartPole.* has no attribute"),
    (lambda: OneGain(actions=2), r"must take one gain as action, .* got shape \(2,\)"),
    (lambda: OneGain(gain_limit=0.5), r"gain_limit = 0\.5|<= 0\.5"),
)
WITHOUT_GAUGES = (lambda: OneGain(block="joint_angles"), r"'modal_coordinates', .* holds \['clock', 'joint_angles'\]")
test_environments_without_one_gain = refused(*UNFIT, by=lambda make: IFDC.for_env(make()))
test_environments_without_gauges = refused(*UNFIT, WITHOUT_GAUGES, by=lambda make: FLSAC.for_env(make()))
