"""Runs policies and records what happened: one environment, or a batch of closed loops.

A controller on the plain lap, for two seconds of it:

    >>> import gymnasium
    >>> from flexarm_baselines.registry import controller, make_controller
    >>> env = gymnasium.make("flexarm_env:FlexArm/Square-v0", **controller("ifdc").options)
    >>> run = run_policy(env, make_controller("ifdc", env), lap="plain", max_steps=200)
    >>> len(run), round(float(run.time[-1]), 2), run.tip.shape
    (201, 2.0, (201, 2))
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexarm_env.actions import gain_from_action
from flexarm_env.envs.registration import warn_of_short_limit
from flexarm_env.envs.single import FlexArmEnv
from flexarm_env.envs.termination import end_reason
from flexarm_env.episode import reward
from flexarm_env.laps import LAPS
from flexarm_env.predictor import predictor
from flexarm_env.simulation.arm import FlexibleArm
from flexarm_env.simulation.closed_loop import ClosedLoop, Results, observation_blocks
from flexarm_env.simulation.trajectory import Trajectory
from flexarm_env.validation import choice, integer, shown

Array = NDArray[np.float64]
Observations = NDArray[np.float32]


def run_policy(
    env: gymnasium.Env[Any, Any],
    policy: Any,
    seed: int | None = None,
    deterministic: bool = True,
    max_steps: int | None = None,
    options: dict[str, Any] | None = None,
    lap: str | None = None,
) -> Trajectory:
    """Run one episode of a FlexArm environment, by default from rest on the first corner.

    Args:
        env: a `FlexArmEnv`, wrapped or not.
        policy: an object with ``predict(observation)`` or stable-baselines3's ``predict``, or a function from an
            observation to an action.
        seed: for the environment's reset.
        deterministic: passed to a ``predict`` that takes it.
        max_steps: stop after so many; None: at the end of the episode, or of a lap where the environment has no
            time limit.
        options: options of the environment's reset; default ``{"start": "corner"}``, with the side of the elbow that
            the environment has or draws.
        lap: instead of options, "swing" or "plain": one of the two standard laps (`flexarm_env.laps.LAPS`).

    Returns:
        The episode; `notes["ended"]` says why: "truncated" or a termination reason.

    Raises:
        TypeError: if the environment is not a `FlexArmEnv` underneath, or the policy cannot be called so.
        ValueError: if the policy's action 1 means another gain than the environment's, for another lap, or for a lap
            beside options.
    """
    inner = getattr(env, "unwrapped", env)
    if not isinstance(inner, FlexArmEnv):
        raise TypeError(f"env = {shown(env)}: must be a FlexArmEnv, wrapped or not")
    options = _start(inner, options, lap)
    predict = predictor(policy, deterministic)
    _check_gain_limit(inner, policy)
    if max_steps is None and (env.spec is None or env.spec.max_episode_steps is None):
        max_steps = inner.lap_steps
    if max_steps is None and env.spec is not None:
        warn_of_short_limit(env.spec, env.spec.max_episode_steps, inner.lap_steps)
    observation, info = env.reset(seed=seed, options=options)
    arm = _episode_arm(inner, inner.episode.parameters)
    signals = ("gain", "torque") if "gain" in info else ("torque",)
    rows = [_row(info, reward=0.0)]
    memory, start, ended = None, np.ones(1, dtype=bool), None
    while ended is None:
        action, memory = predict(observation, memory, start)
        start = np.zeros(1, dtype=bool)
        observation, reward, terminated, truncated, info = env.step(action)
        # of the period that began at the instant recorded last
        rows[-1].update({name: info[name] for name in signals})
        if terminated:
            ended = end_reason(info["end_code"])
            break  # the last state is not one: the record ends before it
        rows.append(_row(info, float(reward)))
        ended = "truncated" if truncated or len(rows) - 1 == max_steps else None
    if len(rows) > 1 and ended == "truncated":
        rows[-1].update({name: rows[-2][name] for name in signals})
    arrays = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    measured = arrays.pop("true_tip")  # of another engine's arm no model's state tells it
    return replace(arm.record(**arrays, notes={"ended": ended}), tip=measured)


def _start(env: FlexArmEnv, options: dict[str, Any] | None, lap: str | None) -> dict[str, Any]:
    """Return the options of the reset that begins the episode."""
    if lap is None:
        return {"start": "corner"} if options is None else options
    if options is not None:
        raise ValueError(f"lap = {shown(lap)} beside options = {shown(options)}: give one of them; a lap sets options")
    return LAPS[choice("lap", lap, LAPS)].reset_options(env.settings.direction)


def _check_gain_limit(env: FlexArmEnv, policy: Any) -> None:
    limit = getattr(policy, "gain_limit", None)
    if limit is None:
        return
    if env.settings.mode.limit != "gain_limit":
        raise ValueError(f"policy commands a gain; the environment's action is {env.settings.action_mode!r}")
    if limit != env.gain_limit:
        raise ValueError(
            f"policy.gain_limit = {limit}: must be the environment's, {env.gain_limit}; its actions mean other gains"
        )


def _episode_arm(env: FlexArmEnv, drawn: dict[str, float]) -> FlexibleArm:
    """Return the arm of an episode, whose payload, stiffness and damping may have been drawn."""
    own = env.arm.parameters
    changes: dict[str, Any] = {}
    if drawn["payload_mass"] != own.payload_mass:
        changes["payload_mass"] = drawn["payload_mass"]
    if drawn["stiffness"] != 1.0:
        changes["flexural_rigidities"] = tuple(drawn["stiffness"] * x for x in own.flexural_rigidities)
    if drawn["damping"] != own.damping_ratio:
        changes["damping_ratio"] = drawn["damping"]
    return FlexibleArm(replace(own, **changes)) if changes else env.arm


def _row(info: dict[str, Any], reward: float) -> dict[str, Any]:
    return {name: info[name] for name in ("time", "state", "true_tip", "reference", "sensed")} | {"reward": reward}


def run_batch(
    loop: ClosedLoop,
    states: ArrayLike,
    policies: Sequence[Any],
    gain_limits: ArrayLike,
    steps: int,
    progress: Callable[[int], Any] | None = None,
    seed: int | None = None,
) -> list[Trajectory]:
    """Run a policy on every arm of a batch.

    What a policy sees and does is what it would in `FlexArmEnv`: float32 observations, actions clipped to [-1, 1].

    Args:
        loop: the batch, of N arms.
        states: where they start. Shape (N, 4 + 4 m).
        policies: one for each arm, as `run_policy` takes them, but from observations of shape (n, k) to actions of
            shape (n, 1); arms that share an object are predicted in one call.
        gain_limits: lambda at action 1. Shape (N,).
        steps: control periods.
        progress: called with the number of control periods done since the last call.
        seed: seed of the sensors' noise, where they have any.

    Returns:
        A `Trajectory` for each arm, `notes["ended"]` as in `run_policy`; an arm whose state stops being valid ends
        there, the others go on.
    """
    steps = integer("steps", steps, 1)
    count = len(loop)
    choose = _chooser(policies, count)
    limits = _gain_limits(gain_limits, count)
    noise = _noise(loop, seed)
    observed = observation_blocks(loop.arm.parameters.modes_per_link)["reference_velocity"].stop
    ends = np.full(count, steps + 1)
    live: slice | NDArray[np.int64] = slice(None)  # arms that go on; one that ended keeps its last valid observation
    loop.reset(states, noise())
    first = loop.packed_results()
    records = np.zeros((steps + 1, *first.shape))
    gains = np.zeros((steps + 1, count))
    records[0], done = first, 0
    observation = np.zeros((count, observed), dtype=np.float32)
    while done < steps and ends.max() > steps:
        observation[live] = loop.observations(records[done])[live]
        gains[done, live] = gain_from_action(choose(observation).clip(-1.0, 1.0), limits)[live]
        loop.advance(gains[done], noise())
        done += 1
        records[done] = loop.packed_results()
        if records[done, live, -1].any():
            ends[(records[done, :, -1] != 0.0) & (ends > steps)] = done
            live = np.flatnonzero(ends > steps)
        if progress is not None:
            progress(1)
    gains[done] = gains[done - 1]
    return _trajectories(loop, loop.unpack(records[: done + 1]), gains, ends)


def _gain_limits(given: ArrayLike, count: int) -> Array:
    """Return lambda at action 1, of each arm. Shape (N,)."""
    if np.shape(given) not in ((), (count,)):
        raise ValueError(f"gain_limits: must be one number or {count}, got shape {np.shape(given)}")
    return np.broadcast_to(np.asarray(given, dtype=float), (count,))


def _chooser(policies: Sequence[Any], count: int) -> Callable[[Observations], Observations]:
    """Let each policy choose for its arms, with a memory: actions, Shape (N,), from observations, Shape (N, k)."""
    if len(policies) != count:
        raise ValueError(f"policies: must be {count}, one for each arm, got {len(policies)}")
    groups = [(predictor(policy, deterministic=True), members) for policy, members in _groups(policies)]
    memories: list[Any] = [None] * len(groups)
    start = np.ones(count, dtype=bool)
    actions = np.zeros(count, dtype=np.float32)

    def choose(observation: Observations) -> Observations:
        for k, (predict, members) in enumerate(groups):
            action, memories[k] = predict(observation[members], memories[k], start[members])
            actions[members] = action[:, 0]
        start[:] = False
        return actions

    return choose


def _noise(loop: ClosedLoop, seed: int | None) -> Callable[[], Array | None]:
    """Draw the sensors' noise of one period; draw nothing where no sensor has any."""
    deviations = loop.noise
    if not deviations.any():
        return lambda: None
    random = np.random.default_rng(seed)
    return lambda: deviations[:, None] * random.normal(size=(len(deviations), 2))


