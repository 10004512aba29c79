"""What the analysis refuses: singular poses, sensors that cannot be held, bad numbers and wrong classes."""

from typing import Any

import numpy as np
import pytest

from flexarm_env import ArmParameters, FlexibleArm, SensorParameters
from flexarm_env.analysis import (
    OperatingPoint,
    Plant,
    Sensor,
    bode,
    crossing_delays,
    crossing_gains,
    delay_margin,
    delay_roots,
    force_to_rate,
    frequency_response,
    gain_margin,
    is_stable,
    joint_angles,
    law_loop,
    linear_plant,
    link_zeros,
    natural_modes,
    passivity,
    poles,
    rigid_point,
    stable_gains,
    strain,
    tip,
    true_point,
    zero_directions,
    zero_limits,
    zeros,
)
from tests.support.refusals import refused

PAPER, LINEAR = FlexibleArm(ArmParameters.paper()), FlexibleArm(ArmParameters.linear())
SHORT = FlexibleArm(ArmParameters.linear(link_lengths=(4.5, 3.0)))
CORNER = (-6.3, -6.3)
ANALYSES = (delay_margin, gain_margin, is_stable, crossing_delays, crossing_gains, stable_gains, delay_roots)


@pytest.mark.parametrize("elbow", [0.0, np.pi, -np.pi])
def test_straight_and_folded_arms_are_refused_with_the_configuration(elbow: float) -> None:
    point = OperatingPoint.at_angles(LINEAR, (0.7, elbow))
    for sensor in (tip(), rigid_point(), true_point(2.0)):
        with pytest.raises(ValueError, match=r"singular configuration, theta = \(0\.7, "):
            zeros(linear_plant(point, sensor))
    assert len(zeros(linear_plant(point, joint_angles())).values) == 8, "the joints are still there"


@pytest.mark.parametrize("sensor", [true_point(0.0), true_point(link=1), true_point(2.0, 1), rigid_point(0.0)])
def test_points_on_link_1_are_refused_by_name(sensor: Sensor) -> None:
    for elbow in (0.0, 1.0):
        with pytest.raises(ValueError, match=r"^sensor (true|rigid) point of link \d at .*take a point of link 2 past"):
            zeros(linear_plant(at(0.3, elbow), sensor))
    part = linear_plant(at(0.3, 1.5), sensor).select(["shoulder"], ["x"])
    assert len(zeros(part).values) > 0


def test_readings_that_depend_on_one_another_are_refused() -> None:
    plant = linear_plant(at(0.3, 1.5), tip(), rigid_point(0.0)).select(
        None, ["x of rigid point of link 2 at 0 m", "y of rigid point of link 2 at 0 m"]
    )
    with pytest.raises(ValueError, match="sensor rigid point of link 2 at 0 m: it moves across link 1 only"):
        zeros(plant)
    twin = linear_plant(at(0.3, 1.5), strain(1, 1.0), strain(1, 1.0, delay=0.01))
    with pytest.raises(ValueError, match="their readings depend on one another"):
        zeros(twin)


@pytest.mark.parametrize(
    "arm",
    [LINEAR, PAPER, FlexibleArm(ArmParameters.linear(modes_per_link=4))],
    ids=["default", "1 mode", "4 modes"],
)
@pytest.mark.parametrize("elbow", [1e-3, 1e-5, 1e-6, 1e-7, 3e-8, 1e-9, 1e-12])
def test_nearly_straight_arms_have_their_double_zero_or_are_refused(arm: FlexibleArm, elbow: float) -> None:
    """It never splits silently: what rounding would split beyond the tolerance is refused."""
    plant = linear_plant(at(0.3, elbow, arm=arm), tip())
    if elbow < 3e-7:
        with pytest.raises(ValueError, match="straight or folded; bend the elbow"):
            zeros(plant)
    else:
        (slowest,) = [(v, n) for v, n in zeros(plant).distinct() if 30.0 < v.real < 45.0]
        assert slowest[1] == 2
        assert slowest[0].imag == 0.0


def at(*angles: float, arm: FlexibleArm = LINEAR, **more: Any) -> OperatingPoint:
    return OperatingPoint.at_angles(arm, angles, **more)


def plant(*sensors: Sensor) -> Plant:
    return linear_plant(at(0, 1), *(sensors or (tip(),)))


RATES = plant(joint_angles(rate=True))
SENSOR, LATE = SensorParameters(), SensorParameters(delay=(0.0, 0.01))


