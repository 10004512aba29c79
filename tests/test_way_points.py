"""Way-points with times: what an environment's target does, and what is refused."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from flexarm_env import ReferencePath, way_points
from tests.support.envs import bare
from tests.support.refusals import refused

SQUARE = [(-4.0, -4.0), (-4.0, 4.0), (4.0, 4.0), (4.0, -4.0)]


def test_the_target_keeps_the_times_of_way_points() -> None:
    """It waits where a point is there twice, and an open path begins anew after its end."""
    table = [(0.0, 5.0, 0.0), (0.1, 5.0, 0.5), (0.15, 5.0, 0.5), (0.2, 4.0, 0.5)]
    env = bare("FlexArm/Track-v0", reference="waypoints", waypoints=table, start="corner", error_limit=None)
    assert env.settings.lap_time == 0.2
    assert env.lap_steps == 20
    env.reset(seed=0)
    seen = [env.step(np.zeros(2))[4]["reference"] for _ in range(25)]
    times = 0.01 * np.arange(1, 26) % 0.2
    expected = [[np.interp(t, *np.transpose(table)[[0, axis]]) for axis in (1, 2)] for t in times]
    np.testing.assert_allclose(seen, expected, atol=1e-12)


@given(st.lists(st.floats(0.5, 5.0), min_size=4, max_size=4))
def test_speeds_are_those_of_the_sides(speeds: list[float]) -> None:
    table = way_points.at_speeds(SQUARE, speeds)
    path = ReferencePath(table)
    middles = 0.5 * (table[:-1, 0] + table[1:, 0])
    np.testing.assert_allclose(np.linalg.norm(path.velocity(middles), axis=1), speeds, rtol=1e-12)
    np.testing.assert_array_equal(table[[0, -1], 1:], [SQUARE[0], SQUARE[0]])
    np.testing.assert_array_equal(way_points.at_speeds(SQUARE, speeds[:3], closed=False), table[:-1])


@given(st.floats(0.05, 2.0))
def test_blends_have_a_constant_acceleration(blend: float) -> None:
    """From side to side within the blend, and none outside it; a corner is cut by an eighth of blend times turn."""
    sharp = way_points.at_speeds(SQUARE, 4.0)  # sides of 2 s
    table = way_points.blended(sharp, blend, 0.005)
    path, corners = ReferencePath(table), ReferencePath(sharp)
    around = np.vstack([table[:-1, 1:], table[:2, 1:]])
    acceleration = np.linalg.norm(np.diff(around, 2, axis=0), axis=1) / 0.005**2
    since = np.abs((table[1:, 0] + 1.0) % 2.0 - 1.0)  # from the nearest corner
    turn = 4.0 * 2**0.5
    np.testing.assert_allclose(acceleration[since < 0.5 * blend - 0.01], turn / blend, rtol=1e-6)
    assert np.all(acceleration[since > 0.5 * blend + 0.01] < 1e-6)
    np.testing.assert_allclose(np.linalg.norm(path.position([0.0, 2.0]) - SQUARE[:2], axis=1), turn * blend / 8.0)
    np.testing.assert_allclose(path.position([1.0, 3.0]), corners.position([1.0, 3.0]), atol=1e-12)


def test_an_open_path_keeps_its_ends() -> None:
    table = way_points.blended([(0.0, 5.0, 0.0), (1.0, 5.0, 2.0), (2.0, 3.0, 2.0)], 0.5)
    np.testing.assert_array_equal(table[[0, -1], 1:], [(5.0, 0.0), (3.0, 2.0)])
    np.testing.assert_allclose(table[100, 1:], (5.0 - 0.125, 2.0 - 0.125))
    np.testing.assert_allclose(way_points.blended(table, 0.0)[:, 1:], table[:, 1:], atol=1e-12)


def test_a_function_of_time_is_sampled() -> None:
    table = way_points.sampled(lambda t: (5.0 * np.cos(t), 5.0 * np.sin(t)), 2.0 * np.pi)
    assert len(table) == 630
    np.testing.assert_array_equal(table[0, 1:], table[-1, 1:])
    np.testing.assert_allclose(np.linalg.norm(table[:, 1:], axis=1), 5.0)
    assert np.any(way_points.sampled(lambda t: (5.0, t), 1.0)[-1] != (1.0, 5.0, 0.0))


test_bad_input_is_refused = refused(
    (lambda: way_points.at_speeds(SQUARE[:1], 1.0), "points: must be at least 2 points, got 1"),
    (lambda: way_points.at_speeds([(1.0, 1.0), (1.0, 1.0)], 1.0), r"points\[0\]: must differ"),
    (lambda: way_points.at_speeds(SQUARE, 0.0), r"speeds\[0\] = 0.0: must be"),
    (lambda: way_points.at_speeds(SQUARE, [1.0, 2e6, 1.0, 1.0]), r"speeds\[1\] = 2000000.0: must be .* <= 1000000"),
    (lambda: way_points.at_speeds(SQUARE, [1.0, 1.0]), r"speeds.*\(4,\)"),
    (lambda: way_points.at_speeds(SQUARE, [1.0, [1.0], 1.0, 1.0]), "speeds: must be an array of real numbers"),
    (lambda: way_points.sampled(lambda t: (t,), 1.0), r"function\(0\)"),
    (lambda: way_points.sampled(lambda t: (t, t), 0.0), "duration = 0.0: must be"),
    (lambda: way_points.sampled(lambda t: (t, t), 1.0, 0.0), "period = 0.0: must be"),
    (lambda: way_points.blended(way_points.at_speeds(SQUARE, 4.0), 2.1), "blend = 2.1: must be"),
)


test_environments_refuse_bad_way_points = refused(
    (
        {"waypoints": [(0.0, 1.0, 1.0), (2.0, 2.0, 1.0), (1.0, 1.0, 1.0)]},
        r"waypoints\[:, 0\] = .*: times must increase from 0",
    ),
    ({"waypoints": [(1.0, 1.0, 1.0), (2.0, 2.0, 1.0)]}, "times must increase from 0"),
    ({"waypoints": [(0.0, 1.0, 1.0), (1e-9, 2.0, 1.0)]}, r"waypoints\[-1\]\[0\] = 1e-09: must be"),
    ({"waypoints": [(0.0, 1.0, 1.0), (1.0, 2.0, 1.0)], "lap_time": 8.0}, "lap_time = 8.0: has no effect here"),
    ({"waypoints": [(0.0, 1.0, 1.0, 1.0)]}, r"waypoints: must have shape \(n, 2\) or \(n, 3\), got \(1, 4\)"),
    ({"waypoints": [(0.0, 1.0), (0.0, 1.0, 2.0)]}, "waypoints"),
    by=lambda options: bare("FlexArm/Track-v0", reference="waypoints", **options),
)