def _groups(policies: Sequence[Any]) -> list[tuple[Any, slice | NDArray[np.int64]]]:
    """Return the policies and the arms of each; neighbours are a slice, which is cheaper to index with."""
    members: dict[int, list[int]] = {}
    for index, policy in enumerate(policies):
        members.setdefault(id(policy), []).append(index)
    return [
        (
            policies[found[0]],
            slice(found[0], found[-1] + 1) if found[-1] - found[0] + 1 == len(found) else np.array(found),
        )
        for found in members.values()
    ]


def _trajectories(loop: ClosedLoop, results: Results, gains: Array, ends: NDArray[Any]) -> list[Trajectory]:
    instants = len(results.status)
    time = loop.control_period * np.arange(instants, dtype=np.float64)
    blocks = observation_blocks(loop.arm.parameters.modes_per_link)
    trajectories = []
    for i in range(len(loop)):
        end = int(ends[i])
        keep = slice(0, min(end, instants))
        observation = results.observation[keep, i]
        earned = _paper_reward(results.true_tip[keep, i], observation[:, blocks["reference_position"]])
        run = loop.arm.record(
            time[keep],
            results.state[keep, i],
            # known only once the period has begun, so one instant late
            np.concatenate([results.torque[1:, i], results.torque[-1:, i]])[keep],
            reference=observation[:, blocks["reference_position"]],
            sensed=observation[:, blocks["sensed_position"]],
            gain=gains[keep, i],
            reward=earned,
            notes={"ended": loop.failure(results.status[end, i]) if end < instants else "truncated"},
        )
        trajectories.append(replace(run, tip=results.true_tip[keep, i].copy()))
    return trajectories


def _paper_reward(tips: Array, references: Array) -> Array:
    """Return the reward of `FlexArm/Paper-v0` at each instant; none at the first. Shape (n,)."""
    wide, middle, _ = reward.tracking_terms(reward.squared_distance([*tips.T], [*references.T]))
    earned: Array = 0.5 * wide + 0.5 * middle
    earned[0] = 0.0
    return earned
