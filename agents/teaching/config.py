"""`TeachingConfig`: everything that decides what a teaching gives, with tuned defaults."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from flexarm_agents.environments import check_id, check_options
from flexarm_agents.policies.encoders import LONGEST_LAG, checked_increasing
from flexarm_agents.training.config import Activation, RunConfig, checked_network
from flexarm_env.validation import integer, number, pair, shown


@dataclass(frozen=True, kw_only=True)
class TeachingConfig(RunConfig):
    """DAgger: a student imitates, in the situations that it gets into, a teacher that knows everything."""

    lesson_options: dict[str, Any] = field(default_factory=dict)
    """Options in which the lessons differ from the environment that the student is scored on, e.g. a wider box."""
    rounds: int = 4
    """Rounds of laps, each with a fit to the data of all rounds so far."""
    arms: int = 64
    """Arms side by side, each of which runs a lap in a round."""
    updates: int = 1000
    """Steps of the optimiser in a round."""
    batch: int = 1024
    """Samples in such a step."""
    learning_rate: float = 2e-3
    """At the beginning; it falls to 0 as half a cosine."""
    averaging: float = 0.998
    """The student is the average of the network's weights, which forgets by this factor in each update."""
    teacher_share: float = 0.2
    """Share of the time in which the teacher drives, from the half of the rounds on; all of it in the first round."""
    torque_noise: float = 0.04
    """Largest standard deviation of what disturbs the torques in a lap, as a share of their limits."""
    knee: float = 0.06
    """Correction by the teacher's feedback, as a share of the limits, that halves the weight of a sample."""
    hidden: tuple[int, ...] = (128, 128)
    """Sizes of the hidden layers."""
    activation: Activation = "elu"
    """Between the layers."""
    lags: tuple[int, ...] = ()
    """Ages of the readings that the student remembers [control periods]; none: it sees the present ones only."""
    change_weight: float = 0.1
    """Of the teacher's plans: on changes of the torques [m^2], see `TrackingProblem`."""
    deflection_limit: float = 1.4
    """Of the teacher's plans: deflections of the links' tips beyond which they cost much [m]."""
    plants: tuple[int, int] = (3, 3)
    """How many payloads and stiffnesses the teacher has plans for, where they are drawn."""
    evaluation_laps: int = 1
    """How often an evaluation runs each of the two standard laps; more than once where episodes differ."""

    def _checked(self) -> dict[str, Any]:
        least = {"rounds": 1, "arms": 2, "updates": 1, "batch": 1, "evaluation_laps": 1}
        if integer("arms", self.arms, 2) % 2:
            raise ValueError(f"arms = {shown(self.arms)}: must be even, half of them for each lap")
        pair("plants", self.plants, least=2)
        return {name: integer(name, getattr(self, name), bound) for name, bound in least.items()} | {
            "lesson_options": check_options(check_id(self.environment), self.lesson_options),
            "learning_rate": number("learning_rate", self.learning_rate, above=0.0, most=1.0),
            "averaging": number("averaging", self.averaging, least=0.0, most=1.0),
            "teacher_share": number("teacher_share", self.teacher_share, least=0.0, most=1.0),
            "torque_noise": number("torque_noise", self.torque_noise, least=0.0, most=1.0),
            "knee": number("knee", self.knee, above=0.0),
            "lags": checked_increasing("lags", self.lags, 1, LONGEST_LAG),
            "change_weight": number("change_weight", self.change_weight, "m^2", least=0.0),
            "deflection_limit": number("deflection_limit", self.deflection_limit, "m", above=0.0),
            "plants": tuple(integer(f"plants[{n}]", count, 2) for n, count in enumerate(self.plants)),
            **checked_network(self.hidden, self.activation),
        }
