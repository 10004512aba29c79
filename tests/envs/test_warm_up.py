"""`warm_up` compiles what environments need, and says what it did."""

import re

import gymnasium
import numpy as np
import pytest

import flexarm_env
from flexarm_env.codegen import cache
from flexarm_env.envs import batch, warm_up
from flexarm_env.envs.settings import Settings
from tests.support.envs import SQUARE
from tests.support.refusals import refused


def test_what_was_warmed_up_needs_no_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    (line,) = flexarm_env.warm_up([SQUARE])
    assert re.fullmatch(rf"{SQUARE}, num_envs = 1: (compiled|was ready)", line)
    monkeypatch.setattr(cache.KernelFolder, "begin", lambda self: pytest.fail("it compiles"))
    assert flexarm_env.warm_up((f"flexarm_env:{SQUARE}",)) == [f"flexarm_env:{SQUARE}, num_envs = 1: was ready"]
    observation, _ = gymnasium.make(SQUARE).reset(seed=0)
    assert np.isfinite(observation).all()


def test_each_id_and_size_is_asked_for_with_the_options(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[Settings, int, int]] = []

    def compile_nothing(self: batch.BatchSimulator) -> None:
        asked.append((self.settings, self.count, self._threads))

    monkeypatch.setattr(batch.BatchSimulator, "compile", compile_nothing)
    monkeypatch.setattr(batch.BatchSimulator, "dispatcher", lambda self: None)
    monkeypatch.setattr(warm_up, "_compilations", lambda kernel: len(asked))
    monkeypatch.setattr(cache, "is_kept", lambda kernel: True)
    ids = [SQUARE, "FlexArm/SquareGain-v0"]
    lines = flexarm_env.warm_up(ids, {"noise": 0.01}, num_envs=[1, 64], threads=2)
    assert lines == [f"{env_id}, num_envs = {size}: compiled" for env_id in ids for size in (1, 64)]
    assert [(one.action_mode, one.noise, count) for one, count, _ in asked] == [
        (mode, 0.01, count) for mode in ("torque", "gain") for count in (1, 64)
    ]
    assert [threads for _, _, threads in asked] == [1, 2, 1, 2]


def test_what_cannot_be_kept_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cache, "is_kept", lambda kernel: False)
    with pytest.raises(OSError, match=rf"{SQUARE}, num_envs = 1: compiled, but not kept"):
        flexarm_env.warm_up([SQUARE])


test_bad_input_is_refused = refused(
    ({"ids": SQUARE}, "TypeError: ids = "),
    ({"ids": []}, "ids = "),
    ({"ids": ["CartPole-v1"]}, "ids = 'CartPole-v1': must be ids of environments of FlexArm"),
    ({"options": {"frames": "world"}}, "TypeError: frames"),
    ({"options": ["noise"]}, "TypeError: options = "),
    ({"num_envs": 8}, "TypeError: num_envs = 8"),
    ({"num_envs": [0]}, r"num_envs\[0\] = 0"),
    ({"threads": 0}, "threads = 0"),
    by=lambda arguments: flexarm_env.warm_up(**{"ids": [SQUARE]} | arguments),
)
