"""Figures of laps: cases computed by hand, invariances, and the same figures while runs go on."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flexarm_env import ArmParameters, FlexibleArm, SquareParameters, Trajectory, metrics, square
from flexarm_env.metrics import Instants, LapFigures, RunningFigures, corners, directions, lap_figures
from tests.support.boards import leaves
from tests.support.refusals import refused

ARM = FlexibleArm(ArmParameters.paper())
PERIOD = 0.01
TIME = PERIOD * np.arange(401)
LAP = square(SquareParameters(lap_time=4.0)).position(TIME)


def drawn_run(seed: int, instants: int = 400) -> Trajectory:
    """Draw a smooth motion of the arm, which follows no equation, beside a square of 4 s."""
    random = np.random.default_rng(seed)
    time = PERIOD * np.arange(instants)
    sizes = np.repeat([1.0, 1.0, 0.3, 0.3], 2).reshape(4, 2)[:, 0]
    waves = sum(
        sizes * random.normal(size=4) * np.sin((k * time)[:, None] + random.uniform(0.0, 6.0, 4)) for k in (1, 3, 8)
    )
    state = np.hstack([waves, np.gradient(waves, PERIOD, axis=0)])
    torque = random.normal(scale=100.0, size=(instants, 2)).clip(-150.0, 150.0)
    path = square(SquareParameters(lap_time=4.0)).position(time)
    return ARM.record(time, state, torque, reference=path, notes={"ended": "truncated"})


def columns_of(run: Trajectory) -> tuple[np.ndarray, ...]:
    """Return what `Instants` has beside the time."""
    towards, rates = directions(run.reference), ARM.tip_deflection(run.state[:, ARM.size :])
    return run.tip, run.reference, towards, run.tip_deflection, rates, run.state[:, :2], run.torque


def still_run(tip_error: np.ndarray, deflection_rate: np.ndarray | float = 0.0) -> LapFigures:
    """Return figures of a lap whose tip is off the reference by what is given."""
    zeros = np.zeros((len(TIME), 1, 2))
    figures = RunningFigures(1, corners(TIME, LAP), (150.0, 50.0))
    tip, towards = (LAP + tip_error)[:, None], directions(LAP)[:, None]
    figures.update(Instants(TIME, tip, LAP[:, None], towards, zeros, zeros + deflection_rate, zeros, zeros))
    return figures.figures()


def test_contour_and_lag_by_hand() -> None:
    """Travelling along y: a tip 0.3 m to the right and 0.4 m short is 0.3 m across and 0.4 m behind."""
    contour, lag = metrics.contour_and_lag(np.array([1.3, 1.6]), np.array([1.0, 2.0]), np.array([0.0, 1.0]))
    assert (contour, lag) == pytest.approx((-0.3, 0.4))


def test_corners_of_the_square() -> None:
    time = PERIOD * np.arange(1601)
    found = corners(time, square(SquareParameters()).position(time))
    assert [corner.time for corner in found] == pytest.approx([4.0, 8.0, 12.0])
    assert [corner.until for corner in found] == pytest.approx([8.0, 12.0, 16.0])
    assert np.array([corner.incoming for corner in found]) == pytest.approx(
        np.array([[0.0, 1.0], [1.0, 0.0], [0.0, -1.0]]), abs=1e-9
    )
    assert found[0].point == pytest.approx([-6.3, 6.3])


def test_a_curve_has_no_corner_and_a_reversal_is_one() -> None:
    angle = np.linspace(0.0, 2.0 * np.pi, 101)
    assert corners(angle, np.column_stack([np.cos(angle), np.sin(angle)])) == []
    there_and_back = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 0.0], [0.0, 0.0]])
    (turn,) = corners(np.arange(4.0), there_and_back)  # it rests from 1 s to 2 s
    assert (turn.time, turn.until, turn.incoming.tolist()) == (2.0, 3.0, [1.0, 0.0])
    assert corners(np.arange(3.0), np.zeros((3, 2))) == []


def test_directions_where_the_reference_rests() -> None:
    points = np.array([[0.0, 0.0], [0.0, 0.0], [0.0, 2.0], [0.0, 2.0], [3.0, 2.0], [3.0, 2.0]])
    assert directions(points).tolist() == [[0, 1], [0, 1], [0, 1], [1, 0], [1, 0], [1, 0]]


def test_settling_overshoot_and_rms_by_hand() -> None:
    """Each side takes 1 s; after the first corner the tip is 0.2 m past it for 0.3 s, then 0.01 m behind."""
    error = np.zeros((401, 2))
    error[100:130] = [0.0, 0.2]  # the first side goes along y
    error[130:200] = [-0.01, 0.0]  # the second along x
    found = still_run(error)
    first, second, _ = found.corners
    assert (first.time, first.overshoot, first.settling_time) == pytest.approx((1.0, 0.2, 0.3))
    assert (second.overshoot, second.settling_time) == pytest.approx((0.0, 0.0), abs=1e-12)
    assert found.rms == pytest.approx(np.sqrt((30 * 0.04 + 70 * 1e-4) / 401))
    assert (found.maximum, found.contour_max, found.lag_max) == pytest.approx((0.2, 0.2, 0.01))
    assert found.lag_mean == pytest.approx(70 * 0.01 / 401)
    assert found.rms_after_2s == pytest.approx(0.0, abs=1e-12)
    never = still_run(np.full((401, 2), 0.1))
    assert [corner.settling_time for corner in never.corners] == [None, None, None]


def test_effort_by_hand() -> None:
    """Three periods: torques 100, -150, 0 and 0, 25, 50 N m; joints turn by 0.1, 0.2, 0.3 and -0.1, -0.1, 0 rad."""
    time = np.array([2.0, 2.5, 3.0, 3.5])
    torque = np.array([[100.0, 0.0], [-150.0, 25.0], [0.0, 50.0], [7.0, 7.0]])  # the last one acts after the run
    joints = np.array([[0.0, 0.0], [0.1, -0.1], [0.3, -0.2], [0.6, -0.2]])
    zeros = np.zeros((4, 1, 2))
    figures = RunningFigures(1, torque_limit=(150.0, 50.0))
    figures.update(Instants(time, zeros, zeros, zeros, zeros, zeros, joints[:, None], torque[:, None]))
    found = figures.figures()
    assert found.peak_torque == (150.0, 50.0)
    assert found.rms_torque == pytest.approx((np.sqrt(32500.0 / 3.0), np.sqrt(3125.0 / 3.0)))
    assert found.torque_travel == pytest.approx((250.0 + 150.0, 25.0 + 25.0))
    assert found.torque_change_after_2s == pytest.approx((np.sqrt((250.0**2 + 150.0**2) / 2.0), 25.0))
    assert found.net_work == pytest.approx(10.0 - 30.0 - 2.5)
    assert found.energy == pytest.approx(10.0 + 30.0 + 2.5)
    assert found.share_at_limit == pytest.approx((1.0 / 3.0, 1.0 / 3.0))


def test_residual_vibration_by_hand() -> None:
    """A tip deflection rate of 0.3 and 0.4 m/s throughout has the r.m.s. 0.5 m/s, over any window."""
    figures = still_run(np.zeros((401, 2)), np.array([0.3, 0.4]))
    assert [corner.residual_vibration for corner in figures.corners] == pytest.approx([0.5] * 3)


@settings(max_examples=20)
@given(seed=st.integers(0, 2**32 - 1), cuts=st.sets(st.integers(1, 399), max_size=5))
def test_figures_while_runs_go_on_are_those_of_the_whole(seed: int, cuts: set[int]) -> None:
    """However the runs are cut into parts; the second run's figures are its own. Sums are rounded otherwise."""
    runs = [drawn_run(seed), drawn_run(seed + 1)]
    going_on = RunningFigures(2, corners(runs[0].time, runs[0].reference), (150.0, 50.0))
    columns = [np.stack(pair, axis=1) for pair in zip(*map(columns_of, runs), strict=True)]
    for begin, end in zip([0, *sorted(cuts)], [*sorted(cuts), 400], strict=True):
        going_on.update(Instants(runs[0].time[begin:end], *(column[begin:end] for column in columns)))
    for k, run in enumerate(runs):
        compare(going_on.figures(k, metrics.elbow_changes(run).tolist()), lap_figures(run, (150.0, 50.0)))


