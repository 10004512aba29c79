"""Resets and steps of compiled environments, hostile ones among them: a twin that gets only the good ones agrees."""

import math
from functools import cache
from typing import Any, NamedTuple

import gymnasium
import numpy as np
import pytest
from hypothesis import event, given
from hypothesis import strategies as st

import flexarm_env  # noqa: F401  (registers the ids)
from flexarm_env.envs.choices import STARTS
from flexarm_env.envs.reset_options import OPTIONS
from flexarm_env.envs.single import FlexArmEnv
from flexarm_env.kernels.entries import DRAWN
from flexarm_env.validation import shown
from tests.hardening.strategies import CAMPAIGN, GARBAGE, MOST_CHARACTERS, cases, numbers

EVERY = ("FlexArm/Square-v0", "FlexArm/SquareUnknown-v0", "FlexArm/Reach-v0", "FlexArm/Paper-v0")
IDS = EVERY if CAMPAIGN else EVERY[:1]  # whose kernels other tests have
CALLS = 20  # of a case
# An error of a call begins with one of these.
NAMED = ("action", "options", "Seed", "seed")


class Call(NamedTuple):
    seed: Any = None  # of a reset
    options: Any = None  # of a reset
    action: Any = None  # of a step; None: the call is a reset


@cache
def twins(name: str) -> tuple[FlexArmEnv, FlexArmEnv]:
    """Make two environments that must agree: one gets every call, the other only those that succeed."""
    found = gymnasium.make(name).unwrapped, gymnasium.make(name).unwrapped
    for env in found:
        env.reset(seed=0)
    return found


def _resets() -> st.SearchStrategy[Call]:
    garbage = st.sampled_from(GARBAGE)
    sensible = {
        "start": st.sampled_from(sorted(STARTS)),
        "time": numbers(0.0, 20.0),
        "elbow_branch": st.sampled_from(["positive", "negative"]),
        "direction": st.sampled_from(["clockwise", "counterclockwise"]),
        "parameters": st.dictionaries(st.sampled_from(sorted(DRAWN)), numbers(1e-6, 2.0) | garbage, max_size=2),
        "state": st.lists(numbers(1e-9, 1e3), min_size=8, max_size=16),
    }
    known = st.fixed_dictionaries({}, optional={name: sensible.get(name, garbage) for name in OPTIONS})
    spoiled = st.dictionaries(st.sampled_from([*OPTIONS, "x"]), garbage, max_size=2)
    seeds = st.none() | st.integers(0, 2**32)
    return (
        seeds.map(lambda seed: Call(seed=seed))
        | st.tuples(seeds, known).map(lambda both: Call(*both))
        | st.tuples(seeds | garbage, spoiled | garbage).map(lambda both: Call(*both))
    )


def _steps(size: int) -> st.SearchStrategy[Call]:
    """Draw steps, most of them with good actions, of so many numbers."""

    def arrays(one: st.SearchStrategy[float], most: int = size) -> st.SearchStrategy[Any]:
        return st.lists(one, min_size=size, max_size=most).map(lambda found: np.array(found, np.float32))

    good, large = arrays(st.floats(-1.5, 1.5, width=32)), arrays(st.floats(width=32), size + 1)
    bad = st.sampled_from([one for one in GARBAGE if one is not None])
    return (good | good | good | large | bad).map(lambda action: Call(action=action))


@st.composite
def drawn(draw: st.DrawFn) -> tuple[str, list[Call]]:
    name = draw(st.sampled_from(IDS))
    steps = _steps(math.prod(twins(name)[0].action_space.shape or ()))
    return name, draw(st.lists(steps | steps | steps | _resets(), min_size=CALLS, max_size=CALLS))


@pytest.mark.compiled
@cases(8, 5_000)
@given(drawn())
def test_bad_calls_change_nothing(case: tuple[str, list[Call]]) -> None:
    """An error names its argument, an observation lies in its space, and twins agree in each bit."""
    name, calls = case
    tried, twin = twins(name)
    for env in (tried, twin):
        env.reset(seed=1)
    for call in calls:
        try:
            found = _done(tried, call)
        except (TypeError, ValueError, gymnasium.error.Error) as error:
            text = str(error)
            assert text.startswith(NAMED), text
            assert len(text) < MOST_CHARACTERS, f"a message of {len(text)} characters"
            event("refused")
            continue
        event("reset" if call.action is None else "step")
        observation, reward, ended = found
        assert np.isfinite(reward), reward
        assert ended or tried.observation_space.contains(observation), observation
        assert np.isfinite(observation).all(), observation
        both = [(seen.tobytes(), given.hex(), over) for seen, given, over in (found, _done(twin, call))]
        assert both[0] == both[1], f"{name} and its twin differ after {shown(call)}"
        if ended:
            for env in (tried, twin):
                env.reset(seed=2)


def _done(env: FlexArmEnv, call: Call) -> tuple[Any, float, bool]:
    """Make a call; return observation, reward and whether the episode ended."""
    if call.action is None:
        return env.reset(seed=call.seed, options=call.options)[0], 0.0, False
    observation, reward, terminated, truncated, _ = env.step(call.action)
    return observation, reward, terminated or truncated
