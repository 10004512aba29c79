"""What the analysis refuses: singular poses, sensors that cannot be held, bad numbers and wrong classes."""

from typing import Any

import numpy as np
import pytest

from flexarm_env import ArmParameters, FlexibleArm, SensorParameters
from flexarm_env.analysis import (
    OperatingPoint,
    Sensor,
    crossing_delays,
    crossing_gains,
    delay_margin,
    delay_roots,
    gain_margin,
    is_stable,
    joint_angles,
    law_loop,
    linear_plant,
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

PAPER = FlexibleArm(ArmParameters.paper())
CORNER = (-6.3, -6.3)
ANALYSES = (delay_margin, gain_margin, is_stable, crossing_delays, crossing_gains, stable_gains, delay_roots)


def bent(arm: FlexibleArm, elbow: float = 1.5) -> OperatingPoint:
    return OperatingPoint.at_angles(arm, (0.3, elbow))


@pytest.mark.parametrize("elbow", [0.0, np.pi, -np.pi])
def test_straight_and_folded_arms_are_refused_with_the_configuration(elbow: float) -> None:
    point = OperatingPoint.at_angles(FlexibleArm(ArmParameters.linear()), (0.7, elbow))
    for sensor in (tip(), rigid_point(), true_point(2.0)):
        with pytest.raises(ValueError, match=r"singular configuration, theta = \(0\.7, "):
            zeros(linear_plant(point, sensor))
    assert len(zeros(linear_plant(point, joint_angles())).values) == 8, "the joints are still there"


@pytest.mark.parametrize("sensor", [true_point(0.0), true_point(link=1), true_point(2.0, 1), rigid_point(0.0)])
def test_points_on_link_1_are_refused_by_name(sensor: Sensor) -> None:
    for elbow in (0.0, 1.0):
        with pytest.raises(ValueError, match=r"^sensor (true|rigid) point of link \d at .*take a point of link 2 past"):
            zeros(linear_plant(bent(FlexibleArm(ArmParameters.linear()), elbow), sensor))
    part = linear_plant(bent(FlexibleArm(ArmParameters.linear())), sensor).select(["shoulder"], ["x"])
    assert len(zeros(part).values) > 0


def test_readings_that_depend_on_one_another_are_refused() -> None:
    plant = linear_plant(bent(FlexibleArm(ArmParameters.linear())), tip(), rigid_point(0.0)).select(
        None, ["x of rigid point of link 2 at 0 m", "y of rigid point of link 2 at 0 m"]
    )
    with pytest.raises(ValueError, match="sensor rigid point of link 2 at 0 m: it moves across link 1 only"):
        zeros(plant)
    twin = linear_plant(bent(FlexibleArm(ArmParameters.linear())), strain(1, 1.0), strain(1, 1.0, delay=0.01))
    with pytest.raises(ValueError, match="their readings depend on one another"):
        zeros(twin)


@pytest.mark.parametrize(
    "arm",
    [FlexibleArm(ArmParameters.linear()), PAPER, FlexibleArm(ArmParameters.linear(modes_per_link=4))],
    ids=["default", "1 mode", "4 modes"],
)
@pytest.mark.parametrize("elbow", [1e-3, 1e-5, 1e-6, 1e-7, 3e-8, 1e-9, 1e-12])
def test_nearly_straight_arms_have_their_double_zero_or_are_refused(arm: FlexibleArm, elbow: float) -> None:
    """It never splits silently: what rounding would split beyond the tolerance is refused."""
    plant = linear_plant(bent(arm, elbow), tip())
    if elbow < 3e-7:
        with pytest.raises(ValueError, match="straight or folded; bend the elbow"):
            zeros(plant)
    else:
        (slowest,) = [(v, n) for v, n in zeros(plant).distinct() if 30.0 < v.real < 45.0]
        assert slowest[1] == 2
        assert slowest[0].imag == 0.0


def test_plants_and_frequencies_are_checked() -> None:
    plant = linear_plant(bent(FlexibleArm(ArmParameters.linear())), tip())
    for call in (zeros, poles, zero_limits, lambda x: zero_directions(x, 1.0)):
        with pytest.raises(TypeError, match="plant = 'x': must be a Plant"):
            call("x")
    with pytest.raises(TypeError, match="s = 'x': must be a finite complex number"):
        zero_directions(plant, "x")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"s = 0 rad/s: is a pole of the arm at theta = \(0\.3, 1\.5\) rad"):
        zero_directions(plant, 0)
    with pytest.raises(ValueError, match=r"s = 1e-300 rad/s: is a pole"):
        plant.at(1e-300)
    with pytest.raises(ValueError, match=r"s = nan: must be a finite"):
        zero_directions(plant, float("nan"))


def test_bad_input_is_refused() -> None:
    with pytest.raises(ValueError, match="gain = 0"):
        law_loop(PAPER, CORNER, SensorParameters(), gain=0.0)
    with pytest.raises(ValueError, match=r"sensor_position = 4\.6"):
        law_loop(PAPER, CORNER, SensorParameters(position=4.6))
    with pytest.raises(ValueError, match=r"reference = \(1\.0, 0\.0\) m.* 4 m away"):
        law_loop(PAPER, (1.0, 0.0), SensorParameters(position=0.5))
    with pytest.raises(ValueError, match=r"the shoulder's must be > 0.*a little more, 1e-05 s"):
        law_loop(PAPER, CORNER, SensorParameters(delay=(0.0, 0.01)))
    with pytest.raises(ValueError, match=r"delay = -1"):
        law_loop(PAPER, CORNER, SensorParameters()).with_delay(-1.0)
    with pytest.raises(ValueError, match=r"longest = 0"):
        crossing_delays(law_loop(PAPER, CORNER, SensorParameters()), 0.0)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: law_loop("x", CORNER, SensorParameters()), "arm = 'x': must be a FlexibleArm"),  # type: ignore[arg-type]
        (lambda: law_loop(PAPER, CORNER, None), "sensor = None: must be a SensorParameters"),  # type: ignore[arg-type]
        (lambda: law_loop(PAPER, CORNER, SensorParameters(), law=3.0), r"law = 3\.0: must be a LawParameters"),  # type: ignore[arg-type]
        *((lambda f=f: f(PAPER), r"loop = FlexibleArm\(.*: must be a LawLoop") for f in ANALYSES),
    ],
)
def test_wrong_classes_are_refused_by_name(call: Any, message: str) -> None:
    with pytest.raises(TypeError, match=message):
        call()
