"""`NMPC`: nonlinear model predictive control in real time, from encoders and the late tip.

Sources: Diehl, Bock and Schloeder, SIAM J. Control and Optimization 43, 2005 (real-time iteration); Mayne, Rawlings,
Rao and Scokaert, *Constrained model predictive control: stability and optimality*, Automatica 36, 2000 (cost-to-go and
local feedback law beyond the horizon); Ljung, IEEE Trans. Automatic Control 24, 1979 (joint estimation of state and
quantities by an extended Kalman filter).
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, ClassVar, Literal

import numpy as np

from flexarm_baselines.along_plans import PlanController, within_half_a_turn
from flexarm_baselines.arrays import Array, Bools, Floats, chosen_rows, is_sound
from flexarm_baselines.controller import Memory, Seen
from flexarm_baselines.observers import GAUGES, SENSORS, Estimate, KalmanFilter, NoiseModel, Readings, fresh
from flexarm_baselines.optimal.laps import DEFLECTION
from flexarm_baselines.optimal.plan import Plan
from flexarm_baselines.predictive.iteration import Instant, RealTimeIteration
from flexarm_baselines.predictive.reference_run import ReferenceRun, previewed
from flexarm_baselines.task import Task
from flexarm_env.physics.constants import ARM_QUANTITIES
from flexarm_env.simulation.arm import FlexibleArm
from flexarm_env.simulation.feedback import Rollout
from flexarm_env.validation import choice, integer, mapping, number, shown

HORIZON = 0.3  # [s]; as good on unknown arms as 0.5, where 0.2 begins to lose some (`scripts.control`, horizon)
STEP = 2e-3  # [s]; of the model's integration
CHANGE_WEIGHT = 0.03  # [m^2], on changes of the torques; with less it steers so hard that late motors shake the arm
UNKNOWN = {"payload_mass": 0.5, "stiffness": 0.2, "delay": 0.02}  # standard deviations at the start [kg], [1], [s]
STAMPED = UNKNOWN | {"delay": 1e-4}  # with time stamps
# Encoders see vibrations of 70 Hz and more that no model integrates well, so that their rates are trusted little.
# Noise on the torques, more than there is, buys robustness to an arm that is not the model.
NOISE = NoiseModel(joint_angle=3e-4, joint_rate=0.1, tip=0.01, torque=(10.0, 4.0))
# For a filter that estimates quantities, too: motors that are late, and vibrations that the model lacks, would else be
# taken for another payload or stiffness.
DOUBTFUL = replace(NOISE, joint_angle=3e-3, joint_rate=1.0)
SOFT = 0.8 * 1.5  # [m]; the softest unknown arm bends to an episode's limit where the model is at this one
REFERENCES = ("plan", "path")


class PredictiveController(PlanController):
    """Real-time iterations about a reference run; subclasses say what is believed of the state.

    Attributes:
        iteration: see `RealTimeIteration`.
        iterations: of each control period.
    """

    def __init__(
        self,
        task: Task,
        plans: Sequence[Plan] | None = None,
        reference: Literal["plan", "path"] = "plan",
        model: FlexibleArm | None = None,
        horizon: float = HORIZON,
        iterations: int = 1,
        change_weight: float = CHANGE_WEIGHT,
        damping: float = 0.0,
        step: float = STEP,
        deflection_limit: float = DEFLECTION,
    ) -> None:
        """Sweep along the reference run.

        Args:
            task: see `Task`.
            plans: plans along the task's reference; None: as `reference` says.
            reference: without plans: "plan" takes the best ones known, which come with the package; "path" makes runs
                of its own from the path alone, by a preview controller.
            model: arm that predicts; None: the task's.
            horizon: [s], a whole number of control periods.
            iterations: of each control period.
            change_weight: weight on changes of the torques, see `TrackingProblem` [m^2].
            damping: see `RealTimeIteration`.
            step: step of the model's integration [s].
            deflection_limit: of the links' tips off their root tangents, a soft constraint [m].

        Raises:
            ValueError: if the payload changes on the way, the horizon is no whole number of control periods, a number
                is out of range, or as in `PlanController`.
        """
        if task.payloads is not None:
            raise ValueError("env: payload_changes: the model that predicts has one payload throughout")
        arm = FlexibleArm(task.arm) if model is None else model
        if choice("reference", reference, REFERENCES) == "path" and plans is None:
            plans = previewed(arm, task.reference, task.torque_limit, task.period)
        super().__init__(task, plans)
        self.check_modes(arm.parameters)
        periods = round(number("horizon", horizon, "s", above=0.0) / task.period)
        if periods < 1 or abs(periods * task.period - horizon) > 1e-9:
            raise ValueError(f"horizon = {horizon!r}: must be a whole number of control periods of {task.period} s")
        self.iterations = integer("iterations", iterations, 1)
        number("deflection_limit", deflection_limit, "m", above=0.0)
        runs = ReferenceRun.along(self.plans, arm, periods, change_weight, deflection_limit)
        number("damping", damping, "m^2", least=0.0)
        number("step", step, "s", above=0.0)
        self.iteration = RealTimeIteration(arm, runs, periods, task.torque_limit, task.period, step, damping)

    # --- what subclasses know ---------------------------------------------------------------------------------------

    @abstractmethod
    def begin(self, seen: Seen, state: Floats) -> Memory:
        """Return what is believed of arms whose episode begins, before their first readings count.

        Args:
            seen: their first observations.
            state: at rest where the encoders say. Shape (n, 4 + 4 m).
        """

    @abstractmethod
    def update(self, seen: Seen, belief: Memory, run: Array) -> tuple[Floats, dict[str, Floats], Memory]:
        """Return states, quantities of the arms by name, and belief, after what has been observed.

        Args:
            seen: the observations.
            belief: of this instant, before them.
            run: places of the arms' runs in `ReferenceRun`. Shape (n,).
        """

    def advance(self, belief: Memory, torque: Floats) -> Memory:
        """Return what is believed of the next instant, after torques that are held until then."""
        return belief

    # --- the controller ---------------------------------------------------------------------------------------------

    def start(self, seen: Seen) -> Memory:
        """Begin on the nearest run."""
        period = self.period_of(seen)
        run = self.nearest(seen["joint_angles"], period)
        prediction = self.iteration.predicted(run, period)
        return (run, np.zeros((len(seen), 2)), *prediction, *self.begin(seen, self.resting(seen, run)))

    def resting(self, seen: Seen, run: Array) -> Floats:
        """Return states at rest where the encoders say, within half a turn of the reference run. Shape (n, 4 + 4 m).

        An arm whose encoders read no numbers is taken to be where the reference run is.
        """
        reference = self.iteration.runs.states[run, self.period_of(seen)]
        state = np.zeros_like(reference)
        state[:, :2] = seen["joint_angles"]
        state[:, :2] = chosen_rows(is_sound(state), state, reference)[:, :2]
        off = state - reference
        return state + within_half_a_turn(off) - off

    def torque(self, seen: Seen, memory: Memory) -> tuple[Floats, Memory]:
        """Improve the arms' predictions, and apply their first torques."""
        run, before, states, torques, *rest = memory
        believed, quantities, belief = self.update(seen, tuple(rest), run)
        believed = chosen_rows(is_sound(believed), believed, states[:, 0])  # without numbers: as predicted
        now = Instant(run, self.period_of(seen), believed, before, quantities)
        prediction = Rollout(states, torques)
        for _ in range(self.iterations):
            prediction = self.iteration.improve(prediction, now)
        torque = prediction.torques[:, 0].copy()
        return torque, (run, torque, *self.iteration.shifted(prediction, now), *self.advance(belief, torque))


