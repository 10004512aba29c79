"""One stage of the integrator under the law: it solves its equation, with limited torques too."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flexarm_env import ArmParameters, FlexibleArm, LawParameters, SensorParameters
from flexarm_env.control import jacobian_transpose as package_law
from flexarm_env.physics.modal_elimination import elimination
from tests.support.oracle import PAPER, Array, Problem, mass_and_forces, oracle_arm, oracle_law, torque

UNDELAYED = ((0.0, 0.0), (1.0, 1.0), (0.0, 0.0), (1.0, 1.0))


def law_data(problem: Problem, arm: FlexibleArm, command: Array) -> package_law.Law:
    law, sensor = problem.law, problem.sensor
    return package_law.Law(
        gain=problem.gain,
        proportional_gain=law.proportional_gain,
        derivative_gain=law.derivative_gain,
        torque_limit=law.torque_limit or (np.inf, np.inf),
        sensor_distance=sensor.position,
        sensor_values=arm.modes[1].shape(sensor.position).tolist(),
        sensor_foreshortening=(),
        noise=(0.01, -0.02),
        command_1=command[0].view(float).tolist(),
        command_2=command[1].view(float).tolist(),
        **dict(zip(("offset", "weight", "rate_offset", "rate_weight"), UNDELAYED, strict=True)),
    )


@pytest.mark.parametrize("model", ["rigid", "true"])
@pytest.mark.parametrize("arm", [PAPER, ArmParameters.linear(modes_per_link=3)], ids=["paper", "3 modes"])
@pytest.mark.parametrize("limit", [None, (40.0, 60.0)], ids=["unlimited", "limited"])
def test_a_stage_solves_its_equation(arm: ArmParameters, model: Any, limit: tuple[float, float] | None) -> None:
    """v = v_known + h gamma M^-1 B tau(v), with the oracle's torque and inertia; in plain Python, uncompiled."""
    problem = Problem(arm, SensorParameters(model, 3.0, delay=0.0), LawParameters(torque_limit=limit), gain=0.8)
    flexible = FlexibleArm(arm)
    n, rng, h_gamma = flexible.size, np.random.default_rng(3), 1.25e-4
    data, law = oracle_arm(flexible), oracle_law(problem, flexible)
    at_limit = 0
    for _ in range(50):
        x = rng.normal(size=2 * n)
        x[n:] *= 5.0
        command = 3.0 * (rng.normal(size=(2, 2)) + 1j * rng.normal(size=(2, 2)))
        internal = flexible.internal_state(x)
        v, mechanical, law_acceleration, tau = package_law.law_stage(
            flexible.constants,
            elimination(flexible.constants),
            law_data(problem, flexible, command),
            (arm.velocity_forces == "complete", model, "delayed"),
            internal[:n].tolist(),
            internal[n:].tolist(),
            h_gamma,
        )
        solved = flexible.public_state(np.concatenate([internal[:n], v]))
        wanted = torque(solved, np.array([solved, solved]), command, 0.01 - 0.02j, 0.8, data, law)
        scale = 1e-9 * (1.0 + np.abs(wanted).max())  # rounding, times M's condition number
        np.testing.assert_allclose(tau, wanted, atol=scale)
        M, h = mass_and_forces(solved[:n], solved[n:], data)
        responses = np.linalg.solve(M, np.array([np.append(tau, np.zeros(n - 2)), -h]).T).T
        to_public = flexible.public_state(np.concatenate([law_acceleration, mechanical]))
        for found, expected in zip(np.split(to_public, 2), responses, strict=True):
            np.testing.assert_allclose(found, expected, atol=1e-8 * np.abs(expected).max())
        np.testing.assert_allclose(v, internal[n:] + h_gamma * np.array(law_acceleration), atol=1e-12)
        at_limit += limit is not None and bool(np.any(np.abs(tau) == limit))
    assert limit is None or at_limit > 10  # the limited case is not the free one in disguise


def numbers(low: float, high: float, count: int = 2) -> st.SearchStrategy[tuple[float, ...]]:
    return st.tuples(*[st.floats(low, high)] * count)


@given(numbers(-5.0, 5.0, 4), numbers(-1e3, 1e3), numbers(0.1, 300.0))
def test_limited_torques_solve_the_clipped_equation(
    feedback: tuple[float, ...], wanted: tuple[float, float], limit: tuple[float, float]
) -> None:
    """tau = clip(wanted - F tau) wherever that has one solution: diagonal and determinant of 1 + F positive."""
    F = np.array(feedback).reshape(2, 2)
    system = np.eye(2) + F
    if system[0, 0] < 0.05 or system[1, 1] < 0.05 or np.linalg.det(system) < 0.05:
        return
    tau = package_law._limited_solution(wanted, F.tolist(), limit)
    assert np.all(np.abs(tau) <= limit)
    residual = tau - np.clip(wanted - F @ tau, -np.array(limit), limit)
    # condition numbers of up to 36 / 0.05, twice
    np.testing.assert_allclose(residual, 0.0, atol=1e-9 * (1.0 + np.abs(wanted).max()))


def test_without_limits_no_diagonal_element_can_spoil_the_torque() -> None:
    """Gains near 17 bring diagonal elements of 1 + F through zero; the determinant stays far from it."""
    F = np.array([[-1.0, 3.0], [-2.0, 0.5]])  # 1 + F = ((0, 3), (-2, 1.5))
    tau = package_law._limited_solution((6.0, 1.0), F.tolist(), (np.inf, np.inf))
    np.testing.assert_allclose(np.array([[0.0, 3.0], [-2.0, 1.5]]) @ tau, (6.0, 1.0), rtol=1e-14)
