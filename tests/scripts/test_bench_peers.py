"""What the benchmark compares with: the chain against beam theory, and that each peer does the work it is timed for."""

import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flexarm_env import ArmParameters
from flexarm_env.physics.damping import material_time

ROOT = Path(__file__).resolve().parents[2]
L, EI, RHO = 4.5, 1676.0, 0.335  # a link
CLAMPED = np.array([1.875104, 4.694091])  # roots of cos x cosh x = -1
PINNED = np.array([3.926602, 7.068583])  # roots of tan x = tanh x; the other end is free

# The chain is the midpoint rule of the bent beam: its error is of second order in 1 / (segments - 1). At 10 segments
# it is 0.28 % for the first clamped mode and 1 % for the second, and so is the tolerance: half again as much.
ERRORS = {10: np.array([0.0042, 0.015]), 20: np.array([0.0010, 0.0034])}


@pytest.fixture(scope="module")
def peers() -> Any:
    from scripts.benchmarks import peers

    return peers


@pytest.fixture(scope="module")
def chain() -> Any:
    pytest.importorskip("mujoco", reason="MuJoCo is in the extra `bench`")
    from flexarm_env.chain import model

    return model


@pytest.fixture(autouse=True)
def no_log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """MuJoCo writes its warnings to a file in the working folder: here is none to be."""
    monkeypatch.chdir(tmp_path)
    yield
    assert not (tmp_path / "MUJOCO_LOG.TXT").exists()


def beam(roots: np.ndarray, length: float = L) -> np.ndarray:
    """Angular frequencies of a uniform beam [rad/s]."""
    return roots**2 * np.sqrt(EI / (RHO * length**4))


def link1(segments: int) -> list[str]:
    return ["shoulder", *(f"bend1_{k}" for k in range(1, segments))]


# --- the chain: frequencies -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("segments", ERRORS)
@pytest.mark.parametrize(("elbow", "roots"), [(["elbow"], CLAMPED), ([], PINNED)], ids=["clamped", "pinned"])
def test_frequencies_of_link_2(chain: Any, segments: int, elbow: list[str], roots: np.ndarray) -> None:
    found = chain.frequencies(chain.chain_model(segments), locked=link1(segments) + elbow)
    elastic = found[found > 1e-3][:2]
    assert len(found) - len(found[found > 1e-3]) == (not elbow)  # the pinned link turns freely
    assert np.all(np.abs(elastic / beam(roots) - 1.0) < ERRORS[segments])


def test_convergence_is_of_second_order(chain: Any) -> None:
    errors = []
    for segments in (9, 17, 33):  # 8, 16, 32 elements
        locked = [*link1(segments), "elbow"]
        errors.append(chain.frequencies(chain.chain_model(segments), locked)[:2] / beam(CLAMPED) - 1.0)
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    np.testing.assert_allclose(orders, 2.0, atol=0.05)


def test_both_links_with_the_elbow_held_are_one_beam(chain: Any) -> None:
    found = chain.frequencies(chain.chain_model(20), locked=["shoulder", "elbow"])
    np.testing.assert_allclose(found[:2], beam(CLAMPED, 2.0 * L), rtol=1e-3)  # 38 elements: 0.02 and 0.06 %


def test_frequencies_depend_on_the_elbow(chain: Any) -> None:
    model = chain.chain_model(10)
    straight, bent = chain.frequencies(model), chain.frequencies(model, elbow=np.pi / 2)
    assert np.all(straight[:2] < 1e-3)
    assert np.all(bent[:2] < 1e-3)
    assert abs(bent[2] / straight[2] - 1.0) > 0.01


# --- the chain: inertia, geometry, damping ----------------------------------------------------------------------------


def test_inertia_of_the_straight_arm(chain: Any) -> None:
    arm = ArmParameters(
        shoulder_hub_inertia=0.3, elbow_hub_inertia=0.2, elbow_mass=0.7, payload_mass=0.5, payload_inertia=0.1
    )
    second = RHO * L**3 / 3.0 + 0.2 + 0.5 * L**2 + 0.1
    whole = RHO * (2.0 * L) ** 3 / 3.0 + 0.3 + 0.2 + 0.7 * L**2 + 0.5 * (2.0 * L) ** 2 + 0.1
    for segments in (2, 10):
        mass = chain.mass_matrix(chain.chain_model(segments, arm))
        assert mass.shape == (2 * segments, 2 * segments)
        assert mass[0, 0] == pytest.approx(whole)
        assert mass[segments, segments] == pytest.approx(second)


