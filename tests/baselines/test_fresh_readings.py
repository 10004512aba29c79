"""What controllers do while the late sensor holds its last reading."""

import numpy as np
import pytest

from flexarm_agents.board.terms import SQUARE
from flexarm_agents.environments import make_one
from flexarm_baselines.observers import fresh
from flexarm_baselines.registry import controller, make_controller
from flexarm_env.laps import LAPS


def test_only_a_reading_that_is_the_one_before_in_both_coordinates_is_missing() -> None:
    before = np.array([[1.0, 2.0], [1.0, 2.0], [np.nan, np.nan]])
    tip = np.array([[1.0, 2.0], [1.0, 2.5], [1.0, 2.0]])
    assert np.isnan(fresh(tip, before)).all(axis=1).tolist() == [True, False, False]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["lqg", "lqg_adaptive", "nmpc"])
def test_an_outage_on_the_nominal_lap_costs_less_than_a_millimetre(name: str) -> None:
    errors = []
    for outage in ({}, {"outage_time": 5.3, "outage_duration": 0.5}):
        env = make_one(SQUARE, {**controller(name).options, **outage})
        policy, state, over, squares = make_controller(name, env), None, False, []
        observation, _ = env.reset(seed=0, options=LAPS["plain"].reset_options())
        while not over:
            action, state = policy.predict(observation, state)
            observation, _, terminated, over, info = env.step(action)
            assert not terminated
            squares.append(np.sum((info["true_tip"] - info["reference"]) ** 2))
        errors.append(np.sqrt(np.mean(squares)))
    assert errors[1] - errors[0] < 1e-3
