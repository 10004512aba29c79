"""The least-squares problem, its solution, and the confidence intervals of the solution."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag
from scipy.optimize import least_squares
from scipy.stats import norm

from flexarm_env.identification.model import (
    LEAST,
    Model,
    check_place,
    checked_delays,
    limits,
    parameter_names,
    value_of,
    with_values,
)
from flexarm_env.identification.recording import Recording
from flexarm_env.parameters import ArmParameters
from flexarm_env.validation import choice, number, shown
from flexarm_env.validation import names as checked_names

Array = NDArray[np.float64]
CONFIDENCE = 0.95
FAR = 1e6  # each residual of an arm that cannot be simulated
ROUNDS = 4  # in which the noise of each channel is estimated anew


class Identified(NamedTuple):
    """What was found.

    Attributes:
        arm: with the fitted parameters.
        values: of what was fitted, by name.
        deviations: standard deviations of these values, by name.
        intervals: their intervals of 95 % confidence, by name.
        noise: r.m.s. residual of each channel, by name [unit of the channel].
        explained: share of each channel's variance that the model explains; 0 where its readings are all equal.
    """

    arm: ArmParameters
    values: dict[str, float]
    deviations: dict[str, float]
    intervals: dict[str, tuple[float, float]]
    noise: dict[str, float]
    explained: dict[str, float]


def identify(
    recordings: Sequence[Recording],
    arm: ArmParameters,
    names: Sequence[str],
    *,
    delay: float = 0.0,
    actuation_delay: float = 0.0,
    sensor_position: float | None = None,
    window: float = 1.0,
) -> Identified:
    """Fit parameters to recordings.

    Args:
        recordings: with equal periods and channels.
        arm: whose other parameters are known; where the search begins. A parameter at 0 begins at 1e-9, one
            at an end of its range just within.
        names: what is fitted, of `parameter_names`.
        delay: of the tip's reading [s]; where the search begins, if it is fitted.
        actuation_delay: from a torque to its effect [s]; likewise.
        sensor_position: of the late sensor on link 2 [m]; None: at the tip.
        window: a record is cut into windows as long as this, each with a first state of its own, so that errors of the
            model do not add up [s].

    Raises:
        TypeError, ValueError: for a bad argument, or parameters that the recordings do not tell apart.
        FloatingPointError: if the arm diverges where the search begins.
    """
    for name in checked_names("names", names):
        choice("names", name, parameter_names())
    if not recordings:
        raise ValueError("recordings: must be one at least")
    known = checked_delays(delay, actuation_delay)
    check_place(arm, sensor_position)
    torque, measured, period = _windows(recordings, window)
    model = Model(names, torque, period, known, sensor_position)
    given = ((name, known[name] if name in known else value_of(arm, name)) for name in names)
    start = np.array([np.clip(max(LEAST, value), *limits(name)) for name, value in given])
    spread = {name: float(np.nanstd(values)) for name, values in measured.items()}
    noise = {name: max(1e-12, 0.01 * one) for name, one in spread.items()}
    unknown = np.concatenate([start, model.first_states(arm, measured).ravel()])
    bounds = np.repeat([[-np.inf], [np.inf]], len(unknown), axis=1)
    bounds[:, : len(names)] = np.transpose([limits(name) for name in names])
    for _ in range(ROUNDS):
        fit = Fit(model, arm, names, measured, noise)
        unknown = least_squares(
            fit.residuals, unknown, fit.jacobian, bounds, x_scale="jac", ftol=1e-7, xtol=1e-10, max_nfev=60
        ).x
        left = fit.left(unknown)
        former, noise = noise, {name: max(1e-12, float(np.sqrt(np.nanmean(r**2)))) for name, r in left.items()}
        if all(abs(noise[name] / former[name] - 1.0) < 0.02 for name in noise):
            break
    return _identified(Fit(model, arm, names, measured, noise), unknown, noise, spread)


def _identified(fit: Fit, unknown: Array, noise: dict[str, float], spread: Mapping[str, float]) -> Identified:
    """Return what a fit found, with deviations, intervals, and the share of the readings' spread that it explains."""
    values, deviation = unknown[: len(fit.names)], _deviations(fit, unknown)
    width = norm.ppf(0.5 + 0.5 * CONFIDENCE) * deviation
    return Identified(
        arm=with_values(fit.arm, dict(zip(fit.names, values, strict=True))),
        values=dict(zip(fit.names, values.tolist(), strict=True)),
        deviations=dict(zip(fit.names, deviation.tolist(), strict=True)),
        intervals={n: (float(v - w), float(v + w)) for n, v, w in zip(fit.names, values, width, strict=True)},
        noise=noise,
        explained={name: 1.0 - (noise[name] / one) ** 2 if one else 0.0 for name, one in spread.items()},
    )


