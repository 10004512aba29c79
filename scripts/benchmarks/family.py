"""Batches beside their peers, Jacobians beside steps, a chain in MuJoCo, the learner alone."""

import os
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces.utils import flatdim

from flexarm_env import ArmParameters, FlexibleArm
from flexarm_env.envs.settings import Settings
from scripts.benchmarks import peers
from scripts.benchmarks.environments import LINEAR, SQUARE, stepped
from scripts.benchmarks.timing import Group, Ratio, Subject

GAIN = "FlexArm/SquareGain-v0"
ENVS = 1024
PERIOD = 0.01  # of control [s]
BATCH_CALLS = 100
SINGLE_CALLS = 4000
SEGMENTS = 10
FINE_STEP = 2e-4  # [s]
LEARNING_FRAMES, LEARNERS = 65_536, 64


def batch(effort: float) -> Group:
    """Batches of 1024 on one core: torques, full observation, reward, delay line, auto-reset."""
    calls = round(BATCH_CALLS * effort)
    gain = _batch(GAIN, GAIN, ENVS, round(0.4 * BATCH_CALLS * effort))
    torque = _batch(f"{SQUARE}, default", SQUARE, ENVS, calls)
    linear = _batch(f"{SQUARE}, linear arm", SQUARE, ENVS, calls, arm=LINEAR)
    subjects = [gain, torque, linear]
    ratios = [
        Ratio(gain.name, torque.name, "the gain's mode over the torque's mode, time of a step"),
        Ratio(torque.name, linear.name, "the default arm over the linear one, time of a step"),
    ]
    if peers.installed("envpool"):
        acrobot = peers.envpool_acrobot(ENVS, effort)
        subjects.append(acrobot)
        ratios += [Ratio(acrobot.name, one.name, f"{one.name} over EnvPool's Acrobot") for one in (torque, linear)]
    return Group("batch", f"Batches of {ENVS}, one core", "us", "env step", subjects, ratios)


def jacobians(effort: float) -> Group:
    """Declare the group of all Jacobians of a control period beside plain steps; a column is a unit of work."""
    subjects, ratios = [], []
    for name, parameters in {"default arm": ArmParameters(), "linear arm": ArmParameters.linear()}.items():
        arm = FlexibleArm(parameters)
        steps = Settings.of({"arm": "default" if name == "default arm" else LINEAR}).substeps
        state = np.zeros((ENVS, 2 * arm.size))
        state[:, 1] = np.linspace(0.5, 2.5, ENVS)
        plain, each = f"{name}, plain steps", f"{name}, a column"
        calls, columns = max(1, round(10 * effort)), 2 * arm.size + 5
        work = (_repeated(10 * calls, arm.step, state, steps), _repeated(calls, arm.step_jacobians, state, steps))
        subjects.append(Subject(plain, work[0], 10 * calls * ENVS * steps))
        subjects.append(Subject(each, work[1], calls * ENVS * steps * columns))
        ratios.append(Ratio(each, plain, f"a column of Jacobians over a plain step, {name}"))
    return Group("jacobians", f"Jacobians of a control period, batch of {ENVS}", "ns", "step and arm", subjects, ratios)


def _repeated(calls: int, function: Callable[..., Any], state: Any, steps: int) -> Callable[[], None]:
    def work() -> None:
        for _ in range(calls):
            function(state, (20.0, -5.0), PERIOD, step=PERIOD / steps)

    return work


def sensors(effort: float) -> Group:
    """Declare the group of what late, noisy and further sensors cost a step of a batch."""
    calls = round(BATCH_CALLS * effort)
    plain = _batch(f"{SQUARE}, no delay", SQUARE, ENVS, calls, delay=0.0)
    observation = *Settings.of({}).observation, "second_sensed_position"
    kinds: dict[str, dict[str, Any]] = {
        "31 ms late": {},
        "delay drawn from 0 to 120 ms": {"randomisation": {"delay": (0.0, 0.12)}},
        "noise, jitter and lost readings": {"noise": 0.01, "jitter": 0.01, "dropout": 0.1},
        "a second sensor": {"second_sensor_link": 1, "observation": observation},
    }
    others = [_batch(f"{SQUARE}, {words}", SQUARE, ENVS, calls, **options) for words, options in kinds.items()]
    ratios = [Ratio(each.name, plain.name, f"{each.name}, over no delay") for each in others]
    return Group("sensors", f"What sensors cost, batches of {ENVS}", "us", "env step", [plain, *others], ratios)


