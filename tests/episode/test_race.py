"""A race: the reference moves at a speed of the action's, along any closed path; laps, their times, and the end."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flexarm_env.envs.info import info_keys
from flexarm_env.envs.settings import Settings
from flexarm_env.envs.termination import END_CODES
from flexarm_env.parameters import DIRECTIONS
from flexarm_env.physics.paths import PATHS
from tests.support.envs import FREE, RACE, bare, same_as_alone
from tests.support.plain import PlainEnvironment
from tests.support.refusals import refused, refuses

TINY: dict[str, Any] = {"arm": {"modes_per_link": 1}, "action_mode": "race", "start": "corner", "frame": "world"}
TINY |= {"scaled": False, "observation": ("reference_position", "reference_velocity", "previews", "sensor_error")}
TINY |= {"direction": "clockwise", "reward_weights": {"progress": 1.0}, **FREE}
CORNER = np.array([-6.3, -6.3])
PERIOD = 0.01
F32 = partial(np.array, dtype=np.float32)


def driven(speeds: list[float], **options: Any) -> PlainEnvironment:
    """Return the race after periods with these commanded speeds [m/s] and no torque."""
    env = PlainEnvironment(**TINY | options)
    env.follow([(0.0, 0.0, speed / env.simulator.settings.reference_speed) for speed in speeds])
    return env


@settings(max_examples=25)
@given(st.lists(st.floats(-25.0, 25.0), min_size=1, max_size=12), st.floats(10.0, 3000.0))
def test_the_speed_approaches_the_commanded_one(speeds: list[float], acceleration: float) -> None:
    """Against the same rule in plain numbers; below 0 is standstill."""
    env = driven(speeds, reference_acceleration=acceleration)
    speed, way = 0.0, 0.0
    for wanted in 25.0 * np.maximum(np.array(speeds) / 25.0, 0.0).astype(np.float32).astype(float):
        speed += np.clip(wanted - speed, -acceleration * PERIOD, acceleration * PERIOD)
        way += speed * PERIOD
    assert env.result("REFERENCE_SPEED")[0] == pytest.approx(speed, abs=1e-12)
    assert env.result("PROGRESS")[0] == pytest.approx(way, abs=1e-12)
    assert env.result("REWARD")[0] == pytest.approx(speed / 25.0, abs=1e-12)
    np.testing.assert_allclose(env.result("REFERENCE"), [-6.3, -6.3 + way, 0.0, speed], atol=1e-9)


@pytest.mark.parametrize("name", sorted(PATHS))
@pytest.mark.parametrize("direction", ["clockwise", "counterclockwise"])
def test_the_reference_keeps_its_speed_on_curves(name: str, direction: str) -> None:
    """Arc length: each period's step is speed times period, but for the corner that it may cut; a lap closes."""
    settings = Settings.of(TINY | {"reference": name, "direction": direction})
    path = settings.path(DIRECTIONS.index(direction))
    points = path.table[:, 1:]
    assert path.lap_time == pytest.approx(np.linalg.norm(np.diff(points, axis=0), axis=1).sum(), rel=1e-12)
    exact = {"circle": 12.6 * np.pi, "square": 50.4, "stops": 50.4, "line": 25.2}
    assert path.lap_time == pytest.approx(exact.get(name, path.lap_time), rel=1e-5)  # 1600 sides for a circle
    ways = np.linspace(0.0, path.lap_time, 501)[:-1]
    places = path.position(ways)
    if name == "circle":
        turned = (-1.0 if direction == "clockwise" else 1.0) * 2.0 * np.pi * ways / path.lap_time
        angle = np.arctan2(-1.0, -1.0) + turned
        np.testing.assert_allclose(places, 6.3 * np.column_stack([np.cos(angle), np.sin(angle)]), atol=2e-5)
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    assert (steps <= (ways[1] - ways[0]) * (1.0 + 1e-9)).all()
    assert np.median(steps) == pytest.approx(ways[1], rel=1e-3)
    np.testing.assert_allclose(np.linalg.norm(path.velocity(ways), axis=1), 1.0, atol=1e-9)


def test_previews_are_by_distance() -> None:
    env = driven([25.0] * 3, previews=(0.5, 12.6, 26.0, 50.4, 60.0))
    way = env.result("PROGRESS")[0]
    assert way == pytest.approx(0.06)
    expected = [(0.0, 0.5), (way, 12.6 - way), (12.6, 11.8 - 2.0 * way), (0.0, 0.0), (0.0, 9.6)]
    np.testing.assert_allclose(env.block("previews").reshape(-1, 2), expected, atol=1e-5)


