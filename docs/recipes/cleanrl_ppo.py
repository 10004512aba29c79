"""PPO in one file, in the manner of CleanRL: torch, a batch of arms, and nothing between you and the loop.

Run it: `python cleanrl_ppo.py --steps 400000`, or read it from top to bottom.
"""

# mypy: allow-untyped-calls
# Some of torch's functions have no annotations.

from __future__ import annotations

import time
from dataclasses import dataclass

import gymnasium
import numpy as np
import torch
import tyro
from numpy.typing import NDArray
from torch import Tensor, nn

from flexarm_agents import evaluate


@dataclass
class Args:
    """Settings of the training; those of `flexarm train` are in `agents/hyperparams/ppo.yml`."""

    environment: str = "flexarm_env:FlexArm/Square-v0"
    """Id of the environment."""
    seed: int = 1
    """Seed of the environments and of torch."""
    steps: int = 400_000
    """Environment steps, rounded down to whole rollouts."""
    envs: int = 64
    """Environments side by side."""
    rollout: int = 64
    """Steps of each environment between two updates."""
    episode_steps: int = 600
    """Control periods after which an episode is cut off; its value is bootstrapped."""
    minibatch: int = 1024
    """Samples in a minibatch; must divide envs * rollout."""
    epochs: int = 6
    """Passes through a rollout."""
    gamma: float = 0.985
    """Discount of a step."""
    gae_lambda: float = 0.95
    """Smoothing of the advantages."""
    learning_rate: float = 1.5e-3
    """At the beginning; it falls linearly to zero."""
    clip: float = 0.2
    """Range of the probabilities' ratio."""


class Agent(nn.Module):
    """A Gaussian policy and a value function on the environment's own, scaled observations."""

    def __init__(self, observations: int, actions: int) -> None:
        """Make both networks.

        Args:
            observations: numbers in an observation.
            actions: numbers in an action.
        """
        super().__init__()
        self.mean = network(observations, actions, 0.01)
        self.value = network(observations, 1, 1.0)
        self.log_std = nn.Parameter(torch.full((actions,), -0.7))

    def distribution(self, observations: Tensor) -> torch.distributions.Normal:
        """Return the distribution of actions. Shape (n, actions)."""
        return torch.distributions.Normal(self.mean(observations), self.log_std.exp())


def network(inputs: int, outputs: int, last_gain: float) -> nn.Sequential:
    """Make two layers of 128, initialised orthogonally."""
    layers: list[nn.Module] = []
    for n, m, gain in ((inputs, 128, 2**0.5), (128, 128, 2**0.5), (128, outputs, last_gain)):
        layer = nn.Linear(n, m)
        nn.init.orthogonal_(layer.weight, gain)
        nn.init.zeros_(layer.bias)
        layers += [layer, nn.ELU()]
    return nn.Sequential(*layers[:-1])


@dataclass
class Rollout:
    """What a batch of environments did for some steps; each field has the shape (steps, environments, ...)."""

    observations: Tensor
    actions: Tensor
    log_probs: Tensor
    values: Tensor
    rewards: Tensor
    advantages: Tensor


def collect(envs: gymnasium.vector.VectorEnv, agent: Agent, now: Tensor, args: Args) -> tuple[Rollout, Tensor]:
    """Run the policy in the environments.

    Args:
        envs: with `autoreset_mode="SameStep"`: the step that ends an episode returns the next one's first observation.
        agent: acts.
        now: the present observations. Shape (environments, k).
        args: settings.

    Returns:
        The rollout with its advantages, and the observations after it.
    """
    kept: list[tuple[Tensor, ...]] = []
    for _ in range(args.rollout):
        distribution, value = agent.distribution(now), agent.value(now)[:, 0]
        action = distribution.sample()
        found, rewards, terminated, truncated, infos = envs.step(action.numpy())
        following = np.array(found)
        for i in np.flatnonzero(terminated | truncated):
            following[i] = infos["final_obs"][i]  # what the action led to; `found` begins the next episode
        next_value = agent.value(torch.as_tensor(following))[:, 0] * torch.as_tensor(~terminated)
        reward = torch.as_tensor(rewards, dtype=torch.float32)
        goes_on = torch.as_tensor(~(terminated | truncated), dtype=torch.float32)
        kept.append((now, action, distribution.log_prob(action).sum(1), value, reward, next_value, goes_on))
        now = torch.as_tensor(found)
    observations, actions, log_probs, values, rewards_, next_values, going = map(torch.stack, zip(*kept, strict=True))
    differences = rewards_ + args.gamma * next_values - values
    advantages, later = torch.zeros_like(values), torch.zeros(args.envs)
    for t in reversed(range(args.rollout)):
        advantages[t] = later = differences[t] + args.gamma * args.gae_lambda * going[t] * later
    return Rollout(observations, actions, log_probs, values, rewards_, advantages), now


