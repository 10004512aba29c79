"""The environment family beside its peers: a batch, one environment, a chain in MuJoCo, the learner alone."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces.utils import flatdim

from flexarm_env.envs.batch import COSTS, BatchSimulator
from flexarm_env.envs.settings import Settings
from scripts.benchmarks import accuracy, peers
from scripts.benchmarks.environments import LINEAR, SQUARE, stepped
from scripts.benchmarks.physics import bare_kernel
from scripts.benchmarks.timing import Group, Ratio, Subject

GAIN = "FlexArm/SquareGain-v0"
ENVS = 1024
PERIOD = 0.01  # of control [s]
BATCH_CALLS = 100
SINGLE_CALLS = 4000
SEGMENTS = 10
FINE_STEP = 2e-4  # [s]
MANY = 4096
LEARNING_FRAMES, LEARNERS = 65_536, 64


def batch(modes: Sequence[int], effort: float, many: int = MANY) -> Group:
    """Batches of 1024 on one core: torques, full observation, reward, delay line, auto-reset."""
    subjects, ratios = [], []
    acrobot = peers.envpool_acrobot(ENVS, effort) if peers.installed("envpool") else None
    if acrobot is not None:
        subjects.append(acrobot)
    for m in modes:
        arm = {"preset": LINEAR, "modes_per_link": m}
        batch_of = _batch(f"{SQUARE}, linear, {m} modes", SQUARE, ENVS, round(BATCH_CALLS * effort), arm=arm)
        bare = bare_kernel(f"its physics alone, {m} modes", m, 32, ENVS, max(1, round(100 * effort)))
        bare = replace(bare, amount=bare.amount / Settings.of({"arm": arm}).substeps)
        subjects += [batch_of, bare]
        ratios.append(Ratio(batch_of.name, bare.name, f"batch step over its bare physics, {m} modes (75 % is 1.33)"))
        if acrobot is not None:
            ratios.append(Ratio(acrobot.name, batch_of.name, f"FlexArm over EnvPool's Acrobot, linear arm, {m} modes"))
    gain = _batch(GAIN, GAIN, ENVS, max(1, round(0.4 * BATCH_CALLS * effort)))
    torque = _batch(f"{SQUARE}, default", SQUARE, ENVS, round(BATCH_CALLS * effort))
    linear = _batch(f"{SQUARE}, linear arm", SQUARE, ENVS, round(BATCH_CALLS * effort), arm=LINEAR)
    subjects += [gain, torque, linear]
    ratios.append(Ratio(gain.name, torque.name, "the gain's mode over the torque's mode, time of a step"))
    ratios.append(Ratio(torque.name, linear.name, "the default arm over the linear one, time of a step"))
    if acrobot is not None:
        ratios.append(Ratio(acrobot.name, torque.name, "FlexArm over EnvPool's Acrobot, default arm"))
    few, *more = (_block(lanes, round(40_000 * effort)) for lanes in COSTS)
    subjects += [few, *more]
    ratios += [Ratio(few.name, each.name, f"{few.name} over {each.name}, per environment") for each in more]
    facts = {f"memory added by {many} environments [MB]": _memory(many)}
    return Group("batch", f"Batches of {ENVS}, one core", "us", "env step", subjects, ratios, facts=facts)


def sensors(effort: float) -> Group:
    """Declare the group of what late, noisy and further sensors cost a step of a batch."""
    calls = round(BATCH_CALLS * effort)
    plain = _batch(f"{SQUARE}, no delay", SQUARE, ENVS, calls, delay=0.0)
    kinds: dict[str, dict[str, Any]] = {
        "31 ms late": {},
        "delay drawn from 0 to 120 ms": {"randomisation": {"delay": (0.0, 0.12)}},
        "noise, jitter and lost readings": {"noise": 0.01, "jitter": 0.01, "dropout": 0.1},
        "a second sensor": {
            "second_sensor_link": 1,
            "observation": (*Settings.of({}).observation, "second_sensed_position"),
        },
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


def _block(lanes: int, calls: int) -> Subject:
    """One full block's step in its kernel alone: what `flexarm_env.envs.batch.COSTS` says, for each environment."""
    simulator = BatchSimulator(Settings.of({}), lanes)
    simulator.start(np.arange(lanes, dtype=np.uint64), np.arange(lanes), simulator.usual_requests)
    calls = max(1, calls // lanes)

    def work() -> None:
        for _ in range(calls):
            simulator.step()

    return Subject(f"block of {lanes} lanes", work, calls * lanes)


def _memory(many: int) -> float:
    imports = "import gymnasium, flexarm_env, numpy as np\nenv = gymnasium.make_vec('FlexArm/Square-v0', num_envs=16)\n"
    imports += "env.reset(seed=0); env.step(np.zeros((16, 2), np.float32))"
    code = f"many = gymnasium.make_vec('FlexArm/Square-v0', num_envs={many})\n"
    code += f"many.reset(seed=0); many.step(np.zeros(({many}, 2), np.float32))"
    return peers.memory_of(code, imports) / 1e6


def chain(modes: Sequence[int], effort: float) -> Group:
    """Declare the group of the same arm as a chain of segments in MuJoCo, per simulated second.

    At its largest stable step; at one whose error in time is some tenths of a millimetre; and at the step at which that
    error is no larger than FlexArm's. The chain's shape is better than one mode's in any case; what is equal there is
    the error that the step makes.
    """
    chains = [peers.mujoco_chain(SEGMENTS, effort, damping) for damping in (0.01, 0.0)]
    chains.append(peers.mujoco_chain(SEGMENTS, effort, step=FINE_STEP))
    error = accuracy.chain_error(SEGMENTS, "implicitfast", round(accuracy.HELD / FINE_STEP))
    subjects, ratios, facts = [*chains], [], {f"error in time, chain at {1e3 * FINE_STEP:g} ms [mm]": 1e3 * error}
    for m in modes:
        accurate, equal = peers.accurate_chain(SEGMENTS, effort, m)
        subjects.append(accurate)
        facts |= {f"error in time, {m} modes [mm]": 1e3 * equal.ours}
        facts |= {f"error in time, chain at {1e3 * equal.step:.3g} ms [mm]": 1e3 * equal.error}
        options = {"arm": {"preset": LINEAR, "modes_per_link": m}}
        single = stepped(f"one environment, {m} modes", SQUARE, max(50, round(SINGLE_CALLS * effort)), **options)
        many = _batch(f"batch of {ENVS}, {m} modes", SQUARE, ENVS, round(BATCH_CALLS * effort), **options)
        for subject in (single, many):
            subjects.append(replace(subject, amount=subject.amount * PERIOD))
            ratios += [Ratio(each.name, subject.name, f"{each.name} over {subject.name}") for each in chains]
            ratios.append(Ratio(accurate.name, subject.name, f"equal accuracy in time: chain over {subject.name}"))
    title = "One simulated second of one arm, MuJoCo and FlexArm, one core"
    return Group("chain", title, "ms", "simulated second", subjects, ratios, facts=facts)


def learning(effort: float) -> Group:
    """Declare the group of PPO on the batch, on an environment that does nothing, and in a training."""
    from flexarm_agents import FlexArmVecEnv

    frames = max(2 * peers.ROLLOUT, round(effort * LEARNING_FRAMES))
    amount = frames + peers.ROLLOUT
    ours = Subject(f"PPO on {SQUARE}", lambda: peers.learn(FlexArmVecEnv.make(SQUARE, LEARNERS), frames), amount)
    empty = Subject(
        "PPO on an empty environment", lambda: peers.learn(peers.empty_vec_env(SQUARE, LEARNERS), frames), amount
    )
    training = _training("a training", frames)
    ratios = [Ratio(empty.name, ours.name, "PPO's rate on FlexArm over that on an empty environment")]
    return Group("learning", "PPO, one core", "us", "frame", [ours, empty, training], ratios, share=0.4)


def _training(name: str, frames: int) -> Subject:
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

    return Subject(name, work, -(-frames // rollout) * rollout)
