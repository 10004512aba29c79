"""The chain of rigid segments in MuJoCo, against beam theory."""

import numpy as np
import pytest

from flexarm_env import ArmParameters
from flexarm_env.physics.damping import material_time
from tests.support.refusals import refused

pytest.importorskip("mujoco", reason="MuJoCo is in the extra `chain`")

from flexarm_env.chain import model as chain

L, EI, RHO = 4.5, 1676.0, 0.335  # a link
CLAMPED = np.array([1.875104, 4.694091])  # roots of cos x cosh x = -1
PINNED = np.array([3.926602, 7.068583])  # roots of tan x = tanh x; the other end is free

# The chain is the midpoint rule of the bent beam: its error is of second order in 1 / (segments - 1). At 10 segments
# it is 0.28 % for the first clamped mode and 1 % for the second, and so is the tolerance: half again as much.
ERRORS = {10: np.array([0.0042, 0.015]), 20: np.array([0.0010, 0.0034])}


def beam(roots: np.ndarray, length: float = L) -> np.ndarray:
    """Angular frequencies of a uniform beam [rad/s]."""
    return roots**2 * np.sqrt(EI / (RHO * length**4))


def link1(segments: int) -> list[str]:
    return ["shoulder", *(f"bend1_{k}" for k in range(1, segments))]


@pytest.mark.parametrize("segments", ERRORS)
@pytest.mark.parametrize(("elbow", "roots"), [(["elbow"], CLAMPED), ([], PINNED)], ids=["clamped", "pinned"])
def test_frequencies_of_link_2(segments: int, elbow: list[str], roots: np.ndarray) -> None:
    found = chain.frequencies(chain.chain_model(segments), locked=link1(segments) + elbow)
    elastic = found[found > 1e-3][:2]
    assert len(found) - len(found[found > 1e-3]) == (not elbow)  # the pinned link turns freely
    assert np.all(np.abs(elastic / beam(roots) - 1.0) < ERRORS[segments])


def test_inertia_of_the_straight_arm() -> None:
    hubs = {"shoulder_hub_inertia": 0.3, "elbow_hub_inertia": 0.2, "elbow_mass": 0.7, "elbow_housing_inertia": 0.4}
    arm = ArmParameters(payload_mass=0.5, payload_inertia=0.1, **hubs)
    second = RHO * L**3 / 3.0 + 0.2 + 0.5 * L**2 + 0.1
    whole = RHO * (2.0 * L) ** 3 / 3.0 + 0.3 + 0.2 + 0.4 + 0.7 * L**2 + 0.5 * (2.0 * L) ** 2 + 0.1
    for segments in (2, 10):
        mass = chain.mass_matrix(chain.chain_model(segments, arm))
        assert mass.shape == (2 * segments, 2 * segments)
        assert mass[0, 0] == pytest.approx(whole)
        assert mass[segments, segments] == pytest.approx(second)


def test_a_numpy_number_is_a_time_step() -> None:
    assert chain.chain_model(np.int64(5), time_step=np.float64(1e-3)).opt.timestep == 1e-3


def test_material_damping_and_friction_are_in_the_hinges() -> None:
    arm = ArmParameters.linear(damping_ratio=0.02, damping_model="material", joint_friction=(0.5, 0.25))
    model = chain.chain_model(10, arm)
    spring, elbow = model.joint("bend2_4"), model.joint("elbow")
    assert spring.stiffness[0] == pytest.approx(EI * 9 / L)
    assert spring.damping[0] / spring.stiffness[0] == pytest.approx(material_time(arm), rel=1e-12)
    assert (elbow.stiffness[0], elbow.damping[0], model.joint("shoulder").damping[0]) == (0.0, 0.25, 0.5)


@pytest.mark.parametrize(("damping", "step"), [(0.01, 1e-3), (0.0, 5e-4)])
def test_largest_stable_step(damping: float, step: float) -> None:
    arm = ArmParameters.linear(damping_ratio=damping, damping_model="material")
    assert chain.largest_stable_step(10, arm) == step
    longer = [s for s in chain.TIME_STEPS if s > step]
    with pytest.raises(ValueError, match="unstable with each step"):
        chain.largest_stable_step(10, arm, longer)


UNDAMPED = ArmParameters(damping_ratio=0.0)
test_refusals = refused(
    (lambda: chain.chain_model(1), "segments = 1: must be"),
    (lambda: chain.chain_model(2.5), "TypeError: segments = 2.5: must be an integer"),
    (lambda: chain.chain_model(5, time_step=0.0), "time_step = 0.0: must be"),
    (lambda: chain.chain_model(5, arm="linear"), "TypeError: arm = 'linear': must be an ArmParameters"),
    (lambda: chain.chain_model(10, ArmParameters(coulomb_friction=(1.0, 0.0))), "coulomb_friction.*no dry friction"),
    (lambda: chain.stable_steps(chain.chain_model(60, UNDAMPED), 0.1, 1e-2), "take more than 1000 steps in"),
)


@pytest.mark.parametrize("damping", [0.0, 0.005, 0.01])
@pytest.mark.parametrize("segments", [5, 20])
def test_steps_are_the_fewest_that_are_stable_with_a_tenth_to_spare(segments: int, damping: float) -> None:
    model = chain.chain_model(segments, ArmParameters(damping_ratio=damping))
    time, longest, growing = 4e-3, 1e-3, 1.0 + 1e-6  # a rigid motion's double eigenvalue is known to half of the digits
    count = chain.stable_steps(model, time, longest)
    assert chain.growth(model, 1.1 * time / count) <= growing
    assert count == 4 or chain.growth(model, 1.1 * time / (count - 1)) > growing
