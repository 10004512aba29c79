"""The filter beside the arm that it models: exact without noise, consistent with it."""

from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chi2

from flexarm_baselines.observers import Estimate, Innovation, KalmanFilter, NoiseModel, Readings
from flexarm_env import ArmParameters, FlexibleArm
from tests.support.refusals import refused

ARM = FlexibleArm(ArmParameters.linear())
PERIOD, STATES = 0.01, 2 * ARM.size
TIPS = np.concatenate([np.abs(link.tip_values) for link in ARM.modes])
JOINTS = [0, 1, ARM.size, ARM.size + 1]
REST = np.zeros(STATES)
REST[1] = 1.0
SMALL = NoiseModel(torque=(0.2, 0.1), start_joint=1e-3, start_mode=1e-3, start_rate=1e-3)


def start_deviations(noise: NoiseModel) -> np.ndarray:
    modes = noise.start_mode / TIPS, noise.start_rate / TIPS
    return np.concatenate([[noise.start_joint] * 2, modes[0], [noise.start_rate] * 2, modes[1]])


def torque_at(k: int) -> np.ndarray:
    return np.array([30.0 * np.sin(0.05 * k), 10.0 * np.sin(0.11 * k)])


class Plant:
    """Arms with the noise that the filter expects, and a sensor that is late by any time."""

    def __init__(self, filter: KalmanFilter, states: np.ndarray, random: np.random.Generator, noisy: float) -> None:
        self.filter, self.states, self.random, self.noisy = filter, states, random, noisy
        self.past = [(states, np.zeros((len(states), 2)))] * 20  # at rest, until now

    def move(self, torque: np.ndarray, **quantities: np.ndarray) -> Readings:
        noise, runs = self.filter.noise, len(self.states)
        drawn = torque + self.noisy * self.random.normal(size=(runs, 2)) * noise.torque
        self.past = [(self.states, drawn), *self.past[:19]]
        self.states = self.filter.arm.step(self.states, drawn, PERIOD, **quantities)
        kicks = self.random.normal(size=(runs, len(TIPS))) * noise.modal_force / TIPS
        self.states[:, ARM.size + 2 :] += self.noisy * kicks
        encoders = self.random.normal(size=(runs, 4)) * ([noise.joint_angle] * 2 + [noise.joint_rate] * 2)
        tip = self.late_tip(quantities) + self.noisy * self.random.normal(size=(runs, 2)) * noise.tip
        return Readings(self.states[:, JOINTS] + self.noisy * encoders, tip)

    def late_tip(self, quantities: dict[str, np.ndarray]) -> np.ndarray:
        """Simulate anew over the part of the period in which the sensor saw the tip."""
        periods = self.filter.delay / PERIOD
        begun = int(np.ceil(periods - 1e-9))  # periods ago
        if begun == 0:
            return np.asarray(ARM.tip(self.states[:, : ARM.size]))
        state, torque = self.past[begun - 1]
        part = PERIOD * (begun - periods)
        if part > 1e-9:
            state = self.filter.arm.step(state, torque, part, step=part / np.ceil(part / 1e-3), **quantities)
        return np.asarray(ARM.tip(state[:, : ARM.size]))


def filtered(
    kalman: KalmanFilter, plant: Plant, periods: int, factor: float = 1.0, **quantities: np.ndarray
) -> Iterator[tuple[Estimate, Innovation]]:
    """Yield the estimate and the innovation of each period; the filter begins at rest."""
    estimate = kalman.start(np.tile(REST, (len(plant.states), 1)))
    for k in range(periods):
        torque = np.tile(factor * torque_at(k), (len(plant.states), 1))
        estimate, innovation = kalman.correct(kalman.predict(estimate, torque), plant.move(torque, **quantities))
        yield estimate, innovation


@settings(max_examples=15)
@given(delay=st.one_of(st.sampled_from([0.0, 0.01, 0.03]), st.floats(1e-3, 0.08)))
def test_without_noise_the_prediction_is_the_plant(delay: float) -> None:
    """Readings late by any fraction of a period leave nothing to correct, but for rounding."""
    kalman = KalmanFilter(ARM, PERIOD, delay)
    plant = Plant(kalman, np.tile(REST, (2, 1)), np.random.default_rng(0), noisy=0.0)
    for _, innovation in filtered(kalman, plant, 15):
        # the encoders are trusted to 1e-4 rad; rounding of 1e-12 is amplified by fast modes over 15 periods
        assert np.abs(innovation.residual).max() < 1e-9


