"""`Plant`: the linear arm from joint torques to a sensor, with its delay; poles, Pade models, files.

Source: Golub & Van Loan, *Matrix computations*, ch. 9 (Pade model of the exponential); Skogestad & Postlethwaite,
*Multivariable feedback control*, 2nd ed. (2005), ch. 4 (state-space models).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import comb, perm
from numbers import Number
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.io import savemat
from scipy.linalg import block_diag

from flexarm_env.analysis.operating_point import OperatingPoint
from flexarm_env.analysis.sensor import Sensor
from flexarm_env.extras import install_hint
from flexarm_env.validation import finite_array, instance, integer, listed, shown
from flexarm_env.validation import names as checked_names

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

MAX_PADE = 12  # beyond that the coefficients of the polynomials span more digits than a double has
JOINTS = ("shoulder", "elbow")


@dataclass(frozen=True, eq=False)
class Plant:
    """``x' = A x + B tau, y(t) = C x(t - delay)``: deviations from an operating point.

    Attributes:
        A: by the state variables of `states`. Shape (n, n); n = 4 + 4 m, and more with motors or a Pade model.
        B: Shape (n, inputs).
        C: Shape (outputs, n).
        D: Shape (outputs, inputs); 0, also with a Pade model: a torque changes no reading at once.
        delays: delays of the outputs [s]. Shape (outputs,).
        inputs: names; torques [N m].
        outputs: names.
        units: units of the outputs.
        sensors: sensors of the outputs, one for each.
        point: where the arm was linearised.
        motors: inputs whose motors lag.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    delays: Array
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    units: tuple[str, ...]
    sensors: tuple[Sensor, ...]
    point: OperatingPoint
    motors: tuple[str, ...] = ()

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the state variables, in their order.

        theta1, theta2 [rad]; the modal coordinates q1_1 ... q1_m of link 1, q2_1 ... q2_m of link 2 [1]; the rates
        of all of these [rad/s, 1/s], theta1_rate ...; then torques of lagging motors; those of a Pade model, pade_1 ...
        """
        modes = self.point.arm.parameters.modes_per_link
        coordinates = ["theta1", "theta2", *(f"q{link}_{i}" for link in (1, 2) for i in range(1, modes + 1))]
        own = [*coordinates, *(f"{name}_rate" for name in coordinates), *(f"{name}_acting" for name in self.motors)]
        return (*own, *(f"pade_{i}" for i in range(1, len(self.A) - len(own) + 1)))

    @property
    def is_square(self) -> bool:
        """As many outputs as inputs."""
        return self.B.shape[1] == self.C.shape[0]

    @property
    def is_mechanical(self) -> bool:
        """The state is the arm's own, coordinates and rates, without motors' or a Pade model's."""
        return len(self.A) == 2 * self.point.arm.size

    def select(self, inputs: Sequence[str] | None = None, outputs: Sequence[str] | None = None) -> Plant:
        """Select some inputs and outputs.

        Args:
            inputs: list of names; None: all.
            outputs: list of names; None: all.

        Raises:
            TypeError: for what is no list, as a single name.
            ValueError: for an unknown name, or none.
        """
        rows = _indices("outputs", self.outputs, outputs)
        columns = _indices("inputs", self.inputs, inputs)
        return replace(
            self,
            B=self.B[:, columns],
            C=self.C[rows],
            D=self.D[np.ix_(rows, columns)],
            delays=self.delays[rows],
            inputs=tuple(self.inputs[i] for i in columns),
            outputs=tuple(self.outputs[i] for i in rows),
            units=tuple(self.units[i] for i in rows),
            sensors=tuple(self.sensors[i] for i in rows),
        )

    def driven_through(self, matrix: ArrayLike, names: Sequence[str]) -> Plant:
        """Put an input map before the plant: ``tau = matrix u``.

        Args:
            matrix: e.g. the transposed Jacobian of the paper's law (10). Shape (inputs, k).
            names: names of the new inputs, k.
        """
        inputs = checked_names("names", names)
        through = finite_array("matrix", matrix, (self.B.shape[1], len(inputs)))
        return replace(self, B=self.B @ through, D=self.D @ through, inputs=inputs)

    def at(self, s: complex) -> Complex:
        """Return the transfer matrix at a complex frequency [rad/s], delay included. Shape (outputs, inputs).

        Raises:
            ValueError: for a frequency that is not finite, or that of a pole.
        """
        if isinstance(s, bool) or not isinstance(s, Number):
            raise TypeError(f"s = {shown(s)}: must be a finite complex number [rad/s]")
        if not np.isfinite(complex(s)):
            raise ValueError(f"s = {shown(s)}: must be a finite complex number [rad/s]")
        try:
            solution = np.linalg.solve(s * np.eye(len(self.A)) - self.A, self.B)
        except np.linalg.LinAlgError:
            solution = np.full_like(self.B, np.inf)
        if not np.all(np.isfinite(solution)):
            raise ValueError(
                f"s = {shown(s)} rad/s: is a pole of the arm at {self.point}, where the response is infinite; the "
                "resting arm has four at 0"
            )
        return np.asarray(np.exp(-s * self.delays)[:, None] * (self.C @ solution + self.D))

    def pade(self, order: int) -> Plant:
        """Replace each delay by its diagonal Pade model, of numerator and denominator of an order from 1 to 12."""
        integer("order", order, 1, MAX_PADE)
        blocks = (_pade(float(delay), order) for delay in self.delays)
        late = [block_diag(*part) for part in zip(*blocks, strict=True)]
        size = len(self.A)
        total = size + len(late[0])
        a, b = np.zeros((total, total)), np.zeros((total, self.B.shape[1]))
        a[:size, :size], a[size:, size:] = self.A, late[0]
        a[size:, :size], b[:size], b[size:] = late[1] @ self.C, self.B, late[1] @ self.D
        c = np.hstack([late[3] @ self.C, late[2]])
        return replace(self, A=a, B=b, C=c, D=late[3] @ self.D, delays=np.zeros_like(self.delays))

    def to_control(self, pade_order: int | None = None) -> Any:
        """Convert to a `control.StateSpace`, for python-control.

        Args:
            pade_order: order of the delay's model; needed when there is a delay.

        Raises:
            ImportError: if python-control is not installed, naming the extra that brings it.
            ValueError: for a delay without an order.
        """
        try:
            import control
        except ImportError as error:
            raise ImportError(install_hint("python-control", "analysis")) from error
        plant = self
        if np.any(self.delays):
            if pade_order is None:
                raise ValueError(f"pade_order = None: the outputs are late by {self.delays.tolist()} s; give an order")
            plant = self.pade(pade_order)
        names = {"inputs": list(plant.inputs), "outputs": list(plant.outputs), "states": list(plant.states)}
        return control.ss(plant.A, plant.B, plant.C, plant.D, name="arm", **names)

    def to_mat(self, path: str | Path) -> None:
        """Write a MATLAB file with A, B, C, D, `delays`, and names: of states, inputs, outputs, units.

        In MATLAB: ``s = load("arm.mat"); G = ss(s.A, s.B, s.C, s.D, "OutputDelay", s.delays, "InputName", s.inputs)``.
        """
        numbers = {name: getattr(self, name) for name in ("A", "B", "C", "D")} | {"delays": self.delays[:, None]}
        names = {name: np.array(getattr(self, name), object) for name in ("states", "inputs", "outputs", "units")}
        savemat(path, numbers | names, oned_as="column")


