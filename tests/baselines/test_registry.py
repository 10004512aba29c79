"""Controllers by name: what they need and read, and that none reads more than it declares."""

from __future__ import annotations

from copy import deepcopy
from typing import Any

import gymnasium
import numpy as np
import pytest

from flexarm_agents.board.entries import Entry
from flexarm_agents.board.episodes import LANES
from flexarm_agents.board.terms import SQUARE
from flexarm_agents.environments import make_one
from flexarm_agents.evaluation.candidates import Candidate, from_controller
from flexarm_baselines.observers import fresh
from flexarm_baselines.policy import GainPolicy
from flexarm_baselines.registry import CONTROLLERS, controller, controller_names, make_controller
from flexarm_env.envs.blocks import BLOCKS, INFORMATION, PRIVILEGED, TRUE_STATE
from flexarm_env.envs.observation import readings_of
from flexarm_env.envs.registration import IDS
from flexarm_env.envs.settings import Settings
from flexarm_env.laps import LAPS
from tests.support.envs import assert_same

ID = "flexarm_env:FlexArm/Square-v0"
PUBLISHED = {"settings", "observation_blocks", "observation_scale", "gain_limit", "arm"}  # the same in every episode
PUBLISHED |= {"action_space", "single_action_space", "observation_space", "single_observation_space"}


class Door:
    """An environment of which a controller may see what it publishes, while it is made, and nothing afterwards."""

    def __init__(self, env: gymnasium.Env[Any, Any]) -> None:
        self._env, self._open = env.unwrapped, True

    def close_door(self) -> None:
        self._open = False

    @property
    def unwrapped(self) -> Door:
        return self

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        assert self._open, f"{name} was read after the controller was made"
        assert name in PUBLISHED, f"{name} is nothing that a controller may read"
        return getattr(self._env, name, None) if name.startswith("single_") else getattr(self._env, name)


SLOW = ("lqg_adaptive", "lqg_adaptive_stamped", "race_lqg_adaptive")  # are designed in many seconds


@pytest.mark.parametrize("name", [pytest.param(n, marks=[pytest.mark.slow] * (n in SLOW)) for n in controller_names()])
def test_a_controller_reads_what_is_published_and_rows_are_independent(name: str) -> None:
    """Once made, it reads observations alone; a row of a batch has the bits that it has alone; what is given stays."""
    env = gymnasium.make(CONTROLLERS[name].environment, **controller(name).options)
    door = Door(env)
    policy = make_controller(name, door)
    door.close_door()
    start = "corners" if "race" in name else "moving"  # a race begins at rest
    rows = np.stack([env.reset(seed=seed, options={"start": start})[0] for seed in range(LANES)])

    def actions(some: slice) -> list[Any]:
        memory, found = None, []
        for _ in range(3):
            given = memory, np.full(len(rows[some]), memory is None)
            kept = deepcopy(given)
            action, memory = policy.predict(rows[some], *given)
            found.append(action)
            assert_same(given, kept)
        return found

    together = np.array(actions(slice(None)))
    assert all(env.action_space.contains(action) for action in np.concatenate(together))
    assert np.ptp(together, axis=1).any() or name == "ifdc"  # whose gain is constant
    for some in (slice(0, 1), slice(1, 4), slice(4, LANES)):
        assert np.array_equal(actions(some), together[:, some])
    assert np.array_equal(policy.predict(rows[0])[0], together[0, 0])
    assert Entry(name).independent


@pytest.mark.parametrize("name", controller_names())
def test_the_true_state_has_one_door(name: str) -> None:
    """By the block that is declared privileged; whoever is to pass it is named here."""
    settings = Settings.of(controller(name).options)
    assert (TRUE_STATE in readings_of(settings)) == (name in ("plan_lqr", "nmpc_state"))
    assert set(CONTROLLERS[name].kind.knows) <= set(INFORMATION) - set(PRIVILEGED)
    assert {block for block, one in BLOCKS.items() if one.reads in PRIVILEGED} == {"state", "episode_parameters"}


def test_what_blocks_and_laws_read() -> None:
    def reads(**options: Any) -> tuple[str, ...]:
        return readings_of(Settings.of(options))

    assert reads() == ("encoders", "late tip", "strain gauges", "preview")
    assert reads(observation=("reference_position", "lap_phase"), frame="world") == ()
    assert reads(observation=("reference_position",), frame="link") == ("encoders",)
    assert reads(observation=("lap_phase",), frame="world", action_mode="residual") == ("encoders",)
    assert readings_of(Settings.of(IDS["Paper-v0"].options)) == ("encoders", "late tip", "strain gauges")
    assert reads(observation=("state",), frame="world") == ("true state",)


def test_a_candidate_reads_what_it_observes_and_is_told() -> None:
    one = from_controller("plan_lqr", "Square-v0", {})
    assert one.reads == ("preview", "plant parameters", "true state")
    assert one.privileged
    other = from_controller("flsac", "Square-v0", {})
    assert other.reads == ("encoders", "strain gauges")  # the law under the gain has the encoders
    assert not other.privileged
    boaster = Candidate("mine", type("Mine", (), {"knows": ("everything",)})(), other.env, other.environment, {})
    with pytest.raises(ValueError, match=r"policy mine: knows = \('everything',\): must be names of encoders, "):
        boaster.reads  # noqa: B018


def test_gain_policies_get_the_id_of_gains() -> None:
    assert GainPolicy.options() == IDS["SquareGain-v0"].options


@pytest.mark.parametrize("name", ["lqg", "ifdc", "flsac", "nmpc"])
def test_a_controllers_options_fit_ids_that_observe_other_actions(name: str) -> None:
    env = gymnasium.make("FlexArm/SquareUnknown-v0", **controller(name).options)
    assert "last_actions" not in env.unwrapped.observation_blocks  # type: ignore[attr-defined]


def test_entries_are_described_and_other_names_refused() -> None:
    for name, one in CONTROLLERS.items():
        assert one.text, name
        assert one.source, name
        assert "\n" not in one.text
    with pytest.raises(ValueError, match=r"name = 'lqq'.*'ifdc'"):
        controller("lqq")


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
