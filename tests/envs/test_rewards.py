"""What is rewarded, what ends an episode, how one starts, and the arm that is drawn for it."""

import math
from typing import Any

import numpy as np
import pytest

from flexarm_env import ArmParameters, FlexibleArm, SquareParameters, end_reason, inverse_kinematics, square
from flexarm_env.envs.single import FlexArmEnv
from flexarm_env.episode.reward import OF_RACES, TERMS
from flexarm_env.parameters import CLAMPED_ONE_PERCENT
from tests.support.envs import FREE, GAIN, PAPER, RESIDUAL, SQUARE, bare, make, played, terms_of

WEIGHTS = {"tracking_wide": 0.5, "tracking_middle": 2.0, "effort": 0.25, "vibration": 3.0, "action_change": 0.125}


@pytest.mark.parametrize("env_id", [SQUARE, RESIDUAL, GAIN])
def test_the_reward_is_the_weighted_sum_of_its_terms(env_id: str) -> None:
    """Of the state after the step, the torque at its start, and the change of the action."""
    weights = WEIGHTS | {"tracking_fine": 0.7}
    env = bare(env_id, reward_weights=weights, start="moving", **FREE)
    time, last = 2.0, np.full(env.action_space.shape, -1.0 if env_id == GAIN else 0.0)
    env.reset(seed=1, options={"time": time})
    for action in np.random.default_rng(0).uniform(-1.3, 1.3, (40, len(last))).astype(np.float32):
        _, reward, _, _, info = env.step(action)
        action = np.clip(action.astype(np.float64), -1.0, 1.0)
        distance = math.dist(info["true_tip"], square(SquareParameters()).position(time + info["time"]))
        assert info["tip_error"] == pytest.approx(distance, rel=1e-11)
        rates = env.arm.tip_deflection(info["state"][env.arm.size :])
        terms = {
            "tracking_wide": math.exp(-((distance / 0.6) ** 2)),
            "tracking_middle": math.exp(-distance / 0.15),
            "tracking_fine": math.exp(-distance / 0.04),
            "action_change": 1.0 / (1.0 + np.sum((action - last) ** 2) / 0.5),
            "effort": 1.0 / (1.0 + np.sum((info["torque"] / (150.0, 50.0)) ** 2)),
            "vibration": 1.0 / (1.0 + np.sum(rates**2)),
        }
        assert set(terms) == set(TERMS).difference(OF_RACES)
        expected = {name: weights[name] * term for name, term in terms.items()}
        # distances are known to 1e-14 m; divided by 0.04 m, and by the accuracy of the exponential
        assert terms_of(info) == pytest.approx(expected, rel=1e-11, abs=1e-14)
        assert reward == pytest.approx(sum(expected.values()), rel=1e-11)
        last = action


STIFF = {"preset": "paper", "flexural_rigidities": (1e6, 1e6), "damping_ratio": CLAMPED_ONE_PERCENT}


def ended(env: FlexArmEnv, action: Any, steps: int = 3000, **options: Any) -> tuple[str, float, dict[str, Any]]:
    """Reason, reward and info of the last step; the space holds every observation."""
    env.reset(seed=0, options=options)
    for _ in range(steps):
        observation, reward, terminated, truncated, info = env.step(np.full(env.action_space.shape, action))
        assert env.observation_space.contains(observation)
        assert not truncated
        if terminated:
            return end_reason(info["end_code"]), reward, info
    raise AssertionError("the episode did not end")


@pytest.mark.parametrize("limit", [0.02, 1.0])
def test_too_large_an_error_ends_an_episode(limit: float) -> None:
    env = bare(error_limit=limit, deflection_limit=None, start="corner")
    reason, reward, info = ended(env, 0.0)
    assert reason == "error"
    assert reward > 0.0  # the state is a valid one
    distance = math.dist(info["true_tip"], info["reference"])
    assert limit < distance < limit + 3.15 * 0.01 * 1.01  # the step before was within


