"""Runs policies and records what happened, in one environment or in a batch.

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
from numpy.typing import NDArray

from flexarm_env.envs.registration import warn_of_short_limit
from flexarm_env.envs.single import FlexArmEnv
from flexarm_env.envs.termination import end_reason
from flexarm_env.envs.vector import FlexArmVectorEnv
from flexarm_env.laps import LAPS
from flexarm_env.parameters import EITHER
from flexarm_env.predictor import predictor
from flexarm_env.simulation.arm import FlexibleArm
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
        TypeError, ValueError: for other steps, another lap, or a lap beside options; also if the policy's action 1
            means another gain than the environment's.
    """
    inner = getattr(env, "unwrapped", env)
    if not isinstance(inner, FlexArmEnv):
        raise TypeError(f"env = {shown(env)}: must be a FlexArmEnv, wrapped or not")
    options = _start(inner, options, lap)
    limit = None if max_steps is None else integer("max_steps", max_steps, 1)
    predict = predictor(policy, deterministic)
    _check_gain_limit(inner, policy)
    if limit is None and (env.spec is None or env.spec.max_episode_steps is None):
        limit = inner.lap_steps
    if limit is None and env.spec is not None:
        warn_of_short_limit(env.spec, env.spec.max_episode_steps, inner.lap_steps)
    observation, info = env.reset(seed=seed, options=options)
    arm = _episode_arm(inner.arm, inner.episode.parameters)
    rows = [_row(info, reward=0.0)]
    memory, start, ended = None, np.ones(1, dtype=bool), None
    while ended is None:
        action, memory = predict(observation, memory, start)
        start = np.zeros(1, dtype=bool)
        observation, reward, terminated, truncated, info = env.step(action)
        row = _row(info, float(reward))
        rows[-1].update({name: row[name] for name in _SIGNALS if name in row})  # it began at the instant recorded last
        if terminated:
            ended = end_reason(info["end_code"])
            break  # the last state is not one: the record ends before it
        rows.append(row)
        ended = "truncated" if truncated or len(rows) - 1 == limit else None
    return _recorded(arm, {name: np.array([row[name] for row in rows]) for name in rows[0]}, ended)


def _start(env: FlexArmEnv | FlexArmVectorEnv, options: dict[str, Any] | None, lap: str | None) -> dict[str, Any]:
    if lap is None:
        return {"start": "corner"} if options is None else options
    if options is not None:
        raise ValueError(f"lap = {shown(lap)} beside options = {shown(options)}: give one of them; a lap sets options")
    named, directions = LAPS[choice("lap", lap, LAPS)], [one.direction for one in env.simulator.each]
    each = [named.reset_options(direction) for direction in directions]
    if len(set(directions)) == 1:
        return each[0]
    found = {"start": "corner", "elbow_branch": [one["elbow_branch"] for one in each]}
    if EITHER in directions:  # where a lap has a direction of its own
        found["direction"] = [one.get("direction", own) for one, own in zip(each, directions, strict=True)]
    return found


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


def _episode_arm(arm: FlexibleArm, drawn: dict[str, Any]) -> FlexibleArm:
    """Return the arm of an episode, some of whose parameters may have been drawn."""
    own = arm.parameters
    found = replace(own, damping_ratio=drawn["damping"], **{name: x for name, x in drawn.items() if hasattr(own, name)})
    if drawn["stiffness"] != 1.0:
        rigidities = tuple(drawn["stiffness"] * x for x in found.flexural_rigidities)
        found = replace(found, flexural_rigidities=rigidities)
    return arm if found == own else FlexibleArm(found)


_MEASURED = ("time", "state", "true_tip", "reference", "sensed")  # of infos, at an instant
_SIGNALS = ("torque", "gain")  # of infos, over the period that ended


def _row(info: dict[str, Any], reward: Any) -> dict[str, Any]:
    return {name: info[name] for name in (*_MEASURED, *_SIGNALS) if name in info} | {"reward": reward}


def _of_the_step(infos: dict[str, Any], ended: NDArray[np.bool_]) -> dict[str, Any]:
    """Return what the step has led to, also where a batch has begun the next episode in it ("SameStep")."""
    if "final_info" not in infos:
        return infos
    found, last = {}, infos["final_info"]
    for name in (*_MEASURED, *_SIGNALS, "end_code"):
        if name in infos:
            mask = ended.reshape(-1, *[1] * (infos[name].ndim - 1))
            found[name] = np.where(mask, last[name], infos[name])
    return found


