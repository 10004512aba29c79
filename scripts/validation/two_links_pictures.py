"""Pictures of the arm's frequencies: by number of modes, by mesh, and by elbow angle."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

from scripts.common.plotting import COLOURS, INK, SOFT, THRESHOLD, WIDTH, headline, save
from scripts.validation.checks import Result
from scripts.validation.small_motion import BASES, MODES
from scripts.validation.two_links import JOINTS, MESHES, RATE_MODES, errors

SHOWN = ("free", "elbow locked")  # the two kinds of link 1's tip: without moment and with it


def draw(result: Result, folder: Path) -> None:
    """Write all pictures."""
    records = result.findings.records
    by_modes(records["rows"], folder)
    convergence(records, folder)
    by_angle(records["rows"], folder)


def by_modes(rows: list[dict[str, Any]], folder: Path) -> None:
    """Error of the first two elastic frequencies, least to largest over the elbow's angles."""
    shape, loads = (len(BASES), len(JOINTS)), list(dict.fromkeys(row["load"] for row in rows))
    figure, axes = plt.subplots(
        *shape, figsize=(WIDTH, 1.6 + 2.9 * len(BASES)), sharex=True, sharey=True, squeeze=False
    )
    for line, basis in zip(axes, BASES, strict=True):
        for axis, joints in zip(line, JOINTS, strict=True):
            for load, colour in zip(loads, COLOURS, strict=False):
                cases = [r for r in rows if r["load"] == load and r["joints"] == joints]
                for i, style in enumerate(("-", "--")):
                    found = 100.0 * np.array([[errors(r, basis, m)[i] for r in cases] for m in MODES])
                    axis.fill_between(MODES, found.min(axis=1), found.max(axis=1), color=colour, alpha=0.12)
                    axis.plot(MODES, found.max(axis=1), marker="o", markersize=4, linestyle=style, color=colour)
            axis.axhline(1.0, **THRESHOLD)
            axis.set(title=joints, yscale="log", xticks=MODES)
        line[0].set_ylabel(f"{basis} shapes:\nfrequency too high by [%]")
    for axis in axes[-1]:
        axis.set_xlabel("modes a link")
    for load, colour in zip(loads, COLOURS, strict=False):
        axes[0, 0].plot([], [], color=colour, label=load)
    for name, style in (("first elastic frequency", "-"), ("second", "--")):
        axes[0, 0].plot([], [], color=SOFT, linestyle=style, label=name)
    figure.legend(loc="outside lower left", ncol=3)
    headline(figure, "Elastic frequencies of the arm against the exact ones, by joints that are locked")
    save(figure, folder, "arm_modes")


def convergence(records: Mapping[str, Any], folder: Path) -> None:
    """Finite elements by mesh; clamped-free shapes by their number, beyond what the package has."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(WIDTH, 5.0))
    shapes = range(1, max(RATE_MODES) + 1)
    for (name, errors_by_mesh), colour in zip(records["mesh_errors"].items(), COLOURS, strict=False):
        left.loglog(MESHES, errors_by_mesh, "o-", color=colour, label=name)
        right.loglog(shapes, 100.0 * np.array(records["shape_errors"][name]), "o-", color=colour, label=name)
    left.loglog(MESHES, 0.1 * np.array(MESHES, dtype=float) ** -4, color=SOFT, linestyle=":", label="order 4")
    modes = np.array(RATE_MODES, dtype=float)
    for power, height in ((1, 40.0), (3, 0.2)):
        right.loglog(modes, height * modes**-power, color=SOFT, linestyle=":")
        right.annotate(
            f"$m^{{-{power}}}$", (modes[-1], height * modes[-1] ** -power), xytext=(4, 0), textcoords="offset points"
        )
    left.set(title="finite elements: 4th frequency", xlabel="elements a link", ylabel="relative error [1]")
    right.set(title="clamped-free shapes: 1st frequency", xlabel="modes a link", ylabel="frequency too high by [%]")
    for axis, ticks in ((left, MESHES), (right, (1, 2, 3, 4, 6, 8, 10))):
        axis.set_xticks(list(ticks), [str(t) for t in ticks])
        axis.minorticks_off()
    figure.legend(*left.get_legend_handles_labels(), loc="outside lower left", ncols=3)
    headline(figure, "Errors of frequencies, by joints that are locked")
    save(figure, folder, "arm_convergence")


def by_angle(rows: list[dict[str, Any]], folder: Path) -> None:
    """Draw the bare arm's first two elastic frequencies by elbow angle."""
    figure, axes = plt.subplots(1, len(SHOWN), figsize=(WIDTH, 5.4))
    for axis, joints in zip(axes, SHOWN, strict=True):
        cases = [r for r in rows if r["load"] == "bare" and r["joints"] == joints]
        angles = np.rad2deg([r["theta2"] for r in cases])
        for i in range(2):
            axis.plot(angles, [r["exact"][i] for r in cases], color=INK, label=None if i else "exact")
            axis.plot(angles, [r["elements"][i] for r in cases], "kx", label=None if i else "finite elements")
            for b, basis in enumerate(BASES):
                for m, style in ((1, ":"), (2, "--"), (4, "-.")):
                    found = [r["found"][basis][str(m)][i] for r in cases]
                    label = None if i else f"{basis} shapes, {m} a link"
                    axis.plot(angles, found, color=COLOURS[b], linestyle=style, label=label)
        axis.set(title=f"joints: {joints}", xlabel="elbow angle [deg]", ylabel="frequency [rad/s]", ylim=(0, None))
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower left", ncol=2)
    headline(figure, "The bare arm's first two elastic frequencies by the elbow's angle")
    save(figure, folder, "arm_angles")
