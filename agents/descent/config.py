"""`DescentConfig`: everything that decides what a descent gives, with tuned defaults."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any

from flexarm_agents.environments import check_id, check_options, settings_of
from flexarm_agents.training.config import Activation, RunConfig, checked_network
from flexarm_env.envs.blocks import BLOCKS
from flexarm_env.validation import choice, integer, listed, mapping, names, number, shown


@dataclass(frozen=True, kw_only=True)
class DescentConfig(RunConfig):
    """A short-horizon actor-critic: costs of a window of control periods, differentiated through the simulation."""

    lesson_options: dict[str, Any] = field(default_factory=lambda: {"start": "corners"})
    """Options in which the training's environments differ from that of the score, e.g. the start."""
    rounds: int = 12
    """Of the policy in the end; each one ends with an evaluation and a checkpoint."""
    candidates: int = 3
    """Untrained policies with which the training begins; after `trial_rounds` of each the best one goes on."""
    trial_rounds: int = 4
    """Rounds of each candidate; they are among the `rounds` of the one that goes on."""
    windows: int = 80
    """Windows in a round, each with one step of the policy's optimiser."""
    horizon: int = 32
    """Control periods of a window, through which derivatives run."""
    arms: int = 64
    """Arms side by side."""
    episode_steps: int = 450
    """Control periods after which a training episode is cut off."""
    torque_noise: float = 0.04
    """Largest standard deviation of what disturbs the torques in training, as a share of their limits; mean half."""
    gamma: float = 0.99
    """Discount of a control period."""
    critic_epochs: int = 2
    """Passes through a window of the critic, the value of what follows it; 0: no critic, plain backpropagation."""
    critic_batch: int = 512
    """Samples in a step of it."""
    critic_lambda: float = 0.95
    """Smoothing of the critic's targets."""
    critic_averaging: float = 0.7
    """The critic in targets is an average of its weights, which forgets by this factor in each window."""
    critic_observation: tuple[str, ...] = ("modal_coordinates", "modal_rates")
    """Blocks that the critic sees beside the policy's observation; they are needed in the training alone."""
    learning_rate: float = 3e-3
    """At the beginning, of policy and critic; it falls linearly to 0."""
    gradient_limit: float = 1.0
    """Largest norm of a gradient; longer ones are shortened."""
    error_knee: float = 0.3
    """Distance of the tip from the reference below which its cost is a square, above which it grows linearly [m]."""
    change_weight: float = 0.02
    """Of the squared change of the actions from one period to the next [m]."""
    excess_weight: float = 0.1
    """Of the squared excess of what the network wants over the largest action [m]."""
    deflection_share: float = 0.8
    """Of the deflection at which an episode ends; larger ones cost [1]."""
    deflection_weight: float = 10.0
    """Of the squared excess over it, as a share of the limit [m]."""
    hidden: tuple[int, ...] = (128, 128)
    """Sizes of the hidden layers, of the policy and of the critic each."""
    activation: Activation = "elu"
    """Between the layers."""
    evaluation_laps: int = 1
    """How often an evaluation runs each of the two standard laps; more than once where episodes differ."""

    def __post_init__(self) -> None:
        """Validate, each field and what they are together.

        Raises:
            TypeError, ValueError: naming the parameter, its value and what is allowed.
        """
        super().__post_init__()
        for one in fields(self) if self.critic_epochs == 0 else ():
            if one.name.startswith("critic_") and one.name != "critic_epochs":
                if (given := getattr(self, one.name)) != one.default:
                    raise ValueError(f"{one.name} = {shown(given)}: has no effect with critic_epochs = 0")
        if self.trial_rounds > self.rounds and self.candidates > 1:
            bound = f"rounds = {self.rounds}, with more than one of candidates"
            raise ValueError(f"trial_rounds = {self.trial_rounds}: must be at most {bound}")

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
        lessons = self.options | self.lesson_options
        return {"max_episode_steps": self.episode_steps, **lessons, "observation": [*own, *more]}

    def _checked(self) -> dict[str, Any]:
        least = {
            "rounds": 1,
            "candidates": 1,
            "trial_rounds": 1,
            "windows": 1,
            "horizon": 2,
            "arms": 1,
            "episode_steps": 1,
            "critic_epochs": 0,
        }
        least |= {"critic_batch": 1, "evaluation_laps": 1}
        shares = ("torque_noise", "gamma", "critic_lambda", "critic_averaging")
        weights = ("change_weight", "excess_weight", "deflection_weight")
        whole = {**mapping("options", self.options), **mapping("lesson_options", self.lesson_options)}
        lessons = check_options(check_id(self.environment), whole)
        blocks = tuple(listed("critic_observation", self.critic_observation))
        for n, name in enumerate(names("critic_observation", blocks) if blocks else ()):
            choice(f"critic_observation[{n}]", name, BLOCKS)
        return {
            "lesson_options": {name: lessons[name] for name in self.lesson_options},
            **{name: integer(name, getattr(self, name), bound) for name, bound in least.items()},
            **{name: number(name, getattr(self, name), least=0.0, most=1.0) for name in shares},
            **{name: number(name, getattr(self, name), "m", least=0.0) for name in weights},
            "learning_rate": number("learning_rate", self.learning_rate, above=0.0, most=1.0),
            "gradient_limit": number("gradient_limit", self.gradient_limit, above=0.0),
            "error_knee": number("error_knee", self.error_knee, "m", above=0.0),
            "deflection_share": number("deflection_share", self.deflection_share, least=0.0, most=1.0),
            "critic_observation": blocks,
            **checked_network(self.hidden, self.activation),
        }
