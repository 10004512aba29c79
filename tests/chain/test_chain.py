"""The chain of rigid segments in MuJoCo: its beams, how links bend and are damped, what gauges and an IMU read."""

from typing import Any

import numpy as np
import pytest
from scipy.linalg import eigh

from flexarm_env import ArmParameters, FlexibleArm
from flexarm_env.physics.damping import clamped_ratio, material_time
from tests.support.refusals import refused

pytest.importorskip("mujoco", reason="MuJoCo is in the extra `chain`")

import mujoco

from flexarm_env.chain import model as chains
from tests.validation.arms import EngineChain, Gauges, Modal
from tests.validation.beams import Beam, clamped_free, pinned_free
from tests.validation.motion import bent_by

L, EI, RHO = 4.5, 1676.0, 0.335  # a link

# The chain is the midpoint rule of the bent beam: its error is of second order in 1 / (segments - 1). At 10 segments
# it is 0.28 % for the first clamped mode and 1 % for the second, and so is the tolerance: half again as much.
ERRORS = {10: np.array([0.0042, 0.015]), 20: np.array([0.0010, 0.0034])}


def link1(segments: int) -> list[str]:
    return ["shoulder", *(f"bend1_{k}" for k in range(1, segments))]


@pytest.mark.parametrize("segments", ERRORS)
@pytest.mark.parametrize(("elbow", "beam"), [(["elbow"], clamped_free), ([], pinned_free)], ids=["clamped", "pinned"])
def test_frequencies_of_link_2(segments: int, elbow: list[str], beam: Any) -> None:
    found = chains.frequencies(chains.chain_model(segments), locked=link1(segments) + elbow)
    elastic = found[found > 1e-3][:2]
    assert len(found) - len(found[found > 1e-3]) == (not elbow)  # the pinned link turns freely
    assert np.all(np.abs(elastic / beam(Beam(L, EI, RHO), 2) - 1.0) < ERRORS[segments])


def test_inertia_of_the_straight_arm() -> None:
    hubs = {"shoulder_hub_inertia": 0.3, "elbow_hub_inertia": 0.2, "elbow_mass": 0.7, "elbow_housing_inertia": 0.4}
    arm = ArmParameters(payload_mass=0.5, payload_inertia=0.1, **hubs)
    second = RHO * L**3 / 3.0 + 0.2 + 0.5 * L**2 + 0.1
    whole = RHO * (2.0 * L) ** 3 / 3.0 + 0.3 + 0.2 + 0.4 + 0.7 * L**2 + 0.5 * (2.0 * L) ** 2 + 0.1
    for segments in (2, 10):
        mass = chains.mass_matrix(chains.chain_model(segments, arm))
        assert mass.shape == (2 * segments, 2 * segments)
        assert mass[0, 0] == pytest.approx(whole)
        assert mass[segments, segments] == pytest.approx(second)


def test_a_numpy_number_is_a_time_step() -> None:
    assert chains.chain_model(np.int64(5), time_step=np.float64(1e-3)).opt.timestep == 1e-3


def test_material_damping_and_friction_are_in_the_hinges() -> None:
    arm = ArmParameters.linear(damping_ratio=0.02, damping_model="material", joint_friction=(0.5, 0.25))
    model = chains.chain_model(10, arm)
    spring, elbow = model.joint("bend2_4"), model.joint("elbow")
    assert spring.stiffness[0] == pytest.approx(EI * 9 / L)
    assert spring.damping[0] / spring.stiffness[0] == pytest.approx(material_time(arm), rel=1e-12)
    assert (elbow.stiffness[0], elbow.damping[0], model.joint("shoulder").damping[0]) == (0.0, 0.25, 0.5)


@pytest.mark.parametrize(("damping", "step"), [(0.01, 1e-3), (0.0, 5e-4)])
def test_largest_stable_step(damping: float, step: float) -> None:
    arm = ArmParameters.linear(damping_ratio=damping, damping_model="material")
    assert chains.largest_stable_step(10, arm) == step
    longer = [s for s in chains.TIME_STEPS if s > step]
    with pytest.raises(ValueError, match="unstable with each step"):
        chains.largest_stable_step(10, arm, longer)


UNDAMPED = ArmParameters(damping_ratio=0.0)
test_refusals = refused(
    (lambda: chains.chain_model(1), "segments = 1: must be"),
    (lambda: chains.chain_model(2.5), "TypeError: segments = 2.5: must be an integer"),
    (lambda: chains.chain_model(5, time_step=0.0), "time_step = 0.0: must be"),
    (lambda: chains.chain_model(5, arm="linear"), "TypeError: arm = 'linear': must be an ArmParameters"),
    (lambda: chains.chain_model(10, ArmParameters(coulomb_friction=(1.0, 0.0))), "coulomb_friction.*no dry friction"),
    (lambda: chains.stable_steps(chains.chain_model(60, UNDAMPED), 0.1, 1e-2), "take more than 1000 steps in"),
)


