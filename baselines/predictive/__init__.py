"""Nonlinear model predictive control: `NMPC`, and its forms that read more or find out more."""

from flexarm_baselines.predictive.controller import DOUBTFUL, NMPC, UNKNOWN, GaugedNMPC, PredictiveController, StateNMPC
from flexarm_baselines.predictive.guide import Guide, previewed
from flexarm_baselines.predictive.iteration import Instant, RealTimeIteration

__all__ = [
    "DOUBTFUL",
    "NMPC",
    "UNKNOWN",
    "GaugedNMPC",
    "Guide",
    "Instant",
    "PredictiveController",
    "RealTimeIteration",
    "StateNMPC",
    "previewed",
]
