"""The torque-driven run: conserved quantities, order, symmetries, limits (the equations: test_dynamics)."""

import numpy as np
import pytest
from scipy.integrate import simpson, solve_ivp

from flexarm_env import ArmParameters, FlexibleArm, Trajectory
from tests.physics.test_dynamics import rigid_velocity_forces
from tests.support.lagrange import loaded_arm, random_state

FREE = {"damping_ratio": 0.0, "joint_friction": (0.0, 0.0)}


def start_of(arm: FlexibleArm, seed: int = 1) -> np.ndarray:
    return random_state(arm.parameters, seed, deflection=0.15, rate=1.0)


def energies(run: Trajectory) -> np.ndarray:
    return run.kinetic_energy + run.strain_energy


def swing(time: float, state: np.ndarray) -> tuple[float, float]:
    """Return a torque that depends on time and on the joint rates."""
    size = len(state) // 2
    return 40.0 * np.sin(9.0 * time) - 5.0 * state[size], 15.0 * np.cos(7.0 * time) - 2.0 * state[size + 1]


@pytest.mark.parametrize(
    ("modes", "substeps", "kinematics"),
    [(1, 4, "linear"), (2, 8, "linear"), (4, 32, "linear"), (2, 8, "foreshortened")],
)
def test_energy_of_the_free_undamped_arm_drifts_like_the_methods_error(
    modes: int, substeps: int, kinematics: str
) -> None:
    """The classical Runge-Kutta method loses energy like the fifth power of the step, so that halving it gains 32."""
    arm = FlexibleArm(loaded_arm(modes, kinematics=kinematics, **FREE))
    coarse, fine = (
        energies(arm.simulate(start_of(arm), None, 10.0, step=1e-2, substeps=n)) for n in (4 * substeps, 8 * substeps)
    )
    drift = [np.abs(energy / energy[0] - 1.0).max() for energy in (coarse, fine)]
    # A step takes (h omega)^6 / 72 of a mode's energy; with h omega = 0.03 for the fastest mode and up to 128 000 steps
    # that is 1e-6 if all energy were there.
    assert drift[0] < 2e-6
    # Within 10 %: an energy error of fourth order, which oscillates and does not grow, comes on top.
    assert drift[0] / drift[1] == pytest.approx(32.0, rel=0.1)


@pytest.mark.parametrize(("modes", "kinematics"), [(1, "linear"), (2, "linear"), (2, "foreshortened")])
def test_angular_momentum_is_conserved_without_shoulder_torque(modes: int, kinematics: str) -> None:
    """An elbow torque, elbow friction and modal damping are internal: they cannot change it."""
    arm = FlexibleArm(loaded_arm(modes, joint_friction=(0.0, 0.4), kinematics=kinematics))
    run = arm.simulate(start_of(arm), lambda time, state: (0.0, swing(time, state)[1]), 0.5, step=1e-2, substeps=20)
    momentum = arm.angular_momentum(run.state)
    drift = np.abs(momentum - momentum[0]).max()
    size = np.abs(energies(run)).max() ** 0.5 * arm.mass_matrix(run.state[0, : arm.size])[0, 0] ** 0.5
    assert np.ptp(energies(run)) > 0.1 * energies(run)[0]  # something did happen
    # No linear invariant: the method keeps it to its own error at h omega = 0.05. Seen: 6e-10 of the size.
    assert drift < 1e-8 * size


def test_energy_gained_is_the_work_of_a_torque_function() -> None:
    arm = FlexibleArm(loaded_arm(2, **FREE))
    run = arm.simulate(start_of(arm), swing, 0.5, step=1e-3, substeps=4)
    power = np.sum(run.torque * run.state[:, arm.size : arm.size + 2], axis=1)
    work = simpson(power, x=run.time)
    assert abs(work) > 10.0
    # Simpson's rule at h omega = 0.09 for the fastest mode: (h omega)^4 / 180 = 4e-7 of its share; seen 1e-9
    assert energies(run)[-1] - energies(run)[0] == pytest.approx(work, rel=1e-7)


@pytest.mark.parametrize(("friction", "damping"), [((0.6, 0.3), 0.0), ((0.0, 0.0), 0.02)])
def test_energy_only_falls_under_friction_or_damping(friction: tuple[float, float], damping: float) -> None:
    arm = FlexibleArm(loaded_arm(2, joint_friction=friction, damping_ratio=damping))
    energy = energies(arm.simulate(start_of(arm), None, 2.0, step=1e-2, substeps=20))
    # where the loss rate touches zero, the drift of a step, 1e-11, may show
    assert np.all(np.diff(energy) < 1e-9 * energy[0])
    assert energy[-1] < 0.9 * energy[0]


