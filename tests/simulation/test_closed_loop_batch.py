"""`ClosedLoop` as a batch: the same bits for one arm and for many, fresh results, repeatable runs."""

from __future__ import annotations

import copy
import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from flexarm_env import ArmParameters, ClosedLoop, FlexibleArm
from flexarm_env.simulation.closed_loop import Results
from tests.support.batches import ARM, CASES, PATH, PERIODS, assert_same_bits, drive, inputs, part, start_states

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