def test_the_sensors_error_is_from_the_present_reference() -> None:
    """Its earlier ones are not kept. The second sensor compares with the rigid arm on the present reference."""
    more = ("second_sensor_error", "second_sensed_position", "sensed_position")
    options = {"observation": (*TINY["observation"], *more), "second_sensor_link": 2, "second_sensor_delay": 0.02}
    env = driven([25.0] * 6, **options)
    for error, position in (("sensor_error", "sensed_position"), ("second_sensor_error", "second_sensed_position")):
        found = env.block("reference_position") - env.block(position)
        np.testing.assert_allclose(env.block(error), found, atol=1e-6)


def test_laps_are_timed_to_the_instant() -> None:
    """On a short path: lap ends lie between control periods, at constant speed within them."""
    corners = [(3.0, 0.0), (3.0, 0.1), (3.1, 0.1), (3.1, 0.0)]
    env = PlainEnvironment(**TINY | {"reference": "waypoints", "waypoints": corners, "race_laps": 3})
    ends = []
    while env.result("STATUS")[0] == 0.0:
        before, begun = env.result("PROGRESS")[0], env.result("TIME")[0]
        env.step((0.0, 0.0, 0.4))
        way, speed = env.result("PROGRESS")[0], env.result("REFERENCE_SPEED")[0]
        ends += [begun + (0.4 * n - before) / speed for n in (1, 2, 3) if before < 0.4 * n - 1e-9 <= way]
    laps = np.diff([0.0, *ends])
    np.testing.assert_allclose(env.result("LAP_TIMES"), [laps[0], laps.min(), ends[-1]], atol=1e-9)
    assert env.result("PROGRESS")[0] >= 1.2 - 1e-9
    assert laps[0] > laps.min()  # from rest


def test_who_leaves_the_reference_is_out_and_who_arrives_is_done() -> None:
    """Also where both are at once; the times of a lost race stay 0."""
    done = bare(RACE, race_laps=1, side=2.0, reference_acceleration=1e6, error_limit=None, deflection_limit=None)
    for _ in range(32):
        *_, terminated, _, info = done.step(F32([0.0, 0.0, 1.0]))
        assert info["lap_times"][2] == 0.0 or terminated
    assert terminated
    assert info["end_code"] == END_CODES["finished"]
    np.testing.assert_allclose(info["lap_times"], 8.0 / 25.0, rtol=1e-12)
    lost = bare(RACE)
    steps = 0
    while not (result := lost.step(F32([0.0, 0.0, 1.0])))[2]:
        steps += 1
    assert result[4]["end_code"] == END_CODES["error"]
    assert result[4]["tip_error"] > 0.25
    assert steps < 10
    assert not result[4]["lap_times"].any()


def test_a_batch_is_as_each_alone() -> None:
    same_as_alone(RACE, 2, {"start": "corners", "race_laps": 1, "side": 0.6, "error_limit": None}, 30)


def test_infos_of_other_modes_have_none_of_it() -> None:
    names = {"progress", "reference_speed", "lap_times"}
    assert names <= set(info_keys(Settings.of(TINY)))
    assert names.isdisjoint(info_keys(Settings.of({})))


test_what_cannot_be_a_race_is_refused = refused(
    ({"start": "mix"}, "start = 'mix'.*begins at rest"),
    ({"reference": "moves"}, "reference.*paths that are given"),
    ({"reference": "drawn", "waypoints": lambda rng: [(1.0, 3.0), (2.0, 3.0)]}, "paths that are given"),
    ({"reference": "waypoints", "waypoints": [(0.0, 3.0, 0.0), (1.0, 4.0, 0.0)]}, "closed path"),
    ({"lap_time": 8.0}, "lap_time = 8.0.*no clock"),
    ({"randomisation": {"lap_time": (8.0, 9.0)}}, "lap_time"),
    ({"side": 0.05}, "reference_speed = 25.0.*longer than 0.25 m"),
    ({"race_laps": 0}, "race_laps = 0"),
    ({"action_mode": "torque"}, "reward_weights.*only with action_mode = 'race'"),
    by=lambda options: Settings.of(TINY | options),
)


def test_a_race_has_no_time_to_begin_at() -> None:
    with refuses(ValueError, "options['time']", "no clock"):
        bare(RACE).reset(options={"time": 1.0})
