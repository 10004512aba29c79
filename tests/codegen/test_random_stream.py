"""The counter-based random stream, the rigid inverse kinematics and elementary functions that the kernels compile."""

import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit
from scipy import stats

from flexarm_env import ArmParameters, inverse_kinematics
from flexarm_env.codegen import elementary
from flexarm_env.codegen.compiler import Kernels
from flexarm_env.envs.bounds import LARGEST_DEVIATE
from flexarm_env.episode.step import TORQUE
from flexarm_env.kernels.variants import Variant
from flexarm_env.physics.inverse_kinematics import LEAST_SINE, joint_angles_for, joint_rates_for

LENGTHS = (4.5, 3.0)
BITS = st.integers(0, 2**64 - 1)


def of_arrays(function: Callable[..., Any]) -> Callable[..., Any]:
    """Call a compiled function, which Python cannot call, with the numbers of arrays; a number is for all."""
    one = njit(lambda *numbers: function(*numbers))
    return lambda *arrays: np.array([one(*numbers) for numbers in zip(*np.broadcast_arrays(*arrays), strict=True)])


@pytest.fixture(scope="module")
def compiled() -> SimpleNamespace:
    """Compile the functions as kernels have them."""
    functions = (elementary.uniform, elementary.normal, elementary.arctan2, elementary.sincos)
    own = map(Kernels(Variant(TORQUE, 1, True, 1)).compiled, (*functions, joint_angles_for, joint_rates_for))
    uniforms, normals, arctan2s, sines, angles, rates = map(of_arrays, own)
    return SimpleNamespace(
        uniforms=uniforms,
        normals=normals,
        arctan2s=arctan2s,
        sines=sines,
        joint_angles=lambda branch, points: angles(*LENGTHS, branch, *points.T),
        joint_rates=lambda theta, velocity: rates(*LENGTHS, *theta.T, *velocity.T),
    )


COUNT = 200_000


def reference_uniform(key: int, place: int) -> float:
    """SplitMix64 of the key combined with that of the place, in Python's own integers."""

    def mixed(bits: int) -> int:
        bits = ((bits ^ bits >> 30) * 0xBF58476D1CE4E5B9) % 2**64
        bits = ((bits ^ bits >> 27) * 0x94D049BB133111EB) % 2**64
        return bits ^ bits >> 31

    return (mixed(key ^ mixed((place + 1) * 0x9E3779B97F4A7C15 % 2**64)) >> 11) / 2**53


@settings(max_examples=200)
@given(BITS, st.integers(0, 10**9))
def test_uniform_is_the_same_in_any_arithmetic(compiled: SimpleNamespace, key: int, place: int) -> None:
    expected = reference_uniform(key, place)
    with np.errstate(over="ignore"):
        assert elementary.uniform(np.uint64(key), place) == expected
    assert compiled.uniforms(np.array([key], np.uint64), np.array([place]))[0] == expected
    assert 0.0 <= expected < 1.0


@pytest.mark.parametrize("along", ["places", "keys"])
def test_normal_is_normal(compiled: SimpleNamespace, along: str) -> None:
    counted = np.arange(COUNT)
    keys, places = (np.full(COUNT, 12345), counted) if along == "places" else (counted, np.full(COUNT, 17))
    numbers = compiled.normals(keys.astype(np.uint64), 2 * places)  # each uses up two
    assert stats.kstest(numbers, "norm").pvalue > 1e-3
    moments = [np.mean(numbers**power) for power in (1, 2, 3, 4)]
    deviations = np.sqrt(np.array([1.0, 2.0, 15.0, 96.0]) / COUNT)
    assert np.all(np.abs(np.array(moments) - [0.0, 1.0, 0.0, 3.0]) < 3.5 * deviations)
    assert 4.0 < np.abs(numbers).max() < 6.0


def test_normal_has_a_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    """At the largest uniform number, one minus 2^-53, in the direction 0: what the observation's bounds assume."""
    monkeypatch.setattr(elementary, "uniform", lambda key, place: (1.0 - 2.0**-53) * (1 - place % 2))
    largest = elementary.normal(np.uint64(0), 0)
    assert largest == pytest.approx(math.sqrt(106.0 * math.log(2.0)), rel=1e-12)
    assert 8.5 < largest < LARGEST_DEVIATE


@pytest.mark.parametrize(("key_step", "place_step"), [(0, 1), (1, 0), (1, 1), (2**40, 0), (1, -1), (0, 8)])
def test_neighbours_are_independent(compiled: SimpleNamespace, key_step: int, place_step: int) -> None:
    """Episodes with similar keys, places that follow each other: pairs fill the unit square evenly."""
    keys = np.arange(COUNT, dtype=np.uint64) if key_step else np.full(COUNT, 5, dtype=np.uint64)
    places = np.arange(COUNT) + 10 if place_step else np.full(COUNT, 3)
    here = compiled.uniforms(keys, places)
    there = compiled.uniforms(keys + np.uint64(key_step), places + place_step)
    counts, *_ = np.histogram2d(here, there, bins=16, range=[(0.0, 1.0)] * 2)
    assert stats.chisquare(counts.ravel()).pvalue > 1e-4
    assert abs(np.corrcoef(here, there)[0, 1]) < 3.5 * COUNT**-0.5


def ring_of_points(count: int = 500) -> np.ndarray:
    rng = np.random.default_rng(0)
    radius, angle = rng.uniform(1.51, 7.49, count), rng.uniform(-np.pi, np.pi, count)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


