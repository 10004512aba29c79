"""Command shaping: references that excite the links' vibration little.

A shaped reference is the reference convolved with a train of impulses that cancel one vibration, and with a window
that rounds its corners. ZV and ZVD: Singer and Seering, *Preshaping command inputs to reduce system vibration*, J. Dyn.
Sys. Meas. Control 112 (1990); EI: Singhose, Seering and Singer, *Residual vibration reduction using vector diagrams*,
J. Mech. Design 116 (1994).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import comb
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import PPoly

from flexarm_baselines.arrays import Floats
from flexarm_env.physics.paths import ReferencePath
from flexarm_env.validation import choice, integer, number

SHAPERS = ("none", "ZV", "ZVD", "EI")
MOST_TIMES = 6  # that a window is applied
TOLERATED = 0.05  # of EI: residual vibration at the modelled frequency, as a share of that of an unshaped step


class Impulses(NamedTuple):
    """A train of impulses whose amplitudes add up to 1.

    Attributes:
        times: [s], from 0 on. Shape (k,).
        amplitudes: Shape (k,).
    """

    times: Floats
    amplitudes: Floats

    @property
    def delay(self) -> float:
        """By how much the train delays what it shapes: its centre of gravity [s]."""
        return float(self.times @ self.amplitudes)


def impulses(shaper: str, frequency: float, damping: float = 0.0) -> Impulses:
    """Return the impulses of a shaper for one vibration.

    Args:
        shaper: "none", "ZV", "ZVD" or "EI" (whose formula neglects damping).
        frequency: frequency of the damped vibration [rad/s].
        damping: its damping ratio, below 1.
    """
    choice("shaper", shaper, SHAPERS)
    half = np.pi / number("frequency", frequency, "rad/s", above=0.0)
    number("damping", damping, least=0.0, most=0.99)
    k = float(np.exp(-np.pi * damping / np.sqrt(1.0 - damping**2)))
    weights = {
        "none": [1.0],
        "ZV": [1.0, k],
        "ZVD": [1.0, 2.0 * k, k * k],
        "EI": [1.0 + TOLERATED, 2.0 * (1.0 - TOLERATED), 1.0 + TOLERATED],
    }[shaper]
    amplitudes = np.array(weights) / np.sum(weights)
    return Impulses(half * np.arange(float(len(weights))), amplitudes)


def residual(train: Impulses, frequency: ArrayLike, damping: float = 0.0) -> Floats:
    """Return the residual vibration that a shaped step leaves, as a share of an unshaped step's (Singer and Seering).

    Args:
        train: impulses.
        frequency: frequency of the damped vibration [rad/s]. Any shape.
        damping: its damping ratio.
    """
    omega = np.asarray(frequency, dtype=np.float64)[..., None]
    decay = damping / np.sqrt(1.0 - damping**2) * omega
    phasors = train.amplitudes * np.exp((decay + 1j * omega) * (train.times - train.times[-1]))
    return np.asarray(np.abs(phasors.sum(axis=-1)))


@dataclass(frozen=True)
class ShapedReference:
    """A reference convolved with impulses and with a window; the lap's path is known, so that the result need not lag.

    Attributes:
        path: the reference; it rests before time 0 and laps follow each other.
        train: impulses.
        window: width of the rectangular window [s]; 0: none.
        lead: by how much the shaped reference is ahead of the causal one [s]; with `centre` the shape is centred on the
            reference, with 0 it leaves its rest when the reference does.
        times: how often the window is applied, 2 to 6: twice makes the acceleration continuous, three times its rate.
    """

    path: ReferencePath
    train: Impulses
    window: float = 0.0
    lead: float = 0.0
    times: int = 2

    def __post_init__(self) -> None:
        """Check the numbers, and that the shape is no wider than a lap."""
        number("window", self.window, "s", least=0.0)
        number("lead", self.lead, "s", least=0.0)
        integer("times", self.times, 2, MOST_TIMES)
        width = self.times * self.window + float(self.train.times[-1])
        if width > self.path.lap_time:
            raise ValueError(
                f"window = {self.window} s: with the impulses the shape is {width} s wide, longer than a lap"
            )

    @property
    def centre(self) -> float:
        """Delay of the causal shape: that of the train, and half the width of all windows [s]."""
        return self.train.delay + 0.5 * self.times * self.window

    def position(self, time: ArrayLike) -> Floats:
        """Return the shaped position [m]. Shape (..., 2)."""
        return self._shaped(time, 0)

    def velocity(self, time: ArrayLike) -> Floats:
        """Return the shaped velocity [m/s]. Shape (..., 2)."""
        return self._shaped(time, 1)

    def acceleration(self, time: ArrayLike) -> Floats:
        """Return the shaped acceleration [m/s^2]; 0 without a window. Shape (..., 2)."""
        return self._shaped(time, 2)

    def _shaped(self, time: ArrayLike, order: int) -> Floats:
        lap, shifted = self.path.lap_time, np.asarray(time, dtype=np.float64) + self.lead
        shifted = np.where(shifted > 2.0 * lap, lap + np.mod(shifted, lap), shifted)  # later laps are as the second one
        moments = shifted[..., None] - self.train.times
        return np.einsum("...ki,k->...i", self._windowed(moments, order), self.train.amplitudes)

    def _windowed(self, time: Floats, order: int) -> Floats:
        """Convolve with the window, as differences of order `times` of the polyline's exact `times`-fold integral."""
        if self.window == 0.0:
            return np.asarray(self._line(time, order))
        integral = self._integral
        terms = [
            (-1.0) ** shift * comb(self.times, shift) * integral(time - shift * self.window, order)
            for shift in range(self.times + 1)
        ]
        return np.asarray(sum(terms) / self.window**self.times)

    @cached_property
    def _line(self) -> PPoly:
        """The polyline over two laps from rest."""
        table, lap = self.path.table, self.path.lap_time
        times = np.concatenate([[-lap], table[:-1, 0], lap + table[:, 0]])
        points = np.concatenate([table[:1, 1:], table[:-1, 1:], table[:, 1:]])
        slopes = np.diff(points, axis=0) / np.diff(times)[:, None]
        return PPoly(np.stack([slopes, points[:-1]]), times)

    @cached_property
    def _integral(self) -> PPoly:
        """The polyline's `times`-fold integral; its constants, which drop out, are chosen so that little is rounded."""
        integral = self._line
        for _ in range(self.times):
            integral = integral.antiderivative()
            integral.c[-1] -= integral(self.path.lap_time)
        return integral