def threads(effort: float, cores: set[int]) -> Group:
    """Declare the group of batches on one thread, two and so on, FlexArm beside EnvPool, by the clock on the wall."""
    counts = [count for count in (1, 2, 4, 8, 16, 32, 64) if count <= len(cores)]
    if cores:
        os.sched_setaffinity(0, cores)  # threads that are made from now on inherit it
    subjects, ratios = [], []
    for make in (_threaded, peers.envpool_acrobot) if peers.installed("envpool") else (_threaded,):
        one, *more = (make(8 * ENVS, effort, count) for count in counts)
        subjects += [one, *more]
        ratios += [Ratio(one.name, each.name, f"{each.name}, over one thread") for each in more]
    return Group("threads", f"Batches of {8 * ENVS} on threads", "us", "env step", subjects, ratios, wall=True)


def _threaded(num_envs: int, effort: float, count: int) -> Subject:
    name = f"{SQUARE}, {num_envs} environments, {count} thread{'s' * (count > 1)}"
    return _batch(name, SQUARE, num_envs, round(BATCH_CALLS * effort / 8), threads=count)


def _batch(name: str, env_id: str, num_envs: int, calls: int, **options: Any) -> Subject:
    env = gymnasium.make_vec(f"flexarm_env:{env_id}", num_envs=num_envs, **options)
    calls = max(1, calls)
    shape = (calls, num_envs, flatdim(env.single_action_space))
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, shape).astype(np.float32)
    env.reset(seed=0)

    def work() -> None:
        for action in actions:
            env.step(action)

    return Subject(name, work, calls * num_envs)


def chain(effort: float) -> Group:
    """Declare the group of the linear arm as a chain of segments in MuJoCo, per simulated second.

    At its largest stable step, and at one whose error in time is some tenths of a millimetre.
    """
    chains = [peers.mujoco_chain(SEGMENTS, effort), peers.mujoco_chain(SEGMENTS, effort, FINE_STEP)]
    subjects, ratios = [*chains], []
    single = stepped("one environment", SQUARE, max(50, round(SINGLE_CALLS * effort)), arm=LINEAR)
    for subject in (single, _batch(f"batch of {ENVS}", SQUARE, ENVS, round(BATCH_CALLS * effort), arm=LINEAR)):
        subjects.append(replace(subject, amount=subject.amount * PERIOD))
        ratios += [Ratio(each.name, subject.name, f"{each.name} over {subject.name}") for each in chains]
    title = "One simulated second of one arm, MuJoCo and FlexArm, one core"
    return Group("chain", title, "ms", "simulated second", subjects, ratios)


def learning(effort: float) -> Group:
    """Declare the group of PPO on the batch, on an environment that does nothing, and in a training."""
    from flexarm_agents import FlexArmVecEnv

    frames = max(2 * peers.ROLLOUT, round(effort * LEARNING_FRAMES))
    amount = frames + peers.ROLLOUT
    ours = Subject(f"PPO on {SQUARE}", lambda: peers.learn(FlexArmVecEnv.make(SQUARE, LEARNERS), frames), amount)
    nothing = "PPO on an empty environment"
    empty = Subject(nothing, lambda: peers.learn(peers.empty_vec_env(SQUARE, LEARNERS), frames), amount)
    ratios = [Ratio(empty.name, ours.name, "PPO's rate on FlexArm over that on an empty environment")]
    return Group("learning", "PPO, one core", "us", "frame", [ours, empty, _training(frames)], ratios, share=0.4)


def _training(frames: int) -> Subject:
    """Rollouts and updates of a training with the tuned settings, without its evaluations."""
    from flexarm_agents import PPOConfig
    from flexarm_agents.training.models import new_model
    from flexarm_agents.training.train import one_thread

    config = PPOConfig()
    model: Any = new_model(config)
    assert config.rollout is not None
    rollout = config.rollout * config.envs

    def work() -> None:
        with one_thread():
            model.learn(frames, reset_num_timesteps=False)

    return Subject("a training", work, -(-frames // rollout) * rollout)
