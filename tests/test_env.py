"""The environment's contract: what Gymnasium and stable-baselines3 ask, and what its docstring promises."""

from __future__ import annotations

import copy
import hashlib
import inspect
import json
import math
import pickle
import subprocess
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from flexarm_env import FlexibleArm, SquareParameters, register_environments, square
from flexarm_env.env import FlexArmEnv
from flexarm_env.task import CONTROL_PERIOD

Array = NDArray[np.float64]
PAPER = "FlexArm/Paper-v0"
IDS = sorted(name for name in gym.registry if name.startswith("FlexArm/"))

# A grid over every option, few enough to run; kernels are shared where an option needs none of its own.
GRID: list[dict[str, Any]] = [
    {},
    {"arm": "default", "noise": 0.01, "gain_limit": 5.0},
    {"arm": {"payload_mass": 0.5}, "sensor": "collocated"},
    {"sensor_position": 0.5, "compensation": "shared", "torque_limit": (300.0, 200.0)},
    {"arm": {"preset": "default", "elbow_hub_inertia": 1.0}, "proportional_gain": 80.0, "derivative_gain": 30.0},
    {"delay": (0.02, 0.01), "compensation": "per_joint", "elbow_branch": "negative"},
    {"wave_speed": 1000.0, "compensation": "per_joint"},
    {"delay": 5e-4, "delayed": "position+rate", "rate_jacobian": "current", "noise": 0.02},
    {"sensor": "true", "noise": 0.05, "gain_limit": 0.2, "side": 8.0},
    {"start_corner": "upper right", "direction": "counterclockwise", "lap_time": 8.0, "physics_step": 1e-4},
]
GRID_NAMES = ["-".join(options) or "defaults" for options in GRID]

# Warnings that a check may give; anything else is an error. Closed: an entry needs its reason here.
ALLOWED_WARNINGS: tuple[str, ...] = ()


def make(env_id: str = PAPER, **options: Any) -> gym.Env[Any, Any]:
    return gym.make(env_id, **options)


def bare(**options: Any) -> FlexArmEnv:
    """Without Gymnasium's wrappers; reset."""
    env = FlexArmEnv(**options)
    env.reset(seed=0)
    return env


@pytest.fixture
def strict_warnings() -> Iterator[None]:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for message in ALLOWED_WARNINGS:
            warnings.filterwarnings("ignore", message)
        yield


# --- the two checkers ---------------------------------------------------------------------------------------


@pytest.mark.usefixtures("strict_warnings")
@pytest.mark.parametrize("options", GRID, ids=GRID_NAMES)
@pytest.mark.parametrize("env_id", IDS)
def test_gymnasiums_checker(env_id: str, options: dict[str, Any]) -> None:
    check_env(make(env_id, **options).unwrapped)


@pytest.mark.usefixtures("strict_warnings")
@pytest.mark.parametrize("options", GRID, ids=GRID_NAMES)
@pytest.mark.parametrize("env_id", IDS)
def test_stable_baselines3s_checker(env_id: str, options: dict[str, Any]) -> None:
    from stable_baselines3.common.env_checker import check_env as check

    check(make(env_id, **options), warn=True)


# --- registration -------------------------------------------------------------------------------------------


def test_the_paper_is_registered() -> None:
    assert PAPER in IDS


def test_registering_again_is_harmless() -> None:
    before = dict(gym.registry)
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # Gymnasium warns of overwritten ids
        register_environments()
        register_environments()
    assert dict(gym.registry) == before


def test_the_registered_limit_is_one_lap() -> None:
    """The registry holds a number; lap time and control period are defined elsewhere."""
    assert gym.spec(PAPER).max_episode_steps == 16_000
    assert gym.spec(PAPER).max_episode_steps == round(SquareParameters().lap_time / CONTROL_PERIOD)
    env = bare()
    assert env.control_period == CONTROL_PERIOD == 1e-3
    assert env.lap_steps == 16_000
    assert bare(lap_time=8.0).lap_steps == 8000


