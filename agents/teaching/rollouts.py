"""Rollouts: laps that student and teacher drive in turns, with what the teacher would have done in each period."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexarm_agents.policies.network import NetworkPolicy
from flexarm_agents.teaching.config import DAggerConfig
from flexarm_agents.teaching.teacher import Pupils, Teacher
from flexarm_env.envs.vector import FlexArmVectorEnv
from flexarm_env.laps import LAPS

Array = NDArray[np.float32]
TURNS = 50  # [control periods] after which student and teacher are drawn anew
BRANCHES = [lap.elbow_branch for lap in LAPS.values()]


class Rollout(NamedTuple):
    """Samples of n arms over T control periods, one period after the other."""

    observations: Array  # Shape (T * n, k)
    ages: NDArray[np.int64]  # control periods since the arm's episode began. Shape (T * n,)
    answers: Array  # what the teacher would have done. Shape (T * n, 2)
    weights: Array  # of the samples in the fit. Shape (T * n,)
    lost: int  # episodes that ended early


def run_rollout(
    env: FlexArmVectorEnv, teacher: Teacher, student: NetworkPolicy | None, config: DAggerConfig, number: int
) -> Rollout:
    """Run a lap on every arm of a batch that starts on the first corner; the result depends on the arguments alone.

    Without a student, which drives a share of the time in later rounds (`number`), the teacher drives alone.
    """
    random = np.random.default_rng([config.seed, number])
    count = config.arms
    seeds: Sequence[int] = random.integers(2**31, size=count).tolist()
    branches = [BRANCHES[i % len(BRANCHES)] for i in range(count)]
    observations, infos = env.reset(seed=seeds, options={"elbow_branch": branches})
    noise = config.torque_noise * random.uniform(size=(count, 1))
    share = teacher_share(config, number)
    begun, age, pupils = np.ones(count, dtype=bool), np.zeros(count, dtype=np.int64), _pupils(env)
    state, drives, lost = None, np.ones(count, dtype=bool), 0
    rows: list[tuple[Array, NDArray[np.int64], Array, Array]] = []
    for period in range(teacher.periods):
        answers, feedback = teacher.actions(pupils, age, infos["state"])
        weight = 1.0 / (1.0 + np.sum(feedback**2, axis=1) / config.knee**2)
        rows.append((observations, age.copy(), answers, weight.astype(np.float32)))
        chosen = answers
        if student is not None:
            if period % TURNS == 0:
                drives = random.uniform(size=count) < share
            own, state = student.predict(observations, state, begun, deterministic=True)
            chosen = np.where(drives[:, None], answers, own)
        disturbed = chosen + noise * random.normal(size=answers.shape)
        observations, _, terminated, truncated, infos = env.step(disturbed.astype(np.float32))
        begun = terminated | truncated
        age = np.where(begun, 0, age + 1)
        lost += int(terminated.sum())
        if begun.any():
            pupils = _pupils(env)
    observations, ages, answers, weights = (np.concatenate(column) for column in zip(*rows, strict=True))
    return Rollout(observations, ages, answers, weights, lost)


def teacher_share(config: DAggerConfig, number: int) -> float:
    """Return the share of the time in which the teacher drives: 1 in the first round, less in each one after it."""
    half = max(config.rounds // 2, 1)
    return 1.0 + (config.teacher_share - 1.0) * min(number / half, 1.0)


def _pupils(env: FlexArmVectorEnv) -> Pupils:
    episode = env.episode
    lap = np.array([BRANCHES.index(branch) for branch in episode.elbow_branch.tolist()])
    return Pupils(lap, episode.parameters)
