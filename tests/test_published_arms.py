"""The arms with published numbers: what their fields are derived from, and what their sources compute of them."""

import numpy as np
import pytest

from flexarm_env import ArmParameters, FlexibleArm
from flexarm_env.analysis import OperatingPoint, natural_modes


def test_quanser_follows_from_the_makers_numbers() -> None:
    """To the digits of the fields, 0.05 %; steel's density is a handbook's."""
    arm = ArmParameters.named("quanser")
    length, modulus, steel = 0.202, 2.068427e11, 7850.0
    for link, (width, thickness) in enumerate([(0.0762, 0.00127), (0.0381, 0.000889)]):
        assert arm.flexural_rigidities[link] == pytest.approx(modulus * width * thickness**3 / 12.0, rel=5e-4)
        assert arm.masses_per_length[link] == pytest.approx(steel * width * thickness, rel=5e-4)
    assert arm.shoulder_hub_inertia == pytest.approx(100**2 * 6.28e-6 + 0.00073616, rel=5e-4)
    assert arm.elbow_hub_inertia == pytest.approx(50**2 * 1.03e-6 + 0.00044455, rel=5e-4)
    assert arm.payload_inertia == pytest.approx(arm.payload_mass * (0.0445**2 + 0.0224**2) / 12.0, rel=5e-4)
    # what link 1 carries is the second stage: its mass, and its inertia about the shoulder
    assert arm.elbow_mass + arm.masses_per_length[1] * length + arm.payload_mass == pytest.approx(1.578, rel=5e-4)
    own = arm.shoulder_hub_inertia + arm.masses_per_length[0] * length**3 / 3.0
    carried = FlexibleArm(arm).mass_matrix(np.zeros(6))[0, 0] - own
    assert carried == pytest.approx(0.18028257 - 1.578 * 0.079**2, rel=5e-4)


def test_the_forearms_rigid_inertias_are_the_published_ones() -> None:
    """J1T + J2T + 2 h3, J2T + h3 and J2T, straight; h3 = 0.195 there, of a uniform forearm 0.1944."""
    mass = FlexibleArm(ArmParameters.named("flexible_forearm")).mass_matrix(np.zeros(10))
    np.testing.assert_allclose(mass[[0, 0, 1], [0, 1, 1]], [1.140, 0.498, 0.303], rtol=2e-3)


@pytest.mark.parametrize("name", ["quanser", "de_luca_siciliano"])
def test_the_chain_in_mujoco_has_the_frequencies_of_the_arm(name: str) -> None:
    """The first two of the free straight arm; 20 segments are 0.07 % too fast, clamped."""
    chain = pytest.importorskip("flexarm_env.chain.model")
    arm = ArmParameters.named(name)
    modes = natural_modes(OperatingPoint.at_angles(FlexibleArm(arm), (0.0, 0.0)))
    found = chain.frequencies(chain.chain_model(20, arm))
    np.testing.assert_allclose(found[2:4], modes.frequencies[2:4], rtol=2e-3)


def test_the_makers_spring_is_stiffer_than_a_beam() -> None:
    """First frequency [Hz] with the shoulder held and the second stage rigid, of a massless beam off the axis [m]."""

    def beam(offset: float, inertia: float) -> float:
        length, rigidity, mass = 0.202, 2.69, 1.578
        compliance = np.array([[length**3 / 3.0, length**2 / 2.0], [length**2 / 2.0, length]]) / rigidity
        masses = np.diag([mass, inertia - mass * (offset + length) ** 2])
        return float(1.0 / np.sqrt(np.linalg.eigvals(compliance @ masses).real.max()) / (2.0 * np.pi))

    spring = np.sqrt(3.0 * 2.69 / 0.202 / 0.1704) / (2.0 * np.pi)
    assert [spring, beam(0.0, 0.1704), beam(0.079, 0.1803)] == pytest.approx([2.44, 1.66, 2.15], abs=0.005)
