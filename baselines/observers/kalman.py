"""An extended Kalman filter on what the sensors deliver: encoders, a late tip, and strain gauges where there are any.

The late sensor is handled by augmentation with what it will deliver. A reading that arrives at `t` shows the tip at
`t - delay`, in general within a control period: the filter predicts that very point, by the plant's own equations over
a part of the period, and keeps it, correlated with the state, until the reading arrives. Nothing is interpolated, and
no Pade approximation is needed; the method is fixed-lag augmentation (Anderson and Moore, Optimal Filtering, 1979,
section 7.3) with a fractional lag.

Quantities that are not known, the arm's payload or stiffness or the sensor's delay, may be estimated with the state
(joint estimation: Ljung, IEEE Trans. Automatic Control 24, 1979).

All arrays have a leading axis over n arms.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from flexarm_baselines.arrays import Bools, Floats, chosen_rows, is_sound, product
from flexarm_baselines.observers.noise import NoiseModel
from flexarm_baselines.observers.readings import Readings
from flexarm_env.physics.constants import ARM_QUANTITIES
from flexarm_env.simulation.arm import FlexibleArm
from flexarm_env.validation import choice, number

OF_THE_ARM = tuple(ARM_QUANTITIES)  # columns of `StepJacobians.by_quantity`
ESTIMABLE = (*OF_THE_ARM, "delay")
# Estimates are clipped to these; a plant that differs from the model in other ways would else drive them farther.
RANGES = {"payload_mass": (0.0, 1.5), "stiffness": (0.7, 1.4), "damping": (0.0, 0.1), "delay": (0.0, 0.15)}
SUBSTEP = 1e-3  # [s]; longest integration step over a part of a period


class Estimate(NamedTuple):
    """Estimates of the states of n arms.

    Attributes:
        mean: state; estimated quantities; the tip's points that the late sensor has still to deliver, the newest first.
            Shape (n, d).
        covariance: Shape (n, d, d).
    """

    mean: Floats
    covariance: Floats


class Transition(NamedTuple):
    """A control period, linearised about states and torques; z is an `Estimate`'s mean.

    Attributes:
        state: after it. Shape (n, 4 + 4 m).
        seen: point of the tip that the late sensor has seen at its end, or within it [m]. Shape (n, 2).
        matrix: derivatives of the next z by z. Shape (n, d, d).
        by_torque: derivatives of the next z by the held torques. Shape (n, d, 2).
    """

    state: Floats
    seen: Floats
    matrix: Floats
    by_torque: Floats


class Innovation(NamedTuple):
    """How the readings differed from the prediction, for tests of consistency.

    Attributes:
        residual: readings minus prediction, 0 where a reading is missing. Shape (n, r).
        covariance: that the filter expects; the unit matrix where readings are missing. Shape (n, r, r).
        degrees: how many readings were there. Shape (n,).
    """

    residual: Floats
    covariance: Floats
    degrees: Floats

    @property
    def normalised(self) -> Floats:
        """Normalised innovation squared (NIS): chi-square of `degrees` degrees if the model is right. Shape (n,)."""
        return np.einsum("ni,ni->n", self.residual, np.linalg.solve(self.covariance, self.residual[..., None])[..., 0])


class KalmanFilter:
    """The extended Kalman filter of an arm whose tip's readings are late.

    Attributes:
        arm: the filter's own model, which may be another than the plant's.
        period: control period [s].
        delay: delay of the late sensor, any fraction of periods [s].
        sensor_position: distance of the late sensor from the elbow along link 2 [m]; None: at the tip.
        noise: standard deviations that the filter assumes.
        quantities: names of the quantities that are estimated with the state.
        size: length of an estimate's mean, d.
    """

    def __init__(
        self,
        arm: FlexibleArm,
        period: float = 0.01,
        delay: float = 0.0,
        sensor_position: float | None = None,
        noise: NoiseModel | None = None,
        quantities: Mapping[str, float] | None = None,
        drift: float | Mapping[str, float] = 0.1,
    ) -> None:
        """Prepare the filter.

        Args:
            arm: the model.
            period: control period [s].
            delay: delay of the late sensor [s].
            sensor_position: distance of the late sensor from the elbow along link 2 [m]; None: at the tip.
            noise: standard deviations; None: the defaults of `NoiseModel`.
            quantities: quantities to estimate (`payload_mass` [kg], `stiffness`, a factor, `damping`, `delay` [s]),
                with the standard deviation of each at the start.
            drift: how far the estimated quantities may wander in a second, as a share of that deviation, one for all
                or by name, 0 without one. It keeps the filter from settling on what it found while it was far off.
        """
        self.arm, self.noise = arm, noise or NoiseModel()
        self.period = number("period", period, "s", above=0.0)
        self.delay = number("delay", delay, "s", least=0.0)
        self.sensor_position = sensor_position
        given = dict(quantities or {})
        for name in given:
            choice("quantities", name, ESTIMABLE)
        self.quantities = tuple(name for name in ESTIMABLE if name in given)
        self._start_deviations = [number(f"quantities[{name!r}]", given[name], above=0.0) for name in self.quantities]
        shares = dict(drift) if isinstance(drift, Mapping) else dict.fromkeys(self.quantities, drift)
        for name in shares:
            choice("drift", name, self.quantities)
        wandering = [number(f"drift of {name}", shares.get(name, 0.0), least=0.0) for name in self.quantities]
        self._drift = np.sqrt(self.period) * np.array(wandering) * np.array(self._start_deviations)
        whole, part = divmod(self.delay / self.period + 1e-9, 1.0)
        self._lag = int(whole)  # periods for which a point waits
        self._until = self.period * (1.0 - max(part - 1e-9, 0.0))  # of a period, when the point is seen
        self._states = 2 * arm.size
        self._known = self._states + len(self.quantities)
        self.size = self._known + 2 * (self._lag + 1)
        m = arm.parameters.modes_per_link
        self._tips = np.concatenate([np.abs(link.tip_values) for link in arm.modes])  # [m] a unit of each mode
        rates = arm.size
        self._joints = [0, 1, rates, rates + 1]
        self._gauges = [*range(2, 2 + 2 * m), *range(rates + 2, rates + 2 + 2 * m)]
        self._reading = [self.size - 2, self.size - 1]

    # --- the parts of an estimate ----------------------------------------------------------------------------------

    def state(self, estimate: Estimate) -> Floats:
        """Return the estimated states of the arms. Shape (n, 4 + 4 m)."""
        return estimate.mean[:, : self._states]

    def values(self, estimate: Estimate) -> dict[str, Any]:
        """Return the estimated quantities by name. Shape (n,) each."""
        columns = estimate.mean[:, self._states : self._known].T
        return dict(zip(self.quantities, columns, strict=True))

    def told(self, estimate: Estimate, **values: Any) -> Estimate:
        """Put values known from elsewhere, clipped to `RANGES`, in the place of estimated ones. Shape (n,) each."""
        mean = estimate.mean.copy()
        for name, value in values.items():
            mean[:, self._states + self.quantities.index(name)] = np.clip(value, *RANGES[name])
        return Estimate(mean, estimate.covariance)

    @staticmethod
    def is_sound(estimate: Estimate) -> Bools:
        """Say which estimates have numbers that the arm's equations take. Shape (n,)."""
        return is_sound(estimate.mean) & is_sound(estimate.covariance)

    # --- the filter ------------------------------------------------------------------------------------------------

    def start(self, state: Floats, **values: Any) -> Estimate:
        """Begin with arms at rest, which have been so for the delay at least.

        Args:
            state: estimated states. Shape (n, 4 + 4 m).
            **values: estimates of quantities that differ from the filter's own. Shape (n,) each.

        Raises:
            ValueError: if the states have another shape.
        """
        states = np.atleast_2d(np.asarray(state, dtype=np.float64))
        if states.ndim != 2 or states.shape[1] != self._states:
            raise ValueError(f"state: must have shape (n, {self._states}), got {np.shape(state)}")
        runs, noise = len(states), self.noise
        own = {"payload_mass": self.arm.parameters.payload_mass, "stiffness": 1.0}
        own |= {"damping": float(self.arm.changes.own[2]), "delay": self.delay}
        known = np.empty((runs, len(self.quantities)))
        for column, name in enumerate(self.quantities):
            known[:, column] = values.get(name, own[name])
        outputs, slopes = self.arm.output_jacobians(states, self.sensor_position)
        mean = np.concatenate([states, known, np.tile(outputs.sensed[:, :2], (1, self._lag + 1))], axis=1)
        modes = noise.start_mode / self._tips, noise.start_rate / self._tips
        deviations = np.concatenate(
            [[noise.start_joint] * 2, modes[0], [noise.start_rate] * 2, modes[1], self._start_deviations]
        )
        spread = np.zeros((runs, self.size, self._known))
        spread[:, : self._known] = np.diag(deviations)
        points = slopes.sensed[:, :2] @ np.diag(deviations[: self._states])
        spread[:, self._known :, : self._states] = np.tile(points, (1, self._lag + 1, 1))
        return Estimate(mean, spread @ spread.swapaxes(1, 2))

    def linearise(self, state: Floats, torque: Floats, **values: Any) -> Transition:
        """Linearise a control period about states and held torques.

        Args:
            state: at its beginning. Shape (n, 4 + 4 m).
            torque: of shoulder and elbow [N m]. Shape (n, 2).
            **values: quantities that are not the filter's own. Shape (n,) each.
        """
        known = self._known
        later = np.asarray(values.pop("delay", self.delay)) - self.delay
        of_the_arm = [name for name in self.quantities if name in OF_THE_ARM]
        columns, last = [OF_THE_ARM.index(name) for name in of_the_arm], self._states + len(of_the_arm)
        after = self.arm.step_jacobians(state, torque, self.period, **values)
        seen, part = after, self._until
        if part < self.period:
            seen = self.arm.step_jacobians(state, torque, part, step=float(part / np.ceil(part / SUBSTEP)), **values)
        at = chosen_rows(is_sound(seen.state), seen.state, state)  # one without numbers has none in `after`
        outputs, slopes = self.arm.output_jacobians(at, self.sensor_position)
        sensed, velocity = slopes.sensed[:, :2], outputs.sensed[:, 2:4]
        matrix = np.zeros((len(state), self.size, self.size))
        matrix[:, : self._states, : self._states] = after.by_state
        matrix[:, : self._states, self._states : last] = after.by_quantity[..., columns]
        matrix[:, self._states : known, self._states : known] = np.eye(known - self._states)
        matrix[:, known : known + 2, : self._states] = sensed @ seen.by_state
        matrix[:, known : known + 2, self._states : last] = sensed @ seen.by_quantity[..., columns]
        matrix[:, known : known + 2, last:known] = -velocity[..., None]  # a later reading shows an earlier point
        matrix[:, known + 2 :, known:-2] = np.eye(self.size - known - 2)
        by_torque = np.zeros((len(state), self.size, 2))
        by_torque[:, : self._states] = after.by_torque
        by_torque[:, known : known + 2] = sensed @ seen.by_torque
        return Transition(after.state, outputs.sensed[:, :2] - velocity * later[..., None], matrix, by_torque)

    def predict(self, estimate: Estimate, torque: Floats) -> Estimate:
        """Carry estimates over a control period with held torques.

        Args:
            estimate: at its beginning.
            torque: torque of shoulder and elbow [N m]. Shape (n, 2).
        """
        transition = self.linearise(self.state(estimate), torque, **self.values(estimate))
        return Estimate(self.moved(estimate.mean, transition), self.spread(estimate.covariance, transition))

    def moved(self, mean: Floats, transition: Transition) -> Floats:
        """Return the mean at the end of a control period. Shape (n, d).

        Args:
            mean: at its beginning. Shape (n, d).
            transition: from there, see `linearise`.
        """
        known = mean[:, self._states : self._known]
        return np.concatenate([transition.state, known, transition.seen, mean[:, self._known : -2]], axis=1)

    def spread(self, covariance: Floats, transition: Transition) -> Floats:
        """Return the covariance at the end of a control period. Shape (n, d, d).

        Args:
            covariance: at its beginning. Shape (n, d, d).
            transition: see `linearise`.
        """
        forced = transition.by_torque * np.asarray(self.noise.torque)
        after = transition.matrix @ covariance @ transition.matrix.swapaxes(1, 2) + forced @ forced.swapaxes(1, 2)
        modal_rates = np.arange(self.arm.size + 2, self._states)
        after[:, modal_rates, modal_rates] += (self.noise.modal_force / self._tips) ** 2
        drifting = np.arange(self._states, self._known)
        after[:, drifting, drifting] += self._drift**2
        return after

    def correct(self, estimate: Estimate, readings: Readings) -> tuple[Estimate, Innovation]:
        """Use the readings that have arrived; one that is NaN is missing.

        Args:
            estimate: predicted for the instant of the readings.
            readings: readings of the same arms.

        Raises:
            ValueError: if they are of other arms, or not as many as the sensors'.
        """
        parts = [readings.joints, readings.tip, *([] if readings.gauges is None else [readings.gauges])]
        rows, _ = self.sensors(readings.gauges is not None)
        given = np.concatenate([np.asarray(part, dtype=np.float64) for part in parts], axis=1)
        if given.shape != (len(estimate.mean), len(rows)):
            raise ValueError(f"readings: must have shape {(len(estimate.mean), len(rows))} in all, got {given.shape}")
        there = ~np.isnan(given)
        residual = np.where(there, given - estimate.mean[:, rows], 0.0)
        gain, covariance, expected = self.gain(estimate.covariance, there)
        mean = estimate.mean + product(gain, residual)
        for offset, name in enumerate(self.quantities):
            mean[:, self._states + offset] = mean[:, self._states + offset].clip(*RANGES[name])
        return Estimate(mean, covariance), Innovation(residual, expected, there.sum(axis=1).astype(np.float64))

    def sensors(self, gauges: bool = False) -> tuple[list[int], Floats]:
        """Return where an estimate has what is read, in the order of `Readings`, and the readings' standard deviations.

        Args:
            gauges: whether there are strain gauges.
        """
        noise = self.noise
        rows = self._joints + self._reading
        deviations = [noise.joint_angle] * 2 + [noise.joint_rate] * 2 + [noise.tip] * 2
        if gauges:
            rows = rows + self._gauges
            deviations += [*(noise.gauge / self._tips), *(noise.gauge_rate / self._tips)]
        return rows, np.array(deviations)

    def gain(self, covariance: Floats, there: Bools) -> tuple[Floats, Floats, Floats]:
        """Return the gain and the covariances of a correction by readings.

        Args:
            covariance: before it. Shape (n, d, d).
            there: which readings have arrived, with or without those of gauges. Shape (n, r).

        Returns:
            The gain on the residual, Shape (n, d, r), the covariance after the correction, Shape (n, d, d), and that of
            the residual, the unit matrix where readings are missing, Shape (n, r, r).
        """
        rows, deviations = self.sensors(there.shape[1] > len(self._joints) + len(self._reading))
        correlated = covariance[:, :, rows] * there[:, None]
        expected = correlated[:, rows] * there[:, :, None] + np.diag(np.square(deviations)) * there[:, None]
        expected += np.eye(len(rows)) * ~there[:, None]
        gain = np.linalg.solve(expected, correlated.swapaxes(1, 2)).swapaxes(1, 2)
        after = covariance - gain @ correlated.swapaxes(1, 2)
        return gain, 0.5 * (after + after.swapaxes(1, 2)), expected
