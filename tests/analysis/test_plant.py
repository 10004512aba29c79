"""Operating points, sensors, linear plants, natural modes."""

import re
import sys
from dataclasses import replace
from pathlib import Path

import control
import matplotlib.pyplot as plt
import numpy as np
import pytest
import scipy.io
import scipy.linalg

from flexarm_env import ArmParameters, FlexibleArm
from flexarm_env.analysis import (
    OperatingPoint,
    Sensor,
    behind_motors,
    bode,
    frequency_response,
    joint_angles,
    linear_plant,
    natural_modes,
    poles,
    rigid_point,
    strain,
    tip,
    true_point,
)
from flexarm_env.extras import install_command
from flexarm_env.physics.damping import clamped_ratio

ARM = FlexibleArm(ArmParameters.linear())
RNG = np.random.default_rng(3)


def random_point(moving: bool = True) -> OperatingPoint:
    rates = RNG.uniform(-1, 1, ARM.size) if moving else None
    return OperatingPoint.at_angles(ARM, RNG.uniform(-2, 2, 2), modal=RNG.uniform(-1, 1, ARM.size - 2), rates=rates)


SENSORS = [joint_angles(), strain(1, 0.0), strain(2, 1.3), rigid_point(2.0), true_point(3.1), true_point(2.0, 1), tip()]


def reading(sensor: Sensor, q: np.ndarray) -> np.ndarray:
    """Return what the sensor reads, by the arm's own kinematics."""
    position = 4.5 if sensor.position is None else sensor.position
    if sensor.kind == "joint angles":
        return q[:2]
    if sensor.kind == "strain":
        own = q[2:4] if sensor.link == 1 else q[4:6]
        return np.array([ARM.modes[sensor.link - 1].curvature(position) @ own])
    if sensor.kind == "rigid point":
        one, both = q[0], q[0] + q[1]
        return 4.5 * np.array([np.cos(one), np.sin(one)]) + position * np.array([np.cos(both), np.sin(both)])
    return ARM.position(q, sensor.link, position)


@pytest.mark.parametrize("sensor", SENSORS, ids=lambda s: f"{s.kind} {s.link} {s.position}")
@pytest.mark.parametrize("rate", [False, True])
def test_output_matrix_is_the_derivative_of_the_reading(sensor: Sensor, rate: bool) -> None:
    """Central differences of the reading, or of its rate along the motion."""
    point = random_point()
    sensor = sensor.rates() if rate else sensor

    def read(state: np.ndarray) -> np.ndarray:
        q, v = np.split(state, 2)
        if not rate:
            return reading(sensor, q)
        return (reading(sensor, q + 1e-5 * v) - reading(sensor, q - 1e-5 * v)) / 2e-5

    step = 1e-4
    columns = [(read(point.state + step * e) - read(point.state - step * e)) / (2 * step) for e in np.eye(2 * ARM.size)]
    np.testing.assert_allclose(sensor.matrix(point), np.stack(columns, axis=1), atol=2e-5)


def test_delay_is_exact_in_frequency_and_pade_models_tend_to_it() -> None:
    point = OperatingPoint.at_point(ARM, (-6.3, 6.3))
    prompt, late = (linear_plant(point, tip(delay=d)) for d in (0.0, 0.0312))
    omega = np.array([0.7, 5.0, 20.0, 60.0])
    turned = frequency_response(prompt, omega).values * np.exp(-1j * omega * 0.0312)[:, None, None]
    exact = frequency_response(late, omega)
    np.testing.assert_allclose(exact.values, turned)
    errors = [np.abs(frequency_response(late.pade(n), omega).values - turned).max() for n in (1, 2, 4, 8)]
    assert np.all(np.diff(errors) < 0.0)
    assert errors[-1] < 1e-9 * np.abs(turned).max()
    assert np.all(poles(late.pade(12)).values.real < 1e-4)  # as the arm's own
    assert exact.magnitude.shape == exact.phase.shape == (4, 2, 2)
    assert exact.singular_values.shape == (4, 2)


