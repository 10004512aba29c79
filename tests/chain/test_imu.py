"""The IMU against MuJoCo: its accelerometer and gyro on the chain, and our arm's beside the chain's."""

import mujoco
import numpy as np

from flexarm_env import ArmParameters, FlexibleArm
from flexarm_env.chain.links import Chain
from flexarm_env.chain.model import chain_xml
from flexarm_env.physics import sensing
from tests.support.envs import Array

SEGMENTS, STEP, PERIOD, RUN = 10, 5e-5, 0.02, 0.4  # [s]
SENSORS = '<sensor><accelerometer site="tip"/><gyro site="tip"/></sensor></mujoco>'


def torque(time: float) -> Array:
    """Return a pulse of the motors [N m]. Shape (2,)."""
    return np.array([60.0, -15.0]) * np.sin(np.pi * time / RUN) ** 2


def reading_of(arm: FlexibleArm, state: Array, tau: Array) -> list[float]:
    """Return what an IMU at the tip reads of our arm. Shape (3,)."""
    length = arm.parameters.link_lengths[1]
    mount = sensing.Mount(2, arm.place(2, length), arm.modes[1].slope(length))
    rates = np.concatenate([state[arm.size :], arm.acceleration(state, tau)])
    (y, v), (_, acceleration) = (np.split(arm.internal_state(each[None])[0], 2) for each in (state, rates))
    return sensing.inertial(arm.constants, mount, sensing.Motion(y, v, acceleration))


def test_the_engines_agree() -> None:
    """Ours of the chain is MuJoCo's to rounding; that of the arm of assumed modes is near, whatever the segments.

    Both see no gravity, which is at right angles to the plane: the chain has none, and MuJoCo's third axis shows 0.
    """
    parameters = ArmParameters()
    arm = FlexibleArm(parameters)
    xml = chain_xml(SEGMENTS, parameters, STEP).replace("</mujoco>", SENSORS)
    chain = Chain(mujoco.MjModel.from_xml_string(xml), parameters)
    tip = chain.point_weights(2, parameters.link_lengths[1])
    start, angles = np.zeros(2 * arm.size), np.zeros(2 * SEGMENTS)
    start[1] = angles[SEGMENTS] = 0.8
    chain.pose(angles, np.zeros(2 * SEGMENTS))
    steps = round(PERIOD / STEP)
    run = arm.simulate(start, lambda time, state: torque(time), RUN, step=PERIOD, substeps=100)
    ours, theirs = [], []
    for n, state in enumerate(run.state[1:]):
        for k in range(steps):
            chain.step(torque((n * steps + k + 0.5) * STEP), 1)
        now = torque((n + 1) * PERIOD)
        chain.data.ctrl[:] = now
        theirs.append(chain.inertial(tip))
        along, across, normal, *rates = chain.data.sensordata
        np.testing.assert_allclose(theirs[-1], [along, across, rates[2]], rtol=1e-9, atol=1e-9)
        assert normal == 0.0
        ours.append(reading_of(arm, state, now))
    difference, size = (np.sqrt(np.mean(np.square(each), axis=0)) for each in (np.subtract(ours, theirs), theirs))
    # 1.0, 1.8 and 0.2 % of their r.m.s., with 10, 20 or 40 segments: three modes a link lack the higher ones
    assert (difference < [0.02, 0.03, 0.004] * size).all()