def update(agent: Agent, optimiser: torch.optim.Optimizer, rollout: Rollout, args: Args) -> None:
    """Improve policy and value on a rollout by the clipped objective."""
    observations, actions = rollout.observations.flatten(0, 1), rollout.actions.flatten(0, 1)
    log_probs, advantages = rollout.log_probs.flatten(), rollout.advantages.flatten()
    targets = advantages + rollout.values.flatten()
    for _ in range(args.epochs):
        for chosen in torch.randperm(len(targets)).split(args.minibatch):
            now = agent.distribution(observations[chosen]).log_prob(actions[chosen]).sum(1)
            ratio = (now - log_probs[chosen]).exp()
            gain = advantages[chosen]
            gain = (gain - gain.mean()) / (gain.std() + 1e-8)
            clipped = ratio.clamp(1.0 - args.clip, 1.0 + args.clip)
            policy_loss = -torch.min(ratio * gain, clipped * gain).mean()
            value_loss = (agent.value(observations[chosen])[:, 0] - targets[chosen]).square().mean()
            optimiser.zero_grad()
            (policy_loss + 0.5 * value_loss).backward()
            nn.utils.clip_grad_norm_(agent.parameters(), 0.5)
            optimiser.step()


def main(args: Args) -> Agent:
    """Train, print the mean reward of a step now and then, and at the end the standard score.

    Args:
        args: settings.

    Returns:
        The trained agent.

    Raises:
        ValueError: if minibatches do not fit into a rollout.
    """
    size = args.envs * args.rollout
    if size % args.minibatch:
        raise ValueError(f"minibatch = {args.minibatch}: must divide envs * rollout = {size}")
    torch.manual_seed(args.seed)
    torch.set_num_threads(1)  # more of them only wait for each other on networks as small as these
    envs = gymnasium.make_vec(
        args.environment, args.envs, autoreset_mode="SameStep", max_episode_steps=args.episode_steps
    )
    observations, actions = envs.single_observation_space.shape, envs.single_action_space.shape
    assert observations is not None
    assert actions is not None
    agent = Agent(observations[0], actions[0])
    optimiser = torch.optim.Adam(agent.parameters(), args.learning_rate, eps=1e-5)
    now = torch.as_tensor(envs.reset(seed=args.seed)[0])
    began, rollouts = time.perf_counter(), args.steps // size
    for n in range(rollouts):
        optimiser.param_groups[0]["lr"] = args.learning_rate * (1.0 - n / rollouts)
        with torch.no_grad():
            rollout, now = collect(envs, agent, now, args)
        update(agent, optimiser, rollout, args)
        if n % 10 == 9 or n + 1 == rollouts:
            seconds = time.perf_counter() - began
            print(f"{(n + 1) * size:9d} steps {seconds:6.1f} s  mean reward {rollout.rewards.mean():.3f}")
    envs.close()

    def policy(observation: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the mean action."""
        with torch.no_grad():
            return np.asarray(agent.mean(torch.as_tensor(observation)))

    env = gymnasium.make(args.environment)
    print(evaluate(env, policy))
    env.close()
    return agent


if __name__ == "__main__":
    main(tyro.cli(Args))
