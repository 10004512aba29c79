"""`Plan`: a run that was optimised, with all that it takes to replay and to judge it; saves to and loads from npz."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from flexarm_baselines.arrays import Array, Floats
from flexarm_baselines.optimal.problem import TrackingProblem
from flexarm_baselines.optimal.solver import Iteration, Solution
from flexarm_env.parameters import ArmParameters
from flexarm_env.simulation import archive
from flexarm_env.simulation.arm import FlexibleArm
from flexarm_env.simulation.feedback import Rollout
from flexarm_env.validation import choice, finite_array, instance, mapping, number, pair, shown

PLANS = Path(__file__).resolve().parents[1] / "plans"
_FORMAT = 1
_ARRAYS = ("states", "torques", "reference")
_BY_PERIOD = ("gains", "references", "torque_gains")  # tables of feedback with an entry for each control period


@dataclass(frozen=True, eq=False, repr=False)
class Plan:
    """States and torques of n control periods that an optimisation found.

    Attributes:
        parameters: the arm.
        states: at the start and after each period. Shape (n + 1, 4 + 4 m).
        torques: held over each period [N m]. Shape (n, 2).
        reference: where the tip should be at each instant [m]. Shape (n + 1, 2).
        limits: largest torques of shoulder and elbow [N m].
        period: control period [s].
        step: of the integration [s].
        notes: anything plain (JSON): weights, starts, the solver's log, scores.
        payloads: what the tip carries in each period [kg], NaN: the arm's or the episode's own payload; None: its own
            throughout. A plan with payloads has no file. Shape (n,).
    """

    parameters: ArmParameters
    states: Floats
    torques: Floats
    reference: Floats
    limits: tuple[float, float]
    period: float
    step: float
    notes: dict[str, Any] = field(default_factory=dict)
    payloads: Floats | None = None

    def __post_init__(self) -> None:
        """Check that all fit together."""
        instance("parameters", self.parameters, ArmParameters)
        mapping("notes", self.notes)
        put = object.__setattr__
        put(self, "torques", finite_array("torques", self.torques, (None, 2)))
        count = len(self.torques)
        put(self, "states", finite_array("states", self.states, (count + 1, 4 + 4 * self.parameters.modes_per_link)))
        put(self, "reference", finite_array("reference", self.reference, (count + 1, 2)))
        put(self, "limits", pair("limits", self.limits, "N m", above=0.0))
        number("period", self.period, "s", above=0.0)
        number("step", self.step, "s", above=0.0)
        if self.payloads is not None and np.shape(self.payloads) != (count,):
            raise ValueError(f"payloads: must have shape ({count},), got {np.shape(self.payloads)}")

    def __repr__(self) -> str:
        """Describe the plan in a line."""
        n = len(self.torques)
        return f"{type(self).__name__}({n} periods of {self.period:g} s, limits={self.limits})"

    @classmethod
    def of(cls, problem: TrackingProblem, solution: Solution, **notes: Any) -> Plan:
        """Make a plan of what the solver found; its log goes into the notes, to seven digits."""
        columns = zip(Iteration._fields, zip(*solution.log, strict=True), strict=True)
        log = {name: [float(f"{value:.7g}") for value in values] for name, values in columns}
        weights = {name: getattr(problem, name) for name in ("torque_weight", "change_weight", "deflection_limit")}
        return cls(
            problem.arm.parameters,
            *solution.run,
            problem.reference,
            problem.limits,
            problem.period,
            problem.step,
            {"converged": solution.converged, **weights, **notes, "log": log},
        )

    @cached_property
    def arm(self) -> FlexibleArm:
        """The arm that it is made for."""
        return FlexibleArm(self.parameters)

    @property
    def time(self) -> Floats:
        """Times of the instants [s]. Shape (n + 1,)."""
        return self.period * np.arange(len(self.states), dtype=np.float64)

    def replay(self) -> Rollout:
        """Run its torques from its first state, open loop, on the arm that it is made for."""
        return self.rollout(self.arm, self.states[0], self.torques)

    def rollout(self, arm: FlexibleArm, state: Floats, torques: Floats, **feedback: Any) -> Rollout:
        """Run an arm from a state, with the plan's limits and steps, and with its changes of the payload.

        Args:
            arm: the arm.
            state: Shape (..., 4 + 4 m).
            torques: Shape (n, 2).
            **feedback: gains, references and quantities of `FlexibleArm.rollout`.
        """
        options: dict[str, Any] = {"limits": self.limits, "period": self.period, "step": self.step}
        if self.payloads is None:
            return arm.rollout(state, torques, **options, **feedback)
        mass = feedback.pop("payload_mass", arm.parameters.payload_mass)
        edges = [0, *(np.flatnonzero(np.diff(np.nan_to_num(self.payloads, nan=-1.0))) + 1).tolist(), len(torques)]
        parts: list[Rollout] = []
        for begin, end in pairwise(edges):
            own = {name: x[begin:end] if name in _BY_PERIOD else x for name, x in feedback.items()}
            if parts and "torque_gains" in feedback:
                own["torque_before"] = parts[-1].torques[..., -1, :]
            carried = self.payloads[begin]
            own["payload_mass"] = mass if np.isnan(carried) else carried
            parts.append(arm.rollout(state, torques[begin:end], **options, **own))
            state = parts[-1].states[..., -1, :]  # the rates stay (`flexarm_env.episode.payload`)
        states = [parts[0].states, *(part.states[..., 1:, :] for part in parts[1:])]
        return Rollout(np.concatenate(states, axis=-2), np.concatenate([part.torques for part in parts], axis=-2))

    def carrying(self, quantities: Mapping[str, Any], arm: FlexibleArm) -> dict[str, Any]:
        """Return quantities of an arm in each period, with the payload that it carries then. Shape (n,) or ()."""
        if self.payloads is None:
            return dict(quantities)
        mass = quantities.get("payload_mass", arm.parameters.payload_mass)
        return {**quantities, "payload_mass": np.where(np.isnan(self.payloads), mass, self.payloads)}

    @property
    def own_payload(self) -> Floats:
        """1 in periods in which the payload is the arm's or the episode's, else 0. Shape (n,)."""
        return np.ones(len(self.torques)) if self.payloads is None else np.isnan(self.payloads).astype(float)

    def save(self, path: str | Path, run: bool = True) -> None:
        """Write an npz file: arrays, and the rest as JSON text.

        Args:
            path: path of the file.
            run: write the states; otherwise the first one, from which `load` runs the torques again.

        Raises:
            ValueError: if the plan has payloads.
        """
        if self.payloads is not None:
            raise ValueError("payloads: a plan with changes of the payload has no file")
        head = {
            "parameters": asdict(self.parameters),
            "limits": self.limits,
            "period": self.period,
            "step": self.step,
            "notes": self.notes,
        }
        arrays = {name: getattr(self, name) for name in _ARRAYS}
        archive.write(path, _FORMAT, head, arrays if run else {**arrays, "states": self.states[:1]})

    @classmethod
    def load(cls, path: str | Path) -> Plan:
        """Read a file written by `save`; nothing in it is executed.

        Raises:
            FileNotFoundError: if there is none.
            ValueError: if the file is not such a file, naming it and what is wrong.
        """
        return archive.read(path, _FORMAT, "Plan", _check_entries, cls._from_file)

    @classmethod
    def _from_file(cls, head: dict[str, Any], arrays: dict[str, Array]) -> Plan:
        parameters = ArmParameters(**mapping("parameters", head["parameters"]))
        states, torques, reference = (arrays[name] for name in _ARRAYS)
        given = tuple(head["limits"]), head["period"], head["step"], head["notes"]
        if len(states) > 1 or not len(torques):
            return cls(parameters, states, torques, reference, *given)
        rest = cls(parameters, np.tile(states, (len(torques) + 1, 1)), torques, reference, *given)  # checks its values
        return replace(rest, states=rest.replay().states)


def _check_entries(head: dict[str, Any], entries: Mapping[str, archive.Entry]) -> None:
    for name in entries:
        if name not in _ARRAYS:
            raise ValueError(f"{shown(name)}: no such array; a Plan has {', '.join(_ARRAYS)}")
    for name in _ARRAYS:
        if entries[name].dtype != np.float64:
            raise ValueError(f"{name}: must hold float64, got {entries[name].dtype}")


def plan_names() -> tuple[str, ...]:
    """Return the names of the plans that come with the package."""
    return tuple(sorted(path.stem for path in PLANS.glob("*.npz")))


def plan_task(name: str) -> tuple[ArmParameters, tuple[float, float], float, Floats]:
    """Return arm, limits [N m], period [s] and reference [m] of a plan of the package, without its run."""
    return archive.read(
        PLANS / f"{name}.npz",
        _FORMAT,
        "Plan",
        _check_entries,
        lambda head, own: (
            ArmParameters(**head["parameters"]),
            tuple(head["limits"]),
            head["period"],
            own["reference"],
        ),
    )


def load_plan(name: str) -> Plan:
    """Load a plan that comes with the package, by its name, e.g. "default_swing"."""
    return Plan.load(PLANS / f"{choice('name', name, plan_names())}.npz")