class NMPC(PredictiveController):
    """Nonlinear model predictive control of the state that a Kalman filter finds from encoders and the late tip.

    Attributes:
        filter: see `KalmanFilter`.
    """

    blocks: ClassVar[tuple[str, ...]] = (*SENSORS, "lap_phase")

    def __init__(
        self,
        task: Task,
        noise: NoiseModel = NOISE,
        unknown: Mapping[str, float] | None = None,
        drift: float = 0.1,
        **design: Any,
    ) -> None:
        """Design filter and prediction.

        Args:
            task: see `Task`.
            noise: standard deviations that the filter assumes.
            unknown: quantities that the filter estimates with the state, with their standard deviations, e.g.
                `UNKNOWN`; see `KalmanFilter`. The model that predicts has those of the arm, too. None: none.
            drift: see `KalmanFilter`.
            **design: see `PredictiveController`.

        Raises:
            ValueError: if the late sensor does not read where its point is, or as in `PredictiveController`.
        """
        task.check_true_point()
        super().__init__(task, **design)
        arm, unknown = self.iteration.model, mapping("unknown", unknown or {})
        self.filter = KalmanFilter(arm, task.period, task.delay, task.sensor_position, noise, unknown, drift)
        self._stiffest = 0.9 * (arm.longest_step() / self.iteration.step) ** 2

    def begin(self, seen: Seen, state: Floats) -> Memory:
        """Begin the filter's estimate; no tip has been read."""
        return (*self.filter.start(state), np.full((len(seen), 2), np.nan))

    def update(self, seen: Seen, belief: Memory, run: Array) -> tuple[Floats, dict[str, Floats], Memory]:
        """Correct the estimate by the readings; one that lost its numbers begins anew."""
        lost = ~self.filter.is_sound(Estimate(*belief[:2]))
        estimate, tip = self._begun_anew(Estimate(*belief[:2]), lost, seen, run), seen["sensed_position"]
        joints = np.concatenate([seen["joint_angles"], seen["joint_rates"]], axis=1)
        expected = self.filter.state(estimate)[:, :2]
        joints[:, :2] = expected + within_half_a_turn(joints[:, :2] - expected)
        reads_gauges = "modal_coordinates" in self.blocks
        gauges = np.concatenate([seen[name] for name in GAUGES], axis=1) if reads_gauges else None
        with np.errstate(over="ignore", invalid="ignore"):
            estimate, _ = self.filter.correct(estimate, Readings(joints, fresh(tip, belief[2]), gauges))
        estimate = self._begun_anew(estimate, lost | ~self.filter.is_sound(estimate), seen, run)
        values = {name: value for name, value in self.filter.values(estimate).items() if name in ARM_QUANTITIES}
        if "stiffness" in values:
            values["stiffness"] = np.minimum(values["stiffness"], self._stiffest)
        return self.filter.state(estimate), values, (*estimate, tip)

    def _begun_anew(self, estimate: Estimate, lost: Bools, seen: Seen, run: Array) -> Estimate:
        """Return estimates of which those that are lost are those of arms at rest."""
        if not lost.any():
            return estimate
        again = self.filter.start(self.resting(seen, run))
        return Estimate(*(chosen_rows(lost, begun, part) for begun, part in zip(again, estimate, strict=True)))

    def advance(self, belief: Memory, torque: Floats) -> Memory:
        """Predict the estimate of the next instant."""
        with np.errstate(over="ignore", invalid="ignore"):  # `update` begins an estimate anew that lost its numbers
            return (*self.filter.predict(Estimate(*belief[:2]), torque), *belief[2:])


