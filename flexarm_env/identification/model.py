"""Windows of a recording, simulated: what sensors would have read of an arm, and its derivatives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from flexarm_env.allowed import Number, Pair
from flexarm_env.identification.recording import CHANNELS, Recording, played_torques
from flexarm_env.parameters import MAX_DELAY, ArmParameters
from flexarm_env.simulation.arm import FlexibleArm
from flexarm_env.simulation.feedback import step_each
from flexarm_env.simulation.open_loop import LARGEST
from flexarm_env.validation import finite_array, instance, number

Array = NDArray[np.float64]
DELAYS = ("actuation_delay", "delay")
LONGEST_NODE = 2.5e-3  # [s]: late readings are interpolated between instants as near as this
CHANGE = 1e-4  # of a parameter, relative, in its differences
LEAST = 1e-9  # value of a parameter, so that it has a relative change


def parameter_names() -> tuple[str, ...]:
    """Return what can be fitted: continuous fields of `ArmParameters`, of pairs each part, and the delays."""
    names: list[str] = []
    for one in fields(ArmParameters):
        allowed = one.metadata["allowed"]
        if isinstance(allowed, Pair):
            names += [f"{one.name}_1", f"{one.name}_2"]
        elif isinstance(allowed, Number) and one.name != "mode_scale":
            names.append(one.name)
    return (*names, *DELAYS)


def limits(name: str) -> tuple[float, float]:
    """Return the least and the largest value that a parameter is fitted to, with room for differences."""
    if name in DELAYS:
        return 0.1 * LEAST, MAX_DELAY
    (allowed,) = (one.metadata["allowed"] for one in fields(ArmParameters) if one.name == split(name)[0])
    return max(0.1 * LEAST, allowed.least * (1.0 + CHANGE)), allowed.most / (1.0 + CHANGE)


def simulated(
    arm: ArmParameters,
    state: Any,
    torque: Any,
    period: float,
    *,
    delay: float = 0.0,
    actuation_delay: float = 0.0,
    sensor_position: float | None = None,
) -> Recording:
    """Return what sensors without noise read of an arm that begins in a state.

    Args:
        arm: its parameters.
        state: in which it begins. Shape (4 + 4 m,).
        torque: held from each instant to the next [N m]. Shape (n, 2).
        period: between instants [s].
        delay: of the tip's reading [s].
        actuation_delay: from a torque to its effect [s]; the arm is in `state` this long after the first instant, when
            the first torque begins to act. Readings of earlier times are NaN; a channel of such alone is left out.
        sensor_position: see `identify`.

    Raises:
        TypeError, ValueError: for bad input.
        FloatingPointError: if the arm's motion diverges.
    """
    torques, delays = played_torques(torque), checked_delays(delay, actuation_delay)
    number("period", period, "s", above=0.0)
    check_place(arm, sensor_position)
    start = finite_array("state", state, (4 * arm.modes_per_link + 4,), LARGEST)
    read, _ = Model([], torques[None], period, delays, sensor_position).readings(arm, start[None], {})
    channels = {name: read[name][0, ..., 0] for name in CHANNELS}
    return Recording(period, torques, **{name: one for name, one in channels.items() if not np.isnan(one).all()})


def checked_delays(delay: float, actuation_delay: float) -> dict[str, float]:
    """Check the delays [s]; return them by name."""
    given = {"delay": delay, "actuation_delay": actuation_delay}
    return {name: number(name, value, "s", least=0.0, most=MAX_DELAY) for name, value in given.items()}


def check_place(arm: ArmParameters, sensor_position: float | None) -> None:
    """Refuse a sensor that is not on link 2 of an arm."""
    instance("arm", arm, ArmParameters)
    if sensor_position is not None:
        number("sensor_position", sensor_position, "m", least=0.0, most=arm.link_lengths[1])


class Model:
    """Windows under their torques: what sensors read of an arm, and its derivatives."""

    def __init__(
        self,
        names: Sequence[str],
        torque: Array,
        period: float,
        delays: Mapping[str, float],
        sensor_position: float | None,
    ) -> None:
        """Take what all arms have in common; torque: Shape (windows, n, 2)."""
        self.torque, self.period, self._delays, self._place = torque, period, delays, sensor_position
        self._late = any(delays.values()) or any(name in DELAYS for name in names)
        self._nodes = int(np.ceil(period / LONGEST_NODE)) if self._late else 1  # of a period
        self._names = [name for name in names if name not in DELAYS]

    def readings(
        self, arm: ArmParameters, states: Array, values: Mapping[str, float]
    ) -> tuple[dict[str, Array], dict[str, Array]]:
        """Simulate, and read.

        Args:
            arm: its parameters.
            states: in which the windows begin. Shape (windows, size).
            values: of what is fitted, by name.

        Returns:
            Readings by channel, Shape (windows, n, 2, 1), and their derivatives by what is fitted, in the order of
            `values`, and then by the window's first state, Shape (windows, n, 2, names + size). Before a window's
            first late reading they are NaN.

        Raises:
            FloatingPointError: if the motion diverges.
        """
        plain = FlexibleArm(arm)
        moved = {
            name: [FlexibleArm(with_values(arm, {name: values[name] * (1.0 + s)})) for s in (CHANGE, -CHANGE)]
            for name in self._names
        }
        both = [one for pair in moved.values() for one in pair]
        span = self.period / self._nodes
        step = span / int(np.ceil(span / min(1e-3, 0.9 * plain.longest_step()) - 1e-9))
        count, size = states.shape[1], self.torque.shape[1]
        state = states
        slopes = np.zeros((len(states), count, len(self._names) + count))
        slopes[:, :, len(self._names) :] = np.eye(count)
        nodes, gradients = [state], [slopes]
        for k in range((size - 1) * self._nodes):
            torque = self.torque[:, k // self._nodes]
            found = plain.step_jacobians(state, torque, span, step=step)
            slopes = found.by_state @ slopes
            if both:
                ends = step_each(both, state, torque, span, step)
                for n, name in enumerate(self._names):
                    slopes[:, :, n] += (ends[2 * n] - ends[2 * n + 1]) / (2.0 * CHANGE * values[name])
            state = found.state
            if not np.all(np.abs(state) <= LARGEST):
                raise FloatingPointError(f"the arm's motion diverges before {(k + 1) * span:.6g} s")
            nodes.append(state)
            gradients.append(slopes)
        return self._read(plain, moved, values, np.stack(nodes, axis=1), np.stack(gradients, axis=1))

    def _read(
        self,
        plain: FlexibleArm,
        moved: Mapping[str, Sequence[FlexibleArm]],
        values: Mapping[str, float],
        states: Array,
        slopes: Array,
    ) -> tuple[dict[str, Array], dict[str, Array]]:
        read, by_state = self._outputs(plain, states)
        beside = {
            name: [self._outputs(one, states)[0] for one in pair] for name, pair in moved.items()
        }  # an arm's shape, too, decides what is read of a state
        late = {name: values.get(name, known) for name, known in self._delays.items()}
        lateness = {"joint": late["actuation_delay"], "deflection": late["actuation_delay"]}
        lateness["tip"] = late["actuation_delay"] + late["delay"]
        results, derivatives = {}, {}
        for channel in CHANNELS:
            rates = by_state[channel] @ slopes
            for n, name in enumerate(self._names):
                more, less = (one[channel] for one in beside[name])
                rates[..., n] += (more - less) / (2.0 * CHANGE * values[name])
            whole = np.concatenate([read[channel][..., None], rates], axis=-1)
            whole, change = self._at(whole, lateness[channel])
            columns = dict(zip(self._names, np.moveaxis(whole[..., 1:], -1, 0), strict=False))
            columns["actuation_delay"] = -change
            columns["delay"] = -change if channel == "tip" else np.zeros_like(change)
            own = [columns[name][..., None] for name in values]
            results[channel] = whole[..., :1]
            derivatives[channel] = np.concatenate([*own, whole[..., 1 + len(self._names) :]], axis=-1)
        return results, derivatives

    def _at(self, whole: Array, late: float) -> tuple[Array, Array]:
        """Return the values that are read at the instants, `late` seconds old [s], and the readings' rates then."""
        if not self._late:
            return whole, np.zeros(whole.shape[:-1])
        nodes = self.period / self._nodes * np.arange(whole.shape[1])
        spline = CubicSpline(nodes, whole, axis=1)
        times = self.period * np.arange(self.torque.shape[1]) - late
        times[times < -1e-12] = np.nan
        return spline(times), spline(times, 1)[..., 0]

    def _outputs(self, arm: FlexibleArm, states: Array) -> tuple[dict[str, Array], dict[str, Array]]:
        found = arm.output_jacobians(states, self._place)
        values, slopes = ({"joint": o.joints, "deflection": o.deflection, "tip": o.sensed} for o in found)
        return {n: v[..., :2] for n, v in values.items()}, {n: s[..., :2, :] for n, s in slopes.items()}

    def first_states(self, arm: ArmParameters, measured: Mapping[str, Array]) -> Array:
        """Return states that give the windows' first readings and their differences. Shape (windows, size)."""
        plain = FlexibleArm(arm)
        half, few = plain.size, min(5, self.torque.shape[1] - 1)
        state = np.zeros((len(self.torque), 2 * half))
        if "joint" in measured:
            state[:, :2] = np.nan_to_num(measured["joint"][:, 0])
        # Readings are right to a twentieth of a link's length; a shape that they do not determine stays near 0.
        length = float(np.mean(arm.link_lengths))
        bends = np.concatenate([0.05 * length / np.abs(link.tip_values) for link in plain.modes])
        prior = np.diag(np.concatenate([[1e-6, 1e-6], bends**-2]))
        fine = np.concatenate([np.full(2, 1.0 if name == "joint" else length) for name in measured]) / 20.0
        for _ in range(20):
            values, slopes = self._outputs(plain, state)
            rows = np.concatenate([slopes[name][..., :half] for name in measured], axis=1) / fine[:, None]
            first = [np.nan_to_num(y[:, 0] - values[name]) for name, y in measured.items()]
            change = [np.nan_to_num((y[:, few] - y[:, 0]) / (few * self.period)) for y in measured.values()]
            normal = np.swapaxes(rows, 1, 2) @ rows + prior
            for part, given in ((slice(half), first), (slice(half, 2 * half), change)):
                wanted = np.swapaxes(rows, 1, 2) @ (np.concatenate(given, axis=1) / fine)[..., None]
                if part.start is None:  # Newton's step, from where the state is
                    wanted = wanted + (normal - prior) @ state[:, part, None]
                state[:, part] = np.linalg.solve(normal, wanted)[..., 0]
        return state


def split(name: str) -> tuple[str, int | None]:
    """Return the field of a parameter, and its place there, if it is one of two."""
    return (name[:-2], int(name[-1]) - 1) if name[-2:] in ("_1", "_2") else (name, None)


def value_of(arm: ArmParameters, name: str) -> float:
    """Return a parameter of an arm."""
    field, part = split(name)
    value = getattr(arm, field)
    return float(value if part is None else value[part])


def with_values(arm: ArmParameters, values: Mapping[str, float]) -> ArmParameters:
    """Return an arm with other parameters; delays are not the arm's."""
    changes: dict[str, Any] = {}
    for name, value in values.items():
        field, part = split(name)
        if part is not None:
            both = changes.get(field, getattr(arm, field))
            changes[field] = (value, both[1]) if part == 0 else (both[0], value)
        elif name not in DELAYS:
            changes[field] = value
    return replace(arm, **changes)