@dataclass(eq=False)
class Fit:
    """The least-squares problem: residuals in units of the noise, by parameters and first states."""

    model: Model
    arm: ArmParameters
    names: Sequence[str]
    measured: Mapping[str, Array]
    noise: Mapping[str, float]
    _latest: tuple[Array, Array, Array] | None = field(default=None, init=False)

    def left(self, unknown: Array) -> dict[str, Array]:
        """Return the residuals of each channel, in its unit. Shape (windows, n, 2).

        Raises:
            ValueError: for a channel whose readings are all older than the windows.
        """
        found = {name: one for name, (one, _) in self.parts(unknown).items()}
        if late := [name for name, one in found.items() if np.isnan(one).all()]:
            raise ValueError(f"window: too short, all readings of {shown(late)} are of earlier instants")
        return found

    def residuals(self, unknown: Array) -> Array:
        """Return residuals in units of the noise: those of the readings, combined to fewer (`_problem`)."""
        return self._problem(unknown)[0]

    def jacobian(self, unknown: Array) -> Array:
        """Return their derivatives by what is unknown."""
        return self._problem(unknown)[1]

    def parts(self, unknown: Array) -> dict[str, tuple[Array, Array]]:
        """Return the residuals of each channel, Shape (windows, n, 2), and their derivatives."""
        values = dict(zip(self.names, unknown[: len(self.names)].tolist(), strict=True))
        states = unknown[len(self.names) :].reshape(len(self.model.torque), -1)
        read, slopes = self.model.readings(with_values(self.arm, values), states, values)
        return {name: (read[name][..., 0] - y, slopes[name]) for name, y in self.measured.items()}

    def _problem(self, unknown: Array) -> tuple[Array, Array]:
        """Return residuals and Jacobian, reduced.

        A QR factorisation of each window's rows leaves as many as there are unknown numbers, and one. Sums of squares
        stay the same, also as functions of what is unknown.
        """
        if self._latest is None or not np.array_equal(self._latest[0], unknown):
            count = len(self.model.torque)
            try:
                found = self.parts(unknown)
            except (FloatingPointError, ValueError):  # an arm that cannot be simulated: the search turns back
                if self._latest is None:
                    raise
                self._latest = unknown.copy(), np.full_like(self._latest[1], FAR), np.zeros_like(self._latest[2])
                return self._latest[1:]
            parts = [
                np.concatenate([slopes, one[..., None]], axis=-1).reshape(count, -1, slopes.shape[-1] + 1)
                / self.noise[name]
                for name, (one, slopes) in found.items()
            ]
            rows = np.concatenate(parts, axis=1)
            rows[~np.isfinite(rows).all(axis=-1)] = 0.0
            short: Array = np.asarray(np.linalg.qr(rows, mode="r"))
            by_value, by_state, residuals = np.split(short, [len(self.names), short.shape[-1] - 1], axis=-1)
            jacobian = np.hstack([np.concatenate(by_value), block_diag(*by_state)])  # windows have states of their own
            self._latest = unknown.copy(), residuals.ravel(), jacobian
        return self._latest[1:]


def _windows(recordings: Sequence[Recording], window: float) -> tuple[Array, dict[str, Array], float]:
    """Cut recordings into windows: torques, readings, Shape (windows, n, 2) each, and the period.

    The last window of a recording has no readings where that has ended.
    """
    first = recordings[0]
    if any(one.channels != first.channels or abs(one.period / first.period - 1.0) > 1e-3 for one in recordings):
        raise ValueError("recordings: must all have the same channels and the same period")
    number("window", window, "s", least=2.0 * first.period)
    size = max(2, round(min(window, *(one.period * len(one.torque) for one in recordings)) / first.period))

    def whole(name: str, missing: float = np.nan) -> Array:
        parts = [getattr(one, name) for one in recordings]
        room = [((0, -len(part) % size), (0, 0)) for part in parts]
        filled = [np.pad(*both, constant_values=missing) for both in zip(parts, room, strict=True)]
        return np.concatenate(filled).reshape(-1, size, 2)

    return whole("torque", 0.0), {name: whole(name) for name in first.channels}, first.period


def _deviations(fit: Fit, unknown: Array) -> Array:
    """Return the standard deviations of the parameters, the first of the unknown numbers. Shape (parameters,).

    Raises:
        ValueError: for parameters that the recordings do not tell apart, or too few readings.
    """
    slopes, names = fit.jacobian(unknown), fit.names
    scale = np.linalg.norm(slopes, axis=0)
    scale[scale == 0.0] = 1.0
    _, size, directions = np.linalg.svd(slopes / scale, full_matrices=False)
    seen = size > 1e-10 * size[0]
    if np.any(np.abs(directions[~seen, : len(names)]) > 1e-6):  # parts of first states may stay unknown
        raise ValueError(f"names = {shown(list(names))}: the recordings do not tell them apart; fit fewer of them")
    deviation = (np.linalg.norm(directions[seen] / size[seen, None], axis=0) / scale)[: len(names)]
    count = sum(np.isfinite(one).sum() for one in fit.left(unknown).values())
    if count <= np.sum(seen):
        raise ValueError(f"recordings: {count} readings for as many unknown numbers, {np.sum(seen)}; must be more")
    # residuals are smaller than the noise, since the fit follows a part of it
    return np.asarray(deviation * np.sqrt(count / (count - np.sum(seen))))
