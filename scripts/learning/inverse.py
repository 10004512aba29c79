"""A learned inverse model of the arm, shifted by more than the sensor's delay, without a reward or a teacher.

A network learns which torques the arm got on its way to where its tip was some time later: hindsight makes the places
that were reached the goals. On the task the goals are the target's places. A nonminimum-phase arm behind a late sensor
has no causal inverse that acts at once, but one that is shifted in time can be approximated. Sources: Widrow & Walach,
*Adaptive inverse control*, 1996 (delayed inverse models); Ghosh et al., *Learning to reach goals via iterated
supervised learning*, ICLR 2021 (hindsight).
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
import torch
from numpy.typing import NDArray

from flexarm_agents import DAggerConfig
from flexarm_agents.environments import make_batch
from flexarm_agents.policies.encoders import Array, Memory, PastReadings, encoded
from flexarm_agents.policies.network import NetworkPolicy
from flexarm_agents.teaching.rollouts import Rollout
from flexarm_agents.teaching.student import Student
from flexarm_agents.training.train import one_thread
from flexarm_env.envs.settings import Settings
from flexarm_env.envs.vector import FlexArmVectorEnv
from flexarm_env.physics.coordinates import rigid_tip
from scripts.learning.judge import Judge, Outcome

READINGS = ("joint_angles", "joint_rates", "sensed_position", "last_actions")  # two numbers each
# Options of the environment; goals lie `previews` ahead.
INTERFACE: Mapping[str, Any] = {
    "observation": (*READINGS, "reference_position", "previews"),
    "frame": "world",
    "scaled": False,
    "last_actions": 1,
}
PERIODS = 600  # of a round, on each arm
RANDOM_ROUNDS = 4  # before the first fit, in which torques are noise
RANDOM_SPREAD = 0.25  # largest standard deviation of these torques, as a share of the limits
CORRELATION = 0.9  # of a disturbance from one control period to the next
FREE: Mapping[str, Any] = {"error_limit": None, "deflection_limit": None, "max_episode_steps": 200}  # in random rounds


@dataclass(frozen=True, repr=False)
class GoalEncoder(PastReadings):
    """Readings, followed by goals of the tip, both as the first link sees them; an `Encoder`."""

    links: tuple[float, float] = (4.5, 4.5)  # lengths [m]
    delay: int = 0  # of the late sensor [control periods]

    @classmethod
    def of(cls, settings: Settings, lags: tuple[int, ...]) -> Self:
        """Make the encoder of an environment.

        Raises:
            ValueError: for other options than `INTERFACE`, and for lags without the moment of any late reading.
        """
        for name, value in INTERFACE.items():
            if (found := getattr(settings, name)) != value:
                raise ValueError(f"{name} = {found!r}: must be {value!r}")
        count, links = 2 * len(READINGS), settings.flexible_arm.parameters.link_lengths
        delay = round(settings.sensor_delays[0] / settings.control_period)
        made = cls(count + 2 + 2 * len(settings.previews), lags, tuple(range(count)), links, delay)
        if not made.dated:
            raise ValueError(f"lags = {lags}: two of 0 and these must be {delay} control periods apart, the delay")
        return made

    @property
    def dated(self) -> list[tuple[int, int]]:
        """For late readings: their number among those of the ages, and that of the angles at the moment they show."""
        ages = (0, *self.lags)
        return [(n, ages.index(age + self.delay)) for n, age in enumerate(ages) if age + self.delay in ages]

    @property
    def inputs(self) -> int:
        """See `Encoder`."""
        return len(self.reset(np.zeros((1, self.size), dtype=np.float32))[0][0])

    def seen(self, angles: NDArray[Any], of: NDArray[Any], points: NDArray[Any]) -> NDArray[Any]:
        """Return complex points x + iy as the first link sees them, from rigid tips.

        Args:
            angles: joint angles of the link that sees. Shape (n, 2).
            of: joint angles of the rigid tips. Shape (n, m or 1, 2).
            points: Shape (n, m).

        Returns:
            x and y of the first, of the second, ... Shape (n, 2 m).
        """
        found = (points - rigid_tip(self.links, of) @ (1.0, 1.0j)) * np.exp(-1j * angles[:, :1])
        return np.ascontiguousarray(found).view(float)

    def advance(self, observations: Array, memory: Memory) -> tuple[Array, Memory]:
        """See `Encoder`."""
        stacked, after = super().advance(observations, memory)
        count, numbers = len(observations), len(self.remembered)
        past = stacked[:, self.size :].reshape(count, -1, numbers)
        rows = np.concatenate([observations[:, None, :numbers], past], axis=1).astype(float)
        angles, sensed = rows[..., :2], rows[..., 4:6] @ (1.0, 1.0j)
        read, moment = (list(part) for part in zip(*self.dated, strict=True))
        target = observations[:, numbers:].astype(float).reshape(count, -1, 2) @ (1.0, 1.0j)
        now = angles[:, 0]
        parts = (
            *(np.cos(now[:, 1:]), np.sin(now[:, 1:]), rows[:, 0, 2:4]),
            (angles[:, 1:] - angles[:, :1]).reshape(count, -1),
            self.seen(now, angles[:, moment], sensed[:, read]),  # deflections
            rows[..., 6:].reshape(count, -1),
            self.seen(now, angles[:, :1], target[:, :1] + target[:, 1:]),  # goals
        )
        return np.concatenate(parts, axis=1).astype(np.float32), after


def rollout(
    env: FlexArmVectorEnv, encoder: GoalEncoder, model: NetworkPolicy | None, spread: float, random: np.random.Generator
) -> Rollout:
    """Drive disturbed arms, and return what is to be learned from it, by hindsight.

    Args:
        env: the arms; an episode begins where one ended.
        encoder: of their observations.
        model: from the encoder's inputs to torques; None: torques are the disturbance alone.
        spread: largest standard deviation of the disturbance, as a share of the torques' limits.
        random: draws the episodes and the disturbance.
    """
    observations, infos = env.reset(seed=int(random.integers(2**31)))
    begun = np.ones(env.num_envs, dtype=bool)
    memory: Memory = ()
    noise, spreads = np.zeros((env.num_envs, 2)), spread * random.uniform(size=(env.num_envs, 1))
    rows = []
    for _ in range(PERIODS):
        inputs, memory = encoded(encoder, observations, memory, begun)
        noise = CORRELATION * noise + np.sqrt(1.0 - CORRELATION**2) * spreads * random.normal(size=noise.shape)
        chosen = noise if model is None else model.predict(inputs)[0] + noise
        actions = np.clip(chosen, -1.0, 1.0).astype(np.float32)
        rows.append((observations[:, :2].astype(float), inputs, actions, infos["true_tip"] @ (1.0, 1.0j), begun))
        observations, _, terminated, truncated, infos = env.step(actions)
        begun = terminated | truncated
    angles, inputs, actions, tips, begun = (np.array(column) for column in zip(*rows, strict=True))
    ahead = [round(time / env.control_period) for time in env.settings.previews]
    last, episode = PERIODS - ahead[-1], np.cumsum(begun, axis=0)
    whole = episode[:last] == episode[ahead[-1] :]  # all goals are of the same episode
    now, reached = angles[:last][whole], np.stack([tips[n : last + n][whole] for n in ahead], axis=1)
    learned = inputs[:last][whole]
    learned[:, -2 * len(ahead) :] = encoder.seen(now, now[:, None], reached)
    count, lost = len(learned), int(begun[1:].sum())
    return Rollout(learned, np.zeros(count, np.int64), actions[:last][whole], np.ones(count, np.float32), lost)


def trained(config: DAggerConfig) -> Outcome:
    """Train by rounds of a rollout and a fit to all of them, and return what was best."""
    options, judge = config.options | config.curriculum_options | {"start": "corners"}, Judge(config)
    with one_thread():
        torch.manual_seed(config.seed)
        random = np.random.default_rng(config.seed)
        env, free = (make_batch(config.environment, config.arms, options | more) for more in ({}, dict(FREE)))
        encoder = GoalEncoder.of(env.settings, config.lags)
        rollouts = [rollout(free, encoder, None, RANDOM_SPREAD, random) for _ in range(RANDOM_ROUNDS)]
        student = Student(config, None, rollouts[0])
        for number in range(config.rounds):
            if number:
                rollouts.append(rollout(env, encoder, student.policy(), config.torque_noise, random))
            student.fit(rollouts)
            policy = replace(student.policy(), encoder=encoder)
            judge.judge(policy, len(rollouts) * PERIODS * config.arms)
        env.close()
        free.close()
    return judge.outcome()
