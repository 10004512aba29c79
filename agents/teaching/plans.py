"""Plans for a box of plants: each standard lap, optimised for a grid of payloads and stiffnesses, kept in a folder."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexarm_agents.files import put
from flexarm_baselines.optimal import (
    Plan,
    PlanRegulator,
    RegulatorWeights,
    SolverOptions,
    TrackingProblem,
    lap_problem,
    load_plan,
    optimise,
)
from flexarm_env.laps import LAPS
from flexarm_env.parameters import ArmParameters
from flexarm_env.simulation.arm import FlexibleArm

Floats = NDArray[np.float64]
WEIGHTS = RegulatorWeights(tip=0.03)  # softer than `GOOD`: a student imitates small gains better than large ones
OPTIONS = SolverOptions(iterations=60, tolerance=3e-3)  # from a neighbour's plan; a hundredth of a millimetre is left


class Bank(NamedTuple):
    """Plans and regulators of all plants of a grid, for both laps.

    Attributes:
        payloads: of the grid [kg]. Shape (p,).
        stiffnesses: of the grid, as factors. Shape (s,).
        states: by lap, payload, stiffness. Shape (2, p, s, n + 1, 4 + 4 m).
        torques: [N m]. Shape (2, p, s, n, 2).
        gains: of feedback on the state's deviation [N m/x]. Shape (2, p, s, n, 2, 4 + 4 m).
    """

    payloads: Floats
    stiffnesses: Floats
    states: Floats
    torques: Floats
    gains: Floats


def bank(
    arm: ArmParameters,
    payloads: Sequence[float],
    stiffnesses: Sequence[float],
    folder: Path,
    wishes: Mapping[str, Any],
) -> Bank:
    """Make the plans that the folder does not hold yet, and return all.

    Args:
        arm: nominal arm.
        payloads: of the grid [kg], increasing.
        stiffnesses: factors of the grid, increasing.
        folder: holds a file for each plan.
        wishes: fields of `TrackingProblem` that all plans share.

    Raises:
        DivergingStartError: if the arm is so unlike the default arm that its plans are no start.
    """
    folder.mkdir(parents=True, exist_ok=True)
    plans = [plan for lap in LAPS for plan in _plans_of_lap(lap, arm, payloads, stiffnesses, folder, wishes)]
    grid = (len(LAPS), len(payloads), len(stiffnesses))

    def stack(arrays: list[Floats]) -> Floats:
        return np.stack(arrays).reshape(*grid, *arrays[0].shape)

    return Bank(
        np.array(payloads),
        np.array(stiffnesses),
        stack([plan.states for plan in plans]),
        stack([plan.torques for plan in plans]),
        stack([PlanRegulator(plan, WEIGHTS).gains for plan in plans]),
    )


def plant(arm: ArmParameters, payload: float, stiffness: float) -> ArmParameters:
    """Return an arm with another payload [kg], and with rigidities times a factor."""
    first, second = arm.flexural_rigidities
    return replace(arm, payload_mass=payload, flexural_rigidities=(stiffness * first, stiffness * second))


def _plans_of_lap(
    lap: str,
    arm: ArmParameters,
    payloads: Sequence[float],
    stiffnesses: Sequence[float],
    folder: Path,
    wishes: Mapping[str, Any],
) -> Iterator[Plan]:
    """Yield the plans of a lap in the grid's order; each starts from its neighbour's torques."""
    made: dict[tuple[int, int], Plan] = {}
    for p, s in product(range(len(payloads)), range(len(stiffnesses))):
        path = folder / f"{lap}-payload-{payloads[p]:g}-stiffness-{stiffnesses[s]:g}.npz"
        own = FlexibleArm(plant(arm, payloads[p], stiffnesses[s]))
        problem = lap_problem(own, lap, **wishes)
        neighbour = made.get((p - 1, s)) or made.get((p, s - 1)) or load_plan(f"default_{lap}")
        made[p, s] = _read(path, problem, wishes) or _make(path, problem, neighbour)
        yield made[p, s]


def _read(path: Path, problem: TrackingProblem, wishes: Mapping[str, Any]) -> Plan | None:
    """Return the plan in a file if it is one of the problem; None if there is none.

    Raises:
        ValueError: if the plan is one of another problem.
    """
    if not path.is_file():
        return None
    plan = Plan.load(path)
    if plan.parameters != problem.arm.parameters or any(plan.notes.get(name) != wishes[name] for name in wishes):
        raise ValueError(
            f"{path}: a plan of another arm, or not with {dict(wishes)}; remove it, or name another folder"
        )
    return plan


def _make(path: Path, problem: TrackingProblem, neighbour: Plan) -> Plan:
    """Optimise from another plant's plan; the start's feedback is that plan's, so that it does not drift away."""
    start = PlanRegulator(neighbour).rollout(problem.initial_state, problem.arm)
    plan = Plan.of(problem, optimise(problem, start, OPTIONS))
    put(path, plan.save)
    return plan