@pytest.mark.parametrize("options", GRID, ids=GRID_NAMES)
def test_the_spec_survives_json(options: dict[str, Any]) -> None:
    env = make(**options)
    assert env.spec is not None
    text = env.spec.to_json()
    json.loads(text)
    twin = gym.make(gym.envs.registration.EnvSpec.from_json(text))
    np.testing.assert_array_equal(env.reset(seed=4)[0], twin.reset(seed=4)[0])
    np.testing.assert_array_equal(env.step(np.ones(1, np.float32))[0], twin.step(np.ones(1, np.float32))[0])


def in_fresh_process(code: str, *arguments: str) -> str:
    """Standard output of a Python process of its own, elsewhere, that stops at any warning."""
    command = [sys.executable, "-W", "error", "-c", code, *arguments]
    result = subprocess.run(command, capture_output=True, text=True, timeout=300, cwd=Path(__file__).anchor)
    assert result.returncode == 0, result.stderr
    return result.stdout.strip()


def test_make_imports_the_package_by_itself() -> None:
    code = (
        "import gymnasium as gym, sys\n"
        "assert not any('flexarm' in name for name in sys.modules if name.startswith('flexarm'))\n"
        "env = gym.make('flexarm_env:FlexArm/Paper-v0', sensor_position=0.5, compensation='shared')\n"
        "env.reset(seed=0)\n"
        "print(*env.step(env.action_space.sample())[2:4])\n"
    )
    assert in_fresh_process(code) == "False False"


# --- options ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"arm": "papers"}, ValueError, r"arm = 'papers': must be one of 'paper', 'default'"),
        ({"arm": 2}, TypeError, r"arm = 2: must be 'paper', 'default' or a mapping of ArmParameters fields"),
        ({"arm": {"mass": 1.0}}, ValueError, r"arm: unknown field\(s\) \['mass'\]; ArmParameters has .*'link_lengths'"),
        ({"arm": {"modes_per_link": 5}}, ValueError, r"modes_per_link = 5: must be an integer from 1 to 4"),
        ({"sensor": "laser"}, ValueError, r"sensor = 'laser': must be one of 'collocated', 'rigid', 'true'"),
        ({"sensor_position": 0.0}, ValueError, r"sensor_position = 0\.0: must be .* > 0\.0 \[m\]"),
        ({"sensor_position": 4.6}, ValueError, r"sensor_position = 4\.6 m: must be on link 2, > 0 and <= 4\.5 m"),
        ({"delay": -1e-3}, ValueError, r"delay = -0\.001: must be .* >= 0\.0 and <= 10\.0 \[s\]"),
        ({"delay": (0.01, math.inf)}, ValueError, r"delay\[1\] = inf: must be .* \[s\]"),
        ({"delay": "late"}, TypeError, r"delay = 'late': must be a .* \[s\]"),
        ({"sensor": "true", "delay": (0.1, 0.2)}, ValueError, r"delay = \(0\.1, 0\.2\): .* must be one number \[s\]"),
        ({"sensor": "collocated", "delay": 0.1}, ValueError, r"delay = 0\.1: .* must be None"),
        ({"delayed": "rate"}, ValueError, r"delayed = 'rate': must be one of 'position', 'position\+rate'"),
        ({"rate_jacobian": "late"}, ValueError, r"rate_jacobian = 'late': must be one of 'delayed', 'current'"),
        ({"noise": -0.1}, ValueError, r"noise = -0\.1: must be .* >= 0\.0 \[m\]"),
        ({"compensation": "both"}, ValueError, r"compensation = 'both': must be one of 'none', 'shared', 'per_joint'"),
        ({"sensor": "collocated", "compensation": "shared"}, ValueError, r"compensation = 'shared': .* must be 'none'"),
        ({"torque_limit": (0.0, 1.0)}, ValueError, r"torque_limit\[0\] = 0\.0: must be .* > 0\.0 \[N m\]"),
        ({"torque_limit": 5.0}, TypeError, r"torque_limit = 5\.0: must be a pair of"),
        ({"gain_limit": 0.0}, ValueError, r"gain_limit = 0\.0: must be .* > 0\.0"),
        ({"gain_limit": math.nan}, ValueError, r"gain_limit = nan: must be a finite number"),
        ({"side": 12.8}, ValueError, r"path: way-point .* misses it by 0\.05097 m"),
        ({"lap_time": 0.0}, ValueError, r"lap_time = 0\.0: must be .* > 0\.0 \[s\]"),
        ({"start_corner": "top"}, ValueError, r"start_corner = 'top': must be one of 'lower left', 'upper left'"),
        ({"direction": "left"}, ValueError, r"direction = 'left': must be one of 'clockwise', 'counterclockwise'"),
        ({"elbow_branch": "up"}, ValueError, r"elbow_branch = 'up': must be one of 'positive', 'negative'"),
        ({"physics_step": 0.1}, ValueError, r"physics_step = 0\.1 s: too long .* at most 0\.01218 s is allowed"),
        ({"physics_step": "auto"}, TypeError, r"physics_step = 'auto': must be a .*number .*\[s\]"),
        ({"wave_speed": 0.0}, ValueError, r"wave_speed = 0\.0: must be .* > 0\.0 \[m/s\]"),
        ({"proportional_gain": -1.0}, ValueError, r"proportional_gain = -1\.0: must be .* >= 0\.0 \[N/m\]"),
        ({"derivative_gain": math.inf}, ValueError, r"derivative_gain = inf: must be .* >= 0\.0 \[N s/m\]"),
        ({"arm": {"preset": "new"}}, ValueError, r"arm = 'new': must be one of 'paper', 'default'"),
        ({"wind": 3.0}, TypeError, "wind"),
    ],
    ids=lambda value: str(value) if isinstance(value, dict) else "",
)
def test_a_wrong_option_fails_at_make(options: dict[str, Any], error: type[Exception], message: str) -> None:
    """Naming the option, its value and what is allowed."""
    with pytest.raises(error, match=message):
        make(**options)


