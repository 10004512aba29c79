"""Whatever the options and actions: observations within their space, rewards within their range, no exception."""

from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from flexarm_env import end_reason
from tests.support.envs import (
    BY_THE_CLOCK,
    CASE_NAMES,
    CASES,
    EVERYWHERE,
    PAPER,
    RANDOM,
    RESIDUAL,
    SQUARE,
    WAYPOINTS,
    make,
    terms_of,
)
from tests.support.plain import KERNELS, run_plainly

POLICIES = ("random", "bang-bang", "spin", "none")


def actions_of(policy: str, shape: tuple[int, ...], steps: int, seed: int) -> np.ndarray:
    """Make the worst actions: full torques that change at random, or never, beyond the range now and then."""
    rng = np.random.default_rng(seed)
    if policy == "random":
        return rng.uniform(-1.5, 1.5, (steps, *shape)).astype(np.float32)
    if policy == "bang-bang":
        return np.repeat(rng.choice([-1.0, 1.0], (steps // 3 + 1, *shape)), 3, axis=0)[:steps]
    return np.full((steps, *shape), 1.0 if policy == "spin" else 0.0, np.float32)


def play(env: Any, policy: str, steps: int, seed: int) -> str | None:
    """Episodes until so many steps are done; returns why the last one that ended did."""
    largest = sum(env.unwrapped.settings.reward_weights.values()) * (1.0 + 1e-9)
    observation, _ = env.reset(seed=seed)
    assert env.observation_space.contains(observation)
    reason = None
    for action in actions_of(policy, env.action_space.shape, steps, seed):
        observation, reward, terminated, truncated, info = env.step(action)
        assert env.observation_space.contains(observation), observation
        assert 0.0 <= reward <= largest
        assert sum(terms_of(info).values()) == pytest.approx(reward, rel=1e-12, abs=1e-12)
        assert min(terms_of(info).values()) >= 0.0
        assert (info["end_code"] != 0.0) == terminated
        if terminated or truncated:
            reason = end_reason(info["end_code"]) if terminated else reason
            observation, _ = env.reset()
            assert env.observation_space.contains(observation)
    return reason


@pytest.mark.parametrize(("env_id", "options"), CASES, ids=CASE_NAMES)
@pytest.mark.parametrize("kernels", KERNELS, indirect=True)
def test_no_policy_leaves_the_bounds(env_id: str, options: dict[str, Any], kernels: str) -> None:
    """In plain Python a policy for each case, compiled all of them, and for longer."""
    if kernels == "plain":
        play(make(env_id, max_episode_steps=25, **options), POLICIES[CASES.index((env_id, options)) % 4], 30, seed=4)
    else:
        for policy in POLICIES:
            play(make(env_id, max_episode_steps=150, **options), policy, 200, seed=4)


@pytest.mark.parametrize("policy", POLICIES)
def test_no_policy_leaves_the_bounds_for_long(policy: str) -> None:
    """On the kernels of other tests."""
    for env_id, options in ((SQUARE, {}), (SQUARE, RANDOM), (RESIDUAL, {}), (PAPER, {})):
        play(make(env_id, max_episode_steps=150, **options), policy, 200, seed=4)


def times(most: float) -> st.SearchStrategy[float]:
    return st.sampled_from([0.0, 1e-9, 1e-3, most]) | st.floats(0.0, most)


def with_effect(options: dict[str, Any]) -> dict[str, Any]:
    """Without what nothing would read, and with what goes together: the rest is refused, which other tests see to."""
    period, moves = options["control_period"], options["reference"] == "moves"
    idle = [name for name in ("previews", "last_actions") if name not in options["observation"]]
    idle += [] if options["start"] in ("moving", "mix") else ["start_spread"]
    idle += ["side", "start_corner", "direction"] if options["reference"] in ("moves", "waypoints") else []
    if options["action_mode"] == "reference":
        options["actuation_delay"] = round(options["actuation_delay"] / period) * period
    if moves or options["start"] in ("moving", "mix"):  # joints that can follow
        options["lap_time"] = max(options["lap_time"], 40.0 * period, 4.0)
    return {name: value for name, value in options.items() if name not in idle}


@st.composite
def options_of_any_kind(draw: st.DrawFn) -> dict[str, Any]:
    mode = draw(st.sampled_from(["torque", "residual", "reference", "gain", "paper"]))
    period = draw(st.sampled_from([1e-3, 0.01, 0.0137, 0.05]))
    options: dict[str, Any] = {
        "control_period": period,
        "noise": draw(st.sampled_from([0.0, 0.01, 1.0])),
        "encoder_noise": draw(st.sampled_from([(0.0, 0.0), (1e-3, 0.0), (0.1, 10.0)])),
        "actuation_delay": draw(times(0.1)),
        "delay": draw(st.none() | times(0.3)),
        "sensor_position": draw(st.floats(0.1, 4.5)),
        "observation": draw(st.permutations(EVERYWHERE))[: draw(st.integers(1, len(EVERYWHERE)))],
        "frame": draw(st.sampled_from(["link", "world"])),
        "scaled": draw(st.booleans()),
        "previews": draw(st.lists(st.floats(1e-6, 50.0), min_size=1, max_size=3)),
        "last_actions": draw(st.integers(1, 9)),
        "side": draw(st.floats(0.5, 12.7)),
        "lap_time": draw(st.floats(0.05, 60.0)),
        "start": draw(st.sampled_from(["corner", "corners", "moving", "mix"])),
        "start_corner": draw(st.sampled_from(["lower left", "upper left", "upper right", "lower right"])),
        "direction": draw(st.sampled_from(["clockwise", "counterclockwise"])),
        "elbow_branch": draw(st.sampled_from(["positive", "negative"])),
        "start_spread": draw(st.tuples(st.floats(0.0, 0.5), st.floats(0.0, 0.5))),
        "reward_weights": draw(st.dictionaries(st.sampled_from(BY_THE_CLOCK), st.floats(0.01, 10.0), min_size=1)),
        "deflection_limit": draw(st.none() | st.floats(0.1, 5.0)),
        "error_limit": draw(st.none() | st.floats(0.1, 20.0)),
    }
    reference = draw(st.sampled_from(["square", "circle", "line", "figure_eight", "waypoints", "moves", "several"]))
    options["reference"] = ["line", "circle"] if reference == "several" else reference
    if reference == "waypoints":
        options["waypoints"] = WAYPOINTS
    if draw(st.booleans()):
        options["randomisation"] = {"payload_mass": (0.0, 1.0), "stiffness": (0.5, 1.5), "damping": (0.0, 0.1)}
    if mode == "paper":
        return with_effect(
            options | {"action_mode": "gain", "arm": "paper", "sensor": "rigid", "feedback_source": "sensor"}
        )
    options |= {
        "jitter": draw(times(0.1)),
        "sensor_period": draw(st.just(0.0) | st.floats(1e-5, 0.2)),  # at most `MOST_TICKS` of them are searched for
        "dropout": draw(st.sampled_from([0.0, 0.5, 1.0])),
    }
    return with_effect(options | {"action_mode": mode})


@settings(max_examples=25, suppress_health_check=list(HealthCheck))
@given(options_of_any_kind(), st.sampled_from(POLICIES), st.integers(0, 2**32 - 1))
def test_no_options_leave_the_bounds(options: dict[str, Any], policy: str, seed: int) -> None:
    with pytest.MonkeyPatch.context() as patch:
        run_plainly(patch)
        play(make(max_episode_steps=8, **options), policy, 10, seed)


@pytest.mark.slow
@settings(max_examples=100, suppress_health_check=list(HealthCheck))
@given(options_of_any_kind(), st.sampled_from(POLICIES), st.integers(0, 2**32 - 1))
def test_no_options_leave_the_bounds_for_long(options: dict[str, Any], policy: str, seed: int) -> None:
    play(make(max_episode_steps=50, **options), policy, 60, seed)
