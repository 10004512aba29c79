"""The equations of motion against a second derivation, the textbook's rigid arm, and beam theory."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flexarm_env import ArmParameters, FlexibleArm
from flexarm_env.physics.damping import clamped_ratio
from tests.support.lagrange import Lagrangian, arms, loaded_arm, random_state, random_states, tensor

MODES = (1, 2, 3, 4)

# The derivations agree to rounding error: shapes carry cosh(lambda_4 L) = 3e4 ulp (7e-12), the modes' cross masses
# are summed up (stored here, integrated there), and a solution multiplies by the condition number of the scaled mass
# matrix, about 30. Seen: 4e-13 at most with three modes, 6e-12 with four.
AGREEMENT = 2e-11


def close(ours: np.ndarray, theirs: np.ndarray, rtol: float = AGREEMENT) -> None:
    """Agreement relative to the largest entry: small ones are differences of large ones."""
    assert ours.shape == theirs.shape
    np.testing.assert_allclose(ours, theirs, rtol=0.0, atol=rtol * np.abs(theirs).max())


@pytest.fixture(
    scope="module", params=itertools.product(MODES, ("linear", "foreshortened"), ("cantilever", "polynomial")), ids=str
)
def pair(request: pytest.FixtureRequest) -> tuple[FlexibleArm, Lagrangian]:
    """Make an arm with every parameter in use, and its independent derivation."""
    modes, kinematics, shapes = request.param
    p = loaded_arm(modes, kinematics=kinematics, mode_shapes=shapes)
    return FlexibleArm(p), Lagrangian(p)


# --- a second derivation ----------------------------------------------------------------------------------------------


def test_mass_matrix_is_the_lagrangians(pair: tuple[FlexibleArm, Lagrangian]) -> None:
    arm, derived = pair
    for state in random_states(arm.parameters, 3):
        q = state[: arm.size]
        close(arm.mass_matrix(q), derived.mass_matrix(q))


def test_velocity_forces_are_the_lagrangians(pair: tuple[FlexibleArm, Lagrangian]) -> None:
    arm, derived = pair
    for state in random_states(arm.parameters, 3):
        q, rates = np.split(state, 2)
        close(arm.velocity_forces(q, rates), derived.velocity_forces(q, rates))


def test_acceleration_is_the_lagrangians(pair: tuple[FlexibleArm, Lagrangian]) -> None:
    arm, derived = pair
    for state, tau in zip(random_states(arm.parameters, 3), ([0.0, 0.0], [60.0, -25.0], [-10.0, 80.0]), strict=True):
        q, rates = np.split(state, 2)
        close(arm.acceleration(state, tau), derived.acceleration(q, rates, np.array(tau)))


def test_energies_are_the_lagrangians(pair: tuple[FlexibleArm, Lagrangian]) -> None:
    arm, derived = pair
    for state in random_states(arm.parameters, 3):
        q, rates = (tensor(half) for half in np.split(state, 2))
        energy = arm.energy(state)
        assert energy.kinetic == pytest.approx(float(derived.kinetic(q, rates)), rel=AGREEMENT)
        assert energy.strain == pytest.approx(float(derived.strain(q)), rel=AGREEMENT)


def test_angular_momentum_is_the_masses_moment_of_momentum(pair: tuple[FlexibleArm, Lagrangian]) -> None:
    arm, derived = pair
    for state in random_states(arm.parameters, 3):
        q, rates = np.split(state, 2)
        # the whole arm turns with theta1: its momentum is that coordinate's
        assert arm.angular_momentum(state) == pytest.approx(derived.mass_matrix(q)[0] @ rates, rel=AGREEMENT)


# --- the mass matrix --------------------------------------------------------------------------------------------------


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


@settings(max_examples=60)
@given(parameters=arms(), seed=st.integers(0, 2**32 - 1))
def test_energies_are_positive_and_quadratic(parameters: ArmParameters, seed: int) -> None:
    arm = FlexibleArm(parameters)
    state = random_state(parameters, seed)
    energy, faster = arm.energy(state), state.copy()
    faster[arm.size :] *= 2.0
    assert energy.kinetic > 0.0
    assert energy.strain > 0.0
    assert arm.energy(faster).kinetic == pytest.approx(4.0 * energy.kinetic, rel=1e-13)  # powers of two are exact


@settings(max_examples=30)
@given(parameters=arms(), seed=st.integers(0, 2**32 - 1), turn=st.floats(-10.0, 10.0))
def test_only_the_shoulders_frame_knows_theta1(parameters: ArmParameters, seed: int, turn: float) -> None:
    arm = FlexibleArm(parameters)
    state = random_state(parameters, seed)
    turned = state.copy()
    turned[0] += turn
    # theta1 + turn is rounded, and the elbow's angle is a difference of two such sums
    close(arm.mass_matrix(turned[: arm.size]), arm.mass_matrix(state[: arm.size]), 1e-13)
    close(arm.acceleration(turned, (7.0, -3.0)), arm.acceleration(state, (7.0, -3.0)), 1e-10)
    # points turn with the arm
    c, s = np.cos(turn), np.sin(turn)
    rotation = np.array([[c, -s], [s, c]])
    np.testing.assert_allclose(
        arm.tip(turned[: arm.size]), rotation @ arm.tip(state[: arm.size]), atol=1e-13 * parameters.reach
    )


# --- the rigid arm ----------------------------------------------------------------------------------------------------


def rigid_two_link(p: ArmParameters, theta2: float, rates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mass matrix and velocity forces of the textbook's rigid two-link arm (e.g. Spong, Hutchinson & Vidyasagar)."""
    (l1, l2), (rho1, rho2) = p.link_lengths, p.masses_per_length
    m1, m2 = rho1 * l1, rho2 * l2
    # link 2 with the payload: mass, static moment and inertia about the elbow
    carried, moment = m2 + p.payload_mass, m2 * l2 / 2.0 + p.payload_mass * l2
    inertia2 = m2 * l2**2 / 3.0 + p.payload_mass * l2**2 + p.payload_inertia + p.elbow_hub_inertia
    inertia1 = m1 * l1**2 / 3.0 + p.elbow_mass * l1**2 + p.shoulder_hub_inertia
    both = inertia2 + moment * l1 * np.cos(theta2)
    total = inertia1 + carried * l1**2 + inertia2 + 2.0 * moment * l1 * np.cos(theta2)
    mass = np.array([[total, both], [both, inertia2]])
    w1, w2 = rates
    forces = moment * l1 * np.sin(theta2) * np.array([-(2.0 * w1 + w2) * w2, w1**2])
    return mass, forces


