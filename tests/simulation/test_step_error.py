"""The expected error of an integration step: against measured ones on drawn arms, and the steps that follow from it."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from flexarm_env import ArmParameters, FlexibleArm
from flexarm_env.actions import TORQUE_LIMIT
from flexarm_env.envs.settings import Settings
from flexarm_env.parameters import PRESETS
from flexarm_env.simulation.stability import count_substeps
from flexarm_env.simulation.step_error import BENT, TOLERANCE, enough_steps, expected_error
from tests.support.lagrange import arms
from tests.support.refusals import refuses
from tests.validation.test_steps import PERIOD, tip_errors

EPISODES = 64
RIGIDITY = 1676.0


def median_error(parameters: ArmParameters, limits: tuple[float, float], count: int, seed: int) -> float:
    """Error of the tip after a second of random torques, against a quarter of the step [m]."""
    return float(np.median(tip_errors(parameters, limits, [count], EPISODES, seed)[count]))


def drawn(seed: int, base: ArmParameters) -> ArmParameters:
    """Another arm: stiffness 0.01 to 100 times, masses, dampings and payload."""
    rng = np.random.default_rng(seed)
    stiffness = 10.0 ** rng.uniform(-2.0, 2.0)
    one, two = stiffness * RIGIDITY * 10.0 ** rng.uniform(-0.3, 0.3, 2)
    return replace(
        base,
        flexural_rigidities=(one, two),
        masses_per_length=tuple(0.335 * 10.0 ** rng.uniform(-0.4, 0.4, 2)),
        payload_mass=max(0.0, rng.uniform(-2.0, 3.0)),
        damping_ratio=10.0 ** rng.uniform(-3.0, -0.7),
        elbow_hub_inertia=rng.uniform(0.0, 0.5),
        joint_friction=(rng.uniform(0.0, 2.0), 0.0),
    )


def bearable(parameters: ArmParameters) -> tuple[float, float]:
    """Torques that a soft arm bears: as the static deflection of a cantilever, up to `BENT` of its length."""
    stiffest = [3.0 * rigidity * BENT / 4.5 for rigidity in parameters.flexural_rigidities]
    share = min(1.0, *(stiffness / limit for stiffness, limit in zip(stiffest, TORQUE_LIMIT, strict=True)))
    return TORQUE_LIMIT[0] * share, TORQUE_LIMIT[1] * share


@pytest.mark.parametrize(
    ("seed", "base", "share"),
    [(seed, ArmParameters(), 1.0) for seed in range(6)] + [(seed, ArmParameters.linear(), 0.3) for seed in range(2)],
)
def test_drawn_arms_keep_the_expected_error(seed: int, base: ArmParameters, share: float) -> None:
    """With linear kinematics fast turns make soft links: their errors spread over three orders of magnitude."""
    parameters = drawn(seed, base)
    shoulder, elbow = bearable(parameters)
    limits = share * shoulder, share * elbow
    stable = count_substeps(PERIOD, None, "explicit", FlexibleArm(parameters).fastest_rate(), "the arm")
    count = enough_steps(parameters, limits, PERIOD, stable)
    # of 60 foreshortened arms drawn in this way the largest median was 0.12 mm
    assert median_error(parameters, limits, count, seed) < 2.0 * TOLERANCE


def test_joints_with_dry_friction_keep_it() -> None:
    """Of 28 arms with friction of 2 to 30 % of the torques the largest median was 0.12 mm."""
    rng = np.random.default_rng(0)
    arm = {"coulomb_friction": 10.0 ** rng.uniform([0.3, 0.0], [1.2, 0.7]), "friction_smoothing": rng.uniform(0.1, 1.0)}
    settings = Settings.of({"arm": arm | {"breakaway_excess": 0.5 * arm["coulomb_friction"]}})
    parameters = settings.flexible_arm.parameters
    assert median_error(parameters, TORQUE_LIMIT, settings.substeps, seed=0) < 2.0 * TOLERANCE


def test_the_error_falls_with_the_fourth_power_of_the_step() -> None:
    parameters = ArmParameters()
    errors = [expected_error(parameters, TORQUE_LIMIT, PERIOD / count) for count in (16, 32, 64)]
    assert np.log2(errors[:-1]) - np.log2(errors[1:]) == pytest.approx(4.0, abs=0.3)


def test_every_preset_has_a_default_step() -> None:
    for name in PRESETS:
        how = Settings.of({"arm": name, "side": ArmParameters.named(name).reach}).integration
        assert how.order == 4
        assert how.expected_error is not None
        assert how.expected_error <= TOLERANCE


def test_a_coarser_step_is_taken_with_a_warning() -> None:
    with pytest.warns(UserWarning, match=r"physics_step = 0\.0025 s: .* off by about 0\.11 mm"):
        settings = Settings.of({"physics_step": 2.5e-3})
    assert settings.integration.substeps == 4


# The longest step that the integrator accepts: from the fastest rate, at any bend and elbow angle.


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
    start, step = vibrating_state(arm, 0, deflection=0.2), 3.5 * longest
    automatic, by_hand = (arm.simulate(start, None, step, step=step, substeps=n).state for n in ("auto", 4))
    np.testing.assert_array_equal(automatic, by_hand)


def test_a_lighter_payload_needs_shorter_steps() -> None:
    """Also where it is another one's in the same call."""
    arm = FlexibleArm(ArmParameters(payload_mass=1.0))
    longest = [arm.longest_step(payload_mass=mass) for mass in (0.0, 0.2, 1.0)]
    assert longest[0] < longest[1] < longest[2] == arm.longest_step()
    state, step = np.zeros((2, 2 * arm.size)), 0.5 * (longest[1] + longest[2])
    arm.step(state, [0.0, 0.0], step, step=step, payload_mass=[2.0, 1.0])
    with refuses(ValueError, "step = ", f"at most {longest[1]:.4g} s is allowed"):
        arm.step(state, [0.0, 0.0], step, step=step, payload_mass=[2.0, 0.2])
    arm.step(state, [0.0, 0.0], longest[1], step=longest[1], payload_mass=[2.0, 0.2])


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


@settings(max_examples=20)
@example(FASTEST_FOLDED, np.pi)
@given(parameters=arms(), theta2=st.floats(-np.pi, np.pi))
def test_fastest_rate_holds_at_any_elbow_angle(parameters: ArmParameters, theta2: float) -> None:
    arm = FlexibleArm(parameters)
    state = np.zeros(2 * arm.size)
    state[1] = theta2
    # nine angles of a smooth even function: up to 2 % may hide between two of them
    assert np.abs(np.linalg.eigvals(arm.linearise(state).A)).max() < 1.02 * arm.fastest_rate()