class GaugedNMPC(NMPC):
    """`NMPC` that reads strain gauges, too."""

    blocks: ClassVar[tuple[str, ...]] = (*SENSORS, *GAUGES, "lap_phase")


class StampedNMPC(NMPC):
    """`NMPC` that reads time stamps: they replace the delay, which must be one of the `unknown` quantities."""

    blocks: ClassVar[tuple[str, ...]] = (*SENSORS, "lap_phase", "reading_age")

    def __init__(self, task: Task, unknown: Mapping[str, float], **design: Any) -> None:
        """Design filter and prediction.

        Args:
            task: see `Task`.
            unknown: see `NMPC`, with the delay, e.g. `STAMPED`.
            **design: see `NMPC`.

        Raises:
            ValueError: if the delay is not one of the unknown quantities.
        """
        if "delay" not in mapping("unknown", unknown):
            raise ValueError(f"unknown = {shown(unknown)}: must have 'delay', which the time stamps replace")
        super().__init__(task, unknown=unknown, **design)

    def begin(self, seen: Seen, state: Floats) -> Memory:
        """See `NMPC`."""
        return self._told(seen, super().begin(seen, state))

    def update(self, seen: Seen, belief: Memory, run: Array) -> tuple[Floats, dict[str, Floats], Memory]:
        """See `NMPC`."""
        return super().update(seen, self._told(seen, belief), run)

    def _told(self, seen: Seen, belief: Memory) -> Memory:
        """Put the latest reading's age in the place of the estimated delay; see `KalmanFilter.told`."""
        return (*self.filter.told(Estimate(*belief[:2]), delay=seen["reading_age"][:, 0]), *belief[2:])


class StateNMPC(PredictiveController):
    """`NMPC` of the true state, which no sensor delivers: a privileged controller, to compare others with."""

    blocks: ClassVar[tuple[str, ...]] = ("state", "joint_angles", "lap_phase")

    def begin(self, seen: Seen, state: Floats) -> Memory:
        """Keep the whole turns between the reference run's angle of the shoulder and the observed one [rad]."""
        turns = state[:, 0] - seen["joint_angles"][:, 0]
        return (np.where(np.isfinite(turns), turns, 0.0),)

    def update(self, seen: Seen, belief: Memory, run: Array) -> tuple[Floats, dict[str, Floats], Memory]:
        """Return the true state."""
        state = seen["state"]
        state[:, 0] += belief[0]
        return state, {}, belief
