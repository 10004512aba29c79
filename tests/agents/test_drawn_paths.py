"""Teaching on drawn paths: the paths, plans for their own arms, loads on the way, mirror images."""

from collections.abc import Iterator
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from stable_baselines3.common.logger import Logger

from flexarm_agents import config_of
from flexarm_agents.teaching.drawn_paths import FASTEST, RING, drawn_path
from flexarm_agents.teaching.path_teacher import PathTeacher
from flexarm_agents.teaching.rollouts import Rollout, run_rollout
from flexarm_agents.teaching.student import Student
from flexarm_agents.teaching.training import DAggerTraining
from flexarm_agents.training.run_folder import RunFolder
from flexarm_baselines.optimal import Plan
from tests.support.refusals import refuses
from tests.support.trainings import TAUGHT, same_network

DRAWN: dict[str, Any] = TAUGHT | {"drawn_paths": 3, "arms": 2, "change_weight": 0.1, "updates": 2, "rounds": 2}
BOX = {"randomisation": {"payload_mass": [0.0, 1.0], "delay": [0.0, 0.1], "actuation_delay": [0.0, 0.01]}}


@pytest.fixture(scope="module")
def short_paths() -> Iterator[None]:
    """Let paths last 5 s, of which 4 s are taught."""
    with pytest.MonkeyPatch.context() as patch:
        for module in ("drawn_paths", "path_teacher", "training"):
            patch.setattr(f"flexarm_agents.teaching.{module}.LAP", 5.0)
        patch.setattr("flexarm_agents.teaching.path_teacher.TAUGHT", 4.0)
        patch.setattr("flexarm_agents.teaching.path_teacher.MORE", 100)
        yield


