"""Pictures in a training's folder: the learning curve after each evaluation, the best policy's laps at the end.

Without matplotlib (extra `plot`) there are none.
"""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from flexarm_agents.files import put
from flexarm_env.simulation.trajectory import Trajectory

try:
    from matplotlib.figure import Figure
except ImportError:
    Figure = None  # type: ignore[assignment, misc]

PANELS = {"duration": "end [s]; dot: complete", "rms": "error, r.m.s. [m]"}


def draw_curve(rows: Sequence[Mapping[str, Any]], laps: Mapping[str, str], path: Path) -> None:
    """Draw how long the evaluations' laps lasted, and the errors of complete ones, over the environment steps.

    The rows are those of `evaluations.json`; of `laps` the names in a row say which are drawn, and what each is called.
    """
    if Figure is None:
        return
    panels = [name for name in PANELS if any(row[lap][name] is not None for row in rows for lap in laps)]
    figure = Figure(figsize=(7.5, 2.2 * len(panels)), layout="constrained")
    axes = figure.subplots(len(panels), sharex=True, squeeze=False)[:, 0]
    for axis, name in zip(axes, panels, strict=True):
        for lap, title in laps.items():
            values = [math.nan if row[lap][name] is None else row[lap][name] for row in rows]
            complete = [row[lap]["complete"] for row in rows]
            steps = [1e-6 * row["steps"] for row in rows]
            axis.plot(steps, values, "-o", label=title, markersize=4, markevery=complete)
        axis.set(ylabel=PANELS[name], yscale="log" if name == "rms" else "linear")
    axes[0].legend()
    axes[-1].set_xlabel("environment steps, millions")
    put(path, figure.savefig)


def draw_laps(runs: Mapping[str, Trajectory], path: Path) -> None:
    """Draw the tip's way over the target's, of runs by what each is called."""
    if Figure is None:
        return
    figure = Figure(figsize=(3.75 * len(runs), 3.8), layout="constrained")
    for axis, (title, run) in zip(figure.subplots(1, len(runs), squeeze=False)[0], runs.items(), strict=True):
        assert run.reference is not None
        axis.plot(*run.reference.T, color="0.75", linewidth=4)
        axis.plot(*run.tip.T)
        axis.set(title=f"{title}, {run.time[-1]:.1f} s", xlabel="x [m]", ylabel="y [m]")
        axis.set_aspect("equal", adjustable="datalim")
    put(path, figure.savefig)