def test_bode_of_a_late_tip(monkeypatch: pytest.MonkeyPatch) -> None:
    """At each frequency C (jw - A)^-1 B turned by -w T; python-control, which has no delay, has the same magnitudes."""
    late = linear_plant(OperatingPoint.at_point(ARM, (-6.3, 6.3)), tip(delay=0.0312))
    found, figure = bode(late)
    w = found.omega[777]
    by_hand = late.C @ np.linalg.inv(1j * w * np.eye(12) - late.A) @ late.B * np.exp(-1j * w * 0.0312)
    np.testing.assert_allclose(found.values[777], by_hand, rtol=1e-9)
    prompt = replace(late, delays=np.zeros(2)).to_control()
    np.testing.assert_allclose(found.magnitude[::200], np.abs(prompt(1j * found.omega[::200])).transpose(2, 0, 1))
    theirs = control.singular_values_response(prompt, found.omega).magnitude
    np.testing.assert_allclose(found.singular_values.T, np.squeeze(theirs), rtol=1e-6)  # of a ratio to the largest
    turned = found.phase - frequency_response(replace(late, delays=np.zeros(2)), found.omega).phase
    np.testing.assert_allclose(turned, np.tile(-found.omega[:, None, None] * 0.0312, (1, 2, 2)), atol=1e-8)
    for peak in natural_modes(late.point).frequencies[2:4]:  # damping of 1 % moves a peak by less than a step
        near = np.abs(found.omega / peak - 1.0) < 0.1
        top = found.omega[near][found.singular_values[near, 0].argmax()]
        assert top == pytest.approx(peak, rel=2.0 * (found.omega[1] / found.omega[0] - 1.0))
    assert [len(axis.lines) for axis in figure.axes] == [4, 4, 2]
    plt.close(figure)
    monkeypatch.setitem(sys.modules, "matplotlib.pyplot", None)
    assert bode(late, [1.0])[1] is None


def test_the_band_of_a_bode_plot_is_that_of_the_arm() -> None:
    """Neither a motor's pole nor those of a delay's model move it."""
    plant = linear_plant(OperatingPoint.at_point(ARM, (-6.3, 6.3)), tip(delay=0.0312))
    omega = bode(plant)[0].omega
    for other in (behind_motors(plant, (0.5, 1e-4)), plant.pade(8)):
        np.testing.assert_array_equal(bode(other)[0].omega, omega)
    plt.close("all")


def test_the_band_of_a_bode_plot_begins_below_the_first_vibration_of_an_arm_with_friction() -> None:
    """Friction of joints moves two poles away from 0, so that not all of the first four are those of joints."""
    point = OperatingPoint.at_angles(FlexibleArm(ArmParameters.named("quanser")), (0.1, 0.9))
    omega = bode(linear_plant(point, joint_angles()))[0].omega
    vibrations = natural_modes(point).frequencies[2:]
    np.testing.assert_allclose(omega[[0, -1]], [0.05 * vibrations[0], 2.0 * vibrations[-1]])
    plt.close("all")


def test_a_matlab_file_has_the_plant(tmp_path: Path) -> None:
    plant = linear_plant(OperatingPoint.at_point(ARM, (-6.3, 6.3)), tip(delay=0.02))
    plant.to_mat(tmp_path / "arm.mat")
    read = scipy.io.loadmat(tmp_path / "arm.mat")
    system = control.ss(*(read[name] for name in "ABCD"))
    np.testing.assert_array_equal(np.sort_complex(system.poles()), np.sort_complex(poles(plant).values))
    assert read["delays"].tolist() == [[0.02], [0.02]]
    for name in ("states", "inputs", "outputs", "units"):
        assert [cell.item() for cell in read[name].ravel()] == list(getattr(plant, name))


def test_poles_and_natural_modes_agree() -> None:
    point = OperatingPoint.at_angles(ARM, (0.2, 1.1))
    found, modes = poles(linear_plant(point, joint_angles())), natural_modes(point)
    vibrating = found.frequencies > 1.0
    np.testing.assert_allclose(found.frequencies[vibrating][::2], modes.frequencies[2:], rtol=1e-3)
    np.testing.assert_allclose(found.damping_ratios[vibrating][::2], modes.damping_ratios[2:], rtol=1e-2)
    np.testing.assert_allclose(modes.frequencies[:2], 0.0)
    mass = ARM.mass_matrix(point.q)
    np.testing.assert_allclose(modes.shapes @ mass @ modes.shapes.T, np.eye(6), atol=1e-10)


def test_locked_and_folded_arm_vibrates_like_a_cantilever() -> None:
    """With locked joints and an infinitely heavy elbow, link 2 is the clamped-free beam."""
    arm = FlexibleArm(ArmParameters.linear(elbow_mass=1e9, elbow_hub_inertia=1e9))
    modes = natural_modes(OperatingPoint.at_angles(arm, (0.0, 1.0)), "locked")
    cantilever = arm.modes[1].frequencies
    for frequency in cantilever:
        assert np.abs(modes.frequencies - frequency).min() < 1e-3 * frequency
    assert np.all(modes.shapes[:, :2] == 0.0)
    first = modes.shapes[int(np.abs(modes.frequencies - cantilever[0]).argmin())]
    assert np.abs(first[4]) > 100.0 * np.abs(first[5])
    np.testing.assert_allclose(modes.damping_ratios[-2:], clamped_ratio(arm.parameters), rtol=0.05)


