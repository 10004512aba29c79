"""What the analysis refuses: singular poses, sensors that cannot be held, bad numbers and wrong classes."""

from typing import Any

import numpy as np
import pytest

import flexarm_env.analysis as fa
from flexarm_env import ArmParameters, FlexibleArm, SensorParameters
from tests.support.refusals import refused

PAPER, LINEAR = FlexibleArm(ArmParameters.paper()), FlexibleArm(ArmParameters.linear())
SHORT = FlexibleArm(ArmParameters.linear(link_lengths=(4.5, 3.0)))
CORNER = (-6.3, -6.3)
ANALYSES = (fa.delay_margin, fa.gain_margin, fa.is_stable, fa.crossing_delays, fa.crossing_gains, fa.stable_gains)


@pytest.mark.parametrize("elbow", [0.0, np.pi, -np.pi])
def test_straight_and_folded_arms_are_refused_with_the_configuration(elbow: float) -> None:
    point = fa.OperatingPoint.at_angles(LINEAR, (0.7, elbow))
    for sensor in (fa.tip(), fa.rigid_point(), fa.true_point(2.0)):
        with pytest.raises(ValueError, match=r"singular configuration, theta = \(0\.7, "):
            fa.zeros(fa.linear_plant(point, sensor))
    assert len(fa.zeros(fa.linear_plant(point, fa.joint_angles())).values) == 8, "the joints are still there"


@pytest.mark.parametrize(
    "sensor", [fa.true_point(0.0), fa.true_point(link=1), fa.true_point(2.0, 1), fa.rigid_point(0.0)]
)
def test_points_on_link_1_are_refused_by_name(sensor: fa.Sensor) -> None:
    for elbow in (0.0, 1.0):
        with pytest.raises(ValueError, match=r"^sensor (true|rigid) point of link \d at .*take a point of link 2 past"):
            fa.zeros(fa.linear_plant(at(0.3, elbow), sensor))
    part = fa.linear_plant(at(0.3, 1.5), sensor).select(["shoulder"], ["x"])
    assert len(fa.zeros(part).values) > 0


def test_readings_that_depend_on_one_another_are_refused() -> None:
    plant = fa.linear_plant(at(0.3, 1.5), fa.tip(), fa.rigid_point(0.0)).select(
        None, ["x of rigid point of link 2 at 0 m", "y of rigid point of link 2 at 0 m"]
    )
    with pytest.raises(ValueError, match="sensor rigid point of link 2 at 0 m: it moves across link 1 only"):
        fa.zeros(plant)
    twin = fa.linear_plant(at(0.3, 1.5), fa.strain(1, 1.0), fa.strain(1, 1.0, delay=0.01))
    with pytest.raises(ValueError, match="their readings depend on one another"):
        fa.zeros(twin)


@pytest.mark.parametrize(
    "arm", [LINEAR, PAPER, FlexibleArm(ArmParameters.linear(modes_per_link=4))], ids=["default", "1 mode", "4 modes"]
)
@pytest.mark.parametrize("elbow", [1e-3, 1e-5, 1e-6, 1e-7, 3e-8, 1e-9, 1e-12])
def test_nearly_straight_arms_have_their_double_zero_or_are_refused(arm: FlexibleArm, elbow: float) -> None:
    """It never splits silently: what rounding would split beyond the tolerance is refused."""
    plant = fa.linear_plant(at(0.3, elbow, arm=arm), fa.tip())
    if elbow < 3e-7:
        with pytest.raises(ValueError, match="straight or folded; bend the elbow"):
            fa.zeros(plant)
    else:
        (slowest,) = [(v, n) for v, n in fa.zeros(plant).distinct() if 30.0 < v.real < 45.0]
        assert slowest[1] == 2
        assert slowest[0].imag == 0.0


def at(*angles: float, arm: FlexibleArm = LINEAR, **more: Any) -> fa.OperatingPoint:
    return fa.OperatingPoint.at_angles(arm, angles, **more)


def plant(*sensors: fa.Sensor) -> fa.Plant:
    return fa.linear_plant(at(0, 1), *(sensors or (fa.tip(),)))


RATES = plant(fa.joint_angles(rate=True))
SENSOR, LATE = SensorParameters(), SensorParameters(delay=(0.0, 0.01))


