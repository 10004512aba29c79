"""Dry friction of a rigid joint against closed forms, and of the flexible arm against its energy."""

from typing import Any

import numpy as np
import pytest

from flexarm_env import ArmParameters, FlexibleArm
from flexarm_env.physics.dynamics import dry_friction
from tests.support.lagrange import DRY, loaded_arm, random_state

COULOMB, SMOOTHING, HUB = 3.0, 0.05, 2.0  # [N m], [rad/s], [kg m^2]


def joint(**changes: Any) -> FlexibleArm:
    """Return an arm whose links weigh nothing beside its hubs."""
    values: dict[str, Any] = {"link_lengths": (0.1, 0.1), "masses_per_length": (1e-4, 1e-4)}
    values |= {"flexural_rigidities": (1e-6, 1e-6), "shoulder_hub_inertia": HUB, "elbow_hub_inertia": 1.0}
    values |= {"coulomb_friction": (COULOMB, 0.0), "friction_smoothing": SMOOTHING}
    return FlexibleArm(ArmParameters.linear(modes_per_link=1, **(values | changes)))


def test_a_joint_stops_in_the_time_and_on_the_way_of_the_closed_form() -> None:
    """I w' = -Fc w / r with r^2 = w^2 + w0^2: time (I / Fc) (r - w0 artanh(w0 / r)), way (I / Fc) times that of r."""
    start, times = np.array([0.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0]), 0.05 * np.arange(31)
    run = joint().simulate(start, None, times[-1], step=0.05, substeps=50)
    angle, rate = run.state[:, 0], run.state[:, 4]
    r = np.hypot(rate, SMOOTHING)
    spent = HUB / COULOMB * (r - SMOOTHING * np.arctanh(SMOOTHING / r))
    area = 0.5 * (rate * r + SMOOTHING**2 * np.arcsinh(rate / SMOOTHING))
    # The step errs by 1e-7; the links' inertia is 1e-7 of the hub's.
    np.testing.assert_allclose(spent[0] - spent, times, atol=1e-6)
    np.testing.assert_allclose(angle, HUB / COULOMB * (area[0] - area), atol=1e-6)
    assert 0.0 < rate[-1] < SMOOTHING  # dry friction alone would stop it after 1.33 s, on 1.33 rad
    assert angle[-1] == pytest.approx(2.0 * HUB / COULOMB, rel=5e-3)


def test_a_joint_creeps_below_the_breakaway_torque_and_runs_away_above_it() -> None:
    arm = joint(breakaway_excess=(COULOMB, 0.0), stribeck_velocity=0.5)
    rates = np.linspace(0.0, 2.0, 20001)
    friction = dry_friction(arm.constants, (rates, rates))[0]
    peak, at = friction.max(), rates[friction.argmax()]
    assert COULOMB < peak < 2.0 * COULOMB
    for share in (0.5, 0.95):
        state = arm.simulate(np.zeros(8), np.full((200, 2), (share * peak, 0.0)), 2.0, step=0.01, substeps=10).state
        creep = np.interp(share * peak, friction[rates <= at], rates[rates <= at])
        np.testing.assert_allclose(state[-1, 4], creep, rtol=1e-3)
    state = arm.simulate(np.zeros(8), np.full((300, 2), (1.05 * peak, 0.0)), 3.0, step=0.01, substeps=10).state
    far = arm.simulate(state[-1], np.full((10, 2), (1.05 * peak, 0.0)), 0.1, step=0.01, substeps=10).state[:, 4]
    assert far[0] > 1.0
    assert (far[-1] - far[0]) / 0.1 == pytest.approx((1.05 * peak - np.interp(far[0], rates, friction)) / HUB, rel=0.05)


@pytest.mark.parametrize("kinematics", ["linear", "foreshortened"])
def test_the_energy_that_is_lost_is_the_work_of_friction(kinematics: str) -> None:
    arm = FlexibleArm(loaded_arm(1, damping_ratio=0.0, joint_friction=(0.0, 0.0), kinematics=kinematics, **DRY))
    run = arm.simulate(random_state(arm.parameters, 3), None, 2.0, step=1e-3, substeps=2)
    rates = run.state[:, 4:6]
    power = np.sum(rates * np.transpose(dry_friction(arm.constants, rates.T)), axis=1)
    lost = -np.diff(run.kinetic_energy + run.strain_energy)
    work = 0.5e-3 * (power[1:] + power[:-1])  # the trapezium errs by a part in a thousand
    assert (power >= 0.0).all()
    assert lost.sum() > 1.0
    np.testing.assert_allclose(np.cumsum(lost), np.cumsum(work), atol=1e-3 * lost.sum())
