"""Figures that docs/model.md and docs/reproduction.md state about the model, recomputed."""

import dataclasses
import re

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from flexarm_baselines import IFDC
from flexarm_env import (
    ArmParameters,
    DivergenceError,
    FlexibleArm,
    LawParameters,
    LoopCase,
    SensorParameters,
    SquareParameters,
    rest_state,
    run_batch,
    square,
    square_loop,
)
from flexarm_env.analysis import law_loop
from flexarm_env.physics.damping import clamped_ratio
from scripts.common.markdown import DOCS

MODEL = DOCS / "model.md"
LAW = LawParameters()
CORNER = np.array([-6.3, -6.3])


def rigid_jacobian(theta: np.ndarray) -> np.ndarray:
    """(13), with the cosine that it misprints."""
    one, both = theta[0], theta[0] + theta[1]
    return 4.5 * np.array(
        [[-np.sin(one) - np.sin(both), -np.sin(both)], [np.cos(one) + np.cos(both), np.cos(both)]],
    )


@pytest.mark.parametrize(("modes", "words"), [(1, "one mode"), (2, None), (3, None), (4, "four")])
def test_fastest_pole_of_the_law_at_the_corner(modes: int, words: str | None) -> None:
    """lambda = 1, collocated, linearised at rest on the corner; docs/model.md states two of them to 1 %."""
    arm = FlexibleArm(ArmParameters.paper(modes_per_link=modes))
    state = rest_state(arm, CORNER)
    plant = arm.linearise(state)
    jacobian = rigid_jacobian(state[:2])
    feedback = np.zeros((2, 2 * arm.size))
    feedback[:, :2] = LAW.proportional_gain * jacobian.T @ jacobian
    feedback[:, arm.size : arm.size + 2] = LAW.derivative_gain * jacobian.T @ jacobian
    fastest = np.linalg.eigvals(plant.A - plant.B @ feedback).real.min()
    assert law_loop(arm, CORNER, SensorParameters()).undelayed_poles().real.min() == pytest.approx(fastest, rel=1e-6)
    page = MODEL.read_text()
    if words:
        (stated,) = re.findall(rf"(-[\d ]+) /s with {words}\b", page)
        assert fastest == pytest.approx(float(stated.replace(" ", "")), rel=0.01)
    (stated,) = re.findall(r"Kd \(L1 \+ L2\)\^2 = (\d+) N m s/rad", page)
    assert LAW.derivative_gain * 9.0**2 == pytest.approx(float(stated), rel=0.01)


def test_the_law_sampled_and_held_at_1_khz_is_unstable() -> None:
    """Why it runs inside the integrator. The same law, evaluated at every stage, stands still on the corner."""
    arm = FlexibleArm(ArmParameters.paper())
    path = square(SquareParameters())
    held: list[float | np.ndarray] = [-1.0, np.zeros(2)]

    def sampled(time: float, state: np.ndarray) -> np.ndarray:
        if round(time * 1e3) > held[0] and abs(time * 1e3 - round(time * 1e3)) < 1e-6:
            jacobian = rigid_jacobian(state[:2])
            error = path.position(time) - arm.rigid_tip(state[: arm.size])
            rate = path.velocity(time) - jacobian @ state[arm.size : arm.size + 2]
            held[:] = [
                round(time * 1e3),
                jacobian.T @ (LAW.proportional_gain * error + LAW.derivative_gain * rate),
            ]
        return np.asarray(held[1])

    with pytest.raises(DivergenceError) as caught, np.errstate(all="ignore"):
        arm.simulate(rest_state(arm, CORNER), sampled, duration=0.1, step=1e-3, substeps=8)
    assert caught.value.time < 0.05


# --- the formulas of docs/model.md, evaluated as they stand there -------------------------------------------------

FULL = ArmParameters.linear(
    velocity_forces="complete",
    payload_mass=0.7,
    payload_inertia=0.3,
    elbow_mass=0.4,
    shoulder_hub_inertia=0.5,
    elbow_hub_inertia=0.2,
    joint_friction=(0.6, 0.8),
)
COORDINATES = np.array([0.3, -1.1, 1.5, -0.4, 0.8, 0.6])  # theta1, theta2, two modes a link
RATES = np.array([0.7, -0.9, 3.0, 5.0, -2.0, 4.0])


