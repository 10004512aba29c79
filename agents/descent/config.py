"""`FOPGConfig`: everything that decides the result of a training by first-order gradients, with tuned defaults."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, ClassVar

from flexarm_agents.environments import settings_of
from flexarm_agents.training.config import RunConfig, setting
from flexarm_env.envs.blocks import BLOCKS
from flexarm_env.validation import choice, integer, listed, mapping, names, number, shown


def _blocks(name: str, value: object) -> tuple[str, ...]:
    blocks = tuple(listed(name, value))
    for n, block in enumerate(names(name, blocks) if blocks else ()):
        choice(f"{name}[{n}]", block, BLOCKS)
    return blocks


@dataclass(frozen=True, kw_only=True)
class FOPGConfig(RunConfig):
    """First-order policy gradients: costs of a window, differentiated through the simulation (short-horizon critic)."""

    algorithm: ClassVar[str] = "fopg"
    training: ClassVar[str] = "flexarm_agents.descent.training:FOPGTraining"

    curriculum_options: dict[str, Any] = setting({"start": "corners"}, mapping)
    """Options in which the training's environments differ from the environment of the score, e.g. the start."""
    rounds: int = setting(12, integer, least=1)
    """Rounds of the final policy's training; each one ends with an evaluation and a checkpoint."""
    candidates: int = setting(3, integer, least=1)
    """Untrained policies with which the training begins; after `trial_rounds` of each the best one goes on."""
    trial_rounds: int = setting(4, integer, least=1)
    """Rounds of each candidate; they are among the `rounds` of the one that goes on, which are more."""
    windows: int = setting(80, integer, least=1)
    """Windows in a round, each with one step of the policy's optimiser."""
    horizon: int = setting(32, integer, least=2)
    """Control periods of a window, through which derivatives run."""
    arms: int = setting(64, integer, least=1)
    """Arms side by side."""
    episode_steps: int = setting(450, integer, least=1)
    """Control periods after which a training episode is cut off."""
    torque_noise: float = setting(0.04, number, least=0.0, most=1.0)
    """Largest standard deviation of the disturbance of the torques, as a share of their limits; arms have 0 to this."""
    gamma: float = setting(0.99, number, least=0.0, most=1.0)
    """Discount of a control period."""
    critic_epochs: int = setting(2, integer, least=0)
    """Passes of the critic through a window, whose end it values; 0: no critic, plain backpropagation."""
    critic_batch: int = setting(512, integer, least=1)
    """Samples in a step of the critic's optimiser."""
    critic_lambda: float = setting(0.95, number, least=0.0, most=1.0)
    """Smoothing of the critic's targets."""
    critic_averaging: float = setting(0.7, number, least=0.0, most=1.0)
    """The critic in targets is an average of its weights, which forgets by this factor in each window."""
    critic_observation: tuple[str, ...] = setting(("modal_coordinates", "modal_rates"), _blocks)
    """Blocks that the critic sees beside the policy's observation; they are needed in the training alone."""
    learning_rate: float = setting(3e-3, number, above=0.0, most=1.0)
    """Learning rate of policy and critic at the beginning; it falls linearly to 0."""
    gradient_limit: float = setting(1.0, number, above=0.0)
    """Largest norm of a gradient; longer ones are shortened."""
    error_knee: float = setting(0.3, number, unit="m", above=0.0)
    """Distance of the tip from the reference below which its cost is a square, above which it grows linearly [m]."""
    change_weight: float = setting(0.02, number, unit="m", least=0.0)
    """Weight of the squared change of the actions from one period to the next [m]."""
    excess_weight: float = setting(0.1, number, unit="m", least=0.0)
    """Weight of the squared excess of the network's output over the largest action [m]."""
    deflection_share: float = setting(0.8, number, least=0.0, most=1.0)
    """Share of the deflection at which an episode ends; larger deflections cost [1]."""
    deflection_weight: float = setting(10.0, number, unit="m", least=0.0)
    """Weight of the squared excess over this deflection, as a share of the limit [m]."""

    def __post_init__(self) -> None:
        """Validate, each field and what they are together."""
        super().__post_init__()
        for one in fields(self) if self.critic_epochs == 0 else ():
            if one.name.startswith("critic_") and one.name != "critic_epochs":
                if (given := getattr(self, one.name)) != one.default:
                    raise ValueError(f"{one.name} = {shown(given)}: has no effect with critic_epochs = 0")
        if self.trial_rounds >= self.rounds and self.candidates > 1:
            bound = f"rounds = {self.rounds}, with more than one of candidates"
            raise ValueError(f"trial_rounds = {self.trial_rounds}: must be less than {bound}")

    @property
    def steps(self) -> int:
        """Environment steps of a round."""
        return self.windows * self.horizon * self.arms

    @property
    def all_rounds(self) -> int:
        """Rounds of the whole training: those of the candidates that do not go on, too."""
        return self.rounds + (self.candidates - 1) * self.trial_rounds

    @property
    def batch_options(self) -> dict[str, Any]:
        """Options of the batch that is trained on: what the critic alone sees follows the policy's observation."""
        own = settings_of(self.environment, self.options).observation
        more = [name for name in self.critic_observation if name not in own] if self.critic_epochs else []
        training = self.options | self.curriculum_options
        return {"max_episode_steps": self.episode_steps, **training, "observation": [*own, *more]}
