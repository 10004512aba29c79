"""A learned inverse model of the arm, shifted by more than the sensor's delay, without a reward or a teacher.

A network learns which torques the arm got on its way to where its tip was some time later. On the task these places
are the target's. A nonminimum-phase arm behind a late sensor has no causal inverse that acts at once, but one that is
shifted in time can be approximated. Sources: Widrow & Walach, *Adaptive inverse control*, 1996 (delayed inverse
models); Ghosh et al., *Learning to reach goals via iterated supervised learning*, ICLR 2021 (where a motion led counts
as where it should lead).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from flexarm_agents import DAggerConfig, StandardScore, evaluate
from flexarm_agents.environments import make_batch, make_one
from flexarm_agents.evaluation.scoring import rank
from flexarm_agents.policies.encoders import Array, Memory, PastReadings, encoded
from flexarm_agents.policies.network import NetworkPolicy
from flexarm_agents.teaching.rollouts import Rollout
from flexarm_agents.teaching.student import Student
from flexarm_agents.training.loop import EVALUATION_SEED
from flexarm_agents.training.train import one_thread
from flexarm_env.envs.settings import Settings
from flexarm_env.envs.vector import FlexArmVectorEnv

READINGS = ("joint_angles", "joint_rates", "sensed_position", "last_actions")  # two numbers each, in m and rad
OBSERVATION = (*READINGS, "reference_position", "previews")  # of the world's frame, not scaled
PERIODS = 600  # of a round, on each arm
RANDOM_ROUNDS = 4  # before the first fit, in which torques are noise
RANDOM_SPREAD = 0.25  # largest standard deviation of these torques, as a share of the limits
KEPT = 0.9  # share of a disturbance that is left after a control period
FREE: Mapping[str, Any] = {"error_limit": None, "deflection_limit": None, "max_episode_steps": 200}  # in random rounds


@dataclass(frozen=True, repr=False)
class Wanted(PastReadings):
    """Readings, and places of the tip ahead, both as the first link sees them; an `Encoder`."""

    links: tuple[float, float] = (4.5, 4.5)  # lengths [m]
    delay: int = 0  # of the late sensor [control periods]

    @classmethod
    def of(cls, settings: Settings, lags: tuple[int, ...]) -> Wanted:
        """Make the encoder of an environment; some lags must be `delay` apart."""
        count = 2 * len(READINGS)
        links, (delay, _) = settings.flexible_arm.parameters.link_lengths, settings.sensor_delays
        size = count + 2 + 2 * len(settings.previews)
        return cls(size, lags, tuple(range(count)), links, round(delay / settings.control_period))

    @property
    def inputs(self) -> int:
        """See `Encoder`."""
        return len(self.reset(np.zeros((1, self.size), dtype=np.float32))[0][0])

    def rigid_tip(self, angles: NDArray[Any]) -> NDArray[Any]:
        """Return tips by rigid kinematics, as complex numbers x + iy, from joint angles. Shape (..., 2)."""
        link_1 = np.exp(1j * angles[..., 0])
        return np.asarray(link_1 * (self.links[0] + self.links[1] * np.exp(1j * angles[..., 1])))

    def places(self, angles: NDArray[Any], points: NDArray[Any]) -> Array:
        """Return complex points as the first link sees them, from the rigid tip. Shape (n, 2 m)."""
        seen = (points - self.rigid_tip(angles)[:, None]) * np.exp(-1j * angles[:, :1])
        return np.ascontiguousarray(seen).view(float).astype(np.float32)

    def advance(self, observations: Array, memory: Memory) -> tuple[Array, Memory]:
        """See `Encoder`."""
        stacked, after = super().advance(observations, memory)
        count, numbers, ages = len(observations), len(self.remembered), (0, *self.lags)
        past = stacked[:, self.size :].reshape(count, -1, numbers)
        rows = np.concatenate([observations[:, None, :numbers], past], axis=1).astype(float)
        angles, sensed = rows[..., :2], rows[..., 4:6] @ (1.0, 1.0j)
        # each reading beside the rigid tip of the moment that it shows
        dated = [(n, ages.index(age + self.delay)) for n, age in enumerate(ages) if age + self.delay in ages]
        read, moment = (list(part) for part in zip(*dated, strict=True))
        bent = (sensed[:, read] - self.rigid_tip(angles[:, moment])) * np.exp(-1j * angles[:, 0, :1])
        target = observations[:, numbers:].astype(float).reshape(count, -1, 2) @ (1.0, 1.0j)
        parts = (
            *(np.cos(angles[:, 0, 1:]), np.sin(angles[:, 0, 1:]), rows[:, 0, 2:4]),
            (angles[:, 1:] - angles[:, :1]).reshape(count, -1),
            np.ascontiguousarray(bent).view(float),
            rows[..., 6:].reshape(count, -1),
            self.places(angles[:, 0], target[:, :1] + target[:, 1:]),
        )
        return np.concatenate(parts, axis=1).astype(np.float32), after


def rollout(
    env: FlexArmVectorEnv, encoder: Wanted, model: NetworkPolicy | None, spread: float, random: np.random.Generator
) -> Rollout:
    """Drive disturbed arms, and return what is to be learned from it: the places that the tip took count as wanted.

    Args:
        env: the arms; an episode begins where one ended.
        encoder: of their observations.
        model: from the encoder's inputs to torques; None: torques are the disturbance alone.
        spread: largest standard deviation of the disturbance, as a share of the torques' limits.
        random: draws the episodes and the disturbance.
    """
    observations, infos = env.reset(seed=int(random.integers(2**31)))
    begun, memory = np.ones(env.num_envs, dtype=bool), encoder.reset(observations)[1]
    noise, spreads = np.zeros((env.num_envs, 2)), spread * random.uniform(size=(env.num_envs, 1))
    rows = []
    for _ in range(PERIODS):
        inputs, memory = encoded(encoder, observations, memory, begun)
        noise = KEPT * noise + np.sqrt(1.0 - KEPT**2) * spreads * random.normal(size=noise.shape)
        chosen = noise if model is None else model.predict(inputs)[0] + noise
        actions = np.clip(chosen, -1.0, 1.0).astype(np.float32)
        rows.append((observations[:, :2].astype(float), inputs, actions, infos["true_tip"] @ (1.0, 1.0j), begun))
        observations, _, terminated, truncated, infos = env.step(actions)
        begun = terminated | truncated
    angles, inputs, actions, tips, begun = (np.array(column) for column in zip(*rows, strict=True))
    ahead = [round(time / env.control_period) for time in env.settings.previews]
    last, episode = PERIODS - ahead[-1], np.cumsum(begun, axis=0)
    whole = episode[:last] == episode[ahead[-1] :]  # all places ahead are of the same episode
    reached = encoder.places(angles[:last][whole], np.stack([tips[n : last + n][whole] for n in ahead], axis=1))
    learned = np.concatenate([inputs[:last][whole][:, : -2 * len(ahead)], reached], axis=1)
    count = len(learned)
    return Rollout(
        learned, np.zeros(count, np.int64), actions[:last][whole], np.ones(count, np.float32), int(begun[1:].sum())
    )


def trained(config: DAggerConfig) -> tuple[NetworkPolicy, StandardScore, list[dict[str, Any]]]:
    """Train by rounds of rollouts and fits; return the best policy, its score, and that after each with the `steps`."""
    options = config.options | config.curriculum_options | {"start": "corners"}
    best: tuple[tuple[int, float], NetworkPolicy, StandardScore] | None = None
    curve: list[dict[str, Any]] = []
    with one_thread(), make_one(config.environment, config.options) as scored:
        torch.manual_seed(config.seed)
        random = np.random.default_rng(config.seed)
        free = make_batch(config.environment, config.arms, {**options, **FREE})
        encoder = Wanted.of(free.settings, config.lags)
        rollouts = [rollout(free, encoder, None, RANDOM_SPREAD, random) for _ in range(RANDOM_ROUNDS)]
        free.close()
        env = make_batch(config.environment, config.arms, options)
        student = Student(config, None, rollouts[0])
        for _ in range(config.rounds):
            student.fit(rollouts)
            policy = replace(student.policy(), encoder=encoder)
            scores = [evaluate(scored, policy, EVALUATION_SEED + n) for n in range(config.evaluation_laps)]
            curve.append({"steps": len(rollouts) * PERIODS * config.arms, **scores[0].as_mapping()})
            if best is None or rank(scores) < best[0]:
                best = rank(scores), policy, scores[0]
            rollouts.append(rollout(env, encoder, student.policy(), config.torque_noise, random))
        env.close()
    assert best is not None
    _, policy, score = best
    return policy, score, curve