def mode_shapes(p: ArmParameters, link: int, x: np.ndarray, order: int = 0) -> np.ndarray:
    """phi_i, or its derivative by x, from (4). Shape (..., m)."""
    length = p.link_lengths[link]
    roots = np.array([brentq(lambda z: np.cos(z) * np.cosh(z) + 1.0, a, a + 1.0) for a in (1.5, 4.2)])
    wave = roots / length
    k = (np.cos(roots) + np.cosh(roots)) / (np.sin(roots) + np.sinh(roots))
    u = np.asarray(x)[..., None] * wave
    bracket = {
        0: np.cosh(u) - np.cos(u) - k * (np.sinh(u) - np.sin(u)),
        1: np.sinh(u) + np.sin(u) - k * (np.cosh(u) - np.cos(u)),
        2: np.cosh(u) + np.cos(u) - k * (np.sinh(u) + np.sin(u)),
    }[order]
    return p.mode_scale * wave**order * bracket


def kinetic_energy(p: ArmParameters, q: np.ndarray, rates: np.ndarray) -> float:
    """T, from the points' velocities: differences, of order 4, of their positions along the rates."""
    nodes, weights = np.polynomial.legendre.leggauss(40)

    def pose(moved: np.ndarray) -> tuple[list[np.ndarray], np.ndarray]:
        a1, q1, q2 = moved[0], moved[2:4], moved[4:6]
        a2 = a1 + moved[1] + mode_shapes(p, 0, np.array(p.link_lengths[0]), 1) @ q1
        root, points = np.zeros(2), []
        for link, (angle, modal) in enumerate(((a1, q1), (a2, q2))):
            x = p.link_lengths[link] * np.append(0.5 * (nodes + 1.0), 1.0)
            along, across = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
            points.append(root + np.outer(x, along) + np.outer(mode_shapes(p, link, x) @ modal, across))
            root = points[-1][-1]
        end = a2 + mode_shapes(p, 1, np.array(p.link_lengths[1]), 1) @ q2
        return points, np.array([a1, a2, end])

    step = 1e-3
    shifted = {n: pose(q + n * step * rates) for n in (-2, -1, 1, 2)}
    weigh = {-2: 1.0 / 12.0, -1: -8.0 / 12.0, 1: 8.0 / 12.0, 2: -1.0 / 12.0}
    velocity = [sum(weigh[n] * shifted[n][0][link] for n in weigh) / step for link in (0, 1)]
    turning = sum(weigh[n] * shifted[n][1] for n in weigh) / step
    inertias = np.array([p.shoulder_hub_inertia, p.elbow_hub_inertia, p.payload_inertia])
    energy = 0.5 * inertias @ turning**2
    for link, tip_mass in enumerate((p.elbow_mass, p.payload_mass)):
        density = 0.5 * p.link_lengths[link] * weights * p.masses_per_length[link]
        energy += 0.5 * np.append(density, tip_mass) @ (velocity[link] ** 2).sum(axis=1)
    return float(energy)


def mass_matrix(p: ArmParameters, q: np.ndarray) -> np.ndarray:
    """M_ab from T, which is quadratic in the rates: T(e_a + e_b) - T(e_a) - T(e_b)."""
    unit = np.eye(len(q))
    alone = [kinetic_energy(p, q, e) for e in unit]
    return np.array(
        [[kinetic_energy(p, q, a + b) - alone[i] - alone[j] for j, b in enumerate(unit)] for i, a in enumerate(unit)]
    )


