"""Zeros: against physics (held outputs, the exact beam), against python-control, and what they forbid."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg

from flexarm_env import ArmParameters, FlexibleArm
from flexarm_env.analysis import (
    OperatingPoint,
    joint_angles,
    linear_plant,
    link_zeros,
    natural_modes,
    poles,
    rigid_point,
    sensitivity_peak,
    strain,
    tip,
    true_point,
    zero_directions,
    zero_limits,
    zeros,
)

ANGLES = (0.3, 1.5)


def arm_with(modes: int, damping: float = 0.0) -> FlexibleArm:
    return FlexibleArm(ArmParameters.linear(modes_per_link=modes, damping_ratio=damping))


def bent(arm: FlexibleArm, elbow: float = 1.5) -> OperatingPoint:
    return OperatingPoint.at_angles(arm, (0.3, elbow))


def right(point: OperatingPoint, s: float) -> np.ndarray:
    return zeros(linear_plant(point, true_point(s))).right_half_plane


def closest(values: np.ndarray, wanted: np.ndarray) -> float:
    """Largest distance of a wanted value from the nearest computed one, relative."""
    return max(float(np.abs(values - w).min() / max(abs(w), 1.0)) for w in wanted)


@pytest.mark.parametrize("modes", [1, 2, 3, 4])
@pytest.mark.parametrize("elbow", [0.3, 1.5, -2.6])
def test_joint_angles_have_zeros_on_the_imaginary_axis_only(modes: int, elbow: float) -> None:
    """They are the natural frequencies with both joints locked."""
    point = bent(arm_with(modes), elbow)
    found = zeros(linear_plant(point, joint_angles()))
    assert np.all(found.values.real == 0.0)
    locked = natural_modes(point, "locked").frequencies
    np.testing.assert_allclose(np.unique(np.abs(found.values.imag).round(6)), np.unique(locked.round(6)), rtol=1e-5)
    assert len(found.values) == 4 * modes
    assert found.infinite == 4
    rigid = zeros(linear_plant(point, rigid_point(2.0))).values  # a constant invertible matrix lies between them
    assert closest(rigid, found.values) < 1e-5
    assert len(rigid) == len(found.values)


@pytest.mark.parametrize(("modes", "zero"), [(1, 33.10), (2, 39.65), (3, 39.01), (4, 39.09)])
def test_one_right_half_plane_zero_depends_neither_on_the_place_nor_on_the_elbow(modes: int, zero: float) -> None:
    arm = arm_with(modes)
    for elbow in (0.3, 1.5, 2.8):
        for s in (0.25, 1.0, 2.25, 3.7, 4.5):
            found = right(bent(arm, elbow), s)
            assert np.abs(found - zero).min() < 0.006, (elbow, s)


@pytest.mark.parametrize("s", [0.3, 1.0, 2.0, 3.0, 4.0, 4.5])
def test_many_zeros_of_the_exact_beam_follow_their_asymptotes(s: float) -> None:
    """kappa s -> n pi and k (L - s) -> (n - 3/4) pi, at the tip kappa L -> (n - 1/4) pi."""
    found, speed = link_zeros(arm_with(1), 2, s, 20), np.sqrt(1676.0 / 0.335)
    n = np.arange(1, 21)
    assert len(found.real) == 20
    assert np.all(np.diff(found.real) > 0.0)
    waves = n * np.pi / s if s < 4.5 else (n - 0.25) * np.pi / s
    np.testing.assert_allclose(found.real[12:], 2.0 * speed * waves[12:] ** 2, rtol=1e-6)
    if s == 4.5:
        assert len(found.imaginary) == 0
        ends = [scipy.optimize.brentq(lambda z: np.tan(z) + np.tanh(z), (i - 0.45) * np.pi, i * np.pi) for i in n]
        np.testing.assert_allclose(found.real, 2.0 * speed * (np.array(ends) / s) ** 2, rtol=1e-10)
    elif s >= 2.0:  # nearer to the hinge the point and the hinge share a wave
        np.testing.assert_allclose(found.imaginary[8:], speed * ((n[8:] - 0.75) * np.pi / (4.5 - s)) ** 2, rtol=1e-6)


@pytest.mark.parametrize("s", [0.5, 2.0, 3.0, 4.0])
def test_zeros_of_a_point_are_those_of_the_exact_beams(s: float) -> None:
    """Its slowest zeros: link 1's at its tip, and link 2's at the point, real and imaginary."""
    arm = arm_with(4)
    values = zeros(linear_plant(bent(arm), true_point(s))).values
    exact = link_zeros(arm, 2, s, 2)
    slow = [w for w in exact.imaginary if w < 110.0]
    if slow:
        assert closest(values, 1j * np.array(slow)) < 1e-2
    if exact.real[0] < 60.0:
        assert closest(values, exact.real[:1]) < 1e-2


def test_a_second_real_zero_comes_in_from_infinity_and_falls_to_the_first_at_the_tip() -> None:
    """With one mode past 3.39 m; at the tip the two coincide, as the links are equal: one double zero."""
    point = bent(arm_with(1))
    assert len(right(point, 3.35)) == 1
    falling = [right(point, s).real.max() for s in (3.42, 3.6, 3.8, 4.0, 4.2, 4.4)]
    assert len(right(point, 3.42)) == 2
    assert np.all(np.diff(falling) < 0.0)
    assert falling[0] > 150.0
    ((value, multiplicity),) = [(v, n) for v, n in zeros(linear_plant(point, tip())).distinct() if v.real > 0.0]
    assert multiplicity == 2
    assert value.real == pytest.approx(33.1017, abs=1e-3)
    response = linear_plant(point, tip()).at(value)
    singular = np.linalg.svd(response, compute_uv=False)
    assert singular[1] < 1e-10
    assert singular[0] > 1e-6, "one direction only: the double zero is defective"


def test_unequal_links_separate_the_double_zero() -> None:
    arm = FlexibleArm(ArmParameters.linear(modes_per_link=4, damping_ratio=0.0, link_lengths=(4.5, 3.0)))
    found = np.sort(right(bent(arm), 3.0).real)[:2]
    exact = sorted(float(link_zeros(arm, link, length, 1).real[0]) for link, length in ((1, 4.5), (2, 3.0)))
    np.testing.assert_allclose(found, exact, rtol=2e-3)


@pytest.mark.parametrize("damping", [0.0, 0.01])
@pytest.mark.parametrize("modes", [1, 2])
def test_zeros_are_poles_of_the_arm_with_its_output_held(modes: int, damping: float) -> None:
    """An independent way: a very stiff and well placed feedback of the output, whose finite poles tend to the zeros."""
    point = bent(arm_with(modes, damping))
    plant = linear_plant(point, true_point(2.8))
    inverse = np.linalg.inv(plant.C @ plant.A @ plant.B)
    for gain, error in ((1e3, 0.2), (1e5, 2e-3)):
        rate = plant.C @ plant.A
        feedback = inverse @ (gain**2 * plant.C + 2.0 * gain * rate)
        held = np.linalg.eigvals(plant.A - plant.B @ feedback)
        assert closest(held, zeros(plant).values) < error


def test_general_pencil_agrees_with_the_deflated_one() -> None:
    """Rates as outputs go through Rosenbrock's pencil: the position's zeros and one at the origin for each output."""
    for damping in (0.0, 0.01):
        point = bent(arm_with(2, damping))
        position = zeros(linear_plant(point, true_point(3.0))).values
        rate = zeros(linear_plant(point, true_point(3.0, rate=True))).values
        assert np.sum(rate == 0.0) == 2
        assert closest(rate, position) < 1e-6
        assert len(rate) == len(position) + 2


def test_a_delay_adds_no_zero_and_its_pade_model_its_own() -> None:
    point = bent(arm_with(1, 0.01))
    prompt, late = (linear_plant(point, true_point(3.8, delay=d)) for d in (0.0, 0.02))
    np.testing.assert_allclose(zeros(late).values, zeros(prompt).values)
    assert zeros(replace(late, delays=np.array([0.0, 100.0]))).values.tolist() == zeros(prompt).values.tolist()
    modelled = zeros(late.pade(2)).values
    assert closest(modelled, zeros(prompt).values) < 1e-5
    extra = 150.0 + 1j * np.sqrt(12.0 / 0.02**2 - 150.0**2)  # of s^2 T^2 - 6 s T + 12, one pair for each output
    assert closest(modelled, np.array([extra, extra.conjugate()])) < 1e-3
    assert len(modelled) == len(zeros(prompt).values) + 4


def test_a_direct_path_is_taken_into_account() -> None:
    """With D regular the zeros are the eigenvalues of A - B D^-1 C."""
    plant = linear_plant(bent(arm_with(2, 0.01)), true_point(3.0))
    direct = np.array([[3e-3, 1e-3], [-2e-3, 4e-3]])
    found = zeros(replace(plant, D=direct))
    expected = np.linalg.eigvals(plant.A - plant.B @ np.linalg.solve(direct, plant.C))
    assert closest(found.values, expected) < 1e-8
    assert found.infinite == 0


def test_one_torque_to_one_joint() -> None:
    """Shoulder torque to its angle, the elbow free: poles with the shoulder locked, interlacing the free ones."""
    point = bent(arm_with(2))
    plant = linear_plant(point, joint_angles()).select(["shoulder"], ["theta1"])
    found = np.abs(zeros(plant).values)
    assert np.sum(found == 0.0) == 2, "the arm still turns about its free elbow"
    locked = np.unique(found[found > 0.0].round(6))
    free = natural_modes(point).frequencies[2:]
    assert np.all(locked[: len(free)] < free)
    assert np.all(free[:-1] < locked[1 : len(free)])


@pytest.mark.parametrize("modes", [1, 2, 3])
def test_strain_does_not_see_the_rigid_arm(modes: int) -> None:
    """Four zeros at the origin cancel the four rigid-body poles there."""
    plant = linear_plant(bent(arm_with(modes)), strain(1), strain(2))
    found = zeros(plant)
    assert np.sum(found.values == 0.0) == 4
    assert len(found.values) == 4 * modes
    assert np.sum(np.abs(poles(plant).values) < 1e-3) == 4


def test_bent_and_spinning_arms_have_zeros_too() -> None:
    """Frozen about a bend or a spin. They move with the first power of the bend, the second of the spin's rate.

    A bent arm is no equilibrium: its unbalanced elastic forces turn with the links, which moves the zeros much more
    than the bend's geometry does.
    """
    arm = arm_with(2)
    still = zeros(linear_plant(bent(arm), true_point(3.8))).values
    bends, spins = [], []
    for size in (1e-7, 1e-6):
        held = OperatingPoint.at_angles(arm, ANGLES, modal=size * np.ones(arm.size - 2))
        bends.append(closest(zeros(linear_plant(held, true_point(3.8))).values, still))
        spinning = OperatingPoint.at_angles(arm, ANGLES, rates=1e5 * size * np.eye(1, arm.size)[0])
        spins.append(closest(zeros(linear_plant(spinning, true_point(3.8))).values, still))
    assert bends[1] / bends[0] == pytest.approx(10.0, rel=0.05)
    assert spins[1] / spins[0] == pytest.approx(100.0, rel=0.05)
    assert "modal" in str(held)
    assert "rates" in str(spinning)


def test_directions_block_the_torque() -> None:
    plant = linear_plant(bent(arm_with(2)), true_point(3.0))
    z = float(right(plant.point, 3.0).real.min())
    found = zero_directions(plant, z)
    u, y = found.input, found.output
    response = plant.at(z)
    assert np.linalg.norm(response @ u) < 1e-9 * np.linalg.norm(response)
    assert np.linalg.norm(y.conj() @ response) < 1e-9 * np.linalg.norm(response)
    assert np.linalg.norm(u) == pytest.approx(1.0)
    assert np.abs(np.concatenate([u.imag, y.imag])).max() < 1e-12


def test_limits_follow_from_the_zeros() -> None:
    point = OperatingPoint.at_point(arm_with(1), (-6.3, 6.3))
    (limit,) = zero_limits(linear_plant(point, tip()))
    assert limit.zero == pytest.approx(33.10, abs=0.01)
    assert limit.multiplicity == 2
    assert limit.bandwidth == pytest.approx(limit.zero / 2.0)
    assert zero_limits(linear_plant(point, joint_angles())) == []
    assert zero_limits(linear_plant(point, tip()), peak=1e9)[0].bandwidth == pytest.approx(limit.zero)


def test_sensitivity_peak_is_reached_by_its_extremal_function() -> None:
    """The bound is sharp for a sensitivity that is epsilon below and the peak above: its Poisson integral at z is 0."""
    zero, band, small = 33.0, 12.28, 0.1
    peak = sensitivity_peak(zero, band, small)
    below = 2.0 * np.arctan(band / zero)
    assert below * np.log(small) + (np.pi - below) * np.log(peak) == pytest.approx(0.0, abs=1e-12)
    assert sensitivity_peak(zero, 2.0 * band, small) > peak
