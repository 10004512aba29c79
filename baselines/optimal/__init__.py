"""Optimal motion: the best run known along a reference, and feedback along it."""

from flexarm_baselines.optimal.laps import lap_problem, lap_square, plan_lap, usual_starts
from flexarm_baselines.optimal.linear_quadratic import AGGRESSIVE, GOOD, LinearQuadratic, RegulatorWeights
from flexarm_baselines.optimal.plan import Plan, load_plan, plan_names
from flexarm_baselines.optimal.problem import TrackingProblem
from flexarm_baselines.optimal.solver import DivergingStartError, Iteration, Solution, SolverOptions, optimise
from flexarm_baselines.optimal.starts import Branch, along, follow, joint_path
from flexarm_baselines.optimal.tracking import PlanRegulator

__all__ = [
    "AGGRESSIVE",
    "GOOD",
    "Branch",
    "DivergingStartError",
    "Iteration",
    "LinearQuadratic",
    "Plan",
    "PlanRegulator",
    "RegulatorWeights",
    "Solution",
    "SolverOptions",
    "TrackingProblem",
    "along",
    "follow",
    "joint_path",
    "lap_problem",
    "lap_square",
    "load_plan",
    "optimise",
    "plan_lap",
    "plan_names",
    "usual_starts",
]