def test_formulas_of_the_mass_matrix_and_of_the_velocity_forces() -> None:
    arm = FlexibleArm(FULL)
    assert mass_matrix(FULL, COORDINATES) == pytest.approx(arm.mass_matrix(COORDINATES), rel=1e-7, abs=1e-7)
    step, unit = 1e-4, np.eye(6)
    by_q = np.array(
        [
            (mass_matrix(FULL, COORDINATES + step * e) - mass_matrix(FULL, COORDINATES - step * e)) / (2 * step)
            for e in unit
        ]
    )  # dM_ab / dq_c: [c, a, b]
    forces = np.einsum("cab,b,c->a", by_q, RATES, RATES) - 0.5 * np.einsum("abc,b,c->a", by_q, RATES, RATES)
    assert forces == pytest.approx(arm.velocity_forces(COORDINATES, RATES), rel=1e-5, abs=1e-3)
    rigid = FlexibleArm(dataclasses.replace(FULL, velocity_forces="rigid"))
    mu = 4.5 * (0.5 * 0.335 * 4.5**2 + 0.7 * 4.5)
    (rate1, rate2), sine = RATES[:2], np.sin(COORDINATES[1])
    shown = mu * sine * np.array([-(2.0 * rate1 + rate2) * rate2, rate1**2, 0.0, 0.0, 0.0, 0.0])
    assert shown == pytest.approx(rigid.velocity_forces(COORDINATES, RATES), rel=1e-12, abs=1e-12)


def test_formulas_of_stiffness_damping_and_torque() -> None:
    """M q'' = B tau - C q' - D q' - K q, with M and C q' as found above."""
    arm = FlexibleArm(FULL)
    tau = np.array([3.0, -2.0])
    stiffness, damping = [0.0, 0.0], list(FULL.joint_friction)
    for link in (0, 1):
        length, rigidity = FULL.link_lengths[link], FULL.flexural_rigidities[link]
        density = FULL.masses_per_length[link]
        for i, root in enumerate((1.8751040687, 4.6940911330)):

            def integral(order: int, link: int = link, i: int = i, length: float = length) -> float:
                return quad(lambda x: mode_shapes(FULL, link, np.array(x), order)[i] ** 2, 0.0, length)[0]

            stiffness.append(rigidity * integral(2))
            omega = (root / length) ** 2 * np.sqrt(rigidity / density)
            damping.append(2.0 * clamped_ratio(FULL) * omega * density * integral(0))
    right = np.append(tau, np.zeros(4)) - arm.velocity_forces(COORDINATES, RATES)
    right -= np.array(damping) * RATES + np.array(stiffness) * COORDINATES
    wanted = np.linalg.solve(arm.mass_matrix(COORDINATES), right)
    found = arm.acceleration(np.concatenate([COORDINATES, RATES]), tau)
    assert wanted == pytest.approx(found, rel=1e-7)


def test_units_of_modal_coordinates() -> None:
    """One unit of any moves the tip of its link by 0.2 m."""
    arm = FlexibleArm(FULL)
    for mode in range(4):
        q = np.zeros(6)
        q[2 + mode] = 1.0
        assert np.abs(arm.tip_deflection(q)).max() == pytest.approx(0.2, rel=1e-9)


def test_formula_of_the_law() -> None:
    """Torques of the simulated loop, on the way, from the states that it went through."""
    sensor = SensorParameters("rigid", position=2.0)
    loop, starts = square_loop(FlexibleArm(ArmParameters.paper()), [LoopCase(sensor, LAW)])
    gain = 0.8
    run = run_batch(loop, starts, [IFDC()], [gain], 400)[0]
    path = square(SquareParameters())
    past = CubicSpline(run.time, run.state[:, :2])
    delays = np.array([(4.5 + 2.0) / 288.33, 2.0 / 288.33])

    def jacobian(theta: np.ndarray) -> np.ndarray:
        one, both = theta[0], theta[0] + theta[1]
        first = 4.5 * np.array([-np.sin(one), np.cos(one)])
        second = 2.0 * np.array([-np.sin(both), np.cos(both)])
        return np.column_stack([first + second, second])

    for instant in (100, 250, 399):
        time, theta, rates = run.time[instant], run.state[instant, :2], run.state[instant, 4:6]
        late = np.array([past(time - delays[j])[j] for j in (0, 1)])
        one, both = late[0], late[0] + late[1]
        point = 4.5 * np.array([np.cos(one), np.sin(one)]) + 2.0 * np.array([np.cos(both), np.sin(both)])
        error = path.position(time) - point
        error_rate = path.velocity(time) - jacobian(late) @ rates
        force = LAW.proportional_gain * error + LAW.derivative_gain * error_rate
        wanted = gain * jacobian(theta).T @ force
        assert run.torque[instant] == pytest.approx(wanted, rel=1e-4, abs=1e-3)