def linear_plant(point: OperatingPoint, *sensors: Sensor) -> Plant:
    """Linearise the arm at a point, from both joints' torques to one sensor or several.

    Args:
        point: see `OperatingPoint`; about one that is no equilibrium the linearisation holds only while the state
            hardly moves.
        *sensors: their outputs, one after the other. Names that two of them share are completed by the sensor, "x of
            true point of link 2 at its tip", and by the delay where nothing else differs.

    Raises:
        ValueError: for no sensor, one off its link, or one twice.
    """
    instance("point", point, OperatingPoint)
    if not sensors:
        raise ValueError("sensors: there must be at least one")
    for sensor in sensors:
        instance("sensor", sensor, Sensor)
    matrices = [sensor.matrix(point) for sensor in sensors]
    linear = point.linearisation
    c = np.vstack(matrices)
    return Plant(
        A=linear.A,
        B=linear.B,
        C=c,
        D=np.zeros((len(c), 2)),
        delays=np.concatenate([np.full(len(m), s.delay) for s, m in zip(sensors, matrices, strict=True)]),
        inputs=JOINTS,
        outputs=_names(sensors),
        units=tuple(sensor.unit for sensor in _each(sensors)),
        sensors=tuple(_each(sensors)),
        point=point,
    )


def behind_motors(plant: Plant, time_constants: ArrayLike) -> Plant:
    """Put motors that lag by first order before a plant: ``T tau' = u - tau``.

    Args:
        plant: with the arm's own state.
        time_constants: T of each input; 0: an ideal motor [s]. Shape (inputs,).

    Raises:
        ValueError: for a negative one, or a plant that has motors or a Pade model already.
    """
    times = finite_array("time_constants", time_constants, (plant.B.shape[1],))
    if times.min() < 0.0 or not plant.is_mechanical:
        raise ValueError(f"time_constants = {times.tolist()} s: must be at least 0, and given once, before `pade`")
    lag = np.flatnonzero(times)
    a = np.block([[plant.A, plant.B[:, lag]], [np.zeros((len(lag), len(plant.A))), -np.diag(1.0 / times[lag])]])
    b = np.vstack([plant.B * (times == 0.0), np.eye(len(times))[lag] / times[lag, None]])
    c = np.pad(plant.C, ((0, 0), (0, len(lag))))
    return replace(plant, A=a, B=b, C=c, motors=tuple(plant.inputs[n] for n in lag))


