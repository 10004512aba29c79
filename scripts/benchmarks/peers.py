"""What FlexArm's speed is held against: other engines, and an environment that does nothing.

The packages behind are optional and imported when first needed; ask `installed` before.
"""

from __future__ import annotations

import importlib.util
import warnings
from typing import TYPE_CHECKING, Any

import numpy as np

from flexarm_env import ArmParameters
from scripts.benchmarks.timing import Subject

if TYPE_CHECKING:
    from stable_baselines3.common.vec_env import VecEnv

ACROBOT = "Acrobot-v1"
ACROBOT_STEPS = 100_000  # a timed call at effort 1
CHAIN_SECONDS = 10.0  # simulated in a timed call at effort 1 [s]
TORQUE, TORQUE_HELD = 20.0, 0.01  # of the chain's motors: up to [N m], constant for [s]
ROLLOUT, BATCH = 8192, 1024  # frames between two updates, and in a gradient step


def installed(*packages: str) -> bool:
    """Whether all these packages can be imported: "envpool", "mujoco", "stable_baselines3"."""
    return all(importlib.util.find_spec(name) is not None for name in packages)


def envpool_acrobot(num_envs: int, effort: float, threads: int = 1) -> Subject:
    """EnvPool's Acrobot-v1 with random actions prepared before; amount: environment steps.

    An episode that is over starts anew with the next step, whose action is lost: one step in 500 is such a reset.
    """
    import envpool

    calls = max(1, round(effort * ACROBOT_STEPS / num_envs))
    actions = np.random.default_rng(0).integers(0, 3, (calls, num_envs), dtype=np.int32)
    pool = envpool.make_gymnasium(ACROBOT, num_envs=num_envs, batch_size=num_envs, num_threads=threads, seed=0)
    with warnings.catch_warnings():  # EnvPool gives gymnasium its bounds in double precision
        warnings.filterwarnings("ignore", message=".*precision lowered by casting", category=UserWarning)
        pool.reset()

    def work() -> None:
        for action in actions:
            pool.step(action)

    name = f"EnvPool {ACROBOT}, {num_envs} environments, {threads} thread{'s' * (threads > 1)}"
    return Subject(name, work, calls * num_envs)


def mujoco_chain(segments: int, effort: float, step: float | None = None) -> Subject:
    """Declare the arm as a chain of so many rigid segments a link in MuJoCo under random torques.

    The amount is simulated seconds; without a step [s] it is the largest stable one of
    `flexarm_env.chain.model.TIME_STEPS`.
    """
    import mujoco

    from flexarm_env.chain import model as chain

    arm = ArmParameters.linear()
    step = chain.largest_stable_step(segments, arm) if step is None else step
    name = f"MuJoCo chain, {segments} segments a link, implicitfast, step {1e3 * step:g} ms"
    model = chain.chain_model(segments, arm, step)
    data = mujoco.MjData(model)
    held = max(1, round(TORQUE_HELD / step))  # steps of a call: what Python costs is spread over them
    calls = max(1, round(effort * CHAIN_SECONDS / (held * step)))
    torques = np.random.default_rng(0).uniform(-TORQUE, TORQUE, (calls, 2))

    def work() -> None:
        for torque in torques:
            data.ctrl[:] = torque
            mujoco.mj_step(model, data, held)
        if not np.isfinite(data.qpos).all():
            raise RuntimeError(f"{name}: the state stopped being finite")

    return Subject(name, work, calls * held * step, prepare=lambda: mujoco.mj_resetData(model, data))


def empty_vec_env(environment: str, num_envs: int) -> VecEnv:
    """Make a batch for Stable-Baselines3, with an id's spaces, that is never stepped: it times the learner alone.

    Observations and rewards are the same random numbers at each step, and no episode ends.
    """
    from flexarm_agents import FlexArmVecEnv

    class EmptyVecEnv(FlexArmVecEnv):
        """Returns what it was made with."""

        def reset(self) -> Any:
            random, shape = np.random.default_rng(0), self.observation_space.shape or ()
            self._observations = random.standard_normal((self.num_envs, *shape)).astype("f4")
            self._rewards = random.standard_normal(self.num_envs).astype("f4")
            self._dones = np.zeros(self.num_envs, dtype=bool)
            self._nothing: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
            return self._observations

        def step_wait(self) -> Any:
            return self._observations, self._rewards, self._dones, self._nothing

    return EmptyVecEnv.make(environment, num_envs)


def learn(env: VecEnv, steps: int) -> None:
    """Let Stable-Baselines3's PPO learn for so many frames, rounded up to rounds, after one round of both; close it.

    Policy and value have two layers of 64 each; a round is about 8192 frames, then ten epochs in batches of at most
    1024, on one thread of PyTorch: two are three to five times slower as soon as the machine is busy.
    """
    from stable_baselines3 import PPO

    from flexarm_agents.training.train import one_thread

    n_steps = max(2, ROLLOUT // env.num_envs)
    round_of = n_steps * env.num_envs
    with one_thread():
        learner = PPO("MlpPolicy", env, device="cpu", seed=0, n_steps=n_steps, batch_size=min(BATCH, round_of))
        learner.learn(round_of)
        learner.learn(steps)
    env.close()
