"""Rollouts: laps that student and teacher drive in turns, with what the teacher would have done in each period."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexarm_agents.policies.network import NetworkPolicy
from flexarm_agents.teaching.config import DAggerConfig
from flexarm_agents.teaching.teacher import Teacher
from flexarm_env.envs.vector import FlexArmVectorEnv

Array = NDArray[np.float32]
TURNS = 50  # [control periods] after which student and teacher are drawn anew
RESCUE = 1.0  # correction by the teacher's feedback, as a share of the limits, at which it takes over an arm


class Rollout(NamedTuple):
    """Samples of n arms over T control periods, one period after the other."""

    observations: Array  # Shape (T * n, k)
    ages: NDArray[np.int64]  # control periods since the arm's episode began. Shape (T * n,)
    answers: Array  # what the teacher would have done. Shape (T * n, 2)
    weights: Array  # of the samples in the fit. Shape (T * n,)
    lost: int  # episodes that ended early, of those with a plan


def run_rollout(
    env: FlexArmVectorEnv, teacher: Teacher, student: NetworkPolicy | None, config: DAggerConfig, number: int
) -> Rollout:
    """Run a lap on every arm of a batch that starts on the first corner; the result depends on the arguments alone.

    Args:
        env: the batch.
        teacher: answers in each period, and drives a share of the time (`teacher_share`).
        student: drives the rest of the time; None: the teacher drives alone.
        config: seed, disturbance, shares and weights.
        number: of the round, from 0.
    """
    random = np.random.default_rng([config.seed, number])
    count = config.arms
    observations, infos = teacher.begin(env, random)
    noise = config.torque_noise * random.uniform(size=(count, 1))
    share = teacher_share(config, number)
    begun, age = np.ones(count, dtype=bool), np.zeros(count, dtype=np.int64)
    pupils = teacher.pupils(env, begun)
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
            far = np.abs(feedback).max(axis=1) > RESCUE
            chosen = np.where((drives | (far & teacher.rescues))[:, None], answers, own)
        disturbed = chosen + noise * random.normal(size=answers.shape)
        observations, _, terminated, truncated, infos = env.step(disturbed.astype(np.float32))
        begun = terminated | truncated
        age = np.where(begun, 0, age + 1)
        lost += int((terminated & (pupils.lap >= 0)).sum())
        if begun.any():
            pupils = teacher.pupils(env, begun, pupils)
    observations, ages, answers, weights = (np.concatenate(column) for column in zip(*rows, strict=True))
    return Rollout(observations, ages, answers, weights, lost)


def teacher_share(config: DAggerConfig, number: int) -> float:
    """Return the share of the time that the teacher drives: 1 in round 0, `config.teacher_share` from the half on."""
    half = max(config.rounds // 2, 1)
    return 1.0 + (config.teacher_share - 1.0) * min(number / half, 1.0)