@pytest.mark.parametrize("limit", [0.1, 1.5])
@pytest.mark.parametrize("torque", [(1.0, 0.0), (0.0, -1.0)])
def test_a_link_bent_too_far_ends_an_episode(limit: float, torque: tuple[float, float]) -> None:
    """Either link, either way; the step before neither was."""
    env = bare(deflection_limit=limit, error_limit=None, start="corner", torque_limit=(400.0, 400.0))
    bent = 0.0
    for _ in range(200):
        *_, reward, terminated, _, info = env.step(np.array(torque))
        before, bent = bent, float(np.abs(env.arm.tip_deflection(info["state"][:6])).max())
        if terminated:
            break
    assert end_reason(info["end_code"]) == "deflection"
    assert before <= limit < bent
    assert reward > 0.0


@pytest.mark.parametrize(
    ("env_id", "options", "reason"),
    [
        (SQUARE, {"torque_limit": (2e3, 500.0)}, "deflection"),
        (SQUARE, {"arm": STIFF | {"preset": "linear", "damping_ratio": 0.01}, "torque_limit": (0.001, 20.0)}, "angle"),
        (PAPER, {"gain_limit": 1e6, "proportional_gain": 1e9}, "angle"),
        (PAPER, {"arm": STIFF, "delayed": "position+rate", "delay": 2e-3}, "rate"),
    ],
)
def test_an_invalid_state_ends_an_episode_without_reward(env_id: str, options: dict[str, Any], reason: str) -> None:
    """And the next is like the first."""
    env = bare(env_id, start="corner", **(FREE | options))
    found, reward, info = ended(env, 1.0)
    assert found == reason
    assert reward == 0.0
    assert not any(terms_of(info).values())
    fresh = bare(env_id, start="corner", **(FREE | options))
    np.testing.assert_array_equal(env.reset(seed=0)[0], fresh.reset(seed=0)[0])
    quiet = -np.ones(env.action_space.shape) if env_id == PAPER else np.zeros(env.action_space.shape)
    np.testing.assert_array_equal(env.step(quiet)[0], fresh.step(quiet)[0])


def starts(count: int, **options: Any) -> tuple[FlexArmEnv, np.ndarray, np.ndarray]:
    env = bare(**options)
    infos = [env.reset()[1] for _ in range(count)]
    return env, np.array([i["state"] for i in infos]), np.array([i["reference"] for i in infos])


def test_starts_at_rest() -> None:
    corners = {(x, y) for x in (-6.3, 6.3) for y in (-6.3, 6.3)}
    env, states, references = starts(5, start="corner", start_corner="upper right")
    np.testing.assert_allclose(references, [(6.3, 6.3)] * 5, atol=1e-12)
    env, states, references = starts(200, start="corners")
    assert not states[:, 2:].any()
    np.testing.assert_allclose(env.arm.tip(states[:, :6]), references, atol=1e-12)
    places = [tuple(np.round(row, 9)) for row in references]
    assert set(places) == corners
    assert min(places.count(corner) for corner in corners) > 25  # of 50, deviation 6


def test_starts_on_the_move() -> None:
    """All along the path, with the velocity of the reference, off it evenly by up to the spread."""
    env, states, references = starts(400, start="moving", start_spread=(0.04, 0.03), elbow_branch="positive")
    path = square(SquareParameters())
    sides = np.argmax(np.abs(references) * [1.0, 1.0001], axis=1) * 2 + (references.max(axis=1) > 6.3 - 1e-9)
    assert min(np.bincount(sides, minlength=4)) > 60  # of 100, deviation 9
    rigid = np.array([inverse_kinematics(env.arm.parameters, point, "positive") for point in references])
    off = states[:, :2] - rigid
    off -= 2.0 * np.pi * np.round(off / (2.0 * np.pi))
    assert np.all(np.abs(off).max(axis=0) == pytest.approx([0.04, 0.04], rel=0.05))
    assert off.std(axis=0) == pytest.approx([0.04 / 3**0.5] * 2, rel=0.15)
    bending = env.arm.tip_deflection(states[:, :6])
    assert np.abs(bending).max(axis=0) == pytest.approx([0.03, 0.03], rel=0.05)
    assert not states[:, [3, 5]].any()  # the second modes
    assert not states[:, 8:].any()
    straight = np.hstack([rigid, np.zeros((400, 4)), states[:, 6:]])
    speeds = np.linalg.norm(env.arm.velocity(straight, 2, 4.5), axis=1)
    np.testing.assert_allclose(speeds, 3.15, rtol=1e-9)
    moving = env.arm.velocity(straight, 2, 4.5) * 1e-4 + references
    nearest = [np.abs(path.position(np.linspace(0.0, 16.0, 1601)) - point).sum(axis=1).min() for point in moving[:20]]
    assert max(nearest) < 0.032


