"""Pictures of the analysis, drawn from its results."""

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexarm_env import FlexibleArm, analysis
from flexarm_env.analysis import OperatingPoint, linear_plant, tip
from scripts.analysis.margins import GAINS, SENSORS
from scripts.common.plotting import BLUE, COLOURS, GREEN, INK, ORANGE, SOFT, WIDTH, headline, label_ends, number_ticks

COLORS = {"IFDC": INK, "FLSAC, largest": ORANGE, "FLSAC, smallest": BLUE}
EXACT = "0.6"
PATHS = {  # the curves that are drawn: of which path, and what of
    "joint torques -> joint rates": ("rates of the joints", INK),
    "the same, 31.2 ms late": ("rate of the rigid tip,\n31 ms late", ORANGE),
    "law's force -> true point's rate, tip": ("rate of the true tip,\nnot late", BLUE),
}
FASTEST = 150.0  # of the frequencies that are drawn [rad/s]
KINDS: dict[str, dict[str, Any]] = {
    "right of the axis, real": {"color": ORANGE, "markersize": 2.6},
    "right of the axis, complex": {"color": GREEN, "markersize": 2.6},
    "on the imaginary axis": {"color": BLUE, "markersize": 2.6},
    "left of the axis, complex": {"color": COLOURS[5], "markersize": 2.6},
    "left of the axis, real": {"color": COLOURS[4], "markersize": 1.2},
}
LINES: dict[str, dict[str, Any]] = {  # the two large gains' curves lie close: a thin one on a broad one
    "FLSAC, smallest": {"color": COLORS["FLSAC, smallest"], "linewidth": 1.5, "zorder": 2.5},
    "FLSAC, largest": {"color": COLORS["FLSAC, largest"], "linewidth": 4.5, "alpha": 0.6},
    "IFDC": {"color": COLORS["IFDC"], "linewidth": 1.2, "zorder": 3},
}
WHOLE_LAP = 1.2  # sides; where the squares of whole laps stand
LABELS = {"position": "position late", "position+rate": "position and rate late"}
PLACES = {"end effector": "at the tip", "collocated, one delay": "at the joints"}


