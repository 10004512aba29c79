"""The figures that every run is reported with."""

from __future__ import annotations

import math

from flexarm_env.metrics.errors import tracking_error
from flexarm_env.metrics.lap import ended_early, figures_so_far
from flexarm_env.simulation.trajectory import Trajectory


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
