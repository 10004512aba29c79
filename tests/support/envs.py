"""The environments as the tests ask for them: every id, options that together use every one, comparisons."""

import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from flexarm_env.actions import MODES
from flexarm_env.envs.blocks import BLOCKS
from flexarm_env.envs.choices import DEFAULT_OBSERVATION
from flexarm_env.envs.info import TERM
from flexarm_env.envs.sensors import FURTHER
from flexarm_env.envs.single import FlexArmEnv
from flexarm_env.envs.vector import FlexArmVectorEnv
from flexarm_env.episode.reward import OF_RACES, TERMS

Array = NDArray[np.float64]
OF_FURTHER_SENSORS = [name for sensor in FURTHER for name in sensor.blocks]
# Blocks that every environment may have, whatever its action mode, and without further sensors.
EVERYWHERE = [name for name, one in BLOCKS.items() if one.modes == tuple(MODES) and name not in OF_FURTHER_SENSORS]
# Blocks that do not depend on whether what the sensor has is drawn or declared: errors use what is declared.
WITHOUT_ERRORS = *(x for x in DEFAULT_OBSERVATION if not x.startswith("sensor_error")), "sensed_position", "reading_age"
BY_THE_CLOCK = [name for name in TERMS if name not in OF_RACES]  # terms of every reward
# All with the compiled arm; `test_chain_env` has the one with another engine's.
IDS = sorted(name for name, spec in gym.registry.items() if name.startswith("FlexArm/") and spec.vector_entry_point)
SQUARE, RESIDUAL, GAIN, PAPER = (f"FlexArm/{name}-v0" for name in ("Square", "SquareResidual", "SquareGain", "Paper"))
REACH, RACE = "FlexArm/Reach-v0", "FlexArm/Race-v0"
TORQUE_LIMITS = np.array([150.0, 50.0])  # the defaults [N m]
FREE: dict[str, Any] = {"error_limit": None, "deflection_limit": None}  # only an invalid state ends an episode
WAYPOINTS = [(-4.0, 1.0), (0.0, 5.0), (4.0, 1.0)]

RANDOMISATION = {
    "payload_mass": (0.0, 0.5),
    "stiffness": (0.9, 1.1),
    "damping": (0.0, 0.02),
    "noise": (0.0, 0.02),
    "delay": (0.01, 0.05),
    "actuation_delay": (0.0, 0.013),
}
# All that is random at once; the last three not where the law acts on the sensor.
RANDOM: dict[str, Any] = {"randomisation": RANDOMISATION, "encoder_noise": (1e-3, 1e-2), "start": "mix"}
# What is drawn without disturbances, which kernels leave out.
CALM: dict[str, Any] = {
    "randomisation": {name: RANDOMISATION[name] for name in ("payload_mass", "stiffness", "damping", "delay")},
    "start": "mix",
}
POOR_SENSOR: dict[str, Any] = {"jitter": 0.01, "sensor_period": 0.015, "dropout": 0.1}
FORESHORTENED = {"arm": "default"}


def random_options(env_id: str) -> dict[str, Any]:
    """Return options with all that is random, as far as kernels have it that other tests compile."""
    rest = {"start": "corners"} if env_id == RACE else {}  # a race begins at rest
    return {PAPER: CALM, SQUARE: RANDOM | POOR_SENSOR | FORESHORTENED}.get(env_id, RANDOM | POOR_SENSOR | rest)


# Each combination of sensor model, kinematics, velocity forces, law and disturbances is a kernel that a fresh clone
# compiles: the cases below share them where what they test does not depend on it.

# What every id takes.
_COMMON: list[dict[str, Any]] = [
    {},
    RANDOM,
    {
        "start": "moving",
        "start_spread": (0.1, 0.02),
        "start_corner": "upper right",
        "direction": "counterclockwise",
        "elbow_branch": "negative",
        "actuation_delay": 0.007,
        "noise": 0.01,
    },
    {
        "observation": EVERYWHERE,
        "previews": (0.02, 0.5),
        "last_actions": 3,
        "scaled": False,
        "frame": "world",
        "reward_weights": dict.fromkeys(BY_THE_CLOCK, 0.1),
        "deflection_limit": None,
        "error_limit": None,
    },
]
# What acts without the paper's law in the late sensor's loop.
_SENSING: list[dict[str, Any]] = [
    POOR_SENSOR | {"delay": 0.02, "sensor_position": 2.0, "scaled": True, "frame": "link"},
    {"sensor": "collocated", "arm": {"payload_mass": 0.5}},
]


