"""`AdaptiveLQG`: LQG that estimates payload, stiffness, damping, and how late the sensor and the motors are.

Sources: Ljung, IEEE Trans. Automatic Control 24, 1979 (joint estimation of state and parameters); Friedland, IEEE
Trans. Automatic Control 14, 1969 (a filter for the state and one for a constant beside it: how late the motors are);
Magill, IEEE Trans. Automatic Control 10, 1965 (a bank of filters, one for each hypothesis); Morse, Mayne and Goodwin,
IEEE Trans. Automatic Control 37, 1992 (switching between them with hysteresis); Rugh and Shamma, *Research on gain
scheduling*, Automatica 36, 2000.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any, ClassVar, NamedTuple

import numpy as np

from flexarm_baselines.along_plans import PlanController
from flexarm_baselines.arrays import Array, Floats, product
from flexarm_baselines.controller import Memory, Seen
from flexarm_baselines.lqg.controller import LQG, share_of_a_period
from flexarm_baselines.lqg.nodes import PlanNumbers, grid, named
from flexarm_baselines.lqg.tables import FilterTables, Place, RegulatorTables, joined, read_only
from flexarm_baselines.observers import KalmanFilter, NoiseModel
from flexarm_baselines.optimal import GOOD, Plan, RegulatorWeights
from flexarm_baselines.task import Task
from flexarm_env.parameters import ArmParameters
from flexarm_env.simulation.arm import FlexibleArm
from flexarm_env.validation import listed, number, shown

# Encoders are trusted little, and their rates hardly at all: at the first moves the filter would else take fast
# vibrations, which no model has right, for payload.
NOISE = NoiseModel(joint_angle=3e-3, joint_rate=3.0, tip=0.01, torque=(5.0, 2.0), modal_force=3e-4)


class Unknown(NamedTuple):
    """Prior of an estimated quantity.

    Attributes:
        deviation: standard deviation before an episode.
        drift: how far it may wander in a second, as a share of that.
        least: smallest estimate.
        most: largest estimate.
    """

    deviation: float
    drift: float
    least: float
    most: float


ESTIMATED = {
    "payload_mass": Unknown(0.4, 0.2, 0.0, 1.1),  # [kg]
    "stiffness": Unknown(0.15, 0.1, 0.75, 1.35),
    "damping": Unknown(0.003, 0.1, 0.001, 0.03),
    "delay": Unknown(0.02, 0.1, 0.0, 0.08),  # [s]
}
STAMPED = ESTIMATED | {"delay": ESTIMATED["delay"]._replace(deviation=1e-4)}  # with time stamps
LATE = 3e-3  # of the motors, for which regulators are designed [s]
LATENESS = Unknown(3e-3, 0.03, 0.0, 0.01)  # of the motors [s]
OF_THE_ARM = ("payload_mass", "stiffness", "damping")
PAYLOADS = (0.0, 0.25, 0.5, 0.75, 1.0)  # [kg]
CARRIED = (0.2, 0.6, 1.0, 1.5)  # [kg]; where the payload changes on the way
STIFFNESSES = (0.8, 1.0, 1.25)


class Hypothesis(NamedTuple):
    """Initial estimates of a filter of the bank, beside the task's damping and delay.

    Attributes:
        payload_mass: [kg].
        stiffness: factor on that of both links.
        late: how late the motors are [s].
    """

    payload_mass: float
    stiffness: float
    late: float


# The first is believed before anything is read. A filter that begins far off may settle on wrong values: no payload,
# more damping and later motors where the payload is heavy.
HYPOTHESES = (Hypothesis(0.3, 0.9, 4e-3), Hypothesis(0.8, 0.9, 4e-3), Hypothesis(0.0, 1.0, 0.0))
MEMORY = 0.97  # share that is kept from period to period of the doubt, a sum of normalised squared innovations
MARGIN = 10.0  # by which another hypothesis must be less in doubt than the one believed


class Beliefs(NamedTuple):
    """Estimates of the filters of the bank, n arms times h hypotheses.

    Attributes:
        estimate: z of `FilterTables`. Shape (n, h, d), or (n h, d).
        late: how late the motors are [s]. Shape (n, h), or (n h,).
        variance: of that [s^2]. Shape (n, h), or (n h,).
        slope: derivative of the estimate by lateness as a share of the period. Shape (n, h, d), or (n h, d).
    """

    estimate: Floats
    late: Floats
    variance: Floats
    slope: Floats

    def flat(self) -> Beliefs:
        """Return them with one leading axis for arms and hypotheses."""
        return Beliefs(*(part.reshape(-1, *part.shape[2:]) for part in self))

    def by_arm(self, count: int) -> Beliefs:
        """Return them with a leading axis for arms and one for hypotheses."""
        return Beliefs(*(part.reshape(count, -1, *part.shape[1:]) for part in self))


class AdaptiveLQG(LQG):
    """LQG for an arm, a sensor and motors that differ from what is published.

    It has plans, filters and regulators for a grid of payloads and stiffnesses. A filter estimates these with the
    state, damping and the sensor's delay; it uses the tables of the node nearest to its estimates, which account for
    the rest to first order. A second filter estimates how late the motors are. The pairs of a bank begin with different
    values; the arm is driven by the pair whose innovations are smallest, with hysteresis (`least_in_doubt`).

    Equal tasks share a design, which takes long: its arrays are read-only. Unlike `LQG` it has no `kalman`,
    `late` or `integrates`.

    Attributes:
        filter: tables of all nodes of the grid, for each of these those of all plans.
        regulator: likewise.
    """

    quantities: ClassVar[Mapping[str, Unknown]] = ESTIMATED

    def __init__(
        self,
        task: Task,
        plans: Sequence[Plan] | None = None,
        weights: RegulatorWeights = GOOD,
        noise: NoiseModel = NOISE,
        payloads: Sequence[float] | None = None,
        stiffnesses: Sequence[float] = STIFFNESSES,
        late: float | None = None,
    ) -> None:
        """Make plans, filters and regulators for all nodes.

        Args:
            task: see `Task`.
            plans: see `PlanController`.
            weights: of the regulators.
            noise: standard deviations that the filters assume.
            payloads: payloads of the grid [kg]; None: `PAYLOADS`, or `CARRIED` where the payload changes on the way.
            stiffnesses: factors on the links' stiffness of the grid.
            late: delay of the motors for which regulators are designed [s]; None: 3 ms, a period if that is shorter.

        Raises:
            ValueError: see `LQG`; if the grid is empty, a payload below 0, or `late` below 0 or above a control period.
        """
        PlanController.__init__(self, task, plans)
        task.check_true_point()
        self.check_modes(task.arm)
        share_of_a_period(task)  # its model has motors that are late by a period at most
        if payloads is None:
            payloads = PAYLOADS if task.payloads is None else CARRIED
        self._grid = _axis("payloads", payloads, least=0.0), _axis("stiffnesses", stiffnesses, above=0.0)
        numbers = tuple(PlanNumbers.of(plan) for plan in self.plans)
        late = min(LATE, task.period) if late is None else number("late", late, "s", least=0.0, most=task.period)
        design = Design(task.arm, numbers, tuple(self._grid[0]), tuple(self._grid[1]), weights, late / task.period)
        sensor = task.period, task.delay, task.sensor_position
        self.filter = filters(design, *sensor, noise, tuple(self.quantities.items()))
        self.regulator = regulators(design)[1]
        size = self.plans[0].states.shape[1]
        self._quantities = slice(size, size + len(ESTIMATED))
        self._of_the_arm = size + len(OF_THE_ARM)
        self._least, self._most = np.array([(one.least, one.most) for one in ESTIMATED.values()]).T
        self._most[list(ESTIMATED).index("payload_mass")] = max(payloads) + 0.1
        self._most_late = min(LATENESS.most, task.period)  # the model's motors are late by a period at most

    def start(self, seen: Seen) -> Memory:
        """Begin on the nearest plan, with all hypotheses."""
        shape, period = (len(seen), len(HYPOTHESES)), self.period_of(seen)
        chosen = self.nearest(seen["joint_angles"], period)
        estimate = np.repeat(self.filter.nominal[chosen, period].astype(np.float64)[:, None], shape[1], axis=1)
        given = np.array(HYPOTHESES)
        estimate[..., self._quantities.start : self._quantities.start + 2] = given[:, :2]
        late = np.tile(np.minimum(given[:, 2], self._most_late), (shape[0], 1))
        variance = np.full(shape, LATENESS.deviation**2)
        beliefs = Beliefs(estimate, late, variance, np.zeros_like(estimate))
        believed: Array = np.zeros(shape[0], dtype=np.int64)
        nothing = np.zeros((shape[0], 2))
        return (*beliefs, chosen, nothing, np.zeros(shape), believed, np.full_like(nothing, np.nan))

    def torque(self, seen: Seen, memory: Memory) -> tuple[Floats, Memory]:
        """Correct all estimates by the readings, command torques by the best ones, and predict the next estimates."""
        chosen, before, doubt, believed, tip = memory[4:]
        count, bank = doubt.shape
        arms = np.repeat(np.arange(count), bank)
        plans, periods = chosen[arms], self.period_of(seen)[arms]
        readings = self._readings(seen, tip)[arms]
        beliefs, squares = self._corrected(plans, periods, Beliefs(*memory[:4]).flat(), readings)
        doubt = MEMORY * doubt + squares.reshape(count, bank)
        believed = least_in_doubt(doubt, believed)

        at, share = (self._nearest_node(plans, beliefs.estimate), periods), beliefs.late[:, None] / self.task.period
        own = bank * np.arange(count) + believed
        here = at[0][own], at[1][own]
        off = (beliefs.estimate[own] - self.filter.nominal[here])[:, : self._of_the_arm]
        torque = self.limited(self.regulator.torques(here, off, before, share[own], off[:, :0]))
        moves = before[arms], torque[arms], share
        slope = self.filter.by_lateness(at, beliefs.slope, *moves)
        beliefs = beliefs._replace(estimate=self.filter.predict(at, beliefs.estimate, *moves), slope=slope)
        return torque, (*beliefs.by_arm(count), chosen, torque, doubt, believed, seen["sensed_position"])

    def _corrected(self, plans: Array, periods: Array, beliefs: Beliefs, readings: Floats) -> tuple[Beliefs, Floats]:
        """Return flat estimates after the readings, and the normalised squares of the innovations. Shape (n h,)."""
        estimate, late, variance, slope = beliefs
        at, tables = (self._nearest_node(plans, estimate), periods), self.filter
        residual, seen_slope = tables.residual(estimate, readings), slope[:, tables.rows]
        change, variance = self._later(at, residual, seen_slope, late, variance)
        gain, scaled = tables.gain[at], change[:, None] / self.task.period
        estimate = estimate + scaled * slope + product(gain, residual - scaled * seen_slope)
        estimate[:, self._quantities] = estimate[:, self._quantities].clip(self._least, self._most)
        squares = np.sum(residual * product(tables.information[at], residual), axis=1)
        return Beliefs(estimate, late + change, variance, slope - product(gain, seen_slope)), squares

    def _later(
        self, at: Place, residual: Floats, slope: Floats, late: Floats, variance: Floats
    ) -> tuple[Floats, Floats]:
        """Return the error of the motors' estimated delay [s], and the variance of the estimate after it [s^2].

        `slope` is the derivative of the readings' residual by lateness as a share of the period. Shape (n, r).
        """
        period = self.task.period
        weighed = product(self.filter.information[at], slope) / period
        known = 1.0 + variance * np.sum(weighed * slope, axis=1) / period
        change = variance / known * np.sum(weighed * residual, axis=1)
        wandering = (LATENESS.drift * LATENESS.deviation) ** 2 * period
        after = np.minimum(variance / known + wandering, LATENESS.deviation**2)
        return (late + change).clip(LATENESS.least, self._most_late) - late, after

    def _nearest_node(self, chosen: Array, estimate: Floats) -> Array:
        """Return the place of the tables for the nearest payload and stiffness. Shape (n,)."""
        first = self._quantities.start
        payload, stiffness = (
            np.argmin(np.abs(estimate[:, first + n, None] - np.array(values)), axis=1)
            for n, values in enumerate(self._grid)
        )
        return np.asarray((payload * len(self._grid[1]) + stiffness) * len(self.plans) + chosen)


class StampedLQG(AdaptiveLQG):
    """`AdaptiveLQG` that reads time stamps, and so need not estimate the sensor's delay."""

    blocks: ClassVar[tuple[str, ...]] = (*AdaptiveLQG.blocks, "reading_age")
    quantities: ClassVar[Mapping[str, Unknown]] = STAMPED

    def start(self, seen: Seen) -> Memory:
        """See `AdaptiveLQG`."""
        return self._told(seen, super().start(seen))

    def torque(self, seen: Seen, memory: Memory) -> tuple[Floats, Memory]:
        """See `AdaptiveLQG`."""
        return super().torque(seen, self._told(seen, memory))

    def _told(self, seen: Seen, memory: Memory) -> Memory:
        """Put the latest reading's age in the place of the estimated delay, in all hypotheses."""
        estimate, column = memory[0].copy(), list(ESTIMATED).index("delay")
        delay = seen["reading_age"].clip(self._least[column], self._most[column])
        estimate[..., self._quantities.start + column] = delay
        return (estimate, *memory[1:])