def test_rendering_is_refused() -> None:
    with pytest.raises(ValueError, match="render_mode = 'human': this environment does not render"):
        FlexArmEnv(render_mode="human")  # type: ignore[arg-type]


def test_reset_knows_no_options() -> None:
    env = make()
    env.reset(options={})
    with pytest.raises(ValueError, match=r"options = \{'corner': 2\}: no option is known"):
        env.reset(options={"corner": 2})


# --- actions ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("action", "gain"), [(-1.0, 0.0), (0.0, 2.0), (1.0, 4.0), (-7.0, 0.0), (1.5, 4.0), (0.5, 3.0)])
def test_the_action_is_the_gain(action: float, gain: float) -> None:
    """-1 to 1 onto 0 to gain_limit; what lies outside is clipped, as the docstring says."""
    env = bare(gain_limit=4.0)
    assert env.step(np.array([action], np.float32))[4]["gain"] == gain


def law_without_gain(env: FlexArmEnv, info: dict[str, Any]) -> Array:
    """J^T (Kp e + Kd e') (10) at an instant of an undelayed run on the first side."""
    theta1, theta2, *_ = info["state"]
    rates = info["state"][env.arm.size : env.arm.size + 2]
    s1, c1, s12, c12 = np.sin(theta1), np.cos(theta1), np.sin(theta1 + theta2), np.cos(theta1 + theta2)
    p = 4.5 * np.array([c1 + c12, s1 + s12])
    J = 4.5 * np.array([[-s1 - s12, -s12], [c1 + c12, c12]])
    error = np.array([-6.3, -6.3 + 3.15 * info["time"]]) - p
    return np.asarray(J.T @ (150.79 * error + 17.364 * (np.array([0.0, 3.15]) - J @ rates)))


def test_the_torque_is_the_papers_law_times_the_gain() -> None:
    """Reported as it acts when the period begins; at the reset there is none."""
    env = bare(sensor="collocated", gain_limit=4.0)
    info = env.reset(seed=0)[1]
    np.testing.assert_array_equal(info["torque"], np.zeros(2))
    for action in (*np.linspace(-1.0, 1.0, 9), *np.zeros(60)):
        expected = 2.0 * (action + 1.0) * law_without_gain(env, info)
        info = env.step(np.array([action], np.float32))[4]
        # rounding of the position, 1e-15 m, times gains of up to 1e4 N m/m; the command's velocity is a difference
        # quotient over 0.25 ms, with 1e-11 m/s of rounding
        np.testing.assert_allclose(info["torque"], expected, rtol=1e-9, atol=1e-8)


