"""`race_lqg` and the plan that it follows: the race in the environment is the one of the plan."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest

from flexarm_agents.board.columns import Point
from flexarm_agents.board.entries import Entry
from flexarm_agents.board.episodes import run_points
from flexarm_baselines.lqg import LQG, RaceLQG
from flexarm_baselines.lqg.race import race_plan
from flexarm_baselines.optimal import load_plan
from flexarm_baselines.registry import controller
from flexarm_env.envs.settings import Settings
from flexarm_env.envs.single import FlexArmEnv
from flexarm_env.parameters import DIRECTIONS
from tests.support.refusals import refuses

RACE = "FlexArm/Race-v0"


@pytest.mark.parametrize("name", ["default", "steady"])
def test_the_plan_is_a_race_of_the_environment(name: str) -> None:
    """Its reference moves as the third action can move it, and its tip stays within the limit, by the model alone."""
    plan = race_plan(name)
    env = gymnasium.make(RACE, **RaceLQG.options()).unwrapped
    assert isinstance(env, FlexArmEnv)
    ways, own = np.array(plan.notes["ways"]), env.settings
    speeds = np.diff(ways, prepend=ways[0]) / plan.period
    assert ways[0] == 0.0
    assert ways[-2] < 3.0 * 50.4 <= ways[-1]
    assert (speeds >= 0.0).all()
    assert (np.abs(np.diff(speeds)) <= own.reference_acceleration * plan.period).all()
    assert speeds.max() <= own.reference_speed
    np.testing.assert_allclose(own.path(DIRECTIONS.index("clockwise")).position(ways), plan.reference, atol=1e-6)
    tips = plan.arm.tip(plan.states[:, : plan.arm.size])
    assert np.linalg.norm(tips - plan.reference, axis=1).max() < own.error_limit
    laps = np.interp(50.4 * np.arange(1, 4), ways, plan.period * np.arange(len(ways)))
    np.testing.assert_allclose(plan.notes["lap_times"], [laps[0], np.diff([0.0, *laps]).min(), laps[2]], atol=1e-3)


def test_another_race_is_refused() -> None:
    for options in ({"side": 8.0}, {"arm": {"payload_mass": 0.5}}, {"direction": "counterclockwise"}):
        env = gymnasium.make(RACE, **RaceLQG.options() | options)
        with refuses(ValueError, "must be a race of the plan's arm"):
            RaceLQG.for_env(env)
    with refuses(ValueError, "plan", "ways"):
        RaceLQG.for_env(gymnasium.make(RACE, **RaceLQG.options()), load_plan("default_plain"))
    with refuses(ValueError, "action_mode = 'race'"):
        RaceLQG.for_env(gymnasium.make("FlexArm/Square-v0", **LQG.options()))
    assert Settings.of(RaceLQG.options()).mode.races


@pytest.mark.slow
@pytest.mark.compiled
def test_the_board_times_it_and_refuses_who_does_not_race() -> None:
    """The times are those of the plan: feedback has nothing to do on the nominal arm."""
    entry = Entry("race_lqg", environment=controller("race_lqg").environment)
    assert entry.home == "race"
    race, square = run_points(entry, [Point("nominal", task="race"), Point("square")])
    figures = race["episodes"][0]["figures"]
    first, fastest, whole = race_plan().notes["lap_times"]
    found = [figures[name] for name in ("first_lap", "fastest_lap", "three_laps")]
    np.testing.assert_allclose(found, [first, fastest, whole], atol=1e-3)
    assert "a race is run by" in square["not_applicable"]
    (other,) = run_points(Entry("lqg"), [Point("nominal", task="race")])
    assert "only with action_mode = 'race'" in other["not_applicable"]