def test_the_mix_of_starts() -> None:
    """Three in ten at rest; 600 draws: deviation 0.019."""
    _, states, _ = starts(600, start="mix")
    assert np.mean(~states[:, 2:].any(axis=1)) == pytest.approx(0.3, abs=0.06)


@pytest.mark.parametrize(
    ("env_id", "requested"),
    [(SQUARE, {}), (RESIDUAL, {"payload_mass": 0.7, "stiffness": 1.2}), (GAIN, {"stiffness": 1.2})],
)
def test_the_arm_is_the_one_that_was_drawn(env_id: str, requested: dict[str, float]) -> None:
    """Like an environment that is made with it: its constants follow from the same formulas up to rounding."""
    ranges = {"payload_mass": (0.1, 0.5), "stiffness": (0.8, 1.3), "damping": (0.0, 0.05)}
    options = {"start": "corner", "elbow_branch": "positive", "physics_step": 5e-4, **FREE}
    env = bare(env_id, randomisation=ranges, **options)
    actions = np.random.default_rng(1).uniform(-0.3, 0.3, (25, *env.action_space.shape))
    found = played(env, actions, 3, parameters=requested)[1]["state"]
    drawn = env.episode.parameters
    assert all(drawn[name] == value for name, value in requested.items())
    made = {
        "payload_mass": drawn["payload_mass"],
        "flexural_rigidities": (1676.0 * drawn["stiffness"],) * 2,
        "damping_ratio": drawn["damping"],
    }
    twin = bare(env_id, arm={"preset": "linear"} | made, **options)
    assert env.settings.substeps == twin.settings.substeps
    expected = played(twin, actions)[1]["state"]
    scale = np.abs(expected).max(axis=0)
    np.testing.assert_allclose(found / scale, expected / scale, rtol=0.0, atol=1e-9)
    nominal, own = (FlexibleArm(ArmParameters.linear(**arm)).acceleration(expected[-1]) for arm in ({}, made))
    assert np.abs(nominal - own).max() > 1.0  # it matters


def test_a_move_goes_there_and_back() -> None:
    """From rest to rest: a move, a rest, a move back, a rest."""
    env = make("FlexArm/Reach-v0", lap_time=2.0, **FREE)
    track = played(env, np.zeros((200, 2)))[1]["reference"]
    np.testing.assert_allclose(track[50:101], np.broadcast_to(track[50], (51, 2)), atol=1e-12)
    np.testing.assert_allclose(track[150:], np.broadcast_to(track[0], (51, 2)), atol=1e-12)
    np.testing.assert_allclose(track[100:151], track[50::-1], atol=1e-9)
    steps = np.linalg.norm(np.diff(track[:51], axis=0), axis=1)
    assert max(steps[0], steps[-1]) < 0.01 * steps.max()


@pytest.mark.parametrize(("links", "ring"), [((4.5, 4.5), (0.35, 0.95)), ((2.7, 6.3), (0.43, 0.97))])
def test_moves_end_within_their_ring(links: tuple[float, float], ring: tuple[float, float]) -> None:
    """Of the reach; unequal links leave a hole."""
    env = bare("FlexArm/Reach-v0", lap_time=1.0, arm={"link_lengths": links}, start="corner", **FREE)
    radii = []
    for seed in range(40):
        env.reset(seed=seed)
        path = env.simulator.path(0)  # there and back
        radii += [np.hypot(*point[:2]) / 9.0 for point in (path[0], path[len(path) // 2])]
    assert ring[0] <= min(radii) < ring[0] + 0.1
    assert ring[1] - 0.1 < max(radii) <= ring[1]
