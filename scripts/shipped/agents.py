"""Which agents are shipped, and how each is trained; all trainings of one differ in their seeds alone."""

from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from flexarm_agents import DAggerConfig, PPOConfig
from flexarm_agents.policies.observer import FILTERED
from flexarm_agents.training.config import RunConfig
from flexarm_env.envs.registration import IDS, UNKNOWN_PLANT
from scripts.common.trainings import Job

LATE = list(IDS["SquareDelayEasy-v0"].options["observation"])
# The late sensor's readings pass through the filter.
BEHIND_FILTER = [*(name for name in LATE if not name.startswith("sensor_error")), *FILTERED]
LATE_TIP: dict[str, Any] = {"observation": LATE, "last_actions": 8}
# The plant of `Paper-v0`, with its gain set 100 times a second and the observation of `Square-v0`.
_PLANT = ("arm", "feedback_source", "sensor", "deflection_limit", "error_limit")
PAPER: dict[str, Any] = {name: IDS["Paper-v0"].options[name] for name in _PLANT} | {"physics_step": None}
# Half a second of readings, closer together where they are new: what payload, stiffness and delay show in.
HALF_A_SECOND = (1, 2, 3, 4, 6, 8, 11, 15, 20, 27, 36, 48)
# Unknown arms with longer delays and less damping: at the box's own edge, where both meet, students are at theirs.
WIDER = {name: list(limits) for name, limits in UNKNOWN_PLANT["randomisation"].items()} | {
    "damping": [0.002, 0.02],
    "delay": [0.0, 0.07],
    "actuation_delay": [0.0, 0.013],
}

# Delays twice as long as the box's, with jitter and lost readings.
LATER = WIDER | {"delay": [0.0, 0.12], "jitter": [0.0, 0.02], "dropout": [0.0, 0.1]}
# Of any path: no block of the episode's side of the elbow, and previews that look further ahead.
OF_ANY_PATH: dict[str, Any] = {
    "last_actions": 1,
    "observation": [
        *("elbow_direction", "joint_rates", "present_joint_error", "present_joint_error_rate", "encoder_error"),
        *("sensor_error", "reference_position", "reference_velocity", "previews", "last_actions"),
    ],
    "previews": [0.04, 0.08, 0.13, 0.2, 0.28, 0.37, 0.48, 0.6, 0.75, 0.9, 1.1, 1.3, 1.6],
}


class Shipped(NamedTuple):
    """A shipped agent."""

    text: str  # what it is, in tables
    config: RunConfig  # of its trainings, but for the seed
    seeds: int = 11  # how many trainings there are
    drawn: bool = False  # the picture of learning curves shows it

    def jobs(self, folder: Path, seeds: int) -> list[Job]:
        """Return its trainings, with the seeds from 0 on."""
        return [(replace(self.config, seed=seed), folder / f"seed-{seed}") for seed in range(seeds)]


UNKNOWN = DAggerConfig(
    environment="FlexArm/SquareUnknown-v0",
    options={"last_actions": 1},
    curriculum_options={"randomisation": WIDER},
    rounds=5,
    lags=HALF_A_SECOND,
    deflection_limit=1.1,  # a margin for what the student does not know at the start
    evaluation_laps=6,
)

UNIVERSAL = DAggerConfig(
    environment="FlexArm/SquareUnknown-v0",
    options=OF_ANY_PATH,
    curriculum_options={"randomisation": LATER},
    drawn_paths=1600,
    arms=96,
    rounds=30,
    updates=2000,
    hidden=(384, 256),
    lags=(*HALF_A_SECOND, 64),
    knee=0.12,
    deflection_limit=1.1,
    evaluation_laps=4,
)

AGENTS: dict[str, Shipped] = {
    "square": Shipped("PPO, shipped (`square`)", PPOConfig(), drawn=True),
    "filtered": Shipped(
        "PPO behind a Kalman filter (`filtered`)",
        PPOConfig(
            environment="FlexArm/SquareDelayMedium-v0",
            options={"last_actions": 1, "observation": BEHIND_FILTER},
            observer="delay",
            steps=1_000_000,
            evaluate_every=100_000,
            evaluation_laps=3,
        ),
    ),
    "scheduler": Shipped(
        "gain scheduler, PPO (`scheduler`)", PPOConfig(environment="FlexArm/SquareGain-v0", steps=500_000)
    ),
    "scheduler_paper": Shipped(
        "gain scheduler on the paper's plant, PPO (`scheduler_paper`)",
        PPOConfig(environment="FlexArm/SquareGain-v0", options=PAPER, steps=500_000),
    ),
    "student": Shipped("student, encoders and late tip (`student`)", DAggerConfig(options=LATE_TIP), drawn=True),
    "student_gauges": Shipped("student, strain gauges too (`student_gauges`)", DAggerConfig(), drawn=True),
    "student_unknown": Shipped("student, unknown arms (`student_unknown`)", UNKNOWN, seeds=7, drawn=True),
    "student_unknown_stamped": Shipped(
        "student, unknown arms, time stamps (`student_unknown_stamped`)",
        replace(UNKNOWN, options=UNKNOWN.options | {"observation": [*LATE, "reading_age"]}),
        seeds=3,
    ),
    "carry": Shipped(
        "student, unknown loads (`carry`)",
        DAggerConfig(
            environment="FlexArm/Carry-v0",
            options={"last_actions": 1},
            rounds=5,
            updates=3000,
            lags=(1, 3, 8, 20),
            plants=(5, 2),
            torque_noise=0.02,
            tip_weight=0.01,
            evaluation_laps=3,
        ),
        seeds=1,
    ),
    "race": Shipped(
        "PPO, a race (`race`)",
        PPOConfig(environment="FlexArm/Race-v0", steps=10_000_000, evaluate_every=500_000),
        seeds=3,
    ),
    "unknown": Shipped(
        "PPO, unknown arms (`unknown`)",
        PPOConfig(
            environment="FlexArm/SquareUnknown-v0",
            options={"last_actions": 1},
            lags=HALF_A_SECOND,
            privileged_critic=True,
            evaluate_every=500_000,
            evaluation_laps=6,
        ),
    ),
    "universal": Shipped("student of any path (`universal`)", UNIVERSAL, seeds=10),
}
