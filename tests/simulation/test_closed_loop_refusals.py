"""What `ClosedLoop` refuses: gains, noise, states, limits, set-ups."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from flexarm_env import ClosedLoop, LawParameters, LoopCase, SensorParameters
from tests.support.batches import ARM, CASES, PATH, assert_same_bits, start_states


@pytest.fixture(scope="module")
def pair_of_arms() -> ClosedLoop:
    loop = ClosedLoop(ARM, CASES[:2], PATH)
    loop.reset(start_states(2))
    return loop


@pytest.mark.parametrize(
    ("gain", "message"),
    [
        ([1.0, -0.1], r"gain = -0\.1: must be >= 0"),
        ([1.0, np.nan], r"gain\[1\] = nan: must be finite"),
        ([np.inf, 1.0], r"gain\[0\] = inf: must be finite"),
        ([1.0], r"gain: must have shape \(2,\), got \(1,\)"),
        ([[1.0, 1.0]], r"gain: must have shape \(2,\), got \(1, 2\)"),
        (1.0, r"gain: must have shape \(2,\), got \(\)"),
    ],
)
def test_a_bad_gain_is_refused_and_nothing_moves(pair_of_arms: ClosedLoop, gain: Any, message: str) -> None:
    before = pair_of_arms.results()
    with pytest.raises(ValueError, match=message):
        pair_of_arms.advance(gain)
    assert_same_bits([pair_of_arms.results()], [before])


def test_nothing_runs_before_a_reset() -> None:
    with pytest.raises(RuntimeError, match=r"advance\(\) before reset\(\)"):
        ClosedLoop(ARM, CASES[:1], PATH).advance([1.0])


@pytest.mark.parametrize("limits", [np.ones(7), np.zeros(8), np.full(8, np.nan), -np.ones(8), 1.0])
def test_bad_limits_are_refused(limits: Any) -> None:
    with pytest.raises(ValueError, match=r"state_limits = .* must be 8 numbers > 0"):
        ClosedLoop(ARM, CASES[:1], PATH, state_limits=limits)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((ARM.parameters, CASES, PATH), r"arm = .* must be a FlexibleArm"),
        ((ARM, CASES, PATH.table), r"(?s)path = .* must be a ReferencePath"),
        ((ARM, [SensorParameters()], PATH), r"cases hold .* must be LoopCase objects"),
    ],
)
def test_wrong_kinds_are_refused(arguments: Any, message: str) -> None:
    with pytest.raises(TypeError, match=message):
        ClosedLoop(*arguments)


def test_bad_noise_and_states_are_refused(pair_of_arms: ClosedLoop) -> None:
    with pytest.raises(ValueError, match=r"noise: must have shape \(2, 2\)"):
        pair_of_arms.advance([1.0, 1.0], np.zeros((1, 2)))
    with pytest.raises(ValueError, match=r"noise\[0, 1\] = nan: must be finite"):
        pair_of_arms.advance([1.0, 1.0], [[0.0, np.nan], [0.0, 0.0]])
    with pytest.raises(ValueError, match=r"states: must have shape \(2, 8\), got \(8,\)"):
        pair_of_arms.reset(np.zeros(8))
    with pytest.raises(ValueError, match=r"states\[1, 2\] = inf: must be finite"):
        pair_of_arms.reset(np.where(np.arange(16).reshape(2, 8) == 10, np.inf, 0.0))


@pytest.mark.parametrize(
    ("cases", "options", "message"),
    [
        ([], {}, "cases: must hold at least one LoopCase"),
        (
            [LoopCase(SensorParameters("true"), LawParameters()), CASES[0]],
            {},
            "cases: sensors of one batch must share model and rate_jacobian",
        ),
        (
            [LoopCase(SensorParameters(rate_jacobian="current"), LawParameters()), CASES[1]],
            {},
            "cases: sensors of one batch must share model and rate_jacobian",
        ),
        (
            [LoopCase(SensorParameters("collocated"), LawParameters(compensation="shared"))],
            {},
            "compensation = 'shared': a collocated sensor has no delay to compensate; it must be 'none'",
        ),
        (
            [LoopCase(SensorParameters(position=4.6), LawParameters())],
            {},
            r"sensor_position = 4\.6 m: must be on link 2, > 0 and <= 4\.5 m",
        ),
        (CASES[:1], {"physics_step": 0.02}, r"physics_step = 0\.02 s: too long .* 98\.5\d rad/s; at most 0\.01218 s"),
        (CASES[:1], {"physics_step": 0.0}, r"physics_step = 0\.0: must be a finite number and > 0"),
        (CASES[:1], {"control_period": -1e-3}, r"control_period = -0\.001: must be a finite number and > 0"),
    ],
)
def test_bad_set_ups_are_refused(cases: list[LoopCase], options: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        ClosedLoop(ARM, cases, PATH, **options)
