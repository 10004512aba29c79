"""`DAggerTraining`: imitation on a batch of arms.

Source: Ross, Gordon & Bagnell, *A reduction of imitation learning and structured prediction to no-regret online
learning*, AISTATS 2011.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import torch

from flexarm_agents.environments import make_batch, settings_of
from flexarm_agents.policies.encoders import past_readings
from flexarm_agents.policies.network import NetworkPolicy
from flexarm_agents.teaching.config import DAggerConfig
from flexarm_agents.teaching.drawn_paths import LAP, drawn_path
from flexarm_agents.teaching.path_teacher import PathTeacher
from flexarm_agents.teaching.rollouts import Rollout, run_rollout
from flexarm_agents.teaching.student import Student
from flexarm_agents.teaching.teacher import Teacher
from flexarm_agents.training.loop import Rounds
from flexarm_agents.training.run_folder import RunFolder
from flexarm_agents.training.warm_start import check_curriculum
from flexarm_env.envs.vector import FlexArmVectorEnv


class DAggerTraining(Rounds):
    """A student that imitates a teacher.

    A checkpoint holds no rollouts: each is repeated by the student of its round, with the same result.
    """

    config: DAggerConfig
    student: Student

    def __init__(self, config: DAggerConfig, run: RunFolder) -> None:
        """Check the curriculum, and that the teacher can have plans for the task; see `Training`."""
        super().__init__(config, run)
        check_curriculum(config)
        options = config.options | config.curriculum_options | {"start": "corner"}
        if config.drawn_paths:
            options |= {"reference": "drawn", "waypoints": drawn_path, "lap_time": LAP}
        self.options = [options]  # of the batches, which take turns
        if config.alternate_options:
            check_curriculum(config, "alternate_options")
            self.options.append(options | config.alternate_options)
        kind = PathTeacher if config.drawn_paths else Teacher
        for one in self.options:
            kind.check(settings_of(config.environment, one))
        self.envs: list[FlexArmVectorEnv] = []
        self.teachers: list[Teacher] = []  # of each batch

    def start(self) -> None:
        """See `Training`."""
        config = self.config
        plans = self.run.path / "plans" if config.plans is None else Path(config.plans)
        for number, options in enumerate(self.options):
            env = make_batch(config.environment, config.arms, options)
            self.envs.append(env)
            if config.drawn_paths:
                self.teachers.append(PathTeacher.along(config, env, plans, number))
            else:
                self.teachers.append(Teacher.of(config, env.settings, plans))
        torch.manual_seed(config.seed)
        self.rollouts = [self.rollout(None)]
        self.student = Student(config, past_readings(config.lags, env.observation_blocks), self.rollouts[0])
        if config.drawn_paths:
            self.student.mirror_with(env.observation_mirror, env.action_mirror)
        self.students: list[dict[str, Any]] = []  # after each round, averages alone
        self.done, self.round_steps = 0, config.arms * self.teachers[0].periods

    def rollout(self, student: NetworkPolicy | None) -> Rollout:
        """Run the next rollout; without a student, the first one, which the teacher drives alone."""
        number = 0 if student is None else len(self.rollouts)
        turn = number % len(self.envs)
        found = run_rollout(self.envs[turn], self.teachers[turn], student, self.config, number)
        if student is not None:
            # the stubs of numpy 2.5 do not say which precision a mean has
            self.teachers[turn].graded(1.0 - found.weights.reshape(-1, self.config.arms).mean(axis=0))  # type: ignore[arg-type, unused-ignore]
        return found

    def next_round(self) -> None:
        """See `Rounds`."""
        if self.students:
            self.rollouts.append(self.rollout(self.student.policy()))
        self.student.fit(self.rollouts)
        average = self.student.average.state_dict()
        self.students.append({name: value.clone() for name, value in average.items()})
        self.done += 1
        self.logger.record("dagger/loss", self.student.loss)
        self.logger.record("dagger/lost_arms", self.rollouts[-1].lost)

    def policy(self) -> NetworkPolicy:
        """See `Training`."""
        return self.student.policy()

    def state(self, complete: bool) -> dict[str, Any]:
        """See `Training`."""
        kept = {"done": self.done, "round_steps": self.round_steps}
        return kept if complete else kept | {"student": self.student.state(), "students": self.students}

    def restore(self, state: dict[str, Any]) -> None:
        """See `Training`."""
        if "student" not in state:  # complete
            self.done, self.round_steps = state["done"], state["round_steps"]
            return
        self.start()
        for weights in state["students"][:-1]:
            self.student.average.load_state_dict(weights)
            self.rollouts.append(self.rollout(self.student.policy()))
        self.student.restore(state["student"])
        self.students, self.done = state["students"], state["done"]

    def close(self) -> None:
        """See `Training`."""
        for env in self.envs:
            env.close()