def test_rigid_block_is_the_textbooks_arm() -> None:
    arm = FlexibleArm(loaded_arm(2))
    q = np.zeros(arm.size)
    for theta2 in np.linspace(-3.0, 3.0, 7):
        q[1] = theta2
        mass, _ = rigid_two_link(arm.parameters, theta2, np.zeros(2))
        close(arm.mass_matrix(q)[:2, :2], mass, 1e-14)  # a few roundings
        # undeflected and without modal rates, the complete velocity forces' joint rows are the rigid arm's too
        rates = np.zeros(arm.size)
        rates[:2] = 1.7, -2.9
        _, forces = rigid_two_link(arm.parameters, theta2, rates[:2])
        close(arm.velocity_forces(q, rates)[:2], forces, 1e-13)


@pytest.mark.parametrize("modes", MODES)
def test_papers_velocity_forces_fill_the_joint_rows_only(modes: int) -> None:
    arm = FlexibleArm(loaded_arm(modes, velocity_forces="rigid"))
    for state in random_states(arm.parameters, 4):
        q, rates = np.split(state, 2)
        forces = arm.velocity_forces(q, rates)
        _, expected = rigid_two_link(arm.parameters, q[1], rates[:2])
        # theta2 and its rate come back from absolute angles by differences
        close(forces[:2], expected, 1e-12)
        np.testing.assert_allclose(forces[2:], 0.0, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("modes", MODES)
def test_papers_variant_keeps_the_deflected_mass_matrix(modes: int) -> None:
    parameters = loaded_arm(modes, velocity_forces="rigid")
    arm, derived = FlexibleArm(parameters), Lagrangian(parameters)
    q, rates = np.split(random_state(parameters, seed=5), 2)
    right = np.zeros(arm.size)
    right[:2] = np.array([40.0, -30.0]) - rigid_two_link(parameters, q[1], rates[:2])[1]
    expected = np.linalg.solve(derived.mass_matrix(q), right - derived.passive_forces(q, rates))
    close(arm.acceleration(np.concatenate([q, rates]), (40.0, -30.0)), expected)


# --- dissipation ------------------------------------------------------------------------------------------------------


def power(arm: FlexibleArm, state: np.ndarray, torque: tuple[float, float]) -> float:
    """d(energy)/dt along the motion, by differences."""
    rate = np.concatenate([state[arm.size :], arm.acceleration(state, torque)])

    def energy(time: float) -> float:
        return float(sum(arm.energy(state + time * rate)))

    h = 1e-6
    return (8.0 * (energy(h) - energy(-h)) - (energy(2.0 * h) - energy(-2.0 * h))) / (12.0 * h)


@pytest.mark.parametrize("modes", [1, 2, 4])
def test_energy_changes_by_torque_friction_and_damping_only(modes: int) -> None:
    arm = FlexibleArm(loaded_arm(modes))
    p = arm.parameters
    for state in random_states(p, 5):
        rates = state[arm.size :]
        modal = [
            2.0 * clamped_ratio(p) * link.frequencies * np.diag(link.mass) * part**2
            for link, part in zip(arm.modes, np.split(rates[2:], 2), strict=True)
        ]
        lost = np.sum(modal) + np.dot(p.joint_friction, rates[:2] ** 2)
        gained = power(arm, state, (11.0, -6.0)) - np.dot((11.0, -6.0), rates[:2])
        assert lost > 0.0
        # Differences of energies over 1e-6 s: rounding, some 10 ulp of the energy, over that time. Truncation, the
        # fourth power of h omega = 1e-3, is nothing. Seen: 4e-10 of the energy; the losses are 5e-4 of it and more.
        assert gained == pytest.approx(-lost, abs=1e-8 * float(sum(arm.energy(state))))


@settings(max_examples=40)
@given(parameters=arms(), seed=st.integers(0, 2**32 - 1))
def test_straight_arm_at_rest_stays_at_rest(parameters: ArmParameters, seed: int) -> None:
    arm = FlexibleArm(parameters)
    rest = np.zeros(2 * arm.size)
    rest[:2] = random_state(parameters, seed)[:2]
    np.testing.assert_array_equal(arm.acceleration(rest), np.zeros(arm.size))
    np.testing.assert_array_equal(arm.velocity_forces(rest[: arm.size], np.zeros(arm.size)), np.zeros(arm.size))


# --- linearisation ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("modes", "variant"), [(1, "complete"), (2, "complete"), (2, "rigid")])
def test_linearisation_is_the_limit_of_differences(modes: int, variant: str) -> None:
    arm = FlexibleArm(loaded_arm(modes, velocity_forces=variant))
    state, torque = random_state(arm.parameters, seed=3), np.array([20.0, -8.0])
    linear = arm.linearise(state, torque)
    size = 2 * arm.size

    def rate(inputs: np.ndarray) -> np.ndarray:
        return np.concatenate([inputs[arm.size : size], arm.acceleration(inputs[:size], inputs[size:])])

    point = np.concatenate([state, torque])
    np.testing.assert_allclose(linear.rate, rate(point), rtol=1e-14)
    h = 1e-4 * np.maximum(np.abs(point), 1.0)
    steps = np.diag(h)
    differences = np.stack(
        [(rate(point + step) - rate(point - step)) / (2.0 * h[i]) for i, step in enumerate(steps)], axis=1
    )
    # central differences: h^2 = 1e-8 of a third derivative that is of the rate's own size, some tens of it
    close(np.hstack([linear.A, linear.B]), differences, 1e-6)


def free_frequencies(modes: int, theta2: float = 0.0) -> np.ndarray:
    """Elastic frequencies of the undamped free arm about straight links, from the linearisation [rad/s]."""
    arm = FlexibleArm(ArmParameters.linear(modes_per_link=modes, damping_ratio=0.0))
    state = np.zeros(2 * arm.size)
    state[1] = theta2
    values = np.linalg.eigvals(arm.linearise(state).A)
    elastic = values[values.imag > 1.0]
    assert len(elastic) == 2 * modes  # the other two motions are the rigid body's
    assert np.all(np.abs(elastic.real) < 1e-8 * np.abs(elastic))  # undamped: rounding of a matrix of norm 1e6
    return np.sort(elastic.imag)


@pytest.mark.parametrize("theta2", [0.0, 0.5, np.pi / 2, 2.5])
def test_one_mode_is_30_to_45_percent_off_and_two_are_within_one(theta2: float) -> None:
    """As ArmParameters says, against four modes (whose own error is a tenth of a percent: `make validate`)."""
    one, two, four = (free_frequencies(modes, theta2)[:2] for modes in (1, 2, 4))
    assert np.all((one > 1.30 * four) & (one < 1.455 * four))  # 45 % when rounded
    assert np.all((two > four) & (two < 1.01 * four))


def test_modal_damping_is_the_same_ratio_for_all_clamped_modes() -> None:
    """Hubs that cannot move clamp both roots; a link 2 without weight leaves link 1's tip free."""
    arm = FlexibleArm(
        ArmParameters.linear(
            modes_per_link=3,
            damping_ratio=0.037,
            damping_model="modal",
            masses_per_length=(0.335, 1e-9),
            flexural_rigidities=(1676.0, 1676e-9),
            shoulder_hub_inertia=1e9,
            elbow_hub_inertia=1e9,
        )
    )
    values = np.linalg.eigvals(arm.linearise(np.zeros(2 * arm.size)).A)
    elastic = values[values.imag > 1.0]
    frequencies = np.sort(np.concatenate([link.frequencies for link in arm.modes]))
    # what still gives: link 2's weight, 3e-9 of link 1's, and the hubs, 1e-8 of their links' inertias
    np.testing.assert_allclose(np.sort(np.abs(elastic)), frequencies, rtol=1e-6)
    np.testing.assert_allclose(-elastic.real / np.abs(elastic), clamped_ratio(arm.parameters), rtol=1e-6)
