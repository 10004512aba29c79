"""The comparison with MuJoCo: its chain, set, read and driven; the laws on it; what is made of the errors."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

from flexarm_env import ArmParameters, FlexibleArm
from flexarm_env.physics.damping import clamped_ratio

mujoco = pytest.importorskip("mujoco", reason="MuJoCo is in the extra `validate`")

ROOT = Path(__file__).resolve().parents[2]
EI, L = 1676.0, 4.5
UNDAMPED = ArmParameters.linear(damping_ratio=0.0)
JOINTS = np.array([0.3, 1.1])


@pytest.fixture(autouse=True)
def no_log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """MuJoCo writes its warnings to a file in the working folder: here is none to be."""
    monkeypatch.chdir(tmp_path)
    yield
    assert not (tmp_path / "MUJOCO_LOG.TXT").exists()


# --- the chain and the models, set and read -------------------------------------------------------------------


def test_both_bend_as_a_cantilever_under_a_force_across_link_2() -> None:
    from scripts.validation.engine.chain import EngineChain
    from scripts.validation.engine.motion import bent_by

    across = 0.1 * np.array([-np.sin(JOINTS.sum()), np.cos(JOINTS.sum())])
    chain, arm = (
        EngineChain(20, UNDAMPED),
        FlexibleArm(ArmParameters.linear(modes_per_link=4, mode_shapes="polynomial")),
    )
    chain.place(JOINTS, across)
    expected = 0.1 * L**3 / (3.0 * EI)
    assert chain.look().deflection[1] == pytest.approx(expected, rel=2e-3)
    q = bent_by(arm, JOINTS, across)
    np.testing.assert_allclose(arm.tip_deflection(q), chain.look().deflection, rtol=4e-3)
    np.testing.assert_allclose(arm.tip(q), chain.look().tip, atol=1e-4)


def test_a_bent_chain_is_in_balance() -> None:
    """Held by its joints and pulled at its tip it does not move."""
    from scripts.validation.engine.chain import EngineChain

    chain, force = EngineChain(6, UNDAMPED), np.array([3.0, 8.0])
    chain.place(JOINTS, force)
    jacobian = np.zeros((3, chain.model.nv))
    mujoco.mj_forward(chain.model, chain.data)
    mujoco.mj_jacSite(chain.model, chain.data, jacobian, None, chain.model.site("tip").id)
    moments = force @ jacobian[:2]
    chain.data.qfrc_applied[:] = moments
    chain.data.ctrl[:] = -moments[chain.shoulder_and_elbow]
    mujoco.mj_forward(chain.model, chain.data)
    assert np.abs(chain.data.qacc).max() < 1e-4  # [rad/s^2]; the pull alone gives thousands


@pytest.mark.parametrize(
    ("damping", "ratios"),
    [
        ("modal", [1.0, 1.0, 1.0, 1.0]),
        ("material", [12.281 / 40.24, 76.96 / 40.24, 215.5 / 40.24, 422.3 / 40.24]),  # clamped over the free first
    ],
)
def test_a_clamped_link_is_damped_as_told(damping: Any, ratios: list[float]) -> None:
    """Link 2 with all before it held, on dense matrices from MuJoCo alone."""
    from scipy.linalg import eigh

    from flexarm_env.chain import model as chain

    arm = ArmParameters.linear(damping_ratio=0.02, damping_model=damping)
    model = chain.chain_model(21, arm)
    bends = slice(22, 42)
    mass, damper = chain.mass_matrix(model)[bends, bends], chain.dampers(model)[bends, bends]
    squares, shapes = eigh(np.diag(model.jnt_stiffness.ravel()[bends]), mass)
    modal = shapes.T @ damper @ shapes / (2.0 * np.sqrt(squares))
    own = clamped_ratio(arm) if damping == "modal" else 0.02
    np.testing.assert_allclose(np.diag(modal)[:4] / own, ratios, rtol=0.02)
    np.testing.assert_allclose(modal - np.diag(np.diag(modal)), 0.0, atol=1e-8)


@pytest.mark.parametrize("damping", ["modal", "material"])
def test_dampers_of_a_chain_do_not_turn_it(damping: Any) -> None:
    """An inner force: it takes energy, and leaves angular momentum about the shoulder alone."""
    from scripts.validation.engine.chain import EngineChain

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


def test_a_force_that_bends_too_far_is_refused() -> None:
    from scripts.validation.engine.chain import EngineChain

    with pytest.raises(RuntimeError, match="bends too far"):
        EngineChain(6, UNDAMPED).place(JOINTS, np.array([0.0, 3000.0]))


@pytest.mark.parametrize("shapes", ["cantilever", "polynomial"])
def test_gauges_read_back_the_state_of_a_model(shapes: Any) -> None:
    from flexarm_env.chain.gauges import Gauges
    from scripts.validation.engine.chain import Modal

    arm = FlexibleArm(ArmParameters.linear(modes_per_link=3, mode_shapes=shapes))
    model = Modal(arm)
    model.state = np.random.default_rng(1).normal(size=2 * arm.size)
    np.testing.assert_allclose(Gauges(arm).state(model.bend()), model.state, rtol=1e-9, atol=1e-9)


def test_gauges_read_the_rates_of_a_chain() -> None:
    from flexarm_env.chain.gauges import Gauges
    from scripts.validation.engine.chain import EngineChain

    arm, chain = FlexibleArm(UNDAMPED), EngineChain(10, UNDAMPED)
    chain.data.qpos[:], chain.data.qvel[:] = np.random.default_rng(2).normal(scale=(0.02, 1.0), size=(22, 2)).T
    state, step = Gauges(arm).state(chain.bend()), 1e-6
    chain.data.qpos[:] += step * chain.data.qvel
    later = Gauges(arm).state(chain.bend())
    np.testing.assert_allclose((later - state)[: arm.size] / step, state[arm.size :], rtol=1e-6, atol=1e-6)


def test_a_model_advances_as_it_is_simulated() -> None:
    from scripts.validation.engine.chain import Modal

    model = Modal(FlexibleArm(UNDAMPED))
    torque = np.array([5.0, -2.0])
    tips = np.concatenate([model.advance(torque, 3), model.advance(torque, 2)])
    again = Modal(FlexibleArm(UNDAMPED)).follow(np.tile(torque, (5, 1)))
    np.testing.assert_allclose(tips, again, rtol=1e-13)


# --- programmes -----------------------------------------------------------------------------------------------


def test_at_small_amplitude_model_and_chain_agree() -> None:
    from scripts.validation.engine.models import model
    from scripts.validation.engine.programmes import PROGRAMMES
    from scripts.validation.engine.study import case, length

    smooth = next(p for p in PROGRAMMES if p.name == "multi_sine").times(0.05)
    best = model("foreshortened", 4, "polynomial")
    found = case(smooth, (10, 20), (best,))
    moved = np.linalg.norm(found.reference.tip - found.reference.tip[0], axis=1).max()
    assert length(found.errors[best].tip).max() < 2e-3 * moved


def test_programmes_scale_and_damp_nothing() -> None:
    from scripts.validation.engine.programmes import PROGRAMMES

    assert {p.name for p in PROGRAMMES} == {"doublet", "bang_bang", "multi_sine", "spin_up", "release", "payload"}
    for programme in PROGRAMMES:
        torques = programme.torques()
        assert torques.shape == (round(programme.duration / 1e-3), 2)
        np.testing.assert_array_equal(programme.times(2.0).torques(), 2.0 * torques)
        assert programme.parameters().damping_ratio == 0.0


def test_extrapolation_removes_the_second_order() -> None:
    from scripts.validation.engine.motion import Motion, extrapolated

    def motion(elements: int) -> Motion:
        return Motion(*(np.full((3, 2), value + 7.0 / elements**2) for value in (1.0, 2.0, 3.0)))

    for found, value in zip(extrapolated(motion(10), motion(20)), (1.0, 2.0, 3.0), strict=True):
        np.testing.assert_allclose(found, value, rtol=1e-13)


def test_low_pass_keeps_what_is_slow() -> None:
    from scripts.validation.engine.motion import low_passed

    time = np.arange(0.0, 2.0, 1e-3)
    slow = np.column_stack([np.sin(2.0 * np.pi * time), np.cos(2.0 * np.pi * time)])
    fast = np.sin(2.0 * np.pi * 60.0 * time)[:, None]
    np.testing.assert_allclose(low_passed(slow + fast)[300:-300], slow[300:-300], atol=5e-3)


# --- what is made of the errors -------------------------------------------------------------------------------


def test_a_limit_lies_where_the_error_passes_the_tolerance() -> None:
    from scripts.validation.engine.validity import limits

    rows = [
        {"model": "m", "programme": name, "bend": bend, "rms": factor * bend**2}
        for name, factor in (("multi_sine", 10.0), ("spin_up", 40.0))
        for bend in (0.005, 0.02, 0.08)
    ]
    (found,) = limits(rows)
    assert found["smooth torques, 10 mm"] == pytest.approx(np.sqrt(0.01 / 40.0))
    assert found["smooth torques, 50 mm"] == pytest.approx(np.sqrt(0.05 / 40.0))
    assert found["release, 10 mm"] is None
    diverged = [{"model": "m", "programme": "release", "bend": b, "rms": e} for b, e in ((0.01, 0.001), (0.1, np.inf))]
    assert limits(diverged)[0]["release, 10 mm"] == 0.01


def test_a_kind_was_tried_as_far_as_that_of_its_programmes_which_bent_least() -> None:
    from scripts.validation.engine.tables import floored
    from scripts.validation.engine.validity import largest_bends

    rows = [
        {"model": "m", "programme": name, "bend": bend}
        for name, bends in (("multi_sine", (0.04, 0.14)), ("spin_up", (0.02, 0.15)), ("release", (0.135,)))
        for bend in bends
    ]
    assert largest_bends(rows) == {"smooth torques": 0.14, "release": 0.135}
    assert floored(13.58) == "13.5"


def test_only_the_linear_model_softens_until_its_spin_is_unstable() -> None:
    from scripts.validation.engine.models import model
    from scripts.validation.engine.validity import FIRST_CLAMPED, critical_spin
    from scripts.validation.spinning import critical_spin as expected

    assert critical_spin(model("foreshortened", 2)) is None
    found = [FIRST_CLAMPED * critical_spin(model("linear", m)) for m in (1, 2, 4)]
    assert found[0] > found[1] > found[2] > expected(ArmParameters.linear())
    assert found[2] == pytest.approx(expected(ArmParameters.linear()), rel=5e-4)


def test_finite_elements_of_the_spinning_arm_have_converged() -> None:
    from scripts.validation.spinning import critical_spin

    arm = ArmParameters()
    assert critical_spin(arm, 5) == pytest.approx(critical_spin(arm, 20), rel=1e-6)


def test_the_square_asks_a_rigid_arm_for_these_rates() -> None:
    """By the Jacobian instead of differences in time."""
    from flexarm_env import SquareParameters, inverse_kinematics, square
    from scripts.validation.engine.square import reference_rates

    path, arm = square(SquareParameters()), FlexibleArm(UNDAMPED)
    largest = 0.0
    for time in np.arange(0.5e-3, 16.0, 5e-3):
        joints = inverse_kinematics(UNDAMPED, path.position(time), "positive")
        jacobian = arm.point_jacobian(np.concatenate([joints, np.zeros(arm.size - 2)]), 2, L)[:, :2]
        largest = max(largest, np.abs(np.cumsum(np.linalg.solve(jacobian, path.velocity(time)))).max())
    found = reference_rates(0.9 * largest)
    assert found["largest"] == pytest.approx(largest, rel=0.01)
    assert 0.0 < found["share"] < 0.05
    assert reference_rates(2.0 * largest)["share"] == 0.0


# --- the square -----------------------------------------------------------------------------------------------


def test_the_law_on_a_stiff_chain_is_the_law_on_a_stiff_arm() -> None:
    """With links 400 times as stiff only the law, its delays and the arm's inertia are left to compare."""
    from scripts.validation.engine.laws import law_lap

    stiff = ArmParameters.linear(modes_per_link=1, damping_ratio=0.0, flexural_rigidities=(400.0 * EI, 400.0 * EI))
    env = gymnasium.make("FlexArm/Paper-v0", arm=stiff)
    env.reset()
    for _ in range(500):
        expected = env.step(np.ones(1, dtype=np.float32))[4]
    sights = law_lap(2, stiff, lambda deflection: 1.0, 0.5)
    np.testing.assert_allclose(sights[-1].joints, expected["state"][:2], atol=2e-3)
    np.testing.assert_allclose(sights[-1].tip, expected["true_tip"], atol=1e-2)
    assert np.linalg.norm(sights[-1].tip - sights[0].tip) > 0.5