def test_joint_angles_are_those_of_inverse_kinematics(compiled: SimpleNamespace) -> None:
    points, arm = ring_of_points(), ArmParameters.linear(link_lengths=LENGTHS)
    branches: dict[Any, float] = {"positive": 1.0, "negative": -1.0}
    for name, branch in branches.items():
        expected = [inverse_kinematics(arm, point, name) for point in points]
        np.testing.assert_array_equal(compiled.joint_angles(branch, points), expected)


def test_beyond_the_reach_the_arm_is_straight_or_folded(compiled: SimpleNamespace) -> None:
    points = np.array([(8.0, 0.0), (0.0, 100.0), (7.5, 0.0), (1.0, 0.0), (0.0, -1.5)])
    theta = compiled.joint_angles(1.0, points)
    # rounding of the reach's square, 1e-14, enters by its root
    np.testing.assert_allclose(theta[:, 1], [0.0, 0.0, 0.0, np.pi, np.pi], rtol=0.0, atol=1e-7)
    np.testing.assert_allclose(theta[:3, 0], [0.0, np.pi / 2.0, 0.0], rtol=0.0, atol=1e-7)


def test_joint_rates_move_the_tip(compiled: SimpleNamespace) -> None:
    """By difference quotients of the angles: their own error is 1e-6 of a rate that the root makes large near reach."""
    points = ring_of_points()
    theta = compiled.joint_angles(1.0, points)
    points, theta = (rows[np.abs(np.sin(theta[:, 1])) > LEAST_SINE] for rows in (points, theta))
    velocity = np.random.default_rng(1).normal(size=points.shape)
    rates = compiled.joint_rates(theta, velocity)
    ahead, behind = (compiled.joint_angles(1.0, points + h * velocity) for h in (1e-6, -1e-6))
    turn = 2.0 * np.pi * np.round((ahead - behind) / (2.0 * np.pi))
    np.testing.assert_allclose(rates, (ahead - behind - turn) / 2e-6, rtol=1e-5, atol=1e-6)


def test_joint_rates_stay_bounded_near_the_straight_arm(compiled: SimpleNamespace) -> None:
    """As if the sine of theta2 were 0.05; exact just outside."""
    theta = np.array([(0.3, angle) for angle in (0.0, 1e-9, -1e-9, 0.04, np.pi, np.arcsin(LEAST_SINE) * 1.0001)])
    velocity = np.array([(0.6, 0.8)] * len(theta))
    rates = compiled.joint_rates(theta, velocity)
    assert np.abs(rates).max() <= (4.5 + 3.0) / (4.5 * 3.0 * LEAST_SINE)
    first, second = np.array(LENGTHS) * np.exp(1j * np.cumsum(theta[-1]))  # the links, as complex numbers
    moved = 1j * (rates[-1, 0] * (first + second) + rates[-1, 1] * second)
    np.testing.assert_allclose([moved.real, moved.imag], velocity[-1], rtol=1e-12)


def coordinates() -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(0)
    size = 10.0 ** rng.uniform(-12.0, 12.0, (2, 3000)) * rng.choice([-1.0, 1.0], (2, 3000))
    special = np.array([(a, b) for a in (0.0, 1.0, -1.0, 1e-200, -3.0, 5e200) for b in (0.0, 1.0, -1.0, 1e-200, 7.0)])
    return np.hstack([size, special.T])


def test_arctan2_is_as_accurate_as_it_says(compiled: SimpleNamespace) -> None:
    """Within 4 units in the last place of the exact angle, the same bits as number, array, and compiled."""
    y, x = coordinates()
    found = elementary.arctan2(y, x)
    np.testing.assert_array_equal(compiled.arctan2s(y, x), found)
    np.testing.assert_array_equal(
        [elementary.arctan2(*pair) for pair in zip(y.tolist(), x.tolist(), strict=True)], found
    )
    with mpmath.workdps(40):
        for value, a, b in zip(found.tolist(), y.tolist(), x.tolist(), strict=True):
            exact = mpmath.atan2(mpmath.mpf(a), mpmath.mpf(b))
            assert abs(value - exact) <= 4.0 * np.spacing(max(abs(float(exact)), 1e-300))
    np.testing.assert_allclose(found, np.arctan2(y, x), rtol=1e-15)
    assert elementary.arctan2(0.0, 0.0) == 0.0
    assert np.isnan(elementary.arctan2(np.array([np.nan, 1.0]), np.array([1.0, np.nan]))).all()


def test_exp_minus_is_as_accurate_as_it_says() -> None:
    """Relative error below 1e-12; the same bits as number and array; one at zero, never more."""
    x = np.concatenate([np.linspace(0.0, 700.0, 4001), 10.0 ** np.linspace(-300.0, 2.8, 2000), [1e9, np.inf]])
    found = elementary.exp_minus(x)
    np.testing.assert_array_equal([elementary.exp_minus(value) for value in x.tolist()], found)
    inside = x <= 700.0
    with mpmath.workdps(40):
        pairs = zip(found[inside].tolist(), x[inside].tolist(), strict=True)
        assert max(abs(mpmath.mpf(a) * mpmath.exp(mpmath.mpf(b)) - 1) for a, b in pairs) < 1e-12
    assert np.all((found >= 0.0) & (found <= 1.0))
    assert np.all(found[~inside] < 1e-300)
    assert elementary.exp_minus(0.0) == 1.0


def test_sines_are_the_same_compiled(compiled: SimpleNamespace) -> None:
    x = np.random.default_rng(0).uniform(-30.0, 30.0, 3000)
    np.testing.assert_array_equal(compiled.sines(x).T, elementary.sincos(x))
