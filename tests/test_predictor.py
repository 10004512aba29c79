"""The forms in which a policy may come and how each is called; the map between its actions and gains."""

import inspect
import re
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flexarm_env.actions import action_from_gain, action_from_physical, gain_from_action, physical_from_action
from flexarm_env.predictor import predictor
from tests.support.refusals import label, refused

OBSERVATION, START = np.arange(3.0), np.ones(1, dtype=bool)
ACTION = np.array([0.1, -0.2])


def full(observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = False) -> Any:
    assert episode_start is START
    return ACTION if deterministic else -ACTION, (state or 0) + 1


def alone(observation: Any) -> Any:
    assert observation is OBSERVATION
    return ACTION


def its_observation_is_called_state(state: Any) -> Any:
    assert state is OBSERVATION
    return ACTION, None


def some_by_name(observation: Any, *, deterministic: bool = False, state: Any = None) -> Any:
    return full(observation, state, START, deterministic)


def another_order(observation: Any, deterministic: bool = True, state: Any = None, episode_start: Any = None) -> Any:
    return full(observation, state, episode_start, deterministic)


def anything(*arguments: Any, **named: Any) -> Any:
    assert len(arguments) == 4
    return ACTION, None


def policy_of(predict: Any) -> Any:
    return SimpleNamespace(predict=predict)


WITH_MEMORY = [full, lambda x, memory, first, calm: full(x, memory, first, calm), some_by_name, another_order]
FORMS = [alone, *map(policy_of, (*WITH_MEMORY, alone, its_observation_is_called_state, anything))]


@pytest.mark.parametrize("policy", FORMS, ids=label)
def test_every_form_gives_its_action(policy: Any) -> None:
    action, _ = predictor(policy, deterministic=True)(OBSERVATION, None, START)
    np.testing.assert_array_equal(action, ACTION)


@pytest.mark.parametrize("predict", WITH_MEMORY, ids=label)
def test_memory_and_determinism_reach_who_takes_them(predict: Any) -> None:
    predict = predictor(policy_of(predict), deterministic=False)
    action, memory = predict(OBSERVATION, None, START)
    np.testing.assert_array_equal(action, -ACTION)
    assert predict(OBSERVATION, memory, START)[1] == 2


@pytest.mark.parametrize("action", [(0.1, -0.2), [0.1, -0.2], (np.float32(0.1), -0.2)])
def test_a_pair_of_numbers_is_an_action(action: Any) -> None:
    assert predictor(lambda observation: action, deterministic=True)(OBSERVATION, None, START) == (action, None)


def test_functions_of_other_languages_are_called_with_the_observation() -> None:
    np.testing.assert_array_equal(
        predictor(np.cos, deterministic=True)(OBSERVATION, None, START)[0], np.cos(OBSERVATION)
    )


def test_the_signature_is_inspected_once(monkeypatch: pytest.MonkeyPatch) -> None:
    calls = []
    original = inspect.signature
    monkeypatch.setattr(inspect, "signature", lambda call: calls.append(call) or original(call))
    predict = predictor(policy_of(full), deterministic=True)
    for _ in range(3):
        predict(OBSERVATION, None, START)
    assert len(calls) == 1


test_other_forms_are_refused = refused(
    (SimpleNamespace, r"policy = <class '.*SimpleNamespace'>: is a class; make a policy of it first"),
    (7, r"policy = 7: must have predict\(observation\) or predict\(observation, state"),
    (policy_of(lambda observation, goal: ACTION), r"the parameters of its predict are \(observation.*, goal.*\)"),
    (lambda: ACTION, r"or be a function of an observation, its parameters are \(\)"),
    by=lambda policy: predictor(policy, deterministic=True),
    kind=TypeError,
)


# --- the map between actions and gains -------------------------------------------------------------------------------


def test_the_action_map_by_hand() -> None:
    np.testing.assert_array_equal(gain_from_action([[-1.0, 0.0], [0.5, 1.0]], 4.0), [[0.0, 2.0], [3.0, 4.0]])
    np.testing.assert_array_equal(action_from_gain([[0.0, 2.0], [3.0, 4.0]], 4.0), [[-1.0, 0.0], [0.5, 1.0]])
    assert gain_from_action(np.float32([0.25]), 2.0).dtype == np.float64


@given(st.floats(1e-6, 1e6), st.floats(0.0, 1.0))
def test_the_action_map_inverts(gain_limit: float, share: float) -> None:
    gain = share * gain_limit
    assert gain_from_action(action_from_gain(gain, gain_limit), gain_limit) == pytest.approx(
        gain, abs=1e-15 * gain_limit
    )
    assert action_from_gain(gain_limit, gain_limit) == 1.0
    assert gain_from_action(1.0, gain_limit) == gain_limit


BEYOND = (-1.0000001, 2.0000001, np.nan, np.inf, -np.inf)
IMPOSSIBLE = [
    *((gain_from_action, [0.0, bad], 2.0, f"action = {bad!r}: must be finite and in [-1.0, 1.0]") for bad in BEYOND),
    *((action_from_gain, [0.0, bad], 2.0, f"gain = {bad!r}: must be finite and in [0.0, 2.0]") for bad in BEYOND),
    *(
        (function, 0.0, bad, f"gain_limit = {bad!r}: must be a finite number > 0")
        for function in (gain_from_action, action_from_gain)
        for bad in (0.0, -1.0, np.nan, np.inf)
    ),
    *(
        (partial(function, "torque"), [0.0, 0.0], bad, f"limit = {bad!r}: must be a finite number > 0")
        for function in (physical_from_action, action_from_physical)
        for bad in (0.0, -1.0)
    ),
]


@pytest.mark.parametrize(("function", "value", "gain_limit", "message"), IMPOSSIBLE, ids=label)
def test_impossible_numbers(function: Any, value: Any, gain_limit: float, message: str) -> None:
    with pytest.raises(ValueError, match=f"^{re.escape(message)}"):
        function(value, gain_limit)