def zeros_locus(results: dict[str, Any]) -> Figure:
    """Draw the magnitude of every zero against the sensor's position, a panel for each arm."""
    locus = results["zeros"]["locus"]
    models = [name for name in locus if name not in ("positions", "exact beam", "exact link 1")]
    s = np.array(locus["positions"])
    lines = -(-len(models) // 2)
    figure, axes = plt.subplots(lines, 2, figsize=(WIDTH, 1.4 + 3.2 * lines), sharex=True, sharey=True, squeeze=False)
    for axis in axes.flat[len(models) :]:
        axis.remove()
    for axis, name in zip(axes.flat, models, strict=False):
        beams = zip(s, locus["exact beam"], strict=True)
        exact = [(at, z) for at, own in beams for z in (*own["real"], *own["imaginary"], *locus["exact link 1"])]
        axis.plot(*np.array(exact).T, "o", color=EXACT, markersize=1.6, zorder=1, label="exact beams, both links")
        kinds: dict[str, list[tuple[float, float]]] = {kind: [] for kind in KINDS}
        for at, row in zip(s, locus[name], strict=True):
            for z in row:
                kinds[_kind(complex(*z))].append((at, abs(complex(*z))))
        for kind, points in kinds.items():
            # an undamped arm's zeros on the left are mirror images of those on the right
            if points and not (kind.startswith("left") and "undamped" in name):
                axis.plot(*np.array(points).T, "o", label=kind, zorder=3, **KINDS[kind])
        title = name.replace("mode,", "mode a link,").replace("modes,", "modes a link,")
        axis.set(title=title, yscale="log", ylim=(10, 1000), xlim=(0, 4.6))
        axis.label_outer()
    plt.setp(axes[-1], xlabel="sensor's distance from the elbow [m]")
    plt.setp(axes[:, 0], ylabel="magnitude of a zero [rad/s]")
    _legend(figure, axes.flat[: len(models)], markerscale=3)
    headline(figure, "Zeros from the motors to a sensor on link 2, by where the sensor is")
    return figure


def _legend(figure: Figure, axes: Any, **look: Any) -> None:
    """Explain each label of some axes once, below them."""
    handles: dict[str, Any] = {}
    for axis in axes:
        handles |= dict(zip(*reversed(axis.get_legend_handles_labels()), strict=True))
    figure.legend(handles.values(), handles.keys(), loc="outside lower left", ncols=2, **look)


def bode(results: dict[str, Any]) -> Figure:
    """Draw the default arm's response to the late tip on a corner of the square, from 1 to 300 rad/s."""
    point = OperatingPoint.at_point(FlexibleArm(), (-6.3, 6.3))
    _, figure = analysis.bode(linear_plant(point, tip(delay=0.0312)), np.geomspace(1.0, 300.0, 1500))
    for axis in figure.axes[:2]:
        for line, colour in zip(axis.lines, (INK, ORANGE, BLUE, GREEN), strict=True):
            line.set_color(colour)
    figure.axes[0].legend()
    headline(figure, "From the motors to the tip, read 31.2 ms late: default arm at rest, tip on a corner")
    return figure


def _kind(zero: complex) -> str:
    """Return where a zero lies, a key of `KINDS`."""
    tiny = 1e-6 * abs(zero)
    if abs(zero.real) <= tiny:
        return "on the imaginary axis"
    shape = "real" if abs(zero.imag) <= tiny else "complex"
    return f"{'right' if zero.real > 0.0 else 'left'} of the axis, {shape}"


def passivity(results: dict[str, Any]) -> Figure:
    """Draw positive realness over frequency, and the law's own damping when its readings are late."""
    results = results["passivity"]
    figure, (above, below) = plt.subplots(2, 1, figsize=(WIDTH, 7.0))
    omega = np.array(results["omega"])
    slow = (omega >= 1.0) & (omega <= FASTEST)
    curves = [np.array(results["curves"][name])[slow] for name in PATHS]
    for curve, (_, colour) in zip(curves, PATHS.values(), strict=True):
        above.plot(omega[slow], curve, color=colour, linewidth=1.8)
    above.axhline(0.0, color=SOFT, linewidth=1)
    above.set(xscale="log", xlim=(1.0, FASTEST), ylim=(-1.05, 0.45), xlabel="frequency [rad/s]")
    above.set_xticks([1, 3, 10, 30, 100], ["1", "3", "10", "30", "100"])
    above.set_ylabel("least eigenvalue of $(G + G^H)/2$\nover the norm of $G$ [1]")
    above.set_title(f"Positive real above 0: least of {results['poses']} poses, linear arm")
    _law_damping(below, results["law"])
    label_ends(above, [*PATHS.values()], [curve[-1] for curve in curves])
    return figure


def _law_damping(axis: Axes, law: dict[str, Any]) -> None:
    omega = np.array(law["omega"])
    slow = omega <= FASTEST
    names = {"position": ("late position,\ncurrent rate", BLUE), "position+rate": ("late position,\nlate rate", ORANGE)}
    for delayed, (_, colour) in names.items():
        axis.plot(omega[slow], np.array(law[delayed])[slow], color=colour, linewidth=1.8)
    both = np.minimum(law["position+rate"], 0.0)[slow]
    axis.fill_between(omega[slow], both, 0.0, color=ORANGE, alpha=0.15)
    axis.axhline(0.0, color=SOFT, linewidth=1)
    for joints, style in (("free", "-"), ("locked", ":")):
        for w in (w for w in law["modes"][joints] if 0.0 < w < FASTEST):
            axis.axvline(w, color="0.55", linestyle=style, linewidth=1.2)
    axis.set(xlabel="frequency [rad/s]; grey: the arm's, joints free (lines) and locked (dotted)", xlim=(0, FASTEST))
    axis.set(ylim=(-20, 24), ylabel="damping [N s/m]")
    axis.set_title(f"Damping that the paper's law supplies with readings {1e3 * law['delay']:.0f} ms late")
    label_ends(axis, [*names.values()], [law[delayed][np.flatnonzero(slow)[-1]] for delayed in names])


def margins(results: dict[str, Any]) -> Figure:
    """Draw delay margins along a side, with the paper's delay and where the simulation diverges, on one scale."""
    profile, rows = results["linear"]["profile"], results["linear"]["rows"]
    simulated = [one for name, one in results.items() if name != "linear"]
    figure, axes = plt.subplots(1, len(SENSORS), figsize=(WIDTH, 5.8), sharex=True, sharey=True)
    side = profile["side"]
    arc = np.array(profile["arc"])
    whole = np.concatenate([arc, side - arc[-2::-1]])
    for axis, sensor in zip(axes, SENSORS, strict=True):
        for curve in (c for c in profile["curves"] if c["sensor"] == sensor):
            values = 1e3 * np.array(curve["margin"])
            name = curve["controller"]
            label = f"{name}{' gain' if ',' in name else ''}: {GAINS[name]:.3g}"
            axis.plot(whole, np.concatenate([values, values[-2::-1]]), label=label, **LINES[name])
        own = next(r for r in rows if r["sensor"] == sensor)["corner"]["delay"]
        axis.axhline(1e3 * own, color=COLOURS[3], linestyle="--", linewidth=2.0, label="the paper's delay")
        _diverging(axis, [r for r in simulated if r["sensor"] == sensor], side)
        axis.set(title=f"sensor {PLACES.get(sensor, sensor)}", yscale="log", xlim=(0, 1.4 * side))
        axis.axvline(side, color="0.7", linewidth=1)
        axis.set_xticks(side * np.array([0.0, 0.5, 1.0, WHOLE_LAP]), ["0", f"{0.5 * side:.1f}", "", "lap"])
        for delayed, height in (("position", 0.985), ("position+rate", 0.02)):
            up = "top" if height > 0.5 else "bottom"
            axis.text(0.02, height, LABELS[delayed], transform=axis.transAxes, va=up, color=SOFT)
    axes[1].set_xlabel("distance along a side of the square [m]; behind it, whole laps")
    axes[0].set_ylabel("delay margin [ms]")
    axes[0].set_ylim(0.08, 320)
    number_ticks(axes[0].yaxis, [0.1, 0.3, 1, 3, 10, 30, 100])
    _legend(figure, axes[:1])
    headline(figure, "Delays from which on the paper's loop is unstable")
    return figure


def _diverging(axis: Axes, rows: list[dict[str, Any]], side: float) -> None:
    """Draw circles where the held arm diverges, and squares behind the lap's end for whole laps."""
    held: dict[str, Any] = {"marker": "o", "label": "simulated, held there", "clip_on": False}
    whole: dict[str, Any] = {"marker": "s", "label": "simulated, a whole lap"}
    for r in rows:
        own: dict[str, Any] = {"color": COLORS[r["controller"]], "mfc": "white", "markersize": 7, "zorder": 4}
        for place, at, look in (("corner", 0.0, held), ("mid-side", 0.5, held), ("lap", WHOLE_LAP, whole)):
            if r[place][1] is not None and np.isfinite(r[place][1]):
                axis.plot(at * side, 1e3 * r[place][1], linestyle="none", **own, **look)
