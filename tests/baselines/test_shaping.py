"""Shapers cancel the vibration that they are made for; shaped references are the convolutions that they claim to be."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flexarm_baselines.joint_space.shaping import SHAPERS, TOLERATED, ShapedReference, impulses, residual
from flexarm_env import SquareParameters, square

PATH = square(SquareParameters())


@given(st.sampled_from(SHAPERS), st.floats(0.5, 50.0), st.floats(0.0, 0.5))
def test_amplitudes_add_up_to_one(shaper: str, frequency: float, damping: float) -> None:
    train = impulses(shaper, frequency, damping)
    assert train.amplitudes.sum() == pytest.approx(1.0, rel=1e-14)
    assert np.all(train.amplitudes > 0.0)
    assert train.times[0] == 0.0
    assert 0.0 <= train.delay <= train.times[-1]


@given(st.floats(0.5, 50.0), st.floats(0.0, 0.3))
def test_what_is_left_of_the_vibration(frequency: float, damping: float) -> None:
    """ZV and ZVD leave nothing at their frequency; EI leaves what it tolerates, undamped. ZVD is flat there."""
    for shaper in ("ZV", "ZVD"):
        assert residual(impulses(shaper, frequency, damping), frequency, damping) < 1e-12
    assert residual(impulses("none", frequency, damping), frequency, damping) == pytest.approx(1.0)
    assert residual(impulses("EI", frequency), frequency) == pytest.approx(TOLERATED, rel=1e-9)
    near = frequency * np.array([0.9, 1.1])
    assert np.all(residual(impulses("ZVD", frequency), near) < 0.3 * residual(impulses("ZV", frequency), near))


def test_a_shaped_step_leaves_an_oscillator_at_rest() -> None:
    """By the oscillator's own response, not by the formula: superposed cosines after the last impulse."""
    train = impulses("ZV", 7.0)
    time = np.linspace(train.times[-1], 3.0, 200)
    moved = sum(a * (1.0 - np.cos(7.0 * (time - t))) for t, a in zip(train.times, train.amplitudes, strict=True))
    assert moved == pytest.approx(np.ones(200), abs=1e-12)


def test_a_windowed_reference_is_the_convolution() -> None:
    """Beside a fine sum over the triangle, whose error is of second order in its step."""
    shaped = ShapedReference(PATH, impulses("none", 1.0), window=0.3)
    time = np.array([0.0, 0.1, 0.45, 3.9, 4.1, 4.5, 15.9])
    shift = np.linspace(0.0, 0.6, 6001)
    weight = np.minimum(shift, 0.6 - shift)
    expected = np.einsum("k,nki->ni", weight / weight.sum(), PATH.position(time[:, None] - shift))
    assert shaped.position(time) == pytest.approx(expected, abs=1e-6)


def test_a_window_that_is_applied_four_times() -> None:
    """As twice the window of the doubly windowed reference; centred, it is symmetric about a corner's instant."""
    once = ShapedReference(PATH, impulses("none", 1.0), window=0.3, times=4)
    twice = ShapedReference(PATH, impulses("none", 1.0), window=0.3)
    time, shift = np.array([0.2, 4.3, 8.9, 15.5]), np.linspace(0.0, 0.6, 6001)
    weight = np.minimum(shift, 0.6 - shift)
    expected = np.einsum("k,nki->ni", weight / weight.sum(), twice.position(time[:, None] - shift))
    assert once.position(time) == pytest.approx(expected, abs=1e-6)
    assert once.centre == pytest.approx(0.6)
    centred = replace(once, lead=once.centre)
    before, after = (centred.position(time) - PATH.position(4.0) for time in (3.8, 4.2))
    assert before == pytest.approx(-after[::-1], abs=1e-7)


def test_later_laps_are_alike() -> None:
    shaped = ShapedReference(PATH, impulses("ZV", 5.0), window=0.3, lead=0.4)
    time = np.linspace(16.0, 32.0, 50)
    assert shaped.position(time + 32.0) == pytest.approx(shaped.position(time), abs=1e-9)


@pytest.mark.parametrize("window", [0.2, 0.5])
def test_velocity_and_acceleration_are_derivatives(window: float) -> None:
    shaped = ShapedReference(PATH, impulses("ZVD", 5.0), window, lead=0.2)
    time, h = np.linspace(0.05, 15.0, 301) + 1e-3, 1e-4
    # the acceleration is piecewise linear in time, so that second differences are exact but for its kinks
    assert shaped.velocity(time) == pytest.approx(
        (shaped.position(time + h) - shaped.position(time - h)) / (2.0 * h), abs=1e-4
    )
    assert shaped.acceleration(time) == pytest.approx(
        (shaped.velocity(time + h) - shaped.velocity(time - h)) / (2.0 * h), abs=2e-2
    )


def test_without_window_it_is_the_shaped_polyline() -> None:
    train = impulses("ZV", 6.0)
    shaped, time = ShapedReference(PATH, train), np.linspace(0.0, 16.0, 50)
    expected = sum(a * PATH.position(time - t) for t, a in zip(train.times, train.amplitudes, strict=True))
    assert shaped.position(time) == pytest.approx(expected, abs=1e-12)
    assert ShapedReference(PATH, impulses("none", 1.0)).acceleration(time) == pytest.approx(np.zeros((50, 2)))


def test_refusals() -> None:
    with pytest.raises(ValueError, match="shaper = 'UM'"):
        impulses("UM", 1.0)
    with pytest.raises(ValueError, match=r"frequency = 0\.0"):
        impulses("ZV", 0.0)
    with pytest.raises(ValueError, match=r"window = -1\.0"):
        ShapedReference(PATH, impulses("ZV", 1.0), window=-1.0)
