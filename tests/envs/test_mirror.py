"""Mirror symmetry: a mirrored episode has mirrored observations and the same rewards, block by block, mode by mode."""

from typing import Any

import numpy as np
import pytest

from flexarm_env.actions import MODES
from flexarm_env.envs.blocks import BLOCKS, SCALAR
from flexarm_env.envs.settings import Settings
from tests.support.envs import WAYPOINTS, Array, bare, vector
from tests.support.plain import PlainEnvironment
from tests.support.refusals import refused

# Numbers are compared exactly. A reflection changes signs alone, sums and products of numbers with other signs round to
# the same magnitudes, and sine and arctangent are our own odd functions; so no tolerance is needed.
FURTHER_SENSORS = {"second_sensor_link": 1, "second_sensor_delay": 0.0137}
FURTHER_SENSORS |= {"imu_link": 2, "imu_position": 3.0, "imu_delay": 0.0042}
PATHS: list[dict[str, Any]] = [
    {"reference": "circle"},
    {"reference": "line", "frame": "world", "start_corner": "upper right"},
    {"reference": "waypoints", "waypoints": WAYPOINTS},
    {"arm": {"modes_per_link": 1, "kinematics": "foreshortened"}, "direction": "counterclockwise"},
]
_OTHER = {"clockwise": "counterclockwise", "positive": "negative", "lower": "upper"}
_OTHER |= {second: first for first, second in _OTHER.items()}


def mirrored_options(options: dict[str, Any]) -> dict[str, Any]:
    """Return the options of the mirror image of an environment whose side and direction are not drawn."""
    settings = Settings.of(options)
    height, side = settings.start_corner.split()
    changed: dict[str, Any] = {"elbow_branch": _OTHER[settings.elbow_branch]}
    if settings.reference == ("waypoints",):
        return options | changed | {"waypoints": [(x, -y) for x, y in settings.waypoints or ()]}
    changed |= {"start_corner": f"{_OTHER[height]} {side}", "direction": _OTHER[settings.direction]}
    return options | changed


def blocks_of(mode: str) -> list[str]:
    return [name for name, block in BLOCKS.items() if mode in block.modes]


def pair(**options: Any) -> tuple[PlainEnvironment, PlainEnvironment]:
    """Make an environment and its mirror image, with every block that the action mode has."""
    mode = options.get("action_mode", "torque")
    whole: dict[str, Any] = {
        "arm": {"modes_per_link": 1},
        "elbow_branch": "positive",
        "start": "corner",
        "observation": blocks_of(mode),
        "last_actions": 2,
        "previews": (0.05, 5.0),
        **FURTHER_SENSORS,
        **options,
    }
    if mode == "gain":
        whole["physics_step"] = 1e-3
    return PlainEnvironment(**whole), PlainEnvironment(**mirrored_options(whole))


def check_mirrored(one: PlainEnvironment, other: PlainEnvironment, steps: int = 8) -> Array:
    """Drive both, one by the mirrored actions, and compare; return the observations' largest magnitudes. Shape (k,)."""
    signs, action_sign = one.simulator.layout.mirror, one.simulator.settings.mode.mirror
    random = np.random.default_rng(5)
    channels = len(one.simulator.settings.action_limit)
    largest = np.zeros(len(signs))
    for k in range(steps + 1):
        if k > 0:
            action = random.uniform(-1.0, 1.0, channels)
            one.step(action)
            other.step(action_sign * action)
        seen, image = one.simulator.observations[0], other.simulator.observations[0]
        largest = np.maximum(largest, np.abs(seen))
        np.testing.assert_array_equal(image, signs * seen)
        np.testing.assert_array_equal(other.result("STATE"), -one.result("STATE"))
        np.testing.assert_array_equal(other.result("REWARD"), one.result("REWARD"))
    return largest


@pytest.mark.parametrize("mode", MODES)
def test_every_block_in_every_action_mode(mode: str) -> None:
    one, other = pair(action_mode=mode)
    largest = check_mirrored(one, other)
    for name, part in one.simulator.layout.blocks.items():
        shows = (largest[part] > 0.0).all()  # a number that is always 0 would fit any sign
        zeros = "episode_parameters" if MODES[mode].law == "tip" else ("episode_parameters", "inner_gain")
        assert shows == (name not in zeros), name
    assert BLOCKS["episode_parameters"].mirror == SCALAR  # always 0 here, so that no sign shows


@pytest.mark.parametrize("options", PATHS, ids=lambda each: "-".join(each))
def test_other_paths_frames_and_arms(options: dict[str, Any]) -> None:
    check_mirrored(*pair(**options))


def test_an_episode_from_another_state() -> None:
    """By `reset(options=...)`, on compiled kernels: the mirrored state has the other signs."""
    env = bare(elbow_branch="positive")
    image = bare(**mirrored_options({"elbow_branch": "positive"}))
    state = np.array([2.9, 1.0, 0.3, -0.1, 0.2, 0.05, 0.4, -0.3, 1.0, -2.0, 0.5, 0.1])
    seen = env.reset(options={"time": 2.0, "state": state})[0]
    shown = image.reset(options={"time": 2.0, "state": -state})[0]
    np.testing.assert_array_equal(shown, env.mirror_observation(seen))
    for action in np.random.default_rng(1).uniform(-1.0, 1.0, (50, 2)).astype(np.float32):
        seen, reward, *_ = env.step(action)
        shown, same, *_ = image.step(env.mirror_action(action))
        np.testing.assert_array_equal(shown, env.mirror_observation(seen))
        assert same == reward


def test_the_maps_take_batches() -> None:
    one, many = bare(), vector(num_envs=3)
    observations, _ = many.reset(seed=0)
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (5, 3, 2)).astype(np.float32)
    for env in (one, many):
        mirrored = env.mirror_observation(observations)
        assert (mirrored.shape, mirrored.dtype) == (observations.shape, np.float32)
        np.testing.assert_array_equal(mirrored, observations * env.observation_mirror)
        np.testing.assert_array_equal(env.mirror_observation(mirrored), observations)
        np.testing.assert_array_equal(env.mirror_action(actions), -actions)
    gain = bare("FlexArm/SquareGain-v0")
    np.testing.assert_array_equal(gain.mirror_action([0.3]), np.float32([0.3]))


test_other_shapes_are_refused = refused(
    (("observation", np.zeros(3)), r"observation: must have shape \(..., 42\), got \(3,\)"),
    (("action", np.zeros(3)), r"action: must have shape \(..., 2\), got \(3,\)"),
    (("action", 1.0), r"action: must have shape \(..., 2\), got \(\)"),
    by=lambda given: getattr(bare(), f"mirror_{given[0]}")(given[1]),
)
