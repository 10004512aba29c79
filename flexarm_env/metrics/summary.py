"""The figures that every run is reported with."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexarm_env.laps import SETTLED
from flexarm_env.metrics.errors import early_end, tracking_error
from flexarm_env.metrics.motion import elbow_changes, vibration
from flexarm_env.simulation.trajectory import Trajectory

Array = NDArray[np.float64]


def ended_early(run: Trajectory) -> bool:
    """Return whether the run ended by anything but its full time, e.g. at a limit of the state (`notes["ended"]`)."""
    return early_end(run) is not None


def summary(run: Trajectory) -> dict[str, object]:
    """Return the figures that every run is reported with; plain numbers, lengths in m, torques in N m.

    A run that ended early is a result of its own. All its figures of merit are None: means and maxima over the part
    that it survived would compare well with those of a whole run. Those after 2 s, the start's transient, are None for
    a run that is shorter.
    """
    early = ended_early(run)
    figures: dict[str, object] = {
        "ended": run.notes.get("ended"),
        "ended_early": early,
        "duration": float(run.time[-1]),
        "elbow_changes": elbow_changes(run).tolist(),
    }
    merits = _merits(run)
    return figures | (dict.fromkeys(merits) if early else merits)


def _merits(run: Trajectory) -> dict[str, object]:
    """Return the part of `summary` that compares controllers."""
    true, rigid = tracking_error(run), tracking_error(run, "rigid")
    later = tracking_error(run, since=SETTLED) if run.time[-1] >= SETTLED else None
    figures: dict[str, object] = {
        "true_tip_rms": true.rms,
        "true_tip_max": true.maximum,
        "true_tip_rms_after_2s": later.rms if later else None,
        "true_tip_max_after_2s": later.maximum if later else None,
        "rigid_tip_rms": rigid.rms,
        "rigid_tip_max": rigid.maximum,
        "peak_deflection": np.abs(run.tip_deflection).max(axis=0).tolist(),
        "peak_torque": np.abs(run.torque).max(axis=0).tolist(),
        "vibration": vibration(run),
    }
    if run.gain is not None:
        figures["mean_gain"] = float(run.gain[:-1].mean())
    return figures