def test_natural_modes_need_an_equilibrium() -> None:
    driven = OperatingPoint.at_angles(ARM, (0, 1), torque=(1.0, 0.0))
    points = {"modal coordinates.*rates": random_point(), "modal coordinates": random_point(moving=False), "": driven}
    for told, point in points.items():
        assert not point.is_equilibrium()
        with pytest.raises(ValueError, match=rf"(?s)theta = \(.*{told}.*no equilibrium"):
            natural_modes(point)
    with pytest.raises(ValueError, match="joints = 'loose'"):
        natural_modes(OperatingPoint.at_angles(ARM, (0, 1)), "loose")  # type: ignore[arg-type]


def test_at_point_puts_the_tip_there() -> None:
    for branch, sign in (("positive", 1.0), ("negative", -1.0)):
        point = OperatingPoint.at_point(ARM, (-6.3, 2.0), branch)
        np.testing.assert_allclose(ARM.tip(point.q), (-6.3, 2.0), atol=1e-12)
        assert np.sign(point.q[1]) == sign
        assert point.is_equilibrium()
        assert point.at_rest


def test_select_and_to_control() -> None:
    plant = linear_plant(OperatingPoint.at_angles(ARM, (0, 1)), joint_angles(), strain(2))
    part = plant.select(["elbow"], ["theta2", "curvature of link 2"])
    np.testing.assert_allclose(part.at(2j), plant.at(2j)[1:, 1:])
    system = part.to_control()
    np.testing.assert_allclose(system(2j), part.at(2j), rtol=1e-9)
    assert system.input_labels == ["elbow"]
    late = linear_plant(plant.point, joint_angles(), tip(delay=0.02))
    assert late.delays.tolist() == [0.0, 0.0, 0.02, 0.02]
    assert late.units == ("rad", "rad", "m", "m")
    np.testing.assert_allclose(late.to_control(8)(2j), late.at(2j), rtol=1e-9)
    modes = ARM.parameters.modes_per_link
    coordinates = ["theta1", "theta2", *(f"q{link}_{i}" for link in (1, 2) for i in range(1, modes + 1))]
    assert plant.states == (*coordinates, *(f"{name}_rate" for name in coordinates))
    assert system.state_labels == list(plant.states)
    assert late.to_control(2).state_labels == [*plant.states, *(f"pade_{i}" for i in range(1, 5))]
    with pytest.raises(ValueError, match="pade_order = None"):
        late.to_control()
    with pytest.raises(ValueError, match=r"inputs = \['wrist'\]"):
        plant.select(["wrist"])


def test_without_python_control_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "control", None)
    with pytest.raises(ImportError, match=re.escape(install_command("analysis"))):
        linear_plant(OperatingPoint.at_angles(ARM, (0, 1)), tip()).to_control()


def test_names_that_two_sensors_share_are_told_apart() -> None:
    point = OperatingPoint.at_angles(ARM, (0, 1))
    plant = linear_plant(point, tip(), rigid_point(), tip(delay=0.01), strain(1), strain(1, 2.0), joint_angles())
    assert len(set(plant.outputs)) == len(plant.outputs) == 10
    assert plant.outputs[0] == "x of true point of link 2 at its tip, 0 s late"
    assert plant.outputs[2:4] == ("x of rigid point of link 2 at its tip", "y of rigid point of link 2 at its tip")
    assert plant.outputs[-2:] == ("theta1", "theta2")
    for i, name in enumerate(plant.outputs):
        part = plant.select(outputs=[name])
        np.testing.assert_array_equal(part.C, plant.C[[i]])
        assert part.sensors == (plant.sensors[i],)
    assert linear_plant(point, tip(), strain(2)).outputs == ("x", "y", "curvature of link 2")


@pytest.mark.parametrize("mode_shapes", ["cantilever", "polynomial"])
def test_at_rest_and_straight_the_foreshortened_arm_is_the_linear_one(mode_shapes: str) -> None:
    """Foreshortening is of second order in the deflections."""
    kinds = ("linear", "foreshortened")
    twins = [FlexibleArm(ArmParameters.linear(kinematics=name, mode_shapes=mode_shapes)) for name in kinds]
    rest = [linear_plant(OperatingPoint.at_angles(arm, (0.4, 1.3)), true_point(3.0)) for arm in twins]
    for part in ("A", "B", "C"):
        linear, foreshortened = (getattr(plant, part) for plant in rest)
        np.testing.assert_allclose(foreshortened, linear, rtol=0.0, atol=1e-11 * np.abs(linear).max())