def test_a_constant_function_is_a_held_torque() -> None:
    arm = FlexibleArm(loaded_arm(2))
    start = start_of(arm)
    as_function = arm.simulate(start, lambda time, state: (3.0, -2.0), 0.3, step=1e-2, substeps=4)
    as_array = arm.simulate(start, np.tile([3.0, -2.0], (30, 1)), 0.3, step=1e-2, substeps=4)
    # one kernel for the slopes; Python puts the stages together, and rounds products that the kernel fuses with sums
    np.testing.assert_allclose(as_function.state, as_array.state, atol=1e-11 * np.abs(as_array.state).max())
    np.testing.assert_array_equal(as_function.torque, as_array.torque)


def test_substeps_are_steps() -> None:
    arm = FlexibleArm(loaded_arm(1))
    start = start_of(arm)
    outer = arm.simulate(start, None, 0.5, step=1e-2, substeps=5)
    inner = arm.simulate(start, None, 0.5, step=2e-3)
    # 0.01/5 and 0.002 are the same number, and so is every state
    np.testing.assert_array_equal(outer.state, inner.state[::5])


def rigid_mass(p: ArmParameters, theta2: float) -> np.ndarray:
    """Mass matrix of the textbook's rigid two-link arm (e.g. Spong, Hutchinson & Vidyasagar). Shape (2, 2)."""
    (l1, l2), (m1, m2) = p.link_lengths, np.multiply(p.link_lengths, p.masses_per_length)
    inertia2 = (m2 / 3.0 + p.payload_mass) * l2**2 + p.payload_inertia + p.elbow_hub_inertia  # about the elbow
    inertia1 = (m1 / 3.0 + p.elbow_mass) * l1**2 + p.shoulder_hub_inertia
    coupling = (m2 / 2.0 + p.payload_mass) * l1 * l2 * np.cos(theta2)
    total = inertia1 + (m2 + p.payload_mass) * l1**2 + inertia2 + 2.0 * coupling
    return np.array([[total, inertia2 + coupling], [inertia2 + coupling, inertia2]])


def test_stiff_links_move_like_the_rigid_arm() -> None:
    """Deflections, and with them all differences from the rigid arm, go like 1 / EI."""
    duration, steps = 2.0, 40

    def torque(time: float, state: np.ndarray | None = None) -> np.ndarray:
        smooth = np.sin(np.pi * time / duration) ** 4  # starts and ends too smoothly to excite vibrations
        return np.array([60.0 * smooth * np.cos(2.0 * time), -25.0 * smooth])

    def parameters(rigidity: float) -> ArmParameters:
        # some damping, for what vibration there is
        return loaded_arm(1, flexural_rigidities=(rigidity, rigidity), joint_friction=(0.0, 0.0), damping_ratio=0.05)

    def rigid_rate(time: float, state: np.ndarray) -> np.ndarray:
        acting = torque(time) - rigid_velocity_forces(parameters(1.0), state[1], state[2:])
        return np.concatenate([state[2:], np.linalg.solve(rigid_mass(parameters(1.0), state[1]), acting)])

    start = np.array([0.3, 0.8, 0.0, 0.0])
    times = np.linspace(0.0, duration, steps + 1)
    # tolerances six orders below the smallest difference that is looked at, 8e-4 rad
    rigid = solve_ivp(rigid_rate, (0.0, duration), start, t_eval=times, method="DOP853", rtol=1e-10, atol=1e-11).y.T
    errors = []
    for rigidity in (5e3, 2e4, 8e4):
        arm = FlexibleArm(parameters(rigidity))
        state = np.concatenate([start[:2], np.zeros(6)])
        substeps = int(3.0 * duration / steps / arm.longest_step()) + 1
        run = arm.simulate(state, torque, duration, step=duration / steps, substeps=substeps)
        errors.append(float(np.abs(run.state[:, :2] - rigid[:, :2]).max()))
    assert np.abs(rigid[:, :2] - start[:2]).max() > 1.0  # a real motion
    assert errors[-1] < 1e-3
    # EI by four: the error by four; what deviates is the next power of 1 / EI, a few percent at first
    np.testing.assert_allclose(np.log2(errors[:-1]) - np.log2(errors[1:]), 2.0, atol=0.05)
