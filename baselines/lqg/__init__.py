"""Linear-quadratic-Gaussian control along plans: `LQG`, and its forms that read or know more."""

from flexarm_baselines.lqg.controller import LQG, GaugedLQG
from flexarm_baselines.lqg.laps import Laps

__all__ = ["LQG", "GaugedLQG", "Laps"]