def test_tip_and_joints(chain: Any) -> None:
    mujoco = pytest.importorskip("mujoco")
    model = chain.chain_model(6)
    data = mujoco.MjData(model)
    np.testing.assert_allclose(chain.tip_position(model, data), [9.0, 0.0], atol=1e-12)
    data.joint("shoulder").qpos[0], data.joint("elbow").qpos[0] = np.pi / 2, -np.pi / 2
    data.joint("elbow").qvel[0] = 0.4
    assert chain.joint_angles(data) == (np.pi / 2, -np.pi / 2)
    assert chain.joint_rates(data) == (0.0, 0.4)
    np.testing.assert_allclose(chain.tip_position(model, data), [L, L], atol=1e-12)


def test_motors_turn_their_joints(chain: Any) -> None:
    mujoco = pytest.importorskip("mujoco")
    model = chain.chain_model(6, time_step=1e-3)
    for motor in range(2):
        data = mujoco.MjData(model)
        data.ctrl[motor] = 5.0
        mujoco.mj_step(model, data)
        assert chain.joint_rates(data)[motor] > 0.0


def test_material_damping_and_friction_are_in_the_hinges(chain: Any) -> None:
    arm = ArmParameters(damping_ratio=0.02, damping_model="material", joint_friction=(0.5, 0.25))
    model = chain.chain_model(10, arm)
    spring, elbow = model.joint("bend2_4"), model.joint("elbow")
    assert spring.stiffness[0] == pytest.approx(EI * 9 / L)
    assert spring.damping[0] / spring.stiffness[0] == pytest.approx(material_time(arm), rel=1e-12)
    assert (elbow.stiffness[0], elbow.damping[0]) == (0.0, 0.25)
    assert model.joint("shoulder").damping[0] == 0.5


def test_energy_is_kept_without_damping(chain: Any) -> None:
    mujoco = pytest.importorskip("mujoco")
    model = chain.chain_model(4, ArmParameters(damping_ratio=0.0), time_step=1e-4)
    model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    data = mujoco.MjData(model)
    data.joint("shoulder").qvel[0], data.joint("bend1_2").qpos[0] = 1.0, 0.1
    mujoco.mj_forward(model, data)
    before = data.energy.sum()
    mujoco.mj_step(model, data, 5000)
    mujoco.mj_forward(model, data)
    assert data.energy.sum() == pytest.approx(before, rel=1e-2)  # first order: it wavers by step times frequency


# --- the chain: time step ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("damping", "step"), [(0.01, 1e-3), (0.0, 5e-4)])
def test_largest_stable_step(chain: Any, damping: float, step: float) -> None:
    arm = ArmParameters(damping_ratio=damping, damping_model="material")
    assert chain.largest_stable_step(10, arm) == step
    longer = [s for s in chain.TIME_STEPS if s > step]
    with pytest.raises(ValueError, match="unstable with each step"):
        chain.largest_stable_step(10, arm, longer)


@pytest.mark.parametrize("damping", [0.01, 0.0])
def test_fastest_rate(chain: Any, damping: float) -> None:
    model = chain.chain_model(5, ArmParameters(damping_ratio=damping, damping_model="material"))
    mass, n = chain.mass_matrix(model), model.nv
    springs, drag = np.diag(model.jnt_stiffness.ravel()), np.diag(model.dof_damping)
    rates = np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(mass, springs), -np.linalg.solve(mass, drag)]])
    assert chain.fastest_rate(model) == pytest.approx(np.abs(np.linalg.eigvals(rates)).max(), rel=1e-6)


def test_less_than_two_segments_are_refused(chain: Any) -> None:
    with pytest.raises(ValueError, match="segments = 1: must be"):
        chain.chain_model(1)


# --- the subjects -----------------------------------------------------------------------------------------------------


