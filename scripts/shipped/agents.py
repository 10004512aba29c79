"""Which agents are shipped, and how each is trained; all trainings of one differ in their seeds alone."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from flexarm_agents import TeachingConfig, TrainingConfig
from flexarm_agents.training.config import RunConfig
from flexarm_env.envs.registration import IDS, UNKNOWN_PLANT
from scripts.common.trainings import Job
from scripts.learning import delays, schedulers

LATE_TIP: dict[str, Any] = {"observation": list(IDS["SquareDelayEasy-v0"].options["observation"]), "last_actions": 8}
# Half a second of readings, closer together where they are new: what payload, stiffness and delay show in.
HALF_A_SECOND = (1, 2, 3, 4, 6, 8, 11, 15, 20, 27, 36, 48)
# Unknown arms with longer delays and less damping: at the box's own edge, where both meet, students are at theirs.
WIDER = {name: list(limits) for name, limits in UNKNOWN_PLANT["randomisation"].items()} | {
    "damping": [0.002, 0.02],
    "delay": [0.0, 0.07],
    "actuation_delay": [0.0, 0.013],
}


class Shipped(NamedTuple):
    """A shipped agent.

    Attributes:
        text: what it is, in tables.
        config: of its trainings, but for the seed.
        seeds: how many trainings there are, an odd number.
        study: "study/agent" of `scripts.learning` whose trainings these are; "": it has its own.
    """

    text: str
    config: RunConfig
    seeds: int = 11
    study: str = ""

    def jobs(self, name: str, seeds: int, own: Path, studies: Path) -> list[Job]:
        """Return its trainings, with the seeds from 0 on.

        Args:
            name: of the agent.
            seeds: how many.
            own: folder of the trainings that belong to no study.
            studies: folder of the studies.
        """
        folder = studies / self.study if self.study else own / name
        return [(replace(self.config, seed=seed), folder / f"seed-{seed}") for seed in range(seeds)]


AGENTS: dict[str, Shipped] = {
    "square": Shipped("PPO, shipped (`square`)", TrainingConfig()),
    "filtered": Shipped(
        "PPO behind a Kalman filter (`filtered`)",
        delays.config_of("unknown", "observer"),
        study="delays/unknown-observer",
    ),
    "scheduler": Shipped(
        "gain scheduler, PPO (`scheduler`)", schedulers.STUDY.agents["square"], study="schedulers/square"
    ),
    "scheduler_paper": Shipped(
        "gain scheduler on the paper's plant, PPO (`scheduler_paper`)",
        schedulers.STUDY.agents["paper"],
        study="schedulers/paper",
    ),
    "student": Shipped("student, encoders and late tip (`student`)", TeachingConfig(options=LATE_TIP)),
    "student_gauges": Shipped("student, strain gauges too (`student_gauges`)", TeachingConfig()),
    "student_unknown": Shipped(
        "student, random arms (`student_unknown`)",
        TeachingConfig(
            environment="FlexArm/SquareUnknown-v0",
            options={"last_actions": 1},
            lesson_options={"randomisation": WIDER},
            rounds=5,
            lags=HALF_A_SECOND,
            deflection_limit=1.1,  # a margin for what the student does not know at the start
            evaluation_laps=6,
        ),
    ),
}