@pytest.fixture(scope="module")
def drawn(short_paths: None, tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Begin a teaching on drawn paths: two arms, three paths."""
    folder = tmp_path_factory.mktemp("runs")
    training = DAggerTraining(config_of(**DRAWN | {"options": BOX}), RunFolder(folder / "drawn"))
    training.start()
    assert isinstance(training.teachers[0], PathTeacher)
    return training


@given(seed=st.integers(0, 2**32 - 1))
def test_a_drawn_path_stays_in_the_ring_and_below_the_speed(seed: int) -> None:
    table = drawn_path(np.random.default_rng(seed))
    np.testing.assert_array_equal(table, drawn_path(np.random.default_rng(seed)))
    np.testing.assert_allclose(np.diff(table[:, 0]), 0.01)
    assert np.linalg.norm(table[:, 1:], axis=1).max() <= RING[1] + 1e-9  # blended corners lie within
    speed = np.linalg.norm(np.diff(table[:, 1:], axis=0), axis=1).max() / 0.01
    assert 0.0 < speed <= 1.25 * FASTEST + 1e-6  # 1.25: minimum jerk in 1.5 times the time


def test_a_teacher_of_drawn_paths_keeps_each_arm_to_its_own(drawn: Any) -> None:
    """The plan's reference is the environment's, and the true tip errs by what the plan does, whatever the delays."""
    teacher, env = drawn.teachers[0], drawn.envs[0]
    _, infos = teacher.begin(env, np.random.default_rng(1))
    pupils, plans, errors = teacher.pupils(env, np.ones(2, dtype=bool)), [], []
    folder = drawn.run.path / "plans"
    for seed in teacher.seeds[pupils.lap]:
        plans.append(Plan.load(folder / f"{seed}.npz"))
    for period in range(teacher.periods):
        np.testing.assert_allclose(infos["reference"], [plan.reference[period] for plan in plans], atol=1e-6)
        answers, _ = teacher.actions(pupils, np.full(2, period), infos["state"])
        *_, infos = env.step(answers)
        errors.append(infos["true_tip"])
    for n, plan in enumerate(plans):
        planned = plan.arm.position(plan.states[1 : teacher.periods + 1, :8], 2, 4.5)
        np.testing.assert_allclose(np.array(errors)[:, n], planned, atol=0.03)  # [m]; torques act up to 10 ms late


def test_an_arm_without_a_plan_teaches_nothing(drawn: Any) -> None:
    teacher = drawn.teachers[0]
    _, infos = teacher.begin(drawn.envs[0], np.random.default_rng(1))
    first = teacher.pupils(drawn.envs[0], np.ones(2, dtype=bool))
    after = teacher.pupils(drawn.envs[0], np.array([True, False]), first)
    assert after.lap.tolist() == [-1, first.lap[1]]
    _, feedback = teacher.actions(after, np.zeros(2, dtype=np.int64), infos["state"])
    assert np.isinf(feedback[0]).all()
    assert np.isfinite(feedback[1]).all()


def test_the_teacher_takes_over_arms_that_a_student_would_lose(drawn: Any) -> None:
    policy, config = drawn.student.policy(), replace(drawn.config, teacher_share=0.0)
    idle = replace(policy, weights=[0.0 * weight for weight in policy.weights])  # no torque
    assert run_rollout(drawn.envs[0], drawn.teachers[0], idle, config, 1).lost == 0
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(PathTeacher, "rescues", False)
        assert 0 < run_rollout(drawn.envs[0], drawn.teachers[0], idle, config, 1).lost <= config.arms  # each one once


def test_paths_that_a_student_leaves_are_drawn_more_often(drawn: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    teacher, random = drawn.teachers[0], np.random.default_rng(0)
    monkeypatch.setattr(teacher, "difficulty", np.full(3, np.nan))
    monkeypatch.setattr(teacher, "chosen", np.array([0, 1]))
    teacher.graded(np.array([0.1, 0.9]))  # the third is unknown: it counts as the mean of the others
    times = np.zeros(3)
    for _ in range(200):
        teacher.begin(drawn.envs[0], random)
        times[teacher.chosen] += 1
    # chances of the first draw are 0.2, 0.47, 0.33, and those of being one of the two that are drawn:
    np.testing.assert_allclose(times / 200, [0.475, 0.817, 0.708], atol=0.1)
    teacher.difficulty[:] = 0.0  # no student left its plan, e.g. where the teacher drives all the time
    teacher.begin(drawn.envs[0], random)


def test_plans_of_drawn_paths_are_kept_and_others_refused(drawn: Any) -> None:
    folder = drawn.run.path / "plans"
    before = {path.name: path.stat().st_mtime_ns for path in folder.iterdir()}
    again = PathTeacher.along(drawn.config, drawn.envs[0], folder)
    np.testing.assert_allclose(again.plans.states, drawn.teachers[0].plans.states, atol=1e-5)
    assert {path.name: path.stat().st_mtime_ns for path in folder.iterdir()} == before
    with refuses(ValueError, "1000000.npz: a plan of another arm or path, or not with"):
        PathTeacher.along(replace(drawn.config, change_weight=0.2), drawn.envs[0], folder)


def test_paths_of_which_none_got_a_plan_are_refused(drawn: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("flexarm_agents.teaching.path_teacher._plan", lambda *given: None)
    with refuses(ValueError, "drawn_paths = 3: no path got a plan with an r.m.s. error below 0.3 m"):
        PathTeacher.along(drawn.config, drawn.envs[0], drawn.run.path / "plans")


LOADS = {
    "payload_changes": [[0.072, None], [0.144, 0.0]],
    "randomisation": BOX["randomisation"] | {"payload_mass": [0.2, 1.5]},
}


@pytest.fixture(scope="module")
def carrying(drawn: Any) -> Any:
    """Begin a teaching of which the second path and every second round have loads; rounds take 0.4 s."""
    values = DRAWN | {"options": BOX, "alternate_options": LOADS, "rounds": 3, "plans": str(drawn.run.path / "plans")}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("flexarm_agents.teaching.path_teacher.TAUGHT", 0.4)
        training = DAggerTraining(config_of(**values), drawn.run)
        training.logger = Logger(None, [])
        training.start()
        yield training
    training.close()


def test_a_plan_with_loads_is_the_motion_of_its_environment(carrying: Any) -> None:
    (_, env), (_, teacher) = carrying.envs, carrying.teachers
    assert teacher.seeds.tolist() == [1_000_001]
    at_once = {name: np.zeros(2) for name in ("delay", "actuation_delay")}
    _, infos = env.reset(seed=[1_000_001] * 2, options={"parameters": at_once})
    plan = Plan.load(Path(carrying.config.plans) / "1000001-carrying.npz")
    for period in range(100):
        np.testing.assert_allclose(infos["state"][0, :8], plan.states[period, :8], atol=2e-3)  # other steps than its
        np.testing.assert_allclose(infos["payload"][0], plan.parameters.payload_mass * (36 < period <= 72))
        *_, infos = env.step(np.float32([plan.torques[period] / plan.limits] * 2))
    assert np.abs(plan.replay().states[100] - plan.states[100])[:8].max() > 0.02  # with the load throughout
    np.testing.assert_array_equal(teacher.plans.states[0], plan.states.astype(np.float32))
    config = replace(carrying.config, alternate_options=LOADS | {"payload_changes": [[0.072, None], [0.168, 0.0]]})
    again = DAggerTraining(config, carrying.run)
    with refuses(ValueError, "1000001-carrying.npz: a plan of another arm or path, or not with"):
        again.start()
    again.close()


def test_rounds_with_loads_alternate_and_are_repeated_as_they_were(carrying: Any) -> None:
    for _ in range(2):
        carrying.next_round()
    kept, generator = deepcopy(carrying.state(complete=False)), torch.get_rng_state()
    again = DAggerTraining(carrying.config, carrying.run)
    again.logger = carrying.logger
    again.restore(kept)
    for training in (carrying, again):
        torch.set_rng_state(generator)
        training.next_round()
        assert all(np.isfinite(teacher.difficulty).any() for teacher in training.teachers)
    for one, same in zip(carrying.rollouts, again.rollouts, strict=True):
        np.testing.assert_array_equal(one.observations, same.observations)
    assert same_network(carrying.policy(), again.policy())
    again.close()


def test_a_student_learns_mirror_images() -> None:
    """From samples with positive inputs alone it knows what to do with negative ones."""
    count = 512
    inputs = np.random.default_rng(0).uniform(0.2, 1.5, (count, 1)).astype(np.float32)
    answers, weights = 0.5 * np.repeat(inputs, 2, axis=1), np.ones(count, np.float32)
    torch.manual_seed(0)
    config = config_of(**TAUGHT | {"lags": [], "rounds": 1, "updates": 500, "batch": 256, "hidden": [32]})
    data = Rollout(inputs, np.zeros(count, np.int64), answers, weights, lost=0)
    student = Student(config, None, data)
    student.mirror_with(np.float32([-1.0]), np.float32([-1.0, 1.0]))
    student.fit([data])
    found, _ = student.policy().predict(np.float32([[0.8], [-0.8]]))
    np.testing.assert_allclose(found, [[0.4, 0.4], [-0.4, 0.4]], atol=0.1)  # else of the other sign
