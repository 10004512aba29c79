"""`ClosedLoop` as a batch: the same bits for one arm and for many, fresh results, repeatable runs, refused input."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from flexarm_env import (
    ArmParameters,
    ClosedLoop,
    FlexibleArm,
    LawParameters,
    LoopCase,
    SensorParameters,
    SquareParameters,
    inverse_kinematics,
    kernels,
    square,
    stepping,
)
from flexarm_env.simulation import Results

Array = NDArray[np.float64]
ARM = FlexibleArm(ArmParameters.paper())
PATH = square(SquareParameters(lap_time=0.2))  # all four corners in a short run

# Whatever may differ inside a batch: delays, sensor positions, command delays, gains of the law, torque limits.
CASES = [
    LoopCase(SensorParameters("collocated"), LawParameters()),
    LoopCase(SensorParameters(), LawParameters()),
    LoopCase(SensorParameters(position=0.5), LawParameters(compensation="per_joint")),
    LoopCase(SensorParameters(), LawParameters(compensation="shared")),
    LoopCase(SensorParameters(position=2.0, delay=0.0), LawParameters(torque_limit=(80.0, 40.0))),
    LoopCase(SensorParameters(position=3.0, delay=(0.031, 0.0002)), LawParameters(compensation="shared")),
    LoopCase(SensorParameters(delay=1e-4), LawParameters(120.0, 20.0)),
    LoopCase(SensorParameters("collocated", 0.5), LawParameters()),
    LoopCase(SensorParameters(wave_speed=1000.0), LawParameters(compensation="per_joint")),
    LoopCase(SensorParameters(delayed="position+rate"), LawParameters()),  # unstable, among stable ones
    LoopCase(SensorParameters(noise=0.01), LawParameters(proportional_gain=0.0)),
    LoopCase(SensorParameters("collocated"), LawParameters(derivative_gain=0.0)),
]
PERIODS = 120


def start_states(count: int) -> Array:
    """A different start for each: at a corner, displaced, moving."""
    states = np.zeros((count, 2 * ARM.size))
    states[:, :2] = inverse_kinematics(ARM.parameters, (-6.3, -6.3), "positive")
    return states + 0.02 * np.random.default_rng(5).normal(size=(len(CASES), 2 * ARM.size))[:count]


def drive(loop: ClosedLoop, states: Array, gains: Array, noise: Array, periods: int = PERIODS) -> list[Results]:
    loop.reset(states, noise[0])
    results = [loop.results()]
    for k in range(periods):
        loop.advance(gains[k], noise[k])
        results.append(loop.results())
    return results


def inputs(count: int) -> tuple[Array, Array, Array]:
    rng = np.random.default_rng(8)
    gains = rng.uniform(0.0, 2.0, (PERIODS, len(CASES)))[:, :count]
    noise = 0.05 * rng.normal(size=(PERIODS, len(CASES), 2))[:, :count]
    return start_states(count), gains, noise


def assert_same_bits(one: Sequence[Results], other: Sequence[Results]) -> None:
    for k, (a, b) in enumerate(zip(one, other, strict=True)):
        for name, x, y in zip(Results._fields, a, b, strict=True):
            assert np.array_equal(x, y, equal_nan=True), f"{name} differs after {k} periods"


def part(results: Sequence[Results], i: int) -> list[Results]:
    return [Results(*(array[i : i + 1] for array in result)) for result in results]


# --- one truth for one and for many -------------------------------------------------------------------------


@pytest.fixture(scope="module")
def singles() -> list[list[Results]]:
    states, gains, noise = inputs(len(CASES))
    return [
        drive(ClosedLoop(ARM, [case], PATH), states[i : i + 1], gains[:, i : i + 1], noise[:, i : i + 1])
        for i, case in enumerate(CASES)
    ]


def test_the_cases_differ(singles: list[list[Results]]) -> None:
    """Otherwise comparing them would show nothing."""
    ends = np.array([run[-1].state[0] for run in singles])
    distances = np.abs(ends[:, None] - ends[None]).max(axis=2) + np.diag(np.full(len(ends), np.inf))
    assert distances.min() > 1e-3
    assert np.all(np.isfinite(ends))


@pytest.mark.parametrize("count", [1, 3, 8, 12])  # alone; part of a block; a full block; two blocks
def test_a_batch_has_the_bits_of_single_loops(count: int, singles: list[list[Results]]) -> None:
    loop = ClosedLoop(ARM, CASES[:count], PATH)
    assert len(loop) == count
    run = drive(loop, *inputs(count))
    for i in range(count):
        assert_same_bits(part(run, i), singles[i])


def test_neighbours_do_not_matter(singles: list[list[Results]]) -> None:
    """The same arms in another order, one of them broken."""
    states, gains, noise = inputs(len(CASES))
    order = np.random.default_rng(1).permutation(len(CASES))
    broken = int(np.flatnonzero(order == 4)[0])
    states, gains, noise = states[order], gains[:, order], noise[:, order]
    states[broken, -1] = 1e200  # overflows at once
    run = drive(ClosedLoop(ARM, [CASES[i] for i in order], PATH), states, gains, noise)
    assert run[-1].status[broken] == -1.0
    for place, i in enumerate(order):
        if place != broken:
            assert_same_bits(part(run, place), singles[i])


def test_threads_do_not_matter(singles: list[list[Results]]) -> None:
    states, gains, noise = inputs(len(CASES))

    def single(i: int) -> list[Results]:
        loop = ClosedLoop(ARM, CASES[i : i + 1], PATH)
        return drive(loop, states[i : i + 1], gains[:, i : i + 1], noise[:, i : i + 1])

    def batch(_: int) -> list[Results]:
        return drive(ClosedLoop(ARM, CASES, PATH), states, gains, noise)

    with ThreadPoolExecutor(8) as pool:
        found = list(pool.map(single, range(len(CASES))))
        batches = list(pool.map(batch, range(4)))
    for run, expected in zip(found, singles, strict=True):
        assert_same_bits(run, expected)
    for run in batches:
        assert_same_bits(run, batches[0])
        assert_same_bits(part(run, 0), singles[0])


# --- state and results --------------------------------------------------------------------------------------


def test_results_are_new_arrays() -> None:
    loop = ClosedLoop(ARM, CASES[:3], PATH)
    states, gains, noise = inputs(3)
    loop.reset(states)
    before = loop.results()
    kept = [array.copy() for array in before]
    again = loop.results()
    for array in before:
        array[...] = np.nan  # what a caller does to them reaches nobody
    assert_same_bits([loop.results()], [again])
    loop.advance(gains[0], noise[0])
    for array, copied in zip(again, kept, strict=True):
        np.testing.assert_array_equal(array, copied)


def test_inputs_are_not_changed() -> None:
    loop = ClosedLoop(ARM, CASES[:3], PATH)
    states, gains, noise = inputs(3)
    copies = states.copy(), gains.copy(), noise.copy()
    drive(loop, states, gains, noise, 3)
    for array, copied in zip((states, gains, noise), copies, strict=True):
        np.testing.assert_array_equal(array, copied)


@pytest.mark.parametrize("count", [1, 12])
def test_reset_repeats_bit_for_bit(count: int) -> None:
    """The torque at the reset included, which is that of gain 0, whatever the gain was before."""
    loop = ClosedLoop(ARM, CASES[:count], PATH)
    first = drive(loop, *inputs(count))
    np.testing.assert_array_equal(first[0].torque, np.zeros((count, 2)))
    assert_same_bits(drive(loop, *inputs(count)), first)


def test_reset_recovers_from_divergence() -> None:
    loop = ClosedLoop(ARM, CASES[:2], PATH)
    states, gains, noise = inputs(2)
    fresh = drive(loop, states, gains, noise)
    broken = states.copy()
    broken[0, -1] = 1e200
    assert np.isnan(drive(loop, broken, gains, noise)[-1].state[0]).any()
    assert_same_bits(drive(loop, states, gains, noise), fresh)


def test_without_noise_given_it_stays_as_it_was() -> None:
    states, gains, noise = inputs(2)
    held, repeated = (ClosedLoop(ARM, CASES[:2], PATH) for _ in range(2))
    held.reset(states, noise[0])
    repeated.reset(states, noise[0])
    for k in range(5):
        held.advance(gains[k])
        repeated.advance(gains[k], noise[0])
    assert_same_bits([held.results()], [repeated.results()])
    held.reset(states)  # and a reset forgets it
    sensed = held.results().observation[:, 4:6]
    held.reset(states, noise[0])
    np.testing.assert_allclose(held.results().observation[:, 4:6] - sensed, noise[0], atol=1e-14)


@pytest.mark.parametrize("count", [1, 12])
@pytest.mark.parametrize("how", ["pickle", "deepcopy"])
def test_a_copy_continues_by_itself(count: int, how: str) -> None:
    states, gains, noise = inputs(count)
    loop = ClosedLoop(ARM, CASES[:count], PATH)
    whole = drive(loop, states, gains, noise)
    drive(loop, states, gains, noise, 50)
    twin = pickle.loads(pickle.dumps(loop)) if how == "pickle" else copy.deepcopy(loop)
    for run in (twin, loop):  # one after the other: shared memory would show
        rest = []
        for k in range(50, PERIODS):
            run.advance(gains[k], noise[k])
            rest.append(run.results())
        assert_same_bits(rest, whole[51:])
    assert twin.time == pytest.approx(0.12, rel=1e-12)


def test_time_and_substeps() -> None:
    loop = ClosedLoop(ARM, CASES[:1], PATH, control_period=2e-3)
    assert loop.substeps == 8  # of 0.25 ms
    assert loop.physics_step == pytest.approx(2.5e-4, rel=1e-15)
    loop.reset(start_states(1))
    assert loop.time == 0.0
    loop.advance([1.0])
    loop.advance([1.0])
    assert loop.time == pytest.approx(4e-3, rel=1e-15)
    assert ClosedLoop(ARM, CASES[:1], PATH, physics_step=3.4e-4).substeps == 3  # the longest that divides a period
    assert ClosedLoop(ARM, CASES[:1], PATH, physics_step=1e-3 / 3.0).substeps == 3  # rounding makes no fourth
    four_modes = FlexibleArm(ArmParameters(modes_per_link=4))
    assert ClosedLoop(four_modes, CASES[:1], PATH).substeps == 8  # its fastest mode wants shorter steps


def test_results_agree_with_the_arms_kinematics() -> None:
    loop = ClosedLoop(ARM, CASES, PATH)
    results = drive(loop, *inputs(len(CASES)), periods=30)[-1]
    q = results.state[:, : ARM.size]
    np.testing.assert_allclose(results.true_tip, ARM.tip(q), atol=1e-13)  # another sine, sums in another order
    np.testing.assert_allclose(results.rigid_tip, ARM.rigid_tip(q), atol=1e-13)
    distance = np.linalg.norm(results.true_tip - PATH.position(loop.time), axis=1)
    wide, narrow = 0.5 * np.exp(-((distance / 0.6) ** 2)), 0.5 * np.exp(-distance / 0.15)
    np.testing.assert_allclose(results.reward_terms, np.stack([wide, narrow], axis=1), atol=1e-13)
    assert np.all(results.status == 0.0)


def test_status_names_the_first_entry_past_its_limit() -> None:
    limits = np.full(8, np.inf)
    limits[[1, 3, 5]] = 2.0, 0.3, 7.0
    loop = ClosedLoop(ARM, CASES[:5], PATH, state_limits=limits)
    states = np.zeros((5, 8))
    states[0, 1] = -2.1
    states[1, 3] = 0.31
    states[2, [5, 3]] = -7.1, -0.4
    states[3, 5] = 7.1
    states[4, [0, 1, 2, 3, 4, 5]] = 50.0, 2.0, 9.0, -0.3, 99.0, -7.0  # at the limits, not past them
    loop.reset(states)
    status = loop.results().status
    np.testing.assert_array_equal(status, [2.0, 4.0, 4.0, 6.0, 0.0])
    assert [loop.failure(s) for s in (*status, -1.0)] == ["angle", "deflection", "deflection", "rate", None, "diverged"]


@pytest.mark.parametrize("node", [0.0, 0.5, 1.0])
def test_late_readings_are_interpolated_exactly_up_to_third_order(node: float) -> None:
    """A cubic in time comes back exactly, and its rate, from steps past; a parabola from the step at hand."""
    case = LoopCase(SensorParameters(delay=(0.00483, 0.0001), delayed="position+rate"), LawParameters())
    loop = ClosedLoop(ARM, [case], PATH)
    loop.reset(start_states(1))
    h, now = loop.physics_step, 61
    late, short = np.polynomial.Polynomial([1.0, -30.0, 4e3, 9e5]), np.polynomial.Polynomial([-2.0, 50.0, 7e3])
    slots = loop._histories.shape[1]
    for step in range(now - slots + 1, now + 1):
        for reading, curve in enumerate((late, short)):
            loop._histories[0, step % slots, [reading, 2 + reading], 0] = curve(step * h), curve.deriv()(step * h)
    loop._clocks[:, stepping.STEPS], loop._clocks[:, stepping.HEAD] = now, now % slots
    module, rows = kernels.load(loop._variant), loop._rows
    module.prepare_readings(loop._flat_arenas[0], loop._flat_histories[0], loop._clocks[0], h, node)
    time = (now + node) * h
    for reading, (curve, delay) in enumerate(((late, 0.00483), (short, 0.0001))):
        offset, weight, rate_offset, rate_weight = (
            loop._arenas[0, rows[name][0] + reading, 0] for name in ("OFFSET", "WEIGHT", "RATE_OFFSET", "RATE_WEIGHT")
        )
        seen = offset + weight * curve(time)
        seen_rate = rate_offset + rate_weight * curve.deriv()(time)
        assert seen == pytest.approx(curve(time - delay), rel=1e-13)
        assert seen_rate == pytest.approx(curve.deriv()(time - delay), rel=1e-11)  # differences over a step


# --- refusals -----------------------------------------------------------------------------------------------


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
