"""`FlexArm/SquareChain-v0`: the environment whose arm is a chain in MuJoCo."""

import copy
import warnings
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from numpy.typing import NDArray

from flexarm_env import ArmParameters, FlexibleArm, warm_up
from flexarm_env.extras import install_command
from flexarm_env.physics.sensing import QUANTITIES_AT_A_POINT
from flexarm_env.rollout import run_policy
from tests.support.envs import SQUARE, WITHOUT_ERRORS, assert_same, bare, in_fresh_process, kinds_of
from tests.support.refusals import refused

mujoco = pytest.importorskip("mujoco")

CHAIN = "FlexArm/SquareChain-v0"
SHORT: dict[str, Any] = {"segments": 6}
RANDOM: dict[str, Any] = {
    "elbow_branch": "either",
    "direction": "either",
    "randomisation": {"payload_mass": (0.0, 0.5), "stiffness": (0.9, 1.1), "damping": (0.0, 0.02)},
}


def make(**options: Any) -> Any:
    return gym.make(f"flexarm_env:{CHAIN}", **(SHORT | options))


def actions_for(steps: int, *shape: int) -> NDArray[np.float32]:
    return np.random.default_rng(1).uniform(-0.5, 0.5, (steps, *shape, 2)).astype(np.float32)


def played(env: Any, seed: int, steps: int = 12) -> list[Any]:
    return [env.reset(seed=seed), *(env.step(action) for action in actions_for(steps))]


def test_the_checkers_of_gymnasium_and_stable_baselines3() -> None:
    for options in ({}, RANDOM):
        check_env(make(**options).unwrapped, skip_render_check=True)
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    checker.check_env(make(**RANDOM), warn=True)


def test_a_seed_decides_an_episode_and_a_copy_goes_on_by_itself() -> None:
    env = make(**RANDOM)
    first = played(env, 3)
    played(env, 4)
    twin = copy.deepcopy(env)
    action = actions_for(1)[0]
    after = env.step(action)
    assert_same(twin.step(action), after)
    for one in (env, make(**RANDOM)):
        assert_same(played(one, 3), first)


def test_an_episode_is_that_of_a_chain_made_with_what_it_drew() -> None:
    """To the last bit; the integration step would follow the fastest arm of the range."""
    arm = {"joint_friction": ((0.5, 2.0), (0.1, 0.5)), "payload_inertia": (0.01, 0.1), "elbow_mass": (0.0, 0.3)}
    arm |= {"masses_per_length": ((0.3, 0.4), (0.3, 0.4)), "flexural_rigidities": ((1500.0, 1700.0),) * 2}
    seen = {"observation": WITHOUT_ERRORS, "physics_step": 1e-3}  # errors use the declared delay
    env = make(randomisation=arm | {"sensor_position": (3.0, 4.5)}, **seen)
    found = played(env, 3)
    drawn = env.unwrapped.episode.parameters
    twin = make(arm={name: drawn[name] for name in arm}, sensor_position=drawn["sensor_position"], **seen)
    assert_same(found, played(twin, 3))


def test_spaces_and_infos_are_those_of_the_square() -> None:
    chain, square = make(**RANDOM), bare(SQUARE, arm="default")
    (_, begun), (*_, info) = chain.reset(seed=0), chain.step(np.zeros(2, np.float32))
    assert chain.observation_space == square.observation_space
    assert chain.action_space == square.action_space
    assert kinds_of(begun) == kinds_of(info) == kinds_of(square.step(np.zeros(2, np.float32))[-1])
    assert chain.unwrapped.episode.parameters.keys() == square.episode.parameters.keys()


def test_gymnasiums_vector_environments_step_single_ones() -> None:
    functions = [partial(make, max_episode_steps=5, **RANDOM)] * 2
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", ".*multi-threaded.*", DeprecationWarning)  # as in test_contract
        workers = gym.vector.AsyncVectorEnv(functions, context="fork")
    made = gym.make_vec(f"flexarm_env:{CHAIN}", num_envs=2, max_episode_steps=5, **SHORT, **RANDOM)
    assert isinstance(made, gym.vector.SyncVectorEnv)
    runs = []
    for envs in (made, workers):
        runs.append([envs.reset(seed=2), *(envs.step(actions) for actions in actions_for(8, 2))])
        envs.close()
    assert_same(*runs)
    alone = make(**RANDOM)
    assert_same(runs[0][0][0][1], alone.reset(seed=3)[0])
    assert_same(runs[0][1][0][1], alone.step(actions_for(8, 2)[0, 1])[0])


