"""Figures of merit: pure functions of a `Trajectory`, and `RunningFigures` for runs that go on.

How far the tip was from the reference in the first two seconds [m]:

    >>> import gymnasium
    >>> from flexarm_baselines.registry import controller, make_controller
    >>> from flexarm_env.rollout import run_policy
    >>> env = gymnasium.make("flexarm_env:FlexArm/Square-v0", **controller("ifdc").options)
    >>> run = run_policy(env, make_controller("ifdc", env), lap="plain", max_steps=200)
    >>> error = tracking_error(run)
    >>> round(error.rms, 2), round(error.maximum, 2)
    (0.28, 0.51)
"""

from flexarm_env.metrics.corners import Corner, corners, directions
from flexarm_env.metrics.errors import (
    CircleFit,
    TrackingError,
    circle_fit,
    overshoot,
    path_difference,
    tracking_error,
)
from flexarm_env.metrics.figures import CornerFigures, LapFigures
from flexarm_env.metrics.lap import ended_early, figures_of, figures_so_far, lap_figures, summary
from flexarm_env.metrics.motion import elbow_changes, tip_acceleration, vibration
from flexarm_env.metrics.rests import Rest, bending_moment, rests
from flexarm_env.metrics.running import Instants, RunningFigures, contour_and_lag

__all__ = [
    "CircleFit",
    "Corner",
    "CornerFigures",
    "Instants",
    "LapFigures",
    "Rest",
    "RunningFigures",
    "TrackingError",
    "bending_moment",
    "circle_fit",
    "contour_and_lag",
    "corners",
    "directions",
    "elbow_changes",
    "ended_early",
    "figures_of",
    "figures_so_far",
    "lap_figures",
    "overshoot",
    "path_difference",
    "rests",
    "summary",
    "tip_acceleration",
    "tracking_error",
    "vibration",
]
