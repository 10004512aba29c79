"""Nonlinear model predictive control: `NMPC`, and its forms that read more or find out more."""

from flexarm_baselines.predictive.controller import (
    DOUBTFUL,
    NMPC,
    SOFT,
    STAMPED,
    UNKNOWN,
    GaugedNMPC,
    PredictiveController,
    StampedNMPC,
    StateNMPC,
)
from flexarm_baselines.predictive.iteration import Instant, RealTimeIteration
from flexarm_baselines.predictive.reference_run import ReferenceRun, previewed

__all__ = [
    "DOUBTFUL",
    "NMPC",
    "SOFT",
    "STAMPED",
    "UNKNOWN",
    "GaugedNMPC",
    "Instant",
    "PredictiveController",
    "RealTimeIteration",
    "ReferenceRun",
    "StampedNMPC",
    "StateNMPC",
    "previewed",
]