def test_a_state_is_the_chains_too() -> None:
    """With another payload, whose chain is built anew."""
    env, other = make(**RANDOM), make(**RANDOM)
    played(env, 0, 3)
    played(other, 1, 2)
    state = env.unwrapped.get_state()
    expected = [env.step(action) for action in actions_for(4)]
    for one in (other, env):
        one.unwrapped.set_state(state)
        np.testing.assert_equal([one.step(action) for action in actions_for(4)], expected)


def test_a_picture_shows_the_chain() -> None:
    pytest.importorskip("pygame")
    env = make(render_mode="rgb_array")
    env.reset(seed=0)
    first = env.render()
    env.step(np.ones(2, np.float32))
    assert first.shape == env.render().shape == (600, 600, 3)
    first_link, second_link = env.unwrapped.simulator.plant.drawing().links
    assert len(first_link) == len(second_link) == SHORT["segments"] + 1
    np.testing.assert_allclose(first_link[-1], second_link[0])


def state_of(env: Any) -> NDArray[np.float64]:
    size = env.unwrapped.arm.size
    modal = np.random.default_rng(3).normal(scale=0.03, size=(2, size - 2))
    return np.concatenate([[0.4, 1.1], modal[0], [0.5, -0.7], 10.0 * modal[1]])


def test_a_state_is_read_back_and_points_are_where_mujoco_has_them() -> None:
    env = make(segments=12)
    state, arm = state_of(env), env.unwrapped.arm
    _, info = env.reset(seed=0, options={"state": state})
    np.testing.assert_allclose(info["state"], state, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(info["true_tip"], arm.tip(state[: arm.size]), atol=0.02)  # the chain keeps its length
    plant = env.unwrapped.simulator.plant
    chain = plant.chain
    np.testing.assert_allclose(plant.truth().true_tip, chain.tip(), atol=1e-13)
    weights = chain.point_weights(1, 4.5), chain.point_weights(2, 2.1), chain.point_weights(2, 4.5)
    before = [chain.point(each) for each in weights]
    elbow = chain.model.joint("elbow").bodyid[0]
    np.testing.assert_allclose(before[0][:2], chain.data.xpos[elbow, :2], atol=1e-13)
    step = 1e-7
    chain.data.qpos[:] += step * chain.data.qvel
    for was, each in zip(before, weights, strict=True):
        np.testing.assert_allclose((chain.point(each)[:2] - was[:2]) / step, was[2:], atol=1e-5)


def test_gauges_of_a_chain_are_those_of_any_arm() -> None:
    """As matrices, and by the deflections that they fit; theta2 goes with the fitted slope of link 1's tip."""
    from tests.validation.arms import EngineChain, Gauges  # they need MuJoCo

    env = make(segments=12)
    env.reset(seed=0)
    plant = env.unwrapped.simulator.plant
    shape = plant.chain.data.qpos.shape
    plant.chain.pose(*np.random.default_rng(2).normal(scale=(0.02, 1.0), size=(*shape, 2)).T)
    truth, sight = plant.truth(), EngineChain.look(plant.chain)
    np.testing.assert_allclose(truth.state, Gauges(env.unwrapped.arm).state(EngineChain.bend(plant.chain)), atol=1e-11)
    np.testing.assert_array_equal(plant.encoders(), [*sight.joints, *sight.rates])
    assert abs(truth.state[1] - sight.joints[1]) > 1e-3  # the encoder has the slope of all vibrations
    np.testing.assert_allclose(truth.deflection, sight.deflection, atol=1e-13)


def test_encoders_read_the_motors_hinges() -> None:
    """Not the joint angles of the state, which are those of shapes that fit the links."""
    env = make(segments=12, start="corner", observation=("joint_angles", "joint_rates"))
    env.reset(seed=0)
    for _ in range(3):
        observation, *_, info = env.step(np.ones(2, np.float32))
        hinges = env.unwrapped.simulator.plant.encoders()
        np.testing.assert_allclose(observation * env.unwrapped.observation_scale, hinges, rtol=1e-6)
    assert abs(info["state"][1] - hinges[1]) > 1e-3


def test_a_fine_chain_moves_as_many_shapes_do() -> None:
    """Half a second under the same torques, from rest; three polynomials with foreshortening have converged there."""
    env = make(segments=20, start="corner")
    _, info = env.reset(seed=0)
    arm = FlexibleArm(ArmParameters(modes_per_link=3, mode_shapes="polynomial", kinematics="foreshortened"))
    start = np.zeros(2 * arm.size)
    start[:2] = info["state"][:2]
    torque = np.array([20.0, -6.0])
    for _ in range(50):
        *_, info = env.step((torque / env.unwrapped.settings.action_limit).astype(np.float32))
    run = arm.simulate(start, np.tile(torque, (500, 1)), 0.5, 1e-3, 8)
    assert np.linalg.norm(run.tip[-1] - run.tip[0]) > 0.5
    assert np.linalg.norm(run.tip[-1] - info["true_tip"]) < 2e-3
    np.testing.assert_allclose(info["torque"], torque, rtol=1e-6)


def test_the_law_on_a_stiff_chain_is_the_law_on_a_stiff_arm(uncompiled: None) -> None:
    """With links 400 times as stiff only the law and the arm's inertia are left to compare."""
    options: dict[str, Any] = {
        "action_mode": "gain",
        "arm": {"preset": "linear", "modes_per_link": 1, "flexural_rigidities": (6.7e5, 6.7e5)},
        "start": "corner",
        "deflection_limit": None,
        "error_limit": None,
    }
    chain, square = make(segments=3, **options), gym.make(SQUARE, **options)
    for env in (chain, square):
        env.reset(seed=0)
    for _ in range(20):
        *_, info = chain.step(np.ones(1, np.float32))
        *_, expected = square.step(np.ones(1, np.float32))
    np.testing.assert_allclose(info["state"][:2], expected["state"][:2], atol=3e-3)
    assert info["gain"] == 1.0
    np.testing.assert_allclose(info["torque"], expected["torque"], rtol=0.2)


def test_each_quantity_at_a_point_is_measured_on_a_chain_too() -> None:
    from flexarm_env.chain.plant import MEASURES

    assert set(MEASURES) == set(QUANTITIES_AT_A_POINT)


def test_a_record_has_the_chains_own_tip() -> None:
    """Not that of the model whose coordinates the gauges read; the two are apart where torques jump."""
    env = gym.make(CHAIN, max_episode_steps=20)
    actions = iter(np.sign(np.sin(np.arange(21.0)))[:, None] * np.ones(2, dtype=np.float32))
    run = run_policy(env, lambda observation: next(actions), lap="plain")
    last = env.unwrapped.simulator.plant.chain.tip()
    np.testing.assert_allclose(run.tip[-1], last, atol=1e-12)
    assert np.linalg.norm(env.unwrapped.arm.tip(run.state[-1, :8]) - last) > 1e-4


test_refusals = refused(
    (lambda: make(segments=2), "segments = 2: must be"),
    (lambda: make(segments=3), "segments = 3: must be at least 5"),
    (lambda: make(chain_step=0.0), "chain_step = 0.0: must be"),
    (lambda: make(segment=6), "TypeError: 'segment'; did you mean 'segments'"),
    (lambda: make(action_mode="residual"), "its law acts within the compiled arm"),
    (lambda: make(action_mode="gain", feedback_source="sensor"), "feedback_source = 'sensor': on a chain"),
    (lambda: make(chain_step=1e-6, physics_step=0.002), "take more than 1000 steps"),
    (lambda: warm_up([CHAIN], num_envs=[4]), "num_envs = 4: must be 1; .* has no batch of its own"),
)


WITHOUT_MUJOCO = f"""
import sys
sys.modules["mujoco"] = None
import gymnasium, flexarm_env
try:
    gymnasium.make("{CHAIN}")
except ModuleNotFoundError as error:
    print(error)
"""


def test_without_mujoco_the_extra_is_named() -> None:
    assert f"mujoco is not installed; run `{install_command('chain')}`" in in_fresh_process(WITHOUT_MUJOCO)