def test_an_agent_sees_a_model_of_the_studies_as_it_sees_its_own_arm() -> None:
    """On the environment's own arm: what differs is the error of its step after jumps (0.29 at 2 ms, 0.013 at 1 ms)."""
    from flexarm_agents import load_policy
    from flexarm_env.laps import LAPS
    from scripts.validation.engine.chain import Modal
    from scripts.validation.plant.hosted import HostedEnv

    trained = load_policy("square")
    env = trained.make_env(physics_step=1e-3)
    start = LAPS["plain"].reset_options()
    expected, info = env.reset(seed=0, options=start)
    model = Modal(env.unwrapped.arm)
    model.state = info["state"].copy()
    hosted = HostedEnv(model, physics_step=1e-3)
    observation, _ = hosted.reset(seed=0, options=start)
    for _ in range(60):
        np.testing.assert_allclose(observation, expected, atol=2e-2)
        action = np.clip(trained.policy.predict(expected, None, np.ones(1, dtype=bool), True)[0], -1.0, 1.0)
        (expected, *_), (observation, *_) = env.step(action), hosted.step(action)
        assert hosted.host.taken().shape == (10, 2)


def test_encoders_of_a_hosted_chain_read_its_own_joints() -> None:
    """Not what a model's shapes make of them, which on a coarse, bent chain is something else."""
    from flexarm_env.chain.gauges import Gauges
    from flexarm_env.envs.settings import Settings
    from scripts.validation.engine.chain import EngineChain
    from scripts.validation.plant.hosted import AnyArm

    chain = EngineChain(4, ArmParameters())
    chain.place(np.array([0.3, 1.1]), np.array([0.0, 5.0]))
    host = AnyArm(chain, Settings.of({}))
    np.testing.assert_allclose(host.encoders()[:2], [0.3, 1.1], atol=1e-12)
    np.testing.assert_array_equal(host.truth().state, Gauges(FlexibleArm()).state(chain.bend()))
    assert abs(host.truth().state[1] - 1.1) > 1e-4


def test_an_arm_is_hosted_where_the_episode_begins_with_its_sensor_at_the_end() -> None:
    from scripts.validation.engine.chain import Modal
    from scripts.validation.plant.hosted import HostedEnv

    arm = Modal(FlexibleArm())
    with pytest.raises(ValueError, match="sensor = 'angles'"):
        HostedEnv(arm, sensor="angles")
    with pytest.raises(ValueError, match="physics step must be a multiple"):
        HostedEnv(arm, physics_step=5e-4)
    with pytest.raises(ValueError, match="arm: must be at"):
        HostedEnv(arm).reset(options={"start": "corner"})
