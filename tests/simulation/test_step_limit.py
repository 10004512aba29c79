"""The longest step that the integrator accepts: from the arm's fastest rate, at any bend and elbow angle."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from flexarm_env import ArmParameters, FlexibleArm
from tests.support.lagrange import arms
from tests.support.refusals import refuses


def vibrating_state(arm: FlexibleArm, seed: int, deflection: float) -> np.ndarray:
    """Any angles; modes as a sudden load leaves them: tip values [m] falling with the square of the frequency."""
    rng = np.random.default_rng(seed)
    omega = arm.modes[0].frequencies
    size = deflection / np.abs(arm.modes[0].tip_values) * (omega[0] / omega) ** 2
    q = [rng.uniform(-np.pi, np.pi, 2), rng.normal(size=(2, len(omega))) * size]
    rates = [rng.normal(size=2), rng.normal(size=(2, len(omega))) * size * omega[0]]
    return np.concatenate([part.ravel() for part in (*q, *rates)])


@pytest.mark.parametrize("modes", [1, 2, 4])
def test_longest_step_is_named_allowed_and_stable(modes: int) -> None:
    arm = FlexibleArm(ArmParameters.linear(modes_per_link=modes, damping_ratio=0.0))
    longest = arm.longest_step()
    with refuses(ValueError, "step = ", f"at most {longest:.4g} s is allowed", "substeps='auto', here 2)"):
        arm.simulate(np.zeros(2 * arm.size), None, 1.001 * longest, step=1.001 * longest)
    for seed in range(5):
        run = arm.simulate(vibrating_state(arm, seed, deflection=0.2), None, 400 * longest, step=longest)
        energy = run.kinetic_energy + run.strain_energy
        # the method damps what it does not resolve; beyond its limit, h omega = 2.83, energy would grow without bound
        assert energy[-1] < energy[0]


@pytest.mark.parametrize("modes", [1, 2, 4])
def test_fastest_rate_holds_for_the_bent_arm(modes: int) -> None:
    arm = FlexibleArm(ArmParameters.linear(modes_per_link=modes))
    for seed in range(20):
        matrix = arm.linearise(vibrating_state(arm, seed, deflection=1.0)).A
        # seen: 3 % at most in 100 states; the step's limit leaves 40 %
        assert np.abs(np.linalg.eigvals(matrix)).max() < 1.1 * arm.fastest_rate()


FASTEST_FOLDED = ArmParameters.linear(  # by 18 %
    link_lengths=(9.0, 4.3),
    flexural_rigidities=(1700.0, 3000.0),
    masses_per_length=(0.26, 0.8),
    shoulder_hub_inertia=5.0,
    elbow_hub_inertia=5.0,
    damping_ratio=1.0,
    joint_friction=(490.0, 410.0),
)


@settings(max_examples=60)
@example(FASTEST_FOLDED, np.pi)
@given(parameters=arms(), theta2=st.floats(-np.pi, np.pi))
def test_fastest_rate_holds_at_any_elbow_angle(parameters: ArmParameters, theta2: float) -> None:
    arm = FlexibleArm(parameters)
    state = np.zeros(2 * arm.size)
    state[1] = theta2
    # nine angles of a smooth even function: up to 2 % may hide between two of them
    assert np.abs(np.linalg.eigvals(arm.linearise(state).A)).max() < 1.02 * arm.fastest_rate()


def test_substeps() -> None:
    default, rest = FlexibleArm(ArmParameters.linear()), np.zeros(12)
    longest = default.longest_step()
    with refuses(ValueError, "step = 0.02 s in 2", "at most"):
        default.simulate(rest, None, 0.1, step=0.02, substeps=2)
    automatic = default.simulate(np.full(12, 0.01), None, 0.1, step=0.02, substeps="auto")
    count = int(np.ceil(0.02 / longest))
    assert count == 4  # as few as the fastest mode, 323 rad/s, allows
    by_hand = default.simulate(np.full(12, 0.01), None, 0.1, step=0.02, substeps=count)
    np.testing.assert_array_equal(automatic.state, by_hand.state)
