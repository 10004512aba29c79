"""Pictures of motion: a late sensor, the tip's wrong way, best plans, a corner with and without rounding."""

import json
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes

from flexarm_baselines.lqg.race import race_plan
from flexarm_baselines.optimal import load_plan
from flexarm_baselines.optimal.plan import PLANS
from scripts.common.plotting import BLUE, GREEN, INK, ORANGE, WIDTH, headline, label_ends, write, write_moving
from scripts.docs.arm_pictures import ARM, LETTERS, PURPLE, Lap, bare, draw_arm, draw_path, image, marks, recorded
from scripts.optimise.corner import BLEND, CHANGES, changed_lap

SHOWN = (0.77, 0.89)  # of the lap [s]; the tip moves evenly there
READ = 0.84  # when the reading is compared [s]
PUSH, RISE = 20.0, 0.03  # a torque [N m], and how long it takes to rise [s]
MOMENTS = (0, 12, 24, 36, 48, 60)  # periods of a plan
TORQUE_LIMITS = (150.0, 50.0)  # [N m]
CORNER, ABOUT = 8.0, 0.45  # time of a corner, and what is shown before and after it [s]
FRAME, REST = 0.06, 2.0  # of the race: between frames, on the last one [s]
LAP, SLOW = 50.4, 16.0  # the way round [m], and the paper's time for it [s]


def late_sensor(path: Path) -> None:
    """Draw the tip's height over time, and what the sensor says that it is."""
    lap = recorded("agent student_unknown", "swing")
    shown = slice(lap.at(SHOWN[0]), lap.at(SHOWN[1]) + 1)
    time, tip, sensed = 1e3 * lap.time[shown], lap.tip[shown, 1], lap.sensed[shown, 1]
    now = 1e3 * READ
    true, read = (float(np.interp(now, time, one)) for one in (tip, sensed))
    then = float(np.interp(read, tip, time))  # when the tip was where the sensor says
    figure, axis = plt.subplots(figsize=(WIDTH, 3.5))
    axis.plot(time, tip, color=ORANGE, linewidth=2.4)
    axis.plot(time, sensed, color=PURPLE, linewidth=2.4, linestyle="--")
    axis.text(time[-1] + 2.0, tip[-1], "true tip", color=LETTERS, va="center")
    axis.text(time[-1] + 2.0, sensed[-1], "late reading", color=PURPLE, va="center")
    _span(axis, (then, read), (now, read), f"{now - then:.0f} ms old", (then - 3.0, read + 0.02), "right")
    _span(axis, (now, true), (now, read), f"{1e3 * (true - read):.0f} mm behind", (now + 1.0, read - 0.03), "left")
    axis.set_xlim(1e3 * SHOWN[0], 1e3 * SHOWN[1] + 20.0)
    axis.set_xlabel("time since the start of the swing lap [ms]")
    axis.set_ylabel("y of the tip [m]")
    headline(figure, "The tip along an edge, and what its sensor says at the same time")
    write(figure, path)


def _span(axis: Axes, one: tuple[float, float], other: tuple[float, float], text: str, at: Any, side: str) -> None:
    axis.annotate("", other, one, arrowprops={"arrowstyle": "<->", "color": INK, "shrinkA": 0, "shrinkB": 0})
    axis.text(at[0], at[1], text, ha=side, va="center", color=INK)


def corner(path: Path) -> None:
    """Draw the best known tip at a sharp corner, and the rounded corner that it can follow."""
    figures = {row["change"]: row for row in json.loads((PLANS / "corner.json").read_text())}
    rounding = next(change for change in CHANGES if change.blend)
    plan, problem = load_plan("default_plain"), changed_lap(rounding)
    time = plan.period * np.arange(len(plan.states))
    near = np.abs(time - CORNER) <= ABOUT
    sharp, tip = plan.reference[near], ARM.tip(plan.states[near, : ARM.size])
    figure, axes = plt.subplots(1, 2, figsize=(WIDTH, 4.2), sharex=True, sharey=True)
    changes = {
        "sharp corner": ("nothing", sharp),
        f"rounded over {BLEND:g} s": (rounding.text, problem.reference[near]),
    }
    for axis, (title, (change, target)) in zip(axes, changes.items(), strict=True):
        most = 1e3 * figures[change]["true_tip_max_after_2s"]
        axis.plot(*target.T, color=BLUE, linewidth=3.0)
        axis.set_title(f"{title}: the best known tip\nis at most {most:.0f} mm off", color=INK)
        axis.set_aspect("equal")
        axis.set_xlabel("x [m]")
    axes[0].plot(*tip.T, color=ORANGE, linewidth=2.0)
    axes[0].text(6.24, 6.4, "target", ha="right", va="center", color=BLUE)
    axes[0].text(6.12, 6.1, "tip", ha="right", va="center", color=LETTERS)
    axes[1].text(6.12, 6.05, "target, and tip\nat this scale", ha="right", va="center", color=BLUE)
    axes[0].set_ylim(4.85, 6.5)
    axes[0].set_ylabel("y [m]")
    write(figure, path)


