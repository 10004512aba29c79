"""Observers: the state of the arm from what its sensors deliver, late readings included."""

from flexarm_baselines.observers.kalman import Estimate, Innovation, KalmanFilter, Transition
from flexarm_baselines.observers.noise import NoiseModel
from flexarm_baselines.observers.readings import GAUGES, SENSORS, Readings, fresh

__all__ = [
    "GAUGES",
    "SENSORS",
    "Estimate",
    "Innovation",
    "KalmanFilter",
    "NoiseModel",
    "Readings",
    "Transition",
    "fresh",
]