def drawn_corners(rng: np.random.Generator) -> Array:
    return np.array(WAYPOINTS) + rng.uniform(-0.5, 0.5, 2)


def terms_together(infos: dict[str, Any]) -> Array:
    return np.asarray(sum(terms_of(infos).values()))


def is_bent(infos: dict[str, Any]) -> NDArray[np.bool_]:
    return np.asarray(np.abs(infos["state"][:, 2]) > 0.05)


_PATHS: list[dict[str, Any]] = [
    {"reference": "drawn", "waypoints": drawn_corners, "reward": terms_together, "termination": is_bent},
    {"reference": ["square", "circle", "line", "figure_eight", "waypoints"], "waypoints": WAYPOINTS, "side": 8.0},
    {"reference": ["square", "line", "waypoints"], "waypoints": WAYPOINTS, "corner_time": 0.5, "side": 8.0},
    {"reference": "moves", "lap_time": 6.0, "start": "corners"},
]
_BY_ID: dict[str, list[dict[str, Any]]] = {
    "Square": [
        *_SENSING,
        *_PATHS,
        {"arm": "paper", "sensor": "rigid", "wave_speed": 100.0},
        {
            "torque_limit": (100.0, 40.0),
            "control_period": 0.02,
            "physics_step": 5e-4,
            "encoder_resolution": (1e-3, 2e-3),
        },
        {
            "observation": [*DEFAULT_OBSERVATION, *OF_FURTHER_SENSORS],
            "second_sensor_link": 1,
            "second_sensor_position": 4.0,
            "second_sensor_delay": 0.0237,
            "second_sensor_noise": 0.01,
            "imu_link": 2,
            "imu_position": 3.0,
            "imu_delay": 0.0042,
            "imu_noise": (0.2, 0.01),
            "imu_bias": (0.1, 0.005),
            "imu_range": (80.0, 17.0),
        },
        FORESHORTENED | {"randomisation": {"payload_mass": (0.0, 0.5), "stiffness": (0.9, 1.1)}},
        {
            "action_mode": "torque_rate",
            "torque_rate_limit": (1000.0, 400.0),
            "payload_changes": ((0.001, 1.0), (0.25, None)),
            "pulse_force": (20.0, -10.0),
            "pulse_time": 0.013,
            "pulse_duration": 0.02,
            "pulse_period": 0.5,
            "outage_time": 0.05,
            "outage_duration": 0.02,
            "gauge_drift": (0.1, -0.2),
        },
        {
            "motor_time_constant": (0.002, 0.003),
            "torque_speed_limit": (30.0, 100.0),
            "torque_resolution": (0.5, 0.1),
            "randomisation": {"side": (8.0, 12.6), "lap_time": (8.0, 16.0)},
        },
    ],
    "SquareResidual": [
        *_SENSING[:1],
        {"inner_stiffness": (40.0, 10.0), "inner_damping": (15.0, 5.0), "torque_limit": (80.0, 30.0)},
        {"action_mode": "reference", "shift_limit": (0.2, 0.1), "actuation_delay": 0.02},
    ],
    "SquareGain": [
        *_SENSING[:1],
        {"gain_limit": 5.0, "proportional_gain": 80.0, "derivative_gain": 30.0, "torque_limit": (300.0, 200.0)},
        {"feedback_source": "sensor", "delay": 0.002, "compensation": "shared", "delayed": "position+rate"},
        FORESHORTENED,
    ],
    "SquareEncoders": [],
    "Race": [{"race_laps": 1, "reference_speed": 10.0, "reference_acceleration": 50.0}],
    "Reach": _SENSING[:1],
    "Track": [*_SENSING[:1], {"reference": "figure_eight", "start": "corners"}],
    "Paper": [
        {"arm": "default", "gain_limit": 5.0},
        {"arm": {"preset": "paper", "payload_mass": 0.5}, "sensor": "collocated"},
        {"sensor_position": 0.5, "compensation": "shared", "torque_limit": (300.0, 200.0)},
        {"delay": (0.02, 0.01), "compensation": "per_joint", "elbow_branch": "negative"},
        {"delay": 5e-4, "delayed": "position+rate", "rate_jacobian": "current", "noise": 0.02},
        {"sensor": "true", "gain_limit": 0.2, "side": 8.0, "lap_time": 8.0, "physics_step": 1e-4},
    ],
}
# Ids that are `Square-v0` with options that are varied there; their own choice is tried as it is.
_CHOICES = (
    *("Carry", "Lab", "Race", "SmoothSquare", "SquareUnknown"),
    *("SquareDelayEasy", "SquareDelayMedium", "SquareDelayHard"),
)
_NOT_OF_MOVES = ("start_corner", "direction")  # without effect there