@pytest.mark.parametrize(
    ("action", "message"),
    [
        ([math.nan], r"action\[0\] = nan: must be finite"),
        ([-math.inf], r"action\[0\] = -inf: must be finite"),
        ([0.0, 0.0], r"action: must have shape \(1,\), got \(2,\)"),
        (0.0, r"action: must have shape \(1,\), got \(\)"),
        ([[0.0]], r"action: must have shape \(1,\), got \(1, 1\)"),
    ],
)
def test_a_wrong_action_is_refused_and_nothing_moves(action: Any, message: str) -> None:
    env = bare()
    time = env.step(np.zeros(1, np.float32))[4]["time"]
    with pytest.raises(ValueError, match=message):
        env.step(np.asarray(action))
    assert env.step(np.zeros(1, np.float32))[4]["time"] == pytest.approx(time + 1e-3, rel=1e-12)


# --- observations -------------------------------------------------------------------------------------------

STEPS = 60


def recorded(env: FlexArmEnv) -> tuple[Array, list[dict[str, Any]]]:
    """Observations and infos of an episode with random actions."""
    observation, info = env.reset(seed=2)
    observations, infos = [observation], [info]
    for action in np.random.default_rng(2).uniform(-1.0, 1.0, (STEPS, 1)).astype(np.float32):
        observation, _, terminated, _, info = env.step(action)
        assert not terminated
        observations.append(observation)
        infos.append(info)
    return np.array(observations), infos


def block(env: FlexArmEnv, observations: Array, name: str) -> Array:
    return observations[..., env.observation_blocks[name]]


@pytest.mark.parametrize("arm", ["paper", "default"])
def test_blocks_hold_what_they_say(arm: str) -> None:
    env = bare(arm=arm, start_corner="upper left", lap_time=0.12, gain_limit=0.01)  # a soft gain over two corners
    observations, infos = recorded(env)
    m = env.arm.parameters.modes_per_link
    states = np.array([info["state"] for info in infos])
    path = square(SquareParameters(start_corner="upper left", lap_time=0.12))
    times = CONTROL_PERIOD * np.arange(STEPS + 1)
    expected = {
        "joint_angles": states[:, :2],
        "joint_rates": states[:, 2 * m + 2 : 2 * m + 4],
        "modal_coordinates": states[:, 2 : 2 * m + 2],
        "reference_position": path.position(times),
        "reference_velocity": path.velocity(times + 1e-9),
    }
    for name, values in expected.items():
        np.testing.assert_allclose(block(env, observations, name), values.astype(np.float32), rtol=3e-7, err_msg=name)
    assert np.ptp(expected["modal_coordinates"], axis=0).min() > 0.0
    # the slices cover the observation once, in order
    ends = [0, *(part.stop for part in env.observation_blocks.values())]
    assert [part.start for part in env.observation_blocks.values()] == ends[:-1]
    assert env.observation_space.shape == (ends[-1],) == (10 + 2 * m,)


@pytest.mark.parametrize("sensor", ["collocated", "rigid", "true"])
def test_the_sensed_position(sensor: Any) -> None:
    """Of angles 4 and 2 ms old, of the point 4 ms ago with its deflection, or of the present angles."""
    delay = {"collocated": None, "rigid": (0.004, 0.002), "true": 0.004}[sensor]
    env = bare(sensor=sensor, sensor_position=3.0, delay=delay, gain_limit=0.3)
    observations, infos = recorded(env)
    states = np.array([info["state"] for info in infos])
    late_1 = states[np.maximum(np.arange(STEPS + 1) - (0 if sensor == "collocated" else 4), 0)]
    late_2 = states[np.maximum(np.arange(STEPS + 1) - (2 if sensor == "rigid" else 0), 0)]
    if sensor == "true":
        expected = env.arm.position(late_1[:, : env.arm.size], 2, 3.0)
    else:
        theta1, both = late_1[:, 0], late_1[:, 0] + late_2[:, 1]
        expected = np.stack([4.5 * np.cos(theta1) + 3.0 * np.cos(both), 4.5 * np.sin(theta1) + 3.0 * np.sin(both)], 1)
    found = block(env, observations, "sensed_position")
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=4e-7)  # float32 at 7 m
    present = env.arm.position(states[:, : env.arm.size], 2, 3.0)
    assert sensor == "collocated" or np.abs(found - present).max() > 1e-3  # it is late


