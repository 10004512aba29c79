"""The chain in MuJoCo: how it is set, how its links bend and are damped, and what gauges read."""

from typing import Any

import numpy as np
import pytest
from scipy.linalg import eigh

from flexarm_env import ArmParameters, FlexibleArm
from flexarm_env.physics.damping import clamped_ratio

pytest.importorskip("mujoco", reason="MuJoCo is in the extra `chain`")

import mujoco

from flexarm_env.chain import model as chains
from tests.validation.arms import EngineChain, Gauges, Modal
from tests.validation.motion import bent_by

EI, L = 1676.0, 4.5
UNDAMPED = ArmParameters.linear(damping_ratio=0.0)
JOINTS = np.array([0.3, 1.1])


def test_chain_and_model_bend_as_a_cantilever_under_a_force_across_link_2() -> None:
    across = 0.1 * np.array([-np.sin(JOINTS.sum()), np.cos(JOINTS.sum())])
    chain = EngineChain(20, UNDAMPED)
    arm = FlexibleArm(ArmParameters.linear(modes_per_link=4, mode_shapes="polynomial"))
    chain.place(JOINTS, across)
    assert chain.look().deflection[1] == pytest.approx(0.1 * L**3 / (3.0 * EI), rel=2e-3)
    q = bent_by(arm, JOINTS, across)
    np.testing.assert_allclose(arm.tip_deflection(q), chain.look().deflection, rtol=4e-3)
    np.testing.assert_allclose(arm.tip(q), chain.look().tip, atol=1e-4)


def test_a_force_that_bends_too_far_is_refused() -> None:
    with pytest.raises(RuntimeError, match="bends too far"):
        EngineChain(6, UNDAMPED).place(JOINTS, np.array([0.0, 3000.0]))


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
