"""The base of torque controllers: what it reads of an environment, and what goes through `predict`."""

from typing import Any, ClassVar

import gymnasium
import numpy as np
import pytest

from flexarm_baselines.controller import Memory, Seen, TorqueController
from flexarm_baselines.task import Task
from flexarm_env import ArmParameters, SquareParameters, square
from flexarm_env.rollout import run_policy
from tests.support.refusals import refused

ID = "flexarm_env:FlexArm/Square-v0"


class Integrator(TorqueController):
    """Sum up how far theta1 has moved since the episode began, and count the periods."""

    blocks: ClassVar[tuple[str, ...]] = ("joint_angles", "lap_phase")

    def start(self, seen: Seen) -> Memory:
        return seen["joint_angles"][:, 0], np.zeros(len(seen))

    def torque(self, seen: Seen, memory: Memory) -> tuple[Any, Memory]:
        begun, count = memory
        moved = seen["joint_angles"][:, 0] - begun
        return np.stack([10.0 * moved, 100.0 + count], axis=1), (begun, count + 1.0)


BLOCKS = {"joint_angles": slice(0, 2), "lap_phase": slice(2, 4)}
TASK = Task(ArmParameters.linear(), square(SquareParameters()), blocks=BLOCKS, scale=np.array([2.0, 2.0, 1.0, 1.0]))


def observed(angles: list[float]) -> np.ndarray:
    rows = np.zeros((len(angles), 4), dtype=np.float32)
    rows[:, 0], rows[:, 2] = np.array(angles) / 2.0, 1.0
    return rows


def test_memory_begins_where_an_episode_does() -> None:
    controller = Integrator(TASK)
    action, state = controller.predict(observed([1.0, 2.0, 3.0]))
    assert action == pytest.approx(np.array([[0.0, 1.0]] * 3))  # limited: 100 of 50 N m
    action, state = controller.predict(observed([1.5, 2.5, 3.5]), state)
    assert action[:, 0] == pytest.approx([5.0 / 150.0] * 3, rel=1e-6)
    before = tuple(part.copy() for part in state)
    action, after = controller.predict(observed([7.0, 9.0, 4.0]), state, np.array([False, True, False]))
    assert action[:, 0] == pytest.approx(np.array([60.0, 0.0, 10.0]) / 150.0, rel=1e-6)
    assert after[1].tolist() == [3.0, 1.0, 3.0]
    assert all(np.array_equal(one, other) for one, other in zip(state, before, strict=True)), "a memory was changed"


def test_time_of_the_lap() -> None:
    periods = np.array([0, 1, 799, 1599])
    angle = 2.0 * np.pi * (periods + 1e-4) / 1600.0
    rows = np.zeros((4, 4), dtype=np.float32)
    rows[:, 2], rows[:, 3] = np.cos(angle), np.sin(angle)
    assert Seen(TASK, rows).time == pytest.approx(0.01 * periods)
    rows[:, 3] *= -1.0  # the last instants of a lap are not the first
    assert Seen(TASK, rows[:2]).time == pytest.approx([0.0, 15.99])


def test_it_reads_an_environment_and_runs() -> None:
    env = gymnasium.make(ID, **Integrator.options())
    controller = Integrator.for_env(env)
    task = controller.task
    assert (task.period, task.periods, task.torque_limit) == (0.01, 1600, (150.0, 50.0))
    assert task.delay == pytest.approx(9.0 / 288.33)
    assert task.path.position(4.0) == pytest.approx([-6.3, 6.3])
    run = run_policy(env, controller, max_steps=30)
    assert run.torque[0] == pytest.approx([0.0, 50.0])
    other = Integrator.for_env(gymnasium.make(ID, direction="counterclockwise", **Integrator.options()))
    assert other.task.path.position(4.0) == pytest.approx([6.3, -6.3])


test_environments_that_do_not_fit = refused(
    ({"action_mode": "torque_rate"}, "action_mode = 'torque_rate'"),
    ({"frame": "link"}, "frame = 'link'"),
    ({"direction": "either"}, "direction = 'either'"),
    ({"reference": ("square", "circle")}, "one reference"),
    ({"observation": ("joint_angles",)}, r"reads the block 'lap_phase'.*Integrator\.options\(\)"),
    by=lambda changes: Integrator.for_env(gymnasium.make(ID, **Integrator.options() | changes)),
)


test_what_it_cannot_read = refused(
    (lambda: Integrator(TASK).predict({"joint_angles": np.zeros(2)}), "TypeError: dict"),
    (lambda: Integrator(TASK).predict(np.zeros(3, dtype=np.float32)), r"shape \(4,\) or \(n, 4\), got \(3,\)"),
    (lambda: Seen(TASK, observed([0.0]))["gauges"], "must have the block 'gauges'"),
    (lambda: Integrator.for_env(gymnasium.make("CartPole-v1")), "TypeError: FlexArm"),
)