def _axis(name: str, given: Sequence[float], **bounds: Any) -> list[float]:
    values = sorted(number(f"{name}[{n}]", value, **bounds) for n, value in enumerate(listed(name, given)))
    if not values:
        raise ValueError(f"{name} = {shown(given)}: must hold a value at least")
    return values


def least_in_doubt(doubt: Floats, believed: Array) -> Array:
    """Return the hypothesis that each arm goes by: another one only if it is clearly less in doubt. Shape (n,).

    Args:
        doubt: Shape (n, h).
        believed: the one so far. Shape (n,).
    """
    arms, least = np.arange(len(doubt)), np.argmin(doubt, axis=1)
    return np.where(doubt[arms, least] < doubt[arms, believed] - MARGIN, least, believed)


# --- the design, once for equal tasks --------------------------------------------------------------------------------


class Design(NamedTuple):
    """What nodes and regulators depend on.

    Attributes:
        arm: see `nodes.grid`.
        plans: likewise.
        payloads: likewise [kg].
        stiffnesses: likewise.
        weights: likewise.
        late: share of a control period after which torques act.
    """

    arm: ArmParameters
    plans: tuple[PlanNumbers, ...]
    payloads: tuple[float, ...]
    stiffnesses: tuple[float, ...]
    weights: RegulatorWeights
    late: float


