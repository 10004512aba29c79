"""Trainings so small that they take a second, and rows of evaluations, for the tests of agents."""

import itertools
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flexarm_agents import NetworkPolicy, Score, StandardScore, train
from flexarm_agents.files import put
from flexarm_agents.teaching.teacher import Teacher
from flexarm_agents.training import loop
from flexarm_agents.training.config import RunConfig
from flexarm_env.envs.vector import FlexArmVectorEnv

ID = "FlexArm/Square-v0"


class Interrupted(Exception):  # noqa: N818
    """Breaks a training off."""


TINY: dict[str, Any] = {
    "envs": 4,
    "rollout": 32,
    "batch": 64,
    "epochs": 2,
    "steps": 512,
    "hidden": [16, 8],
    "evaluate_every": 200,
    "checkpoint_every": 200,
    "episode_steps": 50,
    "options": {"noise": 0.001, "randomisation": {"payload_mass": [0.0, 0.2]}},
}
_ALIKE = {name: value for name, value in TINY.items() if name not in ("rollout", "epochs")}
_OFF_POLICY = {"buffer": 400, "learning_starts": 60, "train_every": 4, "updates": 1}
_READINGS = ("joint_angles", "joint_rates", "sensed_position", "reference_position", "reference_velocity")
_RECURRENT = {**TINY, "algorithm": "recurrent_ppo", "lstm": 8}
_SAC = {**_ALIKE, **_OFF_POLICY, "algorithm": "sac"}
_OBSERVED = {**TINY["options"], "observation": [*_READINGS, "last_actions"]}
_BEGUN = {"options": {}, "hidden": [128, 128], "initial_policy": "student_gauges"}
TINIES: dict[str, dict[str, Any]] = {
    "recurrent_ppo": _RECURRENT,
    "sac": _SAC,
    "tqc": {**_SAC, "algorithm": "tqc", "quantiles": 5, "learning_starts": 300},
    "privileged": {**TINY, "lags": [1, 3], "privileged_critic": True},
    "observer": {**TINY, "observer": "nominal", "options": _OBSERVED},
    "curriculum": {**TINY, "curriculum_options": {"lap_time": 32.0, "deflection_limit": None}, "curriculum_steps": 200},
    "recurrent curriculum": {**_RECURRENT, "curriculum_options": {"start": "moving"}, "curriculum_steps": 450},
    "sac curriculum": {**_SAC, "curriculum_options": {"start": "moving"}, "curriculum_steps": 300},
    "widening": {**TINY, "automatic_randomisation": True},
    "initial": {**TINY, **_BEGUN, "value_steps": 300, "value_learning_rate": 3e-3},
}
"""Tiny trainings of the other algorithms, and of PPO with something in front of its network."""
TAUGHT: dict[str, Any] = {
    "algorithm": "dagger",
    "arms": 4,
    "rounds": 3,
    "updates": 30,
    "batch": 64,
    "hidden": [16, 8],
    "lags": [1, 3],
    "change_weight": 0.003,  # that of the plans that come with the package, which are then the teacher's
    "options": {"noise": 0.001},
}

DESCENDED: dict[str, Any] = {
    "algorithm": "fopg",
    "seed": 1,  # of which the second candidate is the best
    "arms": 4,
    "rounds": 2,
    "candidates": 3,
    "trial_rounds": 1,
    "windows": 2,
    "horizon": 8,
    "episode_steps": 40,
    "hidden": [16, 8],
    "critic_batch": 16,
}


def score(swing: float | None, plain: float | None) -> StandardScore:
    """Return a score by the errors of both laps [m], None for a lap that was lost."""
    laps = (("error" if rms is None else "truncated", rms) for rms in (swing, plain))
    figures = (1.0, 1.0), 0, (0.1, 0.1), (1.0, 1.0), 0.0
    return StandardScore(*(Score(ended, 16.0, rms, rms, rms, rms, *figures) for ended, rms in laps))


def row(steps: int, swing: float | None, plain: float | None) -> dict[str, Any]:
    """Return a row of evaluations; see `score`."""
    return {"steps": steps, "seconds": 1.0, **score(swing, plain).as_mapping()}


@contextmanager
def at_step(number: int, act: Callable[[], None]) -> Iterator[None]:
    """Within `with`, do something in the middle of a training: as its environments' batch begins a step of a number."""
    step, count = FlexArmVectorEnv.step, itertools.count()

    def counted(self: FlexArmVectorEnv, actions: Any) -> Any:
        if next(count) == number:
            act()
        return step(self, actions)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(FlexArmVectorEnv, "step", counted)
        yield


@contextmanager
def without_pictures() -> Iterator[None]:
    """Let trainings write empty pictures, but in a folder `ppo`: to draw them takes longer than a tiny training."""
    with pytest.MonkeyPatch.context() as patch:
        for name in ("draw_curve", "draw_laps"):
            patch.setattr(loop, name, _drawn_in_one_folder(getattr(loop, name)))
        yield


def _drawn_in_one_folder(draw: Callable[..., None]) -> Callable[..., None]:
    return lambda *given: draw(*given) if given[-1].parent.name == "ppo" else put(given[-1], Path.touch)


@contextmanager
def short_rollouts(periods: int = 200) -> Iterator[None]:
    """Let the rollouts of a teaching along the standard laps end after so many control periods, not after a lap."""
    made = Teacher.__init__

    def make(self: Teacher, *given: Any) -> None:
        made(self, *given)
        self.periods = periods

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Teacher, "__init__", make)
        yield


def broken_off(config: RunConfig, folder: Path, number: int) -> None:
    """Begin a training, and break it off at a step; see `at_step`."""

    def interrupt() -> None:
        raise Interrupted

    with at_step(number, interrupt), pytest.raises(Interrupted):
        train(config, folder)


def same_network(one: NetworkPolicy, other: NetworkPolicy) -> bool:
    """Return whether two policies have the same layers, to the last bit."""
    pairs = zip([*one.weights, *one.biases], [*other.weights, *other.biases], strict=True)
    return all(np.array_equal(a, b) for a, b in pairs)


def same_policy(one: Path, other: Path) -> bool:
    """Return whether two files have the networks of one policy, to the last bit."""
    first, second = NetworkPolicy.load(one), NetworkPolicy.load(other)
    return same_network(first, second) and np.array_equal(first.log_std, second.log_std)