def test_the_reference_where_corners_fall_between_the_instants() -> None:
    """It neither overshoots the corner nor turns before it."""
    env = bare(lap_time=0.0404, gain_limit=1e-6)
    observations, _ = recorded(env)
    path = square(SquareParameters(lap_time=0.0404))
    times = CONTROL_PERIOD * np.arange(STEPS + 1)
    np.testing.assert_array_equal(block(env, observations, "reference_position"), np.float32(path.position(times)))
    np.testing.assert_array_equal(block(env, observations, "reference_velocity"), np.float32(path.velocity(times)))


def test_info_and_tips() -> None:
    env = bare(arm="default")
    observations, infos = recorded(env)
    q = np.array([info["state"][: env.arm.size] for info in infos])
    arm = FlexibleArm(env.arm.parameters)
    np.testing.assert_allclose([info["true_tip"] for info in infos], arm.tip(q), atol=1e-13)
    np.testing.assert_allclose([info["rigid_tip"] for info in infos], arm.rigid_tip(q), atol=1e-13)
    np.testing.assert_allclose([info["time"] for info in infos], CONTROL_PERIOD * np.arange(STEPS + 1), rtol=1e-12)
    path = square(SquareParameters())
    references = path.position([info["time"] for info in infos])
    np.testing.assert_allclose([info["reference"] for info in infos], references, atol=1e-14)
    sensed = [info["sensed"] for info in infos]
    np.testing.assert_array_equal(np.float32(sensed), block(env, observations, "sensed_position"))
    np.testing.assert_allclose(infos[0]["rigid_tip"], (-6.3, -6.3), atol=1e-14)
    assert not infos[0]["state"][2:].any()  # at rest, straight
    assert infos[0]["state"][1] > 0.0
    assert bare(elbow_branch="negative").reset()[1]["state"][1] < 0.0


def test_the_reward_is_of_the_true_tip_after_the_step() -> None:
    env = bare(gain_limit=2.0)
    for k in range(1, 40):
        _, reward, _, _, info = env.step(np.ones(1, np.float32))
        distance = math.dist(info["true_tip"], (-6.3, -6.3 + 3.15e-3 * k))
        wide, narrow = 0.5 * math.exp(-((distance / 0.6) ** 2)), 0.5 * math.exp(-distance / 0.15)
        assert info["reward_terms"] == pytest.approx({"tracking_wide": wide, "tracking_narrow": narrow}, rel=1e-9)
        assert reward == pytest.approx(wide + narrow, rel=1e-9)
        assert isinstance(reward, float)


def test_what_is_handed_out_is_new() -> None:
    env, twin = bare(noise=0.01), bare(noise=0.01)
    action = np.ones(1, np.float32)
    for _ in range(5):
        observation, _, _, _, info = env.step(action)
        twin.step(action)
        observation[:] = np.nan
        for value in info.values():
            if isinstance(value, np.ndarray):
                value[:] = np.nan
        info["reward_terms"].clear()
        info.clear()
    np.testing.assert_array_equal(env.step(action)[0], twin.step(action)[0])


# --- randomness ---------------------------------------------------------------------------------------------


def digest(env: gym.Env[Any, Any], steps: int = 20) -> str:
    """Of all that an episode gives out; runs in other processes too."""
    bits = hashlib.sha256()
    for k in range(steps):
        observation, reward, _, _, info = env.step(np.array([k % 3 - 1.0], np.float32))
        for part in (observation, np.float64(reward), info["state"], info["torque"]):
            bits.update(part.tobytes())
    return bits.hexdigest()