test_bad_input_is_refused = refused(
    # points
    (lambda: at(0.0), "angles: must have shape"),
    (lambda: at(0.0, np.nan), r"angles\[1\] = nan"),
    (lambda: at(0, 1, modal=(0.0,)), "modal: must have shape"),
    (lambda: OperatingPoint.at_point(LINEAR, (8.0, 6.0)), r"point = \(8\.0, 6\.0\) m.*reach by 1 m"),
    (lambda: OperatingPoint.at_point(SHORT, (0.5, 0.0)), r"point = \(0\.5, 0\.0\) m.*reach by 1 m"),
    # sensors and plants
    (lambda: linear_plant(at(0, 1)), "sensors: there must be at least one"),
    (lambda: plant(true_point(5.0)), "s = 5.0|position = 5.0"),
    (lambda: plant(strain(1, 4.6)), "position = 4.6"),
    (lambda: true_point(-1.0), "position = -1.0"),
    (lambda: tip(delay=-0.1), "delay = -0.1"),
    (lambda: strain(3), "link = 3"),
    (lambda: Sensor("rigid point", 1, 2.0), "link = 1: a rigid point is on link 2"),
    (lambda: Sensor("laser"), "kind = 'laser'"),
    (lambda: Sensor("joint angles", 1, 2.0), r"link = 1, position = 2\.0: joint angles have no place"),
    (lambda: plant(tip(), tip()), "sensors: there are two of Sensor"),
    (lambda: plant().select(inputs="shoulder"), "TypeError: inputs = 'shoulder': must be a list or a tuple"),
    (lambda: plant().driven_through(np.eye(2), "uv"), "TypeError: names = 'uv': must be a list or a tuple"),
    (lambda: plant(tip(delay=0.1)).pade(0), "order = 0"),
    (lambda: link_zeros(LINEAR, 1, 0.0), "position = 0.0"),
    # frequencies
    (lambda: frequency_response(plant(), []), r"omega = \[\]: must have one frequency at least"),
    (lambda: frequency_response(plant(), [0.0, 1.0]), r"s = 0j rad/s: is a pole of the arm at theta = \(0, 1\) rad"),
    (lambda: bode(plant(), [-1.0, 2.0]), r"omega = \[-1\.0, 2\.0\]: must be > 0 and increasing"),
    (lambda: bode(plant(), [2.0, 1.0]), r"omega = \[2\.0, 1\.0\]: must be"),
    (lambda: bode(plant(), []), r"omega = \[\]: must be"),
    (lambda: zero_directions(plant(), 0), r"s = 0 rad/s: is a pole of the arm at theta = \(0, 1\) rad"),
    (lambda: zero_directions(plant(), float("nan")), r"s = nan: must be a finite"),
    (lambda: plant().at(1e-300), r"s = 1e-300 rad/s: is a pole"),
    # zeros and passivity
    (lambda: zeros(plant(strain(1))), r"2 inputs.* and 1 outputs"),
    (lambda: passivity(plant(strain(1)), [1.0]), "2 inputs and 1 outputs"),
    (lambda: passivity(plant(joint_angles()), [1.0]), r"its outputs \['theta1', 'theta2'\] must be rates"),
    (lambda: passivity(RATES, [0.0, 1.0]), r"omega = 0\.0"),
    (lambda: passivity(RATES, []), r"omega = \[\]: must have one frequency at least"),
    (lambda: passivity(RATES, [1.0], growth=-1.0), "growth = -1"),
    (lambda: force_to_rate(at(0, 1), joint_angles()), "must be a rigid or true point of link 2"),
    (lambda: force_to_rate(at(0, 1), true_point(1.0, 1)), "must be a rigid or true point of link 2"),
    # the paper's loop
    (lambda: law_loop(PAPER, CORNER, SENSOR, gain=0.0), "gain = 0"),
    (lambda: law_loop(PAPER, CORNER, SensorParameters(position=4.6)), r"sensor_position = 4\.6"),
    (lambda: law_loop(PAPER, (1, 0), SensorParameters(position=0.5)), r"reference = \(1\.0, 0\.0\) m.* 4 m away"),
    (lambda: law_loop(PAPER, CORNER, SensorParameters(position=0.5), elbow_branch="up"), "elbow_branch = 'up'"),
    (lambda: law_loop(PAPER, CORNER, LATE), r"the shoulder's must be > 0.*a little more, 1e-05 s"),
    (lambda: law_loop(PAPER, CORNER, SENSOR).with_delay(-1.0), r"delay = -1"),
    (lambda: crossing_delays(law_loop(PAPER, CORNER, SENSOR), 0.0), r"longest = 0"),
)


test_wrong_classes_are_refused_by_name = refused(
    (lambda: OperatingPoint.at_angles("arm", (0, 1)), "must be a FlexibleArm"),
    (lambda: linear_plant(LINEAR, tip()), "must be an OperatingPoint"),
    (lambda: plant("tip"), "must be a Sensor"),
    (lambda: natural_modes(LINEAR), r"point = .*must be an OperatingPoint"),
    (lambda: link_zeros("arm", 1, 1.0), "arm = 'arm': must be a FlexibleArm"),
    (lambda: poles(LINEAR), r"plant = .*must be a Plant"),
    *((lambda f=f: f("x"), "plant = 'x': must be a Plant") for f in (zeros, poles, zero_limits)),
    (lambda: zero_directions("x", 1.0), "plant = 'x': must be a Plant"),
    (lambda: passivity("x", [1.0]), "plant = 'x': must be a Plant"),
    (lambda: zero_directions(plant(), "x"), "s = 'x': must be a finite complex number"),
    (lambda: law_loop("x", CORNER, SENSOR), "arm = 'x': must be a FlexibleArm"),
    (lambda: law_loop(PAPER, CORNER, None), "sensor = None: must be a SensorParameters"),
    (lambda: law_loop(PAPER, CORNER, SENSOR, law=3.0), r"law = 3\.0: must be a LawParameters"),
    *((lambda f=f: f(PAPER), r"loop = FlexibleArm\(.*: must be a LawLoop") for f in ANALYSES),
    kind=TypeError,
)