@dataclass(frozen=True, eq=False)
class Poles:
    """Eigenvalues of a plant.

    Attributes:
        values: [rad/s], sorted by magnitude. Shape (n,).
    """

    values: Complex

    @property
    def frequencies(self) -> Array:
        """Magnitudes [rad/s]. Shape (n,)."""
        return np.abs(self.values)

    @property
    def damping_ratios(self) -> Array:
        """-Re / magnitude; 0 for a pole at the origin. Shape (n,)."""
        size = np.abs(self.values)
        return np.divide(-self.values.real, size, out=np.zeros_like(size), where=size > 0.0)


def poles(plant: Plant) -> Poles:
    """Return the poles; a delay has none, its Pade model has."""
    instance("plant", plant, Plant)
    values = np.linalg.eigvals(plant.A).astype(complex)
    return Poles(values[np.lexsort((values.imag, np.round(np.abs(values), 6)))])


def _names(sensors: Sequence[Sensor]) -> tuple[str, ...]:
    for i, sensor in enumerate(sensors):
        if sensor in sensors[:i]:
            raise ValueError(f"sensors: there are two of {sensor!r}; they must differ")
    plain = [name for sensor in sensors for name in sensor.names()]
    placed = [f"{name} of {sensor.place()}" for sensor in sensors for name in sensor.names()]
    late = [f"{name}, {sensor.delay:g} s late" for name, sensor in zip(placed, _each(sensors), strict=True)]
    named = [short if plain.count(short) == 1 else long for short, long in zip(plain, placed, strict=True)]
    return tuple(name if named.count(name) == 1 else longest for name, longest in zip(named, late, strict=True))


def _each(sensors: Sequence[Sensor]) -> list[Sensor]:
    return [sensor for sensor in sensors for _ in sensor.names()]


def _indices(name: str, known: tuple[str, ...], wanted: Sequence[str] | None) -> list[int]:
    if wanted is None:
        return list(range(len(known)))
    given = listed(name, wanted)
    if not given or not all(entry in known for entry in given):
        raise ValueError(f"{name} = {given}: must be some of {list(known)}")
    return [known.index(entry) for entry in given]


def _pade(delay: float, order: int) -> tuple[Array, Array, Array, Array]:
    """Return the state-space form of the (order, order) Pade model of exp(-s delay), in the time unit of the delay."""
    if delay == 0.0:
        return np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.ones((1, 1))
    weight = np.array([comb(order, j) / perm(2 * order, j) for j in range(order + 1)])
    denominator = weight[::-1] / weight[-1]  # monic, highest power of (s delay) first
    numerator = denominator * (-1.0) ** np.arange(order, -1, -1)
    a = np.zeros((order, order))
    a[0], a[1:, :-1] = -denominator[1:], np.eye(order - 1)
    c = (numerator[1:] - numerator[0] * denominator[1:])[None]
    return a / delay, np.eye(order, 1) / delay, c, np.array([[numerator[0]]])