def test_chain_simulates_the_seconds_it_is_timed_for(peers: Any, chain: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    mujoco = pytest.importorskip("mujoco")
    made = []
    make = mujoco.MjData
    monkeypatch.setattr(mujoco, "MjData", lambda model: made.append(make(model)) or made[-1])
    subject = peers.mujoco_chain(4, 0.05)
    assert "4 segments a link, damping 0.01" in subject.name
    for _ in range(2):
        subject.prepare()
        subject.work()
        assert made[-1].time == pytest.approx(subject.amount)
        assert abs(made[-1].qpos[0]) > 1e-3


def test_accurate_chain_errs_no_more_than_the_arm(peers: Any, chain: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    from scripts.benchmarks import accuracy

    monkeypatch.setattr(accuracy, "SECONDS", 0.1)
    for cached in (accuracy.chain_error, accuracy.chain_tips):
        cached.cache_clear()
    subject, equal = peers.accurate_chain(4, 0.01, 2)
    assert equal.error <= equal.ours
    count = round(accuracy.HELD / equal.step)
    coarser = accuracy.COUNTS[accuracy.COUNTS.index(count) - 1]
    assert accuracy.chain_error(4, equal.integrator, coarser) > equal.ours
    assert accuracy.our_error(1) < accuracy.our_error(2)
    assert f"{equal.integrator}, step {1e3 * equal.step:.3g} ms: as accurate in time as 2 modes" in subject.name
    subject.prepare()
    subject.work()
    for cached in (accuracy.chain_error, accuracy.chain_tips):
        cached.cache_clear()


def test_envpool_makes_the_steps_it_is_timed_for(peers: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    envpool = pytest.importorskip("envpool", reason="EnvPool is in the extra `bench`")
    made = []
    make = envpool.make_gymnasium
    monkeypatch.setattr(envpool, "make_gymnasium", lambda *a, **k: made.append(make(*a, **k)) or made[-1])
    subject = peers.envpool_acrobot(16, 0.01)
    assert subject.amount == 992  # 62 calls
    subject.work()
    *_, info = made[0].step(np.zeros(16, dtype=np.int32))
    assert np.all(info["elapsed_step"] == 63)


def test_installed(peers: Any) -> None:
    assert peers.installed("numpy", "scipy")
    assert not peers.installed("numpy", "no_such_package")


def test_multiply_add_peak(peers: Any) -> None:
    subject = peers.multiply_adds(1e-3)
    assert subject.amount == pytest.approx(1e-3 * peers.FLOPS, rel=0.01)
    lanes = np.linspace(0.0, 1.0, peers.LANES)
    peers._multiply_add(lanes, 0.5, 0.25, 1)
    np.testing.assert_allclose(lanes, 0.5 + (np.linspace(0.0, 1.0, peers.LANES) - 0.5) / 2**peers.CHAINED)
    assert 1e8 < peers.fma_peak(repeats=3) < 1e12


def test_empty_vec_env_has_the_shapes_asked_for(peers: Any) -> None:
    vec_env = pytest.importorskip("stable_baselines3.common.vec_env")
    env = peers.empty_vec_env(5, 12, 2)
    assert isinstance(env, vec_env.VecEnv)
    assert env.observation_space.contains(env.reset()[0])
    observations, rewards, dones, infos = env.step(np.zeros((5, 2), dtype=np.float32))
    assert (observations.shape, observations.dtype, rewards.shape) == ((5, 12), np.float32, (5,))
    assert not dones.any()
    assert infos == [{}] * 5


def test_ppo_rate(peers: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    torch = pytest.importorskip("torch")
    pytest.importorskip("stable_baselines3")
    monkeypatch.setattr(peers, "ROLLOUT", 256)
    threads = torch.get_num_threads()
    assert peers.ppo_rate(lambda n: peers.empty_vec_env(n, 12, 1), 16, 512) > 0.0
    assert torch.get_num_threads() == threads


# --- memory -----------------------------------------------------------------------------------------------------------


def test_memory_of_a_statement(peers: Any) -> None:
    size = 30_000_000
    assert peers.memory_of(f"text = b'x' * {size}") == pytest.approx(size, rel=0.05)
    assert peers.memory_of("y = numpy.ones(3)", imports="import numpy") < 2_000_000  # numpy itself is 15 MB


def test_memory_of_a_failing_statement(peers: Any, capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(subprocess.CalledProcessError):
        peers.memory_of("1 / 0")
    assert "ZeroDivisionError" in capfd.readouterr().err