def compare(found: LapFigures, expected: LapFigures, *left_out: str) -> None:
    pairs = (dict(leaves(each.plain())).items() for each in (found, expected))
    one, other = ({place: x for place, x in own if {*left_out}.isdisjoint(place.split("/"))} for own in pairs)
    assert one.keys() == other.keys()
    for place, value in other.items():
        assert one[place] == (None if value is None else pytest.approx(value, rel=1e-9, abs=1e-12)), place


@settings(max_examples=20)
@given(seed=st.integers(0, 2**32 - 1), turn=st.floats(-3.0, 3.0), mirrored=st.booleans())
def test_a_turned_and_mirrored_lap_has_the_same_figures(seed: int, turn: float, mirrored: bool) -> None:
    run, side = drawn_run(seed), -1.0 if mirrored else 1.0
    state = side * run.state
    state[:, 0] += turn
    c, s = np.cos(turn), np.sin(turn)
    path = run.reference * [1.0, side] @ np.array([[c, s], [-s, c]])
    moved = ARM.record(run.time, state, side * run.torque, reference=path, notes=run.notes)
    compare(lap_figures(moved), lap_figures(run))


def test_a_lap_that_begins_later_has_the_same_figures() -> None:
    """But for the figures that name instants of the clock: those from 2 s on, and the times of corners and changes."""
    run = drawn_run(3)
    after_2s = ("rms_after_2s", "maximum_after_2s", "torque_change_after_2s")
    compare(lap_figures(replace(run, time=run.time + 5.0)), lap_figures(run), *after_2s, "elbow_changes", "time")


RUN = drawn_run(0)
test_refusals = refused(
    (lambda: lap_figures(replace(RUN, notes={"ended": "deflection"})), r"ended early \(deflection, after 3\.99 s\)"),
    (lambda: lap_figures(RUN, torque_limit=(150.0, 0.0)), "torque_limit"),
    (lambda: lap_figures(RUN, band=0.0), r"band = 0.*> 0"),
    (lambda: lap_figures(replace(RUN, reference=None)), "has none"),
)


def test_instants_of_a_wrong_shape_or_at_the_same_time_are_refused() -> None:
    figures, zeros = RunningFigures(2), np.zeros((1, 2, 2))
    with pytest.raises(ValueError, match=r"tip: must have shape \(1, 2, 2\), got \(1, 1, 2\)"):
        figures.update(Instants(np.zeros(1), zeros[:, :1], *[zeros] * 6))
    figures.update(Instants(np.zeros(1), *[zeros] * 7))
    with pytest.raises(ValueError, match="time"):
        figures.update(Instants(np.zeros(1), *[zeros] * 7))