@pytest.mark.parametrize("damping", [0.0, 0.005, 0.01])
@pytest.mark.parametrize("segments", [5, 20])
def test_steps_are_the_fewest_that_are_stable_with_a_tenth_to_spare(segments: int, damping: float) -> None:
    model = chains.chain_model(segments, ArmParameters(damping_ratio=damping))
    time, longest, growing = 4e-3, 1e-3, 1.0 + 1e-6  # a rigid motion's double eigenvalue is known to half of the digits
    count = chains.stable_steps(model, time, longest)
    assert chains.growth(model, 1.1 * time / count) <= growing
    assert count == 4 or chains.growth(model, 1.1 * time / (count - 1)) > growing


LINEAR = ArmParameters.linear(damping_ratio=0.0)
JOINTS = np.array([0.3, 1.1])


def test_chain_and_model_bend_as_a_cantilever_under_a_force_across_link_2() -> None:
    across = 0.1 * np.array([-np.sin(JOINTS.sum()), np.cos(JOINTS.sum())])
    chain = EngineChain(20, LINEAR)
    arm = FlexibleArm(ArmParameters.linear(modes_per_link=4, mode_shapes="polynomial"))
    chain.place(JOINTS, across)
    assert chain.look().deflection[1] == pytest.approx(0.1 * L**3 / (3.0 * EI), rel=2e-3)
    q = bent_by(arm, JOINTS, across)
    np.testing.assert_allclose(arm.tip_deflection(q), chain.look().deflection, rtol=4e-3)
    np.testing.assert_allclose(arm.tip(q), chain.look().tip, atol=1e-4)


def test_a_force_that_bends_too_far_is_refused() -> None:
    with pytest.raises(RuntimeError, match="bends too far"):
        EngineChain(6, LINEAR).place(JOINTS, np.array([0.0, 3000.0]))


def test_modal_damping_of_a_clamped_link_is_the_same_for_all_modes() -> None:
    """Link 2 with all before it held, on dense matrices from MuJoCo alone."""
    arm = ArmParameters.linear(damping_ratio=0.02, damping_model="modal")
    model = chains.chain_model(21, arm)
    bends = slice(22, 42)
    mass, damper = chains.mass_matrix(model)[bends, bends], chains.dampers(model)[bends, bends]
    squares, shapes = eigh(np.diag(model.jnt_stiffness.ravel()[bends]), mass)
    modal = shapes.T @ damper @ shapes / (2.0 * np.sqrt(squares))
    np.testing.assert_allclose(np.diag(modal)[:4], clamped_ratio(arm), rtol=0.02)
    np.testing.assert_allclose(modal - np.diag(np.diag(modal)), 0.0, atol=1e-8)


@pytest.mark.parametrize("damping", ["modal", "material"])
def test_dampers_of_a_chain_do_not_turn_it(damping: Any) -> None:
    """An inner force: it takes energy, and leaves angular momentum about the shoulder alone."""
    chain = EngineChain(6, ArmParameters.linear(damping_model=damping), angle=0.1)  # implicitfast is of first order
    chain.data.qpos[:], chain.data.qvel[:] = np.random.default_rng(3).normal(scale=(0.05, 1.0), size=(14, 2)).T

    def momentum_and_energy() -> tuple[float, float]:
        mujoco.mj_forward(chain.model, chain.data)
        mass = np.zeros((14, 14))
        mujoco.mj_fullM(chain.model, chain.data, mass)
        kinetic = 0.5 * chain.data.qvel @ mass @ chain.data.qvel
        return float(mass[0] @ chain.data.qvel), kinetic + 0.5 * chain.model.jnt_stiffness.ravel() @ chain.data.qpos**2

    before = momentum_and_energy()
    chain.advance(np.zeros(2), 200)
    after = momentum_and_energy()
    assert after[0] == pytest.approx(before[0], rel=1e-4)
    assert 0.05 * before[1] < after[1] < 0.9 * before[1]


@pytest.mark.parametrize("shapes", ["cantilever", "polynomial"])
def test_gauges_read_back_the_state_of_a_model(shapes: Any) -> None:
    arm = FlexibleArm(ArmParameters.linear(modes_per_link=3, mode_shapes=shapes))
    model = Modal(arm)
    model.state = np.random.default_rng(1).normal(size=2 * arm.size)
    np.testing.assert_allclose(Gauges(arm).state(model.bend()), model.state, rtol=1e-9, atol=1e-9)
