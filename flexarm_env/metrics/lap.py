"""The figures of a whole lap, and those that every run is reported with."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexarm_env.metrics.corners import corners, directions
from flexarm_env.metrics.errors import early_end, reference, tracking_error
from flexarm_env.metrics.figures import LapFigures
from flexarm_env.metrics.motion import times_of_changes
from flexarm_env.metrics.running import BAND, Instants, RunningFigures
from flexarm_env.simulation.arm import FlexibleArm
from flexarm_env.simulation.trajectory import Trajectory

Array = NDArray[np.float64]


def ended_early(run: Trajectory) -> bool:
    """Return whether the run ended by anything but its full time, e.g. at a limit of the state (`notes["ended"]`)."""
    return early_end(run) is not None


def lap_figures(run: Trajectory, torque_limit: ArrayLike | None = None, band: float = BAND) -> LapFigures:
    """Return all figures of a policy's whole run.

    Args:
        run: a run with a reference.
        torque_limit: torque limit of shoulder and elbow [N m]; None: none, and no share of time at the limit.
        band: within which the tip has settled after a corner [m].

    Raises:
        ValueError: if the run has no reference, or ended early: its part would compare well with a whole lap.
    """
    if ended_early(run):
        when = f"{run.notes['ended']}, after {run.time[-1]:.2f} s"
        raise ValueError(f"run: ended early ({when}); the figures of a part compare with no whole lap's")
    return figures_so_far(run, torque_limit, band)


def figures_so_far(run: Trajectory, torque_limit: ArrayLike | None = None, band: float = BAND) -> LapFigures:
    """Return the figures of a run until its end, early or not; see `lap_figures`."""
    arm = FlexibleArm(run.parameters)
    return figures_of(arm, run.time, run.state, run.torque, run.tip, reference(run), torque_limit, band)


def figures_of(
    arm: FlexibleArm,
    time: Array,
    state: Array,
    torque: Array,
    tip: Array,
    points: Array,
    torque_limit: ArrayLike | None = None,
    band: float = BAND,
) -> LapFigures:
    """Return the figures of a record that is no `Trajectory`: of an arm whose tip is measured, or of another engine.

    Args:
        arm: whose shapes the modal coordinates are of.
        time: [s]. Shape (n,).
        state: public states. Shape (n, 4 + 4 m).
        torque: of shoulder and elbow, from each instant on [N m]. Shape (n, 2).
        tip: true tip [m]. Shape (n, 2).
        points: reference [m]. Shape (n, 2).
        torque_limit: see `lap_figures`.
        band: see `lap_figures`.
    """
    running = RunningFigures(1, corners(time, points), torque_limit, band)
    pairs = (
        tip,
        points,
        directions(points),
        arm.tip_deflection(state[:, : arm.size]),
        arm.tip_deflection(state[:, arm.size :]),  # linear in the modal coordinates
        state[:, :2],
        torque,
    )
    running.update(Instants(time, *(values[:, None] for values in pairs)))
    return running.figures(times_of_changes=times_of_changes(time, state[:, 1]).tolist())


def summary(run: Trajectory) -> dict[str, object]:
    """Return the figures that every run is reported with; plain numbers, lengths in m, torques in N m.

    A run that ended early is a result of its own. All its figures of merit are None: means and maxima over the part
    that it survived would compare well with those of a whole run. The figures after 2 s leave out the transient of the
    start; they are None for a shorter run, as the mean gain is for a run of one instant.

    Raises:
        ValueError: if the run has no reference.
    """
    early, figures = ended_early(run), figures_so_far(run)
    rigid = tracking_error(run, "rigid")
    merits: dict[str, object] = {
        "true_tip_rms": figures.rms,
        "true_tip_max": figures.maximum,
        "true_tip_rms_after_2s": figures.rms_after_2s,
        "true_tip_max_after_2s": figures.maximum_after_2s,
        "rigid_tip_rms": rigid.rms,
        "rigid_tip_max": rigid.maximum,
        "peak_deflection": list(figures.peak_deflection),
        "peak_torque": list(figures.peak_torque),
        "vibration": math.hypot(*figures.rms_deflection_rate),  # as `vibration` of the whole run
    }
    if run.gain is not None:
        merits["mean_gain"] = float(run.gain[:-1].mean()) if len(run.gain) > 1 else None
    return {
        "ended": run.notes.get("ended"),
        "ended_early": early,
        "duration": float(run.time[-1]),
        "elbow_changes": list(figures.elbow_changes),
        **(dict.fromkeys(merits) if early else merits),
    }