def _options_of(name: str) -> list[dict[str, Any]]:
    return [{}, *_BY_ID.get(name, [])] if name in _CHOICES else _COMMON + _BY_ID[name]


CASES = [
    (env_id, {name: value for name, value in options.items() if env_id != REACH or name not in _NOT_OF_MOVES})
    for env_id in IDS
    for options in _options_of(env_id[len("FlexArm/") : -len("-v0")])
]
CASE_NAMES = [f"{env_id[8:]}-{'-'.join(options) or 'defaults'}"[:80] for env_id, options in CASES]


def terms_of(info: dict[str, Any]) -> dict[str, float]:
    return {name.removeprefix(TERM): value for name, value in info.items() if name.startswith(TERM)}


def kinds_of(info: dict[str, Any]) -> dict[str, tuple[type, Any, tuple[int, ...]]]:
    """Type, dtype and shape of each value, in the order of the keys."""
    return {name: (type(value), np.asarray(value).dtype, np.shape(value)) for name, value in info.items()}


def shared_arm(env_id: str, options: dict[str, Any]) -> dict[str, Any]:
    """Return options with the linear arm unless they name one: tests that are not about the plant share its kernels."""
    own = env_id == PAPER or "arm" in (options.get("per_env") or {})
    return options if own else {"arm": "linear"} | options


def make(env_id: str = SQUARE, **options: Any) -> gym.Env[Any, Any]:
    """Make the environment as users get it, wrapped; see `shared_arm`."""
    return gym.make(env_id, **shared_arm(env_id, options))


def bare(env_id: str = SQUARE, seed: int = 0, **options: Any) -> FlexArmEnv:
    """Without Gymnasium's wrappers; reset."""
    env = make(env_id, **options).unwrapped
    assert isinstance(env, FlexArmEnv)
    env.reset(seed=seed)
    return env


def vector(env_id: str = SQUARE, num_envs: int = 3, seed: int | None = None, **options: Any) -> FlexArmVectorEnv:
    """Many environments as `make_vec` gives them, reset if there is a seed; see `shared_arm`."""
    env = gym.make_vec(env_id, num_envs=num_envs, **shared_arm(env_id, options))
    assert type(env) is FlexArmVectorEnv
    if seed is not None:
        env.reset(seed=seed)
    return env


def actions_for(env: Any, steps: int, seed: int = 1) -> np.ndarray:
    """Draw actions a little beyond [-1, 1]. Shape (steps, N, channels)."""
    shape = (steps, *env.action_space.shape)
    return np.random.default_rng(seed).uniform(-1.2, 1.2, shape).astype(np.float32)


def exact_actions(steps: int, seed: int = 0, size: float = 1.0) -> Array:
    """Draw actions that float32 and float64 hold alike. Shape (steps, 2)."""
    return np.random.default_rng(seed).integers(-64, 65, (steps, 2)) / 64.0 * size


