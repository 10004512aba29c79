"""Figures that docs/model.md and docs/reproduction.md state about the model, recomputed."""

import numpy as np
import pytest

from flexarm_env import ArmParameters, DivergenceError, FlexibleArm, LawParameters, SquareParameters, rest_state, square

LAW = LawParameters()
CORNER = np.array([-6.3, -6.3])


def rigid_jacobian(theta: np.ndarray) -> np.ndarray:
    """(13), with the cosine that it misprints."""
    one, both = theta[0], theta[0] + theta[1]
    return 4.5 * np.array(
        [[-np.sin(one) - np.sin(both), -np.sin(both)], [np.cos(one) + np.cos(both), np.cos(both)]],
    )


@pytest.mark.parametrize(("modes", "pole"), [(1, -11_000.0), (2, -31_500.0), (3, -162_000.0), (4, -271_000.0)])
def test_fastest_pole_of_the_law_at_the_corner(modes: int, pole: float) -> None:
    """lambda = 1, collocated, linearised at rest on the corner; stated to 1 %."""
    arm = FlexibleArm(ArmParameters.paper(modes_per_link=modes))
    state = rest_state(arm, CORNER)
    plant = arm.linearise(state)
    jacobian = rigid_jacobian(state[:2])
    feedback = np.zeros((2, 2 * arm.size))
    feedback[:, :2] = LAW.proportional_gain * jacobian.T @ jacobian
    feedback[:, arm.size : arm.size + 2] = LAW.derivative_gain * jacobian.T @ jacobian
    fastest = np.linalg.eigvals(plant.A - plant.B @ feedback).real.min()
    assert fastest == pytest.approx(pole, rel=0.01)
    norm = np.linalg.norm(jacobian, 2) ** 2 * LAW.derivative_gain
    assert norm == pytest.approx(1400.0, rel=0.3)  # Kd |J|^2, "1400 N m s/rad"


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
