"""Nonlinear model predictive control: `NMPC`, and its forms that read more or find out more."""

from flexarm_baselines.predictive.controller import DOUBTFUL, NMPC, UNKNOWN, GaugedNMPC, PredictiveController, StateNMPC
from flexarm_baselines.predictive.iteration import Instant, RealTimeIteration
from flexarm_baselines.predictive.reference_run import ReferenceRun, previewed

__all__ = [
    "DOUBTFUL",
    "NMPC",
    "UNKNOWN",
    "GaugedNMPC",
    "Instant",
    "PredictiveController",
    "RealTimeIteration",
    "ReferenceRun",
    "StateNMPC",
    "previewed",
]
