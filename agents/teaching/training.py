"""`teach`: DAgger on a batch of arms, judged by the true score, with the best student kept.

Source: Ross, Gordon & Bagnell, *A reduction of imitation learning and structured prediction to no-regret online
learning*, AISTATS 2011.
"""

from __future__ import annotations

import io
from dataclasses import asdict
from pathlib import Path
from typing import Any

import torch
from stable_baselines3.common.logger import Logger

from flexarm_agents.environments import make_batch
from flexarm_agents.jobs.stopping import StopSignals
from flexarm_agents.policies.encoders import past_readings
from flexarm_agents.policies.network import NetworkPolicy
from flexarm_agents.teaching.config import TeachingConfig
from flexarm_agents.teaching.lessons import Lesson, give_lesson
from flexarm_agents.teaching.student import Student
from flexarm_agents.teaching.teacher import Teacher
from flexarm_agents.training.checkpoint import read_parts, write_parts
from flexarm_agents.training.evaluator import TrainingProgress
from flexarm_agents.training.rounds import Rounds
from flexarm_agents.training.run_folder import RunFolder
from flexarm_agents.training.train import Outcome, one_thread
from flexarm_agents.training.versions import versions
from flexarm_env.envs.vector import FlexArmVectorEnv

_STATE = "state.pt"


def teach(
    config: TeachingConfig,
    folder: str | Path | None = None,
    resume: bool = False,
    progress: bool = False,
    plans: str | Path | None = None,
) -> Outcome:
    """Teach, on one thread; the same configuration gives the same numbers on the same machine, interrupted or not.

    Args:
        config: the configuration.
        folder: for the results; None: `config.folder`. See `RunFolder` for what it holds.
        resume: go on with the interrupted teaching in the folder, from the round that it was in.
        progress: show a bar if stderr is a terminal; without a bar, the logger "flexarm_agents" gets a line for each
            round.
        plans: folder for the teacher's plans, which several teachings can share; None: `plans` in the folder.

    Raises:
        TrainingStopped: a `KeyboardInterrupt`, after SIGINT (Ctrl-C) or SIGTERM in the main thread: the round that runs
            is finished and a checkpoint written. A second signal ends the process at once.
        FileExistsError: if the folder is not empty and is not to be resumed.
        FileNotFoundError: if there is no teaching to resume.
        ValueError: if the teaching in the folder has another configuration, or the environment is not one of the
            standard laps by torques.
    """
    run = RunFolder(config.folder if folder is None else folder)
    run.enter(config, versions([__name__]), resume)
    with run.named(), one_thread(), StopSignals() as stop:
        lessons = config.options | config.lesson_options | {"start": "corner"}
        env = make_batch(config.environment, config.arms, lessons)
        try:
            where = run.path / "plans" if plans is None else Path(plans)
            teaching = _Teaching(config, run, env, Teacher.of(config, env.settings, where))
            steps = config.arms * teaching.teacher.periods
            return teaching.go_on(config, config.rounds, steps, config.evaluation_laps, stop, progress)
        finally:
            env.close()


class _Teaching(Rounds):
    """A teaching between two rounds.

    A checkpoint holds no lessons: each is given again by the student that was given it, with the same result.
    """

    def __init__(self, config: TeachingConfig, run: RunFolder, env: FlexArmVectorEnv, teacher: Teacher) -> None:
        super().__init__(run)
        self.config, self.env, self.teacher = config, env, teacher
        torch.manual_seed(config.seed)
        self.lessons = [self.lesson(None)]
        self.student = Student(config, past_readings(config.lags, env.observation_blocks), self.lessons[0])
        self.students: list[dict[str, Any]] = []  # after each round, averages alone
        if run.checkpoint.exists():
            self.load()

    def lesson(self, student: NetworkPolicy | None) -> Lesson:
        """Give the next lesson."""
        number = 0 if student is None else len(self.lessons)
        return give_lesson(self.env, self.teacher, student, self.config, number)

    @property
    def done(self) -> int:
        """See `Rounds`."""
        return len(self.students)

    def next_round(self, logger: Logger) -> None:
        """See `Rounds`."""
        if self.students:
            self.lessons.append(self.lesson(self.student.policy()))
        self.student.fit(self.lessons)
        self.students.append(self.average())
        logger.record("teaching/loss", self.student.loss)
        logger.record("teaching/lost_arms", self.lessons[-1].lost)

    def policy(self) -> NetworkPolicy:
        """See `Rounds`."""
        return self.student.policy()

    def average(self) -> dict[str, Any]:
        """Return a copy of the averaged weights."""
        return {name: value.clone() for name, value in self.student.average.state_dict().items()}

    def save(self, path: Path) -> None:
        """See `Rounds`."""
        state = {
            "found": asdict(self.found),
            "student": self.student.state(),
            "students": self.students,
            "random": torch.get_rng_state(),
        }
        content = io.BytesIO()
        torch.save(state, content)
        write_parts(path, self.config, {_STATE: content.getvalue()})

    def load(self) -> None:
        """Go on from the checkpoint; nothing in it is executed.

        Raises:
            ValueError: if the file is not a checkpoint of a teaching.
        """
        (content,) = read_parts(self.run.checkpoint, self.config, [_STATE])
        try:
            state = torch.load(io.BytesIO(content), weights_only=True)
            self.found = TrainingProgress(**state["found"])
            for weights in state["students"][:-1]:
                self.student.average.load_state_dict(weights)
                self.lessons.append(self.lesson(self.student.policy()))
            self.student.restore(state["student"])
            self.students = state["students"]
            torch.set_rng_state(state["random"])
        except Exception as error:  # damage meets torch anywhere
            raise ValueError(f"{self.run.checkpoint}: not a checkpoint of this teaching ({error})") from error
