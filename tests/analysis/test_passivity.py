"""Hyperstability: collocated rates are positive real, everything else is not."""

import numpy as np
import pytest

from flexarm_env import ArmParameters, FlexibleArm
from flexarm_env.analysis import (
    OperatingPoint,
    force_to_rate,
    joint_angles,
    linear_plant,
    passivity,
    rigid_point,
    true_point,
)

OMEGA = np.geomspace(0.1, 1000.0, 150)


def poses(arm: FlexibleArm) -> list[OperatingPoint]:
    rng = np.random.default_rng(1)
    return [OperatingPoint.at_angles(arm, rng.uniform(-3.0, 3.0, 2)) for _ in range(8)]


@pytest.mark.parametrize("modes", [1, 2, 4])
def test_collocated_rates_are_positive_real_at_every_pose(modes: int) -> None:
    arm = FlexibleArm(ArmParameters.linear(modes_per_link=modes, payload_mass=0.3, joint_friction=(0.1, 0.2)))
    for pose in poses(arm):
        assert passivity(linear_plant(pose, joint_angles(rate=True)), OMEGA).is_positive_real
        assert passivity(force_to_rate(pose, rigid_point(2.0)), OMEGA).is_positive_real


def test_an_undamped_arm_is_lossless() -> None:
    """Hermitian part zero on the axis, positive to the right of it: positive real, not strictly."""
    for pose in poses(FlexibleArm(ArmParameters.paper())):
        plant = linear_plant(pose, joint_angles(rate=True))
        assert np.abs(passivity(plant, OMEGA).relative).max() < 1e-9
        assert passivity(plant, OMEGA, growth=0.05).relative.min() > 1e-3


def test_it_equals_the_power_that_stays_in_the_arm() -> None:
    """tau^H (G + G^H) tau / 2 = v^H (Re(s) M + D + Re(s) / |s|^2 K) v."""
    arm = FlexibleArm(ArmParameters.linear())
    pose = OperatingPoint.at_angles(arm, (0.4, 1.3))
    linear, mass = pose.linearisation, arm.mass_matrix(pose.q)
    stiffness, damping = (-mass @ linear.A[6:, part] for part in (slice(0, 6), slice(6, None)))
    s, torque = 0.7 + 11.0j, np.array([0.3, -1.2 + 0.4j])
    rates = s * np.linalg.solve(s**2 * mass + s * damping + stiffness, np.eye(6, 2) @ torque)
    power = rates.conj() @ (s.real * mass + damping + s.real / abs(s) ** 2 * stiffness) @ rates
    assert force_to_rate(pose, true_point()).inputs == ("force x", "force y")
    response = linear_plant(pose, joint_angles(rate=True)).at(s)
    assert (torque.conj() @ (response + response.conj().T) @ torque / 2.0).real == pytest.approx(power.real, rel=1e-9)


@pytest.mark.parametrize("s", [0.05, 0.5, 2.25, 4.5])
def test_a_sensor_off_the_joint_is_not_positive_real(s: float) -> None:
    for pose in poses(FlexibleArm(ArmParameters.linear())):
        assert passivity(force_to_rate(pose, true_point(s)), OMEGA).worst[0] < -0.1


@pytest.mark.parametrize("delay", [1e-3, 0.0312])
def test_a_late_sensor_is_not_positive_real(delay: float) -> None:
    for pose in poses(FlexibleArm(ArmParameters.linear())):
        assert not passivity(linear_plant(pose, joint_angles(rate=True, delay=delay)), OMEGA).is_positive_real
        assert passivity(force_to_rate(pose, rigid_point(delay=delay)), OMEGA).worst[0] < -0.01