@lru_cache(maxsize=4)
def regulators(design: Design) -> tuple[list[tuple[Floats, list[Plan]]], RegulatorTables]:
    """Return values and plans of each node, and the regulators of all nodes."""
    arm, found, tables = FlexibleArm(design.arm), [], []
    own = arm, design.payloads, design.stiffnesses, design.weights
    for nodes in zip(*(grid(plan.plan(), *own) for plan in design.plans), strict=True):
        plans = [node.plan for node in nodes]
        problems = [node.problem.with_quantities(OF_THE_ARM) for node in nodes]
        tables.append(RegulatorTables.along(plans, problems, design.late))
        found.append((nodes[0].values, plans))
    return found, read_only(joined(tables))


@lru_cache(maxsize=4)
def filters(
    design: Design,
    period: float,
    delay: float,
    sensor_position: float,
    noise: NoiseModel,
    quantities: tuple[tuple[str, Unknown], ...],
) -> FilterTables:
    """Return the filters of all nodes; see `KalmanFilter`."""
    deviations, drifts = ({name: one[n] for name, one in quantities} for n in (0, 1))
    kalman = KalmanFilter(FlexibleArm(design.arm), period, delay, sensor_position, noise, deviations, drifts)
    nodes, _ = regulators(design)
    return read_only(joined([FilterTables.along(kalman, plans, **named(values)) for values, plans in nodes]))
