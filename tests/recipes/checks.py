"""What is checked of a wrapped environment: each check gets it, what the bare one gave, and the actions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np

LIMIT = 5  # steps of a short episode


class Step(NamedTuple):
    """What `reset` (without reward and flags) or `step` returned."""

    observation: Any
    reward: Any
    terminated: Any
    truncated: Any
    info: dict[str, Any]


Trace = list[Step]


def trace(env: Any, actions: Sequence[Any]) -> Trace:
    """Reset with seed 3 and step; goes on after an episode's end."""
    observation, info = env.reset(seed=3)
    found = [Step(observation, 0.0, False, False, info)]
    found += [Step(*env.step(action)) for action in actions]
    return found


def same(found: Any, expected: Any) -> None:
    """Check for equal arrays."""
    np.testing.assert_array_equal(np.asarray(found), np.asarray(expected))


def observations(of: Trace) -> Any:
    """Stack a trace's observations."""
    return np.array([step.observation for step in of])


def rewards(of: Trace) -> Any:
    """Stack a trace's rewards, that of the reset left out."""
    return np.array([step.reward for step in of[1:]])


def each_observation(change: Callable[[Any], Any]) -> Callable[[Any, Trace, Any], None]:
    """Check that observations are the bare ones changed, and that they are in the space."""

    def check(env: Any, bare: Trace, actions: Any) -> None:
        found = trace(env, actions)
        same(observations(found), [change(step.observation) for step in bare])
        space = getattr(env, "observation_space", None)
        assert all(step.observation in space for step in found)

    return check


def each_reward(change: Callable[[Any], Any]) -> Callable[[Any, Trace, Any], None]:
    """Check that rewards are the bare ones changed."""

    def check(env: Any, bare: Trace, actions: Any) -> None:
        same(rewards(trace(env, actions)), change(rewards(bare)))

    return check


def each_action(change: Callable[[Any], Any]) -> Callable[[Any, Trace, Any], None]:
    """Check that changed actions give what the bare environment gives."""

    def check(env: Any, bare: Trace, actions: Any) -> None:
        same(observations(trace(env, change(actions))), observations(bare))

    return check


def ends_by_time(env: Any, bare: Trace, actions: Any) -> None:
    found = trace(env, actions[:LIMIT])
    assert [step.truncated for step in found] == [False] * LIMIT + [True]
    same(observations(found), observations(bare[: LIMIT + 1]))


def counts(env: Any, bare: Trace, actions: Any) -> None:
    last = trace(env, actions[:LIMIT])[-1].info["episode"]
    np.testing.assert_allclose(last["r"], rewards(bare)[:LIMIT].sum(axis=0), rtol=1e-6)
    same(last["l"], np.full(np.shape(last["l"]), LIMIT))


def normalises(env: Any, bare: Trace, actions: Any) -> None:
    found = observations(trace(env, actions))
    assert found.shape == observations(bare).shape
    assert np.isfinite(found).all()
    assert np.abs(found).max() < 10.0


def rescales(env: Any, bare: Trace, actions: Any) -> None:
    found, space = observations(trace(env, actions)), env.observation_space
    np.testing.assert_array_equal(space.low, np.zeros_like(space.low))
    assert (found >= 0.0).all()
    assert (found <= 1.0).all()
    assert np.ptp(found, axis=0).max() > 0.0


def normalises_rewards(env: Any, bare: Trace, actions: Any) -> None:
    found = rewards(trace(env, actions))
    assert np.isfinite(found).all()
    assert (found != rewards(bare)).any()


def stacks(env: Any, bare: Trace, actions: Any) -> None:
    found, plain = observations(trace(env, actions)), observations(bare)
    same(found[:, -1], plain)
    same(found[2:, 0], plain[:-2])


def flattens(env: Any, bare: Trace, actions: Any) -> None:
    found, plain = observations(trace(env, actions)), observations(bare)
    same(found[2:, -plain.shape[1] :], plain[2:])


def delays(env: Any, bare: Trace, actions: Any) -> None:
    found, plain = observations(trace(env, actions)), observations(bare)
    same(found[:2], np.zeros_like(plain[:2]))
    same(found[2:], plain[:-2])


def knows_time(env: Any, bare: Trace, actions: Any) -> None:
    found = observations(trace(env, actions))
    same(found[:, :-1], observations(bare))
    assert (np.diff(found[:, -1]) > 0.0).all()


def insists_on_a_reset(env: Any, bare: Trace, actions: Any) -> None:
    try:
        env.step(actions[0])
    except gym.error.ResetNeeded:
        same(observations(trace(env, actions)), observations(bare))
    else:
        raise AssertionError("a step before the reset went through")


def resets_itself(env: Any, bare: Trace, actions: Any) -> None:
    found = trace(env, [*actions[:LIMIT], actions[0], actions[1]])
    assert found[LIMIT].truncated
    assert found[LIMIT + 1].info["time"] == found[0].info["time"] == 0.0
    assert found[LIMIT + 2].info["time"] > 0.0


def sticks(env: Any, bare: Trace, actions: Any) -> None:
    found = trace(env, actions)
    same(observations(found)[:2], observations(bare)[:2])
    assert (observations(found)[3] != observations(bare)[3]).any()


def repeats(env: Any, bare: Trace, actions: Any) -> None:
    found = env.reset(seed=3), env.step(actions[0])
    env.reset(seed=3)
    assert found[1][-1]["time"] == 4 * bare[1].info["time"]


def repeats_and_adds(env: Any, bare: Trace, actions: Any) -> None:
    again = trace(env.unwrapped, [actions[0]] * 4)
    env.reset(seed=3)
    found = Step(*env.step(actions[0]))
    same(found.observation, again[-1].observation)
    np.testing.assert_allclose(found.reward, rewards(again).sum(), rtol=1e-6)


def bins(env: Any, bare: Trace, actions: Any) -> None:
    found, space, own = observations(trace(env, actions)), env.observation_space, env.unwrapped.observation_space
    assert all(one in space for one in found)
    same(space.nvec, np.full(own.shape, 9))
    edges = np.linspace(own.low, own.high, 10)[1:-1]  # of the bins of each number
    same(found, (observations(bare)[:, None] >= edges).sum(axis=1))


def discretises(env: Any, bare: Trace, actions: Any) -> None:
    assert env.action_space.n == 25
    found = trace(env, [12] * 3)  # the middle: no torque
    np.testing.assert_allclose(found[-1].info["torque"], 0.0, atol=1e-5)


def draws(env: Any, bare: Trace, actions: Any) -> None:
    observation, _ = env.reset(seed=3)
    assert observation.dtype == np.uint8
    assert observation.shape[2] == 3


def collects(env: Any, bare: Trace, actions: Any) -> None:
    trace(env, actions[:3])
    assert len(env.render()) == 4


def films(env: Any, bare: Trace, actions: Any) -> None:
    trace(env, actions[:LIMIT])
    env.close()
    assert [path.stat().st_size > 0 for path in Path("films").glob("*.mp4")] == [True]


def counts_in_batch(env: Any, bare: Trace, actions: Any) -> None:
    last = trace(env, actions[:LIMIT])[-1].info["episode"]
    np.testing.assert_allclose(last["r"], rewards(bare)[:LIMIT].sum(axis=0), rtol=1e-6)
    same(last["l"], np.full(3, LIMIT))


def lists(env: Any, bare: Trace, actions: Any) -> None:
    _, infos = env.reset(seed=3)
    assert [info["tip_error"] for info in infos] == bare[0].info["tip_error"].tolist()
