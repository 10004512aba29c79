"""Linear-quadratic-Gaussian control along plans: `LQG`, and its forms that read more or find out more."""

from flexarm_baselines.lqg.adaptive import AdaptiveLQG, StampedLQG
from flexarm_baselines.lqg.controller import LQG, NOISE, QUICK, WEIGHTS, GaugedLQG
from flexarm_baselines.lqg.hinf import HInfinityLQG
from flexarm_baselines.lqg.imu import InertialLQG
from flexarm_baselines.lqg.race import RaceLQG

__all__ = [
    "LQG",
    "NOISE",
    "QUICK",
    "WEIGHTS",
    "AdaptiveLQG",
    "GaugedLQG",
    "HInfinityLQG",
    "InertialLQG",
    "RaceLQG",
    "StampedLQG",
]