EPISODE = f"""
from __future__ import annotations
import hashlib, sys
import numpy as np
from flexarm_env.env import FlexArmEnv

{inspect.getsource(digest)}
"""
SEEDED = (
    EPISODE
    + """
env = FlexArmEnv(noise=0.02)
np.random.seed(int(sys.argv[2]))  # somebody else's business
observation, _ = env.reset(seed=int(sys.argv[1]))
print(observation.tobytes().hex(), digest(env))
"""
)
CONTINUED = (
    EPISODE
    + """
import pickle
with open(sys.argv[1], "rb") as file:
    print(digest(pickle.load(file)))
"""
)


def seeded(seed: int | None, env: FlexArmEnv | None = None) -> str:
    env = env or FlexArmEnv(noise=0.02)
    return f"{env.reset(seed=seed)[0].tobytes().hex()} {digest(env)}"


def test_a_seed_repeats_across_processes_whatever_others_seed() -> None:
    here = seeded(7)
    assert in_fresh_process(SEEDED, "7", "1") == here
    assert seeded(8) != here


def test_the_global_generator_is_neither_read_nor_moved() -> None:
    np.random.seed(0)  # noqa: NPY002  (the thing under test)
    state = np.random.get_state(legacy=False)["state"]  # noqa: NPY002
    first = seeded(7)
    moved = np.random.get_state(legacy=False)["state"]  # noqa: NPY002
    assert state["pos"] == moved["pos"]
    np.testing.assert_array_equal(state["key"], moved["key"])
    np.random.seed(1)  # noqa: NPY002
    assert seeded(7) == first


def test_without_a_seed_an_episode_has_noise_of_its_own() -> None:
    env = FlexArmEnv(noise=0.02)
    runs = [seeded(7, env), seeded(None, env), seeded(None, env)]
    assert len(set(runs)) == 3
    assert [seeded(7, env), seeded(None, env), seeded(None, env)] == runs  # the sequence repeats


def test_noise_has_the_size_it_says() -> None:
    """On the sensed position alone, fresh every period; 400 draws: the estimate's own deviation is 3.5 %."""
    noisy, clean = bare(noise=0.02, gain_limit=1e-9), bare(gain_limit=1e-9)  # too weak to move the arm
    rows = np.array([[e.step(np.ones(1, np.float32))[0] for e in (noisy, clean)] for _ in range(200)])
    difference = rows[:, 0] - rows[:, 1]
    sensed = difference[:, noisy.observation_blocks["sensed_position"]]
    assert sensed.std() == pytest.approx(0.02, rel=0.15)
    assert abs(sensed.mean()) < 0.004
    assert abs(np.corrcoef(sensed[1:, 0], sensed[:-1, 0])[0, 1]) < 0.3
    assert abs(np.corrcoef(sensed[:, 0], sensed[:, 1])[0, 1]) < 0.3
    others = np.delete(difference, np.r_[noisy.observation_blocks["sensed_position"]], axis=1)
    assert np.abs(others).max() < 1e-6


# --- episodes -----------------------------------------------------------------------------------------------


@st.composite
def options_of_any_kind(draw: st.DrawFn) -> dict[str, Any]:
    """Any valid set of options; the four kernels it needs are those of the other tests."""
    kinds = [("collocated", "delayed"), ("rigid", "delayed"), ("rigid", "current"), ("true", "delayed")]
    sensor, jacobian = draw(st.sampled_from(kinds))
    one_delay = st.floats(0.0, 0.05)
    delays = {"collocated": st.none(), "true": st.none() | one_delay}
    delay = draw(delays.get(sensor, st.none() | one_delay | st.tuples(one_delay, one_delay)))
    compensation = "none" if sensor == "collocated" else draw(st.sampled_from(["none", "shared", "per_joint"]))
    arms = ["paper", "default"] if (sensor, jacobian) in kinds[:2] else ["paper"]
    return {
        "arm": draw(st.sampled_from(arms)),
        "sensor": sensor,
        "rate_jacobian": jacobian,
        "sensor_position": draw(st.floats(0.1, 4.5)),
        "delay": delay,
        "delayed": draw(st.sampled_from(["position", "position+rate"])),
        "noise": draw(st.sampled_from([0.0, 0.01, 1.0])),
        "compensation": compensation,
        "torque_limit": draw(st.none() | st.tuples(st.floats(1.0, 1e4), st.floats(1.0, 1e4))),
        "gain_limit": draw(st.floats(0.01, 30.0)),
        "side": draw(st.floats(0.5, 12.7)),
        "lap_time": draw(st.floats(0.01, 60.0)),
        "start_corner": draw(st.sampled_from(["lower left", "upper left", "upper right", "lower right"])),
        "direction": draw(st.sampled_from(["clockwise", "counterclockwise"])),
        "elbow_branch": draw(st.sampled_from(["positive", "negative"])),
    }


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(options_of_any_kind(), st.integers(0, 2**32 - 1))
def test_no_episode_gives_anything_invalid(options: dict[str, Any], seed: int) -> None:
    env = make(**options)
    rng = np.random.default_rng(seed)
    observation, _ = env.reset(seed=seed)
    assert env.observation_space.contains(observation)
    for _ in range(40):
        action = rng.uniform(-1.5, 1.5, 1).astype(np.float32)  # now and then beyond the action space
        observation, reward, terminated, truncated, info = env.step(action)
        assert env.observation_space.contains(observation), observation
        assert 0.0 <= reward <= 1.0
        assert not truncated
        assert ("termination_reason" in info) == terminated
        assert 0.0 <= info["gain"] <= options["gain_limit"]
        if terminated:
            assert reward == 0.0
            break