def wrong_way(path: Path) -> None:
    """Draw how the tip goes backwards when the elbow's motor pushes forwards, and the shapes of link 2 then."""
    run = ARM.simulate(np.zeros(2 * ARM.size), lambda time, state: (0.0, PUSH * min(time / RISE, 1.0)), 0.08)
    time, tip = 1e3 * run.time, 1e3 * run.tip[:, 1]
    figure, (left, right) = plt.subplots(1, 2, figsize=(WIDTH, 3.8))
    left.plot(time, tip, color=ORANGE, linewidth=2.4)
    left.fill_between(time, np.minimum(tip, 0.0), 0.0, color=ORANGE, alpha=0.2)
    left.axhline(0.0, color=INK, linewidth=1.0)
    left.set(title=f"the true tip after a push of {PUSH:.0f} N m", xlabel="time [ms]", ylabel="way forwards [mm]")
    behind = time[1:][tip[1:] < -0.05]
    left.text(2.0, 0.3 * tip.max(), f"behind its start from\n{behind[0]:.0f} to {behind[-1]:.0f} ms", color=LETTERS)
    along = np.linspace(0.0, ARM.parameters.link_lengths[1], 60)
    ends = {}
    for moment, shade in zip((20, 30, 40), ("0.72", "0.45", "0.1"), strict=True):
        shape = 1e3 * ARM.position(run.state[moment, : ARM.size], 2, along)[:, 1]
        right.plot(along, shape, color=shade, linewidth=2.4)
        ends[f"{moment} ms", shade] = shape[-1]
    right.axhline(0.0, color=INK, linewidth=1.0)
    right.set(title="link 2", xlabel="distance from the elbow [m]", ylabel="way forwards [mm]")
    label_ends(right, [*ends], [*ends.values()])
    headline(figure, "The elbow's motor turns link 2 forwards: the tip first goes backwards")
    write(figure, path)


def best_plan(path: Path) -> None:
    """Draw the arm along the best known swing lap's first second, and the torques."""
    plan = load_plan("default_swing")
    figure, (left, right) = plt.subplots(1, 2, figsize=(WIDTH, 4.4), width_ratios=(1.0, 1.15))
    bare(left, (-7.0, 0.4), (-7.0, 1.2))
    draw_path(left)
    tip = ARM.tip(plan.states[:, : ARM.size])
    left.plot(*tip[: MOMENTS[-1] + 1].T, color=ORANGE, linewidth=1.8)
    for moment, shade in zip(MOMENTS, np.linspace(0.8, 0.1, len(MOMENTS)), strict=True):
        draw_arm(left, plan.states[moment, : ARM.size], str(shade), 3.0)
        left.plot(*tip[moment], "o", markersize=6, color=ORANGE)
    left.set_title(f"the arm every {plan.period * MOMENTS[1]:.2f} s, later is darker", color=INK)
    time = plan.period * np.arange(100)
    joints = (("shoulder", BLUE), ("elbow", GREEN))
    for joint, (_, colour) in enumerate(joints):
        right.step(time, plan.torques[:100, joint], color=colour, linewidth=1.6, where="post")
        for limit in (-1.0, 1.0):
            right.axhline(limit * TORQUE_LIMITS[joint], color=colour, linestyle=":", linewidth=1.2)
    right.set(title="torques; dotted: their limits", xlabel="time [s]", ylabel="torque [N m]", xlim=(0.0, 1.0))
    label_ends(right, joints, plan.torques[99])
    headline(figure, "Best plan known for the start of the swing lap: the elbow swings through the straight arm")
    write(figure, path)


def race(path: Path) -> None:
    """Draw the fastest lap of the best known race beside the paper's lap, in real time, as an animated WebP."""
    plan = race_plan()
    q, fastest = plan.states[:, : ARM.size], plan.notes["lap_times"][1]
    whole = Lap(plan.time, q, ARM.tip(q), ARM.tip(q), plan.reference, plan.torques)
    begun = np.interp(LAP * np.arange(3), plan.notes["ways"], plan.time)
    begin = float(begun[np.argmin(np.diff(begun, append=plan.notes["lap_times"][2]))])
    paper, frames = recorded("flsac", "plain"), []
    for time in np.append(np.arange(0.0, fastest, FRAME), fastest):
        figure, axes = plt.subplots(1, 2, figsize=(9.6, 5.6), dpi=70)
        share = f"{100.0 * time / SLOW:.0f} % of a lap"
        sides = (("FLSAC, the paper's controller", paper, time, share), ("best known race", whole, begin + time, ""))
        for axis, (title, one, instant, text) in zip(axes, sides, strict=True):
            now = one.at(instant)
            bare(axis, (-8.2, 8.2), (-8.2, 8.2))
            axis.set_title(title, fontsize=14, color=INK)
            draw_path(axis)
            draw_arm(axis, one.q[now], width=4.0)
            axis.plot(*one.tip[one.at(instant - time) : now + 1].T, color=ORANGE, linewidth=2.0)
            marks(axis, one, now)
            axis.text(0.0, -8.1, text or f"{time:.2f} s", ha="center", fontsize=14, color=INK)
        frames.append(image(figure))
    write_moving(path, frames, FRAME, REST)