test_bad_input_is_refused = refused(
    # points
    (lambda: at(0.0), "angles: must have shape"),
    (lambda: at(0.0, np.nan), r"angles\[1\] = nan"),
    (lambda: at(0, 1, modal=(0.0,)), "modal: must have shape"),
    (lambda: fa.OperatingPoint.at_point(LINEAR, (8.0, 6.0)), r"point = \(8\.0, 6\.0\) m.*reach by 1 m"),
    (lambda: fa.OperatingPoint.at_point(SHORT, (0.5, 0.0)), r"point = \(0\.5, 0\.0\) m.*reach by 1 m"),
    # sensors and plants
    (lambda: fa.linear_plant(at(0, 1)), "sensors: there must be at least one"),
    (lambda: plant(fa.true_point(5.0)), "s = 5.0|position = 5.0"),
    (lambda: plant(fa.strain(1, 4.6)), "position = 4.6"),
    (lambda: fa.true_point(-1.0), "position = -1.0"),
    (lambda: fa.tip(delay=-0.1), "delay = -0.1"),
    (lambda: fa.strain(3), "link = 3"),
    (lambda: fa.Sensor("rigid point", 1, 2.0), "link = 1: a rigid point is on link 2"),
    (lambda: fa.Sensor("laser"), "kind = 'laser'"),
    (lambda: plant(fa.tip(), fa.tip()), "sensors: there are two of Sensor"),
    (lambda: plant(fa.tip(delay=0.1)).pade(0), "order = 0"),
    (lambda: fa.link_zeros(LINEAR, 1, 0.0), "position = 0.0"),
    # frequencies
    (lambda: fa.frequency_response(plant(), [0.0, 1.0]), r"s = 0j rad/s: is a pole of the arm at theta = \(0, 1\) rad"),
    (lambda: fa.bode(plant(), [-1.0, 2.0]), r"omega = \[-1\.0, 2\.0\]: must be > 0 and increasing"),
    (lambda: fa.bode(plant(), [2.0, 1.0]), r"omega = \[2\.0, 1\.0\]: must be"),
    (lambda: fa.bode(plant(), []), r"omega = \[\]: must be"),
    (lambda: fa.zero_directions(plant(), 0), r"s = 0 rad/s: is a pole of the arm at theta = \(0, 1\) rad"),
    (lambda: fa.zero_directions(plant(), float("nan")), r"s = nan: must be a finite"),
    (lambda: plant().at(1e-300), r"s = 1e-300 rad/s: is a pole"),
    # zeros and passivity
    (lambda: fa.zeros(plant(fa.strain(1))), r"2 inputs.* and 1 outputs"),
    (lambda: fa.passivity(plant(fa.strain(1)), [1.0]), "2 inputs and 1 outputs"),
    (lambda: fa.passivity(plant(fa.joint_angles()), [1.0]), r"its outputs \['theta1', 'theta2'\] must be rates"),
    (lambda: fa.passivity(RATES, [0.0, 1.0]), r"omega = 0\.0"),
    (lambda: fa.passivity(RATES, [1.0], growth=-1.0), "growth = -1"),
    (lambda: fa.force_to_rate(at(0, 1), fa.joint_angles()), "must be a rigid or true point of link 2"),
    (lambda: fa.force_to_rate(at(0, 1), fa.true_point(1.0, 1)), "must be a rigid or true point of link 2"),
    # the paper's loop
    (lambda: fa.law_loop(PAPER, CORNER, SENSOR, gain=0.0), "gain = 0"),
    (lambda: fa.law_loop(PAPER, CORNER, SensorParameters(position=4.6)), r"sensor_position = 4\.6"),
    (lambda: fa.law_loop(PAPER, (1, 0), SensorParameters(position=0.5)), r"reference = \(1\.0, 0\.0\) m.* 4 m away"),
    (lambda: fa.law_loop(PAPER, CORNER, LATE), r"the shoulder's must be > 0.*a little more, 1e-05 s"),
    (lambda: fa.law_loop(PAPER, CORNER, SENSOR).with_delay(-1.0), r"delay = -1"),
    (lambda: fa.crossing_delays(fa.law_loop(PAPER, CORNER, SENSOR), 0.0), r"longest = 0"),
)


test_wrong_classes_are_refused_by_name = refused(
    (lambda: fa.OperatingPoint.at_angles("arm", (0, 1)), "must be a FlexibleArm"),
    (lambda: fa.linear_plant(LINEAR, fa.tip()), "must be an OperatingPoint"),
    (lambda: plant("tip"), "must be a Sensor"),
    (lambda: fa.natural_modes(LINEAR), r"point = .*must be an OperatingPoint"),
    (lambda: fa.link_zeros("arm", 1, 1.0), "arm = 'arm': must be a FlexibleArm"),
    (lambda: fa.poles(LINEAR), r"plant = .*must be a Plant"),
    *((lambda f=f: f("x"), "plant = 'x': must be a Plant") for f in (fa.zeros, fa.poles, fa.zero_limits)),
    (lambda: fa.zero_directions("x", 1.0), "plant = 'x': must be a Plant"),
    (lambda: fa.passivity("x", [1.0]), "plant = 'x': must be a Plant"),
    (lambda: fa.zero_directions(plant(), "x"), "s = 'x': must be a finite complex number"),
    (lambda: fa.law_loop("x", CORNER, SENSOR), "arm = 'x': must be a FlexibleArm"),
    (lambda: fa.law_loop(PAPER, CORNER, None), "sensor = None: must be a SensorParameters"),
    (lambda: fa.law_loop(PAPER, CORNER, SENSOR, law=3.0), r"law = 3\.0: must be a LawParameters"),
    *((lambda f=f: f(PAPER), r"loop = FlexibleArm\(.*: must be a LawLoop") for f in (*ANALYSES, fa.delay_roots)),
    kind=TypeError,
)
