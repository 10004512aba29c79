"""Observers: the state of the arm from what its sensors deliver, late readings included."""

from flexarm_baselines.observers.kalman import Estimate, Innovation, KalmanFilter, Transition
from flexarm_baselines.observers.noise import NoiseModel
from flexarm_baselines.observers.readings import Readings

__all__ = ["Estimate", "Innovation", "KalmanFilter", "NoiseModel", "Readings", "Transition"]
