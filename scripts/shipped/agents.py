"""Which agents are shipped, and how each is trained; all trainings of one differ in their seeds alone."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from flexarm_agents import TeachingConfig, TrainingConfig
from flexarm_agents.config import RunConfig
from flexarm_env.envs.registration import IDS, UNKNOWN_PLANT

LATE_TIP: dict[str, Any] = {"observation": list(IDS["SquareDelayEasy-v0"].options["observation"]), "last_actions": 8}
# Half a second of readings, closer together where they are new: what payload, stiffness and delay show in.
HALF_A_SECOND = (1, 2, 3, 4, 6, 8, 11, 15, 20, 27, 36, 48)
# The unknown plant with longer delays and less damping: at the box's own edge, where both meet, students are at theirs.
WIDER = {name: list(limits) for name, limits in UNKNOWN_PLANT["randomisation"].items()} | {
    "damping": [0.002, 0.02],
    "delay": [0.0, 0.07],
    "actuation_delay": [0.0, 0.013],
}
AGENTS: dict[str, RunConfig] = {
    "square": TrainingConfig(),
    "student": TeachingConfig(options=LATE_TIP),
    "student_gauges": TeachingConfig(),
    "student_unknown": TeachingConfig(
        environment="FlexArm/SquareUnknown-v0",
        options={"last_actions": 1},
        lesson_options={"randomisation": WIDER},
        rounds=5,
        lags=HALF_A_SECOND,
        deflection_limit=1.1,  # a margin for what the student does not know at the start
        evaluation_laps=6,
    ),
}
TEXTS = {
    "square": "PPO, shipped (`square`)",
    "student": "taught, encoders and late tip (`student`)",
    "student_gauges": "taught, strain gauges too (`student_gauges`)",
    "student_unknown": "taught on the unknown plant (`student_unknown`)",
}


def configs(name: str, seeds: int) -> list[RunConfig]:
    """Return the configurations of an agent's trainings, with the seeds from 0 on."""
    return [replace(AGENTS[name], seed=seed) for seed in range(seeds)]
