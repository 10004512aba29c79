"""Figures of rests and of bending moments, against constructed signals and the cantilever's closed form."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flexarm_env.metrics import bending_moment, rests
from flexarm_env.parameters import ArmParameters, SquareParameters
from flexarm_env.physics.paths import stops
from flexarm_env.simulation.arm import FlexibleArm

TIME = 0.01 * np.arange(2401)
PATH = stops(SquareParameters(lap_time=24.0)).position(np.minimum(TIME, 24.0))


def ringing(amplitude: float, decay: float, rate: float) -> np.ndarray:
    """Return a tip that rings in x after each arrival, 6 s apart from 4 s on, and is exact before. Shape (n, 2)."""
    since = np.mod(TIME - 4.0, 6.0) * (TIME >= 4.0)
    return PATH + np.outer(amplitude * np.exp(-decay * since) * np.cos(rate * since) * (TIME >= 4.0), [1.0, 0.0])


def test_a_path_that_stops_at_each_corner() -> None:
    """Rest to rest along each side by minimum jerk: 4 s of 6 s, at 15/8 of the mean speed in the middle."""
    speed = np.linalg.norm(np.diff(PATH, axis=0), axis=1) / 0.01
    assert speed.max() == pytest.approx(1.875 * 12.6 / 4.0, rel=1e-4)
    for n, corner in enumerate([(-6.3, 6.3), (6.3, 6.3), (6.3, -6.3), (-6.3, -6.3)]):
        np.testing.assert_allclose(PATH[600 * n + 400 : 600 * n + 601], np.tile(corner, (201, 1)), atol=1e-12)
    np.testing.assert_allclose(np.abs(PATH).max(axis=1), 6.3)  # on the square throughout


@given(st.floats(0.03, 0.5), st.floats(1.0, 4.0))
def test_what_rings_settles_when_its_envelope_says_so(amplitude: float, decay: float) -> None:
    """``A exp(-d t) |cos w t|`` last exceeds the band within half a period before ``ln(A / band) / d``."""
    rate = 40.0
    found = rests(TIME, ringing(amplitude, decay, rate), PATH)
    np.testing.assert_allclose([one[:2] for one in found], [(6.0 * n + 4.0, 6.0 * n + 6.0) for n in range(4)])
    latest = np.log(amplitude / 0.02) / decay
    for one in found:
        if latest < 1.9:
            assert max(latest - np.pi / rate, 0.0) - 0.011 <= one.settling_time <= latest + 0.011
        elif latest > 2.1:
            assert one.settling_time == np.inf or one.settling_time > 2.0 - np.pi / rate - 0.011


def test_vibration_is_that_of_a_sine_about_its_mean() -> None:
    """An offset is no vibration. 16 whole periods in each rest: r.m.s. A / sqrt 2, peak to peak 2 A."""
    rate = 16.0 * np.pi
    tip = ringing(0.03, 0.0, rate) + np.array([0.1, -0.2])
    deflection = np.stack([0.05 * np.sin(rate * TIME), np.zeros_like(TIME)], axis=1)
    for one in rests(TIME, tip, PATH, deflection):
        assert one.vibration == pytest.approx(0.03 / np.sqrt(2.0), rel=0.01)  # 201 instants, both ends
        assert one.swing == pytest.approx((0.1, 0.0), rel=0.01)
        assert one.settling_time == np.inf


def test_a_record_that_ends_on_the_way_and_a_reference_that_never_moves() -> None:
    assert len(rests(TIME[:550], PATH[:550], PATH[:550])) == 1
    assert len(rests(TIME[:700], PATH[:700], PATH[:700])) == 1
    assert rests(TIME[:9], np.zeros((9, 2)), np.zeros((9, 2))) == []


def test_the_moment_of_a_link_under_a_force_at_its_tip() -> None:
    """``w = F x^2 (3 L - x) / (6 EI)`` lies among the polynomial shapes; its moment is F L at the root."""
    arm, force = FlexibleArm(ArmParameters(modes_per_link=2)), 20.0
    length, rigidity = arm.parameters.link_lengths[1], arm.parameters.flexural_rigidities[1]
    x = np.linspace(0.0, length, 40)
    shape, *_ = np.linalg.lstsq(arm.modes[1].shape(x), force * x**2 * (3.0 * length - x) / (6.0 * rigidity))
    q = np.concatenate([[0.3, -0.8, 0.0, 0.0], -shape])
    found = bending_moment(arm, np.stack([q, 2.0 * q]))
    np.testing.assert_allclose(found, [[0.0, force * length], [0.0, 2.0 * force * length]], atol=1e-9)