def test_truncation_ends_exactly_one_lap() -> None:
    """Not the first step, not any other but the 16 000th."""
    env = make(sensor="collocated")
    env.reset(seed=0)
    action = np.ones(1, np.float32)
    for k in range(1, 16_001):
        _, _, terminated, truncated, info = env.step(action)
        assert not terminated
        assert truncated == (k == 16_000)
    assert info["time"] == pytest.approx(16.0, rel=1e-12)


STIFF = {"flexural_rigidities": (1e6, 1e6), "modal_damping_ratio": 0.01}


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"delayed": "position+rate"}, "deflection"),
        ({"delayed": "position+rate", "delay": 2e-3, "arm": STIFF}, "rate"),
        ({"sensor": "collocated", "sensor_position": 0.01, "lap_time": 1.0, "arm": STIFF}, "angle"),  # round and round
        ({"gain_limit": 1e300}, "diverged"),
    ],
    ids=["deflection", "rate", "angle", "diverged"],
)
def test_termination(options: dict[str, Any], reason: str) -> None:
    env = make(**options)
    previous, _ = env.reset(seed=0)
    for _ in range(16_000):
        observation, reward, terminated, truncated, info = env.step(np.ones(1, np.float32))
        assert env.observation_space.contains(observation)
        if terminated:
            break
        previous = observation.copy()
        observation[:] = np.nan  # the caller's own
    assert info["termination_reason"] == reason
    assert (reward, truncated) == (0.0, False)
    np.testing.assert_array_equal(observation, previous)  # the last valid one
    assert "reward_terms" not in info
    again, _ = env.reset(seed=0)  # and the next episode is like the first
    np.testing.assert_array_equal(again, make(**options).reset(seed=0)[0])
    assert not env.step(-np.ones(1, np.float32))[2]


# --- copies -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("wrapped", [True, False])
@pytest.mark.parametrize("how", ["pickle", "deepcopy"])
def test_a_copy_continues_identically(how: str, wrapped: bool) -> None:
    env: gym.Env[Any, Any] = (make if wrapped else bare)(noise=0.01, delay=(0.02, 0.007))
    env.reset(seed=3)
    digest(env, 30)
    twin = pickle.loads(pickle.dumps(env)) if how == "pickle" else copy.deepcopy(env)
    found = digest(twin, 40)
    assert digest(env, 40) == found
    assert digest(twin.unwrapped, 5) == digest(env.unwrapped, 5)


def test_a_pickle_holds_no_compiled_code_and_continues_elsewhere(tmp_path: Path) -> None:
    env = bare(noise=0.01)
    digest(env, 30)
    data = pickle.dumps(env)
    assert len(data) < 100_000
    assert b"flexarm_loop" not in data  # the kernel modules' names
    (tmp_path / "env.pickle").write_bytes(data)
    assert in_fresh_process(CONTINUED, str(tmp_path / "env.pickle")) == digest(env)
