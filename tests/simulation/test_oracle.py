"""The oracle of the closed loop itself: its arm, its convergence, another solver."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from flexarm_env import ArmParameters, FlexibleArm, SensorParameters
from tests.support.oracle import PAPER, Array, Problem, mass_and_forces, oracle, oracle_arm, oracle_law, state_rate


@pytest.mark.parametrize("complete", [True, False])
@pytest.mark.parametrize("modes", [1, 2, 3, 4])
def test_the_oracle_and_the_arm_are_the_same_arm(modes: int, complete: bool) -> None:
    """Two derivations that share nothing but mode shapes: material points here, closed forms there."""
    parameters = ArmParameters.linear(
        link_lengths=(5.0, 4.2),
        masses_per_length=(0.4, 0.3),
        flexural_rigidities=(2000.0, 1500.0),
        modes_per_link=modes,
        velocity_forces="complete" if complete else "rigid",
    )
    arm = FlexibleArm(parameters)
    states = np.random.default_rng(modes).normal(size=(20, 2 * arm.size))
    tau = np.array([3.0, -2.0])
    for state in states:
        M, h = mass_and_forces(state[: arm.size], state[arm.size :], oracle_arm(arm))
        expected = np.linalg.solve(M, np.append(tau, np.zeros(arm.size - 2)) - h)
        # rounding times M's condition number, up to 1e5 with four modes
        np.testing.assert_allclose(arm.acceleration(state, tau), expected, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("modes", [1, pytest.param(4, marks=pytest.mark.slow)])
def test_the_oracle_is_converged(modes: int) -> None:
    """Against a hundredth of the tolerance: a hundred times below what it is to decide."""
    arm = PAPER if modes == 1 else ArmParameters.linear(modes_per_link=modes)
    problem = Problem(arm, SensorParameters(), periods=300)
    finer = oracle(problem, rtol=1e-11)
    relative = np.abs(oracle(problem) - finer) / np.ptp(finer, axis=0)
    assert relative.max() < 1e-6  # 3e-8 and 2e-7 found


def test_the_oracle_agrees_with_another_solver() -> None:
    """An implicit Runge-Kutta method instead of LSODA's multistep formulas; undelayed."""
    problem = Problem(periods=300)
    flexible = FlexibleArm(PAPER)
    arm, law = oracle_arm(flexible), oracle_law(problem, flexible)

    def rate(t: float, x: Array) -> Array:
        command = np.array([problem.reference(t, 0.15)] * 2)
        return np.asarray(state_rate(np.ascontiguousarray(x), np.array([x, x]), command, 0j, 1.0, arm, law))

    solution = solve_ivp(rate, (0.0, 0.3), problem.start_state(), method="Radau", rtol=1e-8, atol=1e-9)
    expected = oracle(problem)
    assert np.abs(solution.y[:, -1] - expected[-1]).max() < 1e-6 * np.ptp(expected, axis=0).max()
