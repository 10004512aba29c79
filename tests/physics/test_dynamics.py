"""The equations of motion against a second derivation, and the textbook's rigid arm."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flexarm_env import ArmParameters, FlexibleArm
from tests.support.lagrange import DRY, Lagrangian, arms, loaded_arm, random_state, random_states, tensor

MODES = (1, 2, 3, 4)

# The derivations agree to rounding error: shapes carry cosh(lambda_4 L) = 3e4 ulp (7e-12), the modes' cross masses
# are summed up (stored here, integrated there), and a solution multiplies by the condition number of the scaled mass
# matrix, about 30. Seen: 4e-13 at most with three modes, 6e-12 with four.
AGREEMENT = 2e-11


def close(ours: np.ndarray, theirs: np.ndarray, rtol: float = AGREEMENT) -> None:
    """Agreement relative to the largest entry: small ones are differences of large ones."""
    assert ours.shape == theirs.shape
    np.testing.assert_allclose(ours, theirs, rtol=0.0, atol=rtol * np.abs(theirs).max())


@pytest.mark.parametrize("shapes", ["cantilever", "polynomial"])
@pytest.mark.parametrize("kinematics", ["linear", "foreshortened"])
@pytest.mark.parametrize("modes", MODES)
def test_the_equations_are_the_lagrangians(modes: int, kinematics: str, shapes: str) -> None:
    """Every parameter is in use, and each pair of modes, kinematics, shapes and damping; dry friction with one mode."""
    damping = ("modal", "material")[(modes + (kinematics == "linear") + (shapes == "polynomial")) % 2]
    housing = 0.3 * (kinematics == "foreshortened")
    named = {"kinematics": kinematics, "mode_shapes": shapes, "damping_model": damping}
    parameters = loaded_arm(modes, elbow_housing_inertia=housing, **named, **(DRY if modes == 1 else {}))
    arm, derived = FlexibleArm(parameters), Lagrangian(parameters)
    for state, tau in zip(random_states(parameters, 2), ([0.0, 0.0], [60.0, -25.0]), strict=True):
        q, rates = np.split(state, 2)
        mass, energy = derived.mass_matrix(q), arm.energy(state)
        close(arm.mass_matrix(q), mass)
        close(arm.velocity_forces(q, rates), derived.velocity_forces(q, rates))
        close(arm.acceleration(state, tau), derived.acceleration(q, rates, np.array(tau)))
        assert energy.kinetic == pytest.approx(float(derived.kinetic(tensor(q), tensor(rates))), rel=AGREEMENT)
        assert energy.strain == pytest.approx(float(derived.strain(tensor(q))), rel=AGREEMENT)
        # the whole arm turns with theta1: its momentum is that coordinate's
        assert arm.angular_momentum(state) == pytest.approx(mass[0] @ rates, rel=AGREEMENT)


@pytest.mark.parametrize("shapes", ["cantilever", "polynomial"])
@pytest.mark.parametrize("kinematics", ["linear", "foreshortened"])
def test_points_are_where_the_second_derivation_has_them(kinematics: str, shapes: str) -> None:
    parameters = loaded_arm(3, kinematics=kinematics, mode_shapes=shapes)
    arm, derived = FlexibleArm(parameters), Lagrangian(parameters)
    q = random_state(parameters, 3)[: arm.size]
    along = [arm.position(q, link, x.numpy()) for link, x in enumerate(derived.x, start=1)]
    close(np.concatenate([*along, [arm.elbow(q), arm.tip(q)]]), derived.configuration(tensor(q))[0].numpy())
    across = [float(tip @ tensor(modal)) for tip, modal in zip(derived.tip, np.split(q[2:], 2), strict=True)]
    close(arm.tip_deflection(q), np.array(across))


@settings(max_examples=60)
@given(parameters=arms(), seed=st.integers(0, 2**32 - 1))
def test_mass_matrix_is_symmetric_and_positive_definite(parameters: ArmParameters, seed: int) -> None:
    arm = FlexibleArm(parameters)
    matrix = arm.mass_matrix(random_state(parameters, seed)[: arm.size])
    # to and from absolute angles: sums of up to (2 m + 2)^2 products, each rounded
    np.testing.assert_allclose(matrix, matrix.T, rtol=0.0, atol=1e-14 * np.abs(matrix).max())
    scale = 1.0 / np.sqrt(np.diag(matrix))
    # Four modes of a bare link nearly hold its rotation as a rigid body: 3e-5 for the default arm; lumped masses at
    # tips of light links bring it down to 3e-6 (least of 2000 random arms). Rounding is 1e-15.
    assert np.linalg.eigvalsh(scale[:, None] * matrix * scale).min() > 1e-8


def rigid_velocity_forces(p: ArmParameters, theta2: float, rates: np.ndarray) -> np.ndarray:
    """Those of the textbook's rigid two-link arm (e.g. Spong, Hutchinson & Vidyasagar). Shape (2,)."""
    length1, length2 = p.link_lengths
    moment = p.masses_per_length[1] * length2**2 / 2.0 + p.payload_mass * length2  # static, about the elbow
    w1, w2 = rates
    return moment * length1 * np.sin(theta2) * np.array([-(2.0 * w1 + w2) * w2, w1**2])


@pytest.mark.parametrize("modes", MODES)
def test_papers_velocity_forces_are_in_the_joint_rows_only_and_the_mass_matrix_is_the_deflected_arms(
    modes: int,
) -> None:
    parameters = loaded_arm(modes, velocity_forces="rigid")
    arm, derived = FlexibleArm(parameters), Lagrangian(parameters)
    for state in random_states(parameters, 2):
        q, rates = np.split(state, 2)
        expected = np.zeros(arm.size)
        expected[:2] = rigid_velocity_forces(parameters, q[1], rates[:2])
        # theta2 and its rate come back from absolute angles by differences
        close(arm.velocity_forces(q, rates), expected, 1e-12)
        torque = np.append((40.0, -30.0), np.zeros(2 * modes))
        right = torque - expected - derived.passive_forces(q, rates)
        close(arm.acceleration(state, (40.0, -30.0)), np.linalg.solve(derived.mass_matrix(q), right))