def test_the_filter_is_consistent_where_its_model_is_right() -> None:
    """NIS and NEES average to their degrees of freedom within what 60 runs and a correlation of 10 periods allow."""
    random, runs, periods = np.random.default_rng(1), 60, 100
    kalman = KalmanFilter(ARM, PERIOD, 0.0312, noise=SMALL)
    plant = Plant(kalman, REST + start_deviations(SMALL) * random.normal(size=(runs, STATES)), random, noisy=1.0)
    innovations, errors = [], []
    for estimate, innovation in filtered(kalman, plant, periods):
        error = plant.states - kalman.state(estimate)
        inverse = np.linalg.solve(estimate.covariance[:, :STATES, :STATES], error[..., None])[..., 0]
        innovations.append(innovation.normalised)
        errors.append(np.sum(error * inverse, axis=1))
    for values, degrees, correlated in ((innovations, 6, 1), (errors, STATES, 10)):
        count = runs * periods // correlated
        low, high = chi2.ppf([0.001, 0.999], degrees * count) / count
        assert low < np.mean(values) < high


def test_a_wrong_delay_shows_in_the_innovations() -> None:
    random, runs = np.random.default_rng(2), 20
    right, wrong = (KalmanFilter(ARM, PERIOD, delay, noise=SMALL) for delay in (0.0312, 0.0))
    plant = Plant(right, np.tile(REST, (runs, 1)), random, noisy=1.0)
    assert np.mean([innovation.normalised for _, innovation in filtered(wrong, plant, 60, factor=4.0)]) > 2.0 * 6


def test_payload_and_stiffness_are_estimated_with_the_state() -> None:
    random, runs = np.random.default_rng(3), 8
    kalman = KalmanFilter(ARM, PERIOD, 0.0312, noise=SMALL, quantities={"payload_mass": 0.3, "stiffness": 0.2})
    truth = {"payload_mass": np.linspace(0.1, 0.8, runs), "stiffness": np.linspace(1.2, 0.85, runs)}
    plant = Plant(kalman, np.tile(REST, (runs, 1)), random, noisy=1.0)
    before = kalman.values(kalman.start(plant.states))
    assert (before["payload_mass"] == 0.0).all()
    assert (before["stiffness"] == 1.0).all()
    *_, (estimate, _) = filtered(kalman, plant, 200, **truth)
    found = kalman.values(estimate)
    assert found["payload_mass"] == pytest.approx(truth["payload_mass"], abs=0.03)  # [kg]
    assert found["stiffness"] == pytest.approx(truth["stiffness"], abs=0.03)


def test_missing_readings_correct_nothing() -> None:
    kalman = KalmanFilter(ARM, PERIOD, 0.0312)
    estimate = kalman.predict(kalman.start(np.tile(REST, (3, 1))), np.zeros((3, 2)))
    readings = Readings(estimate.mean[:, JOINTS] + 0.01, np.zeros((3, 2)) + 5.0)
    whole, _ = kalman.correct(estimate, readings)
    readings.tip[1] = np.nan
    readings.joints[2], readings.tip[2] = np.nan, np.nan
    found, innovation = kalman.correct(estimate, readings)
    assert innovation.degrees.tolist() == [6.0, 4.0, 0.0]
    assert np.array_equal(found.mean[0], whole.mean[0])
    assert not np.allclose(found.mean[1], whole.mean[1])
    assert np.array_equal(found.mean[2], estimate.mean[2])
    assert np.allclose(found.covariance[2], estimate.covariance[2], rtol=1e-12, atol=0.0)
    assert innovation.normalised[2] == 0.0


def test_gauges_are_readings_of_the_modes() -> None:
    kalman = KalmanFilter(ARM, PERIOD, 0.0312)
    estimate = kalman.start(np.tile(REST, (1, 1)))
    modes = np.zeros((1, 4 * ARM.parameters.modes_per_link))
    modes[0, 0] = 0.05 / TIPS[0]  # link 1's first mode moves its tip by 5 cm
    readings = Readings(REST[None, JOINTS], np.full((1, 2), np.nan), modes)
    found = kalman.state(kalman.correct(estimate, readings)[0])
    # the start's deviation of 20 mm against the gauge's of 2 mm: a hundredth is left
    assert found[0, 2] == pytest.approx(modes[0, 0] * 100.0 / 101.0, rel=1e-6)


test_refusals = refused(
    (lambda: KalmanFilter(ARM, delay=-1.0), r"delay = -1\.0"),
    (lambda: KalmanFilter(ARM, quantities={"mass_of_payload": 1.0}), "mass_of_payload"),
    (lambda: KalmanFilter(ARM, quantities={"payload_mass": 0.0}), r"payload_mass.* = 0\.0"),
    (lambda: KalmanFilter(ARM, quantities={"stiffness": 0.1}, drift={"stifness": 1.0}), "drift = 'stifness'"),
    (lambda: NoiseModel(tip=0.0), r"tip = 0\.0"),
    (lambda: KalmanFilter(ARM).start(np.zeros((2, 8))), r"state.*\(n, 12\)"),
    (
        lambda: KalmanFilter(ARM).correct(
            KalmanFilter(ARM).start(np.tile(REST, (2, 1))), Readings(np.zeros((1, 4)), np.zeros((1, 2)))
        ),
        r"readings: must have shape \(2, 6\)",
    ),
)