def played(env: Any, actions: Any, seed: int = 0, **options: Any) -> tuple[Array, dict[str, Array]]:
    """Reset, and step while nothing ends; return observations and the infos' values. Shape (steps + 1, k) each."""
    rows = [env.reset(seed=seed, options=options)]
    for action in actions:
        observation, _, terminated, _, info = env.step(action)
        assert not terminated
        rows.append((observation, info))
    infos = {name: np.array([info[name] for _, info in rows]) for name in rows[0][1]}
    return np.array([row for row, _ in rows], dtype=float), infos


def block(env: FlexArmEnv, observations: Array, name: str) -> Array:
    """Return the numbers of a block in observations, in its units. Shape (..., n)."""
    part = env.observation_blocks[name]
    return np.asarray(observations[..., part] * env.observation_scale[part])


def same_as_alone(
    env_id: str,
    count: int,
    options: dict[str, Any],
    steps: int,
    *,
    per_env: dict[str, list[Any]] | None = None,
    chosen: Sequence[int] | None = None,
    limit: int = 23,
) -> None:
    """Compare a batch with single environments of the same options, all or those chosen, to the last bit.

    Episodes begin anew after `limit` steps, and where they end before.
    """
    batch = vector(env_id, count, max_episode_steps=limit, per_env=per_env, **options)
    own = {i: {name: values[i] for name, values in (per_env or {}).items()} for i in chosen or range(count)}
    alone = {i: make(env_id, max_episode_steps=limit, **options, **each) for i, each in own.items()}
    found, _ = batch.reset(seed=7)
    expected = {i: env.reset(seed=7 + i)[0] for i, env in alone.items()}
    ended = set()
    for actions in 0.7 * actions_for(batch, steps):
        for i, observation in expected.items():
            assert_same(found[i], observation)
        found, rewards, terminated, truncated, infos = batch.step(actions)
        for i, env in alone.items():
            if i in ended:
                expected[i], info = env.reset()
                ended.remove(i)
            else:
                expected[i], reward, over, cut, info = env.step(actions[i])
                assert (rewards[i], terminated[i], truncated[i]) == (reward, over, cut)
                ended |= {i} if over or cut else set()
            for name, value in info.items():
                assert_same(infos[name][i], value, name)
            assert batch.episode.one(i) == env.unwrapped.episode  # type: ignore[attr-defined]


def calling(made: Callable[[], Any], method: str, name: str, **options: Any) -> Callable[[Any], None]:
    """Return what calls a method with an argument of this name; the environment must then go on as its twin does."""

    def call(given: Any) -> None:
        env, twin = made(), made()
        for each in (env, twin):
            each.reset(seed=0)
        try:
            getattr(env, method)(**options, **{name: given})
        finally:
            for actions in actions_for(env, 3):
                assert_same(env.step(actions), twin.step(actions))
            assert_same(env.reset(), twin.reset())

    return call


def in_fresh_process(code: str, *arguments: str) -> str:
    """Run Python in another process and folder, which stops at any warning; return its standard output."""
    command = [sys.executable, "-W", "error", "-c", code, *arguments]
    result = subprocess.run(command, capture_output=True, text=True, timeout=600, cwd=Path(__file__).anchor)
    assert result.returncode == 0, result.stderr
    return result.stdout.strip()


def assert_same(found: Any, expected: Any, place: str = "") -> None:
    """Check for the same structure, types and bits: tuples, dicts, arrays (of objects too), numbers."""
    if isinstance(expected, tuple | list):
        assert len(found) == len(expected), place
        for n, (a, b) in enumerate(zip(found, expected, strict=True)):
            assert_same(a, b, f"{place}[{n}]")
    elif isinstance(expected, dict):
        assert set(found) == set(expected), place
        for name in expected:
            assert_same(found[name], expected[name], f"{place}[{name!r}]")
    elif isinstance(expected, np.ndarray) and expected.dtype == object:
        assert found.dtype == object, place
        assert_same(list(found), list(expected), place)
    elif isinstance(expected, np.ndarray):
        assert (found.dtype, found.shape) == (expected.dtype, expected.shape), place
        assert found.tobytes() == expected.tobytes() or np.array_equal(found, expected, equal_nan=True), place
    else:
        assert type(found) is type(expected), place
        assert found == expected, place