def run_batch(
    envs: FlexArmVectorEnv,
    policies: Sequence[Any],
    seed: int | None = None,
    max_steps: int | None = None,
    options: dict[str, Any] | None = None,
    lap: str | None = None,
) -> list[Trajectory]:
    """Run one episode of each environment of a batch, by default from rest on the first corner.

    Args:
        envs: a `FlexArmVectorEnv`, which begins new episodes by itself (any `autoreset_mode` but "Disabled").
        policies: one for each environment, as `run_policy` takes them, but from observations of shape (n, k) to
            actions of shape (n, channels); environments that share an object are predicted in one call. The action 1
            means what it means in the environment, whatever the policy was made for.
        seed: see `run_policy`.
        max_steps: stop after so many; None: after a lap.
        options: see `run_policy`.
        lap: see `run_policy`.

    Returns:
        A `Trajectory` for each environment, as `run_policy` returns it; where an episode ends, its record does, and the
        others go on.

    Raises:
        TypeError, ValueError: for another batch, another number of policies, a policy that cannot be called, or a lap
            beside options.
    """
    if not isinstance(envs, FlexArmVectorEnv):
        raise TypeError(f"envs = {shown(envs)}: must be a FlexArmVectorEnv")
    steps = envs.lap_steps if max_steps is None else integer("max_steps", max_steps, 1)
    choose = _chooser(policies, envs)
    observation, infos = envs.reset(seed=seed, options=_start(envs, options, lap))
    arms = [_episode_arm(one.flexible_arm, envs.episode.one(i).parameters) for i, one in enumerate(envs.simulator.each)]
    rows = _row(infos, np.zeros(envs.num_envs))
    records = {name: np.array([values] * (steps + 1)) for name, values in rows.items()}
    ended: list[str | None] = [None] * envs.num_envs
    kept = np.full(envs.num_envs, steps + 1)  # instants of each record
    for done in range(1, steps + 1):
        observation, rewards, terminated, truncated, infos = envs.step(choose(observation))
        infos = _of_the_step(infos, terminated | truncated)
        for name, values in _row(infos, rewards).items():
            records[name][done] = values
            if name in _SIGNALS:
                records[name][done - 1] = values  # they began at the instant before
        for i in np.flatnonzero((terminated | truncated) & (kept > steps)).tolist():
            ended[i] = end_reason(infos["end_code"][i]) if terminated[i] else "truncated"
            kept[i] = done if terminated[i] else done + 1  # the last state of a terminated episode is not one
        if None not in ended:
            break
    return [
        _recorded(arm, {name: values[:count, i].copy() for name, values in records.items()}, reason or "truncated")
        for i, (arm, count, reason) in enumerate(zip(arms, kept.tolist(), ended, strict=True))
    ]


def _recorded(arm: FlexibleArm, arrays: dict[str, Array], ended: str) -> Trajectory:
    measured = arrays.pop("true_tip")  # that of another engine's arm does not follow from the state of our model
    return replace(arm.record(**arrays, notes={"ended": ended}), tip=measured)


def _chooser(policies: Sequence[Any], envs: FlexArmVectorEnv) -> Callable[[Observations], Observations]:
    """Return a function from observations to actions; each policy acts for its environments. Shape (N, ...) each."""
    count = envs.num_envs
    if len(policies) != count:
        raise ValueError(f"policies: must be {count}, one for each environment, got {len(policies)}")
    places: dict[int, list[int]] = {}
    for index, policy in enumerate(policies):
        places.setdefault(id(policy), []).append(index)
    groups = [(predictor(policies[own[0]], deterministic=True), np.array(own)) for own in places.values()]
    memories: list[Any] = [None] * len(groups)
    start = np.ones(count, dtype=bool)
    actions = np.zeros(envs.action_space.shape or (), dtype=np.float32)

    def choose(observation: Observations) -> Observations:
        for k, (predict, members) in enumerate(groups):
            actions[members], memories[k] = predict(observation[members], memories[k], start[members])
        start[:] = False
        return actions

    return choose
