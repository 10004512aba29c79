"""A fixed LQG for unknown arms: how fast deviations decay over the published box, and what that does to lost laps.

The design has four numbers: the weight of speeds, that of torques, the trust in encoders, and the noise on the torques.
The search makes the slowest decay over a sample of the box as fast as it can; it runs no episode.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import gymnasium
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from scipy.optimize import minimize
from scipy.stats import qmc

from flexarm_agents.evaluation.candidates import ENVIRONMENT
from flexarm_baselines.arrays import Floats
from flexarm_baselines.controller import TorqueController
from flexarm_baselines.lqg import LQG, QUICK
from flexarm_baselines.lqg.controller import NOISE, WEIGHTS
from flexarm_baselines.observers import KalmanFilter
from flexarm_baselines.optimal import GOOD, Plan, RegulatorWeights
from flexarm_baselines.task import Task
from flexarm_env import FlexibleArm
from flexarm_env.envs.registration import UNKNOWN_PLANT
from flexarm_env.laps import LAPS, SETTLED
from scripts.common.markdown import millimetres, table
from scripts.common.plotting import COLOURS, WIDTH
from scripts.common.study import Trial, study
from scripts.control.trials import run_laps

BOX: Mapping[str, tuple[float, float]] = UNKNOWN_PLANT["randomisation"]
OF_THE_ARM = ("payload_mass", "stiffness", "damping")
PLANTS, SEED = 32, 0
EPISODES = 256  # on unknown arms
FIRST, LAST = 200, 1000  # control periods of the lap that count: two sides, after the start
LOSSES = ("lost", "median [mm]", "90th percentile [mm]")
BLOCK = 20  # control periods after which growing deviations are scaled down
EVALUATIONS = 100


class Design(NamedTuple):
    """The numbers of a design, as factors on those of `QUICK` and `GOOD`."""

    speed: float = 1.0  # weight of the tip's speed [0.3 m/s]
    effort: float = 1.0  # of the torques [6 and 2 N m]
    encoders: float = 1.0  # deviations of angles and rates [0.3 mrad, 0.1 rad/s]
    torque: float = 1.0  # noise on the torques [10 and 4 N m]

    def arguments(self) -> dict[str, Any]:
        """Return keyword arguments of `LQG`."""
        first, second = GOOD.torque
        weights = RegulatorWeights(speed=self.speed * GOOD.speed, torque=(self.effort * first, self.effort * second))
        noise = replace(
            QUICK,
            joint_angle=self.encoders * QUICK.joint_angle,
            joint_rate=self.encoders * QUICK.joint_rate,
            torque=(self.torque * QUICK.torque[0], self.torque * QUICK.torque[1]),
        )
        return {"weights": weights, "noise": noise}

    def towards(self, other: Design, share: float) -> Design:
        """Return the design a share of the way to another, in logarithms."""
        return Design(*np.exp((1.0 - share) * np.log(self) + share * np.log(other)).tolist())


# Where the search ends, see `searched`; NOISE and WEIGHTS of `LQG` are this in round numbers.
FOUND = Design(0.159, 1.36, 92.5, 1.03)
SERIES: dict[str, dict[str, Design]] = {
    "quick": {"0": Design()},
    "loop transfer recovery: torque noise": {f"x {f:g}": Design(torque=f) for f in (3.0, 10.0, 30.0)},
    "encoders' deviations": {f"x {f:g}": Design(encoders=f) for f in (3.0, 10.0, 30.0, 100.0)},
    "weight of speeds": {f"/ {f:g}": Design(speed=1.0 / f) for f in (3.0, 6.0, 10.0)},
    "from quick to found": {f"{s:.0%}": Design().towards(FOUND, s) for s in (0.25, 0.5, 0.75, 1.0, 1.25)},
}


class Loop(NamedTuple):
    """A plant of the box along the plans: how its state and late readings go on. l plans, n periods."""

    matrix: Floats  # Shape (l, n, d, d)
    by_torque: Floats  # Shape (l, n, d, 2)
    rows: list[int]  # places of what is read
    late: float  # share of a period after which torques act


def plants(task: Task, plans: tuple[Plan, ...], count: int = PLANTS, seed: int = SEED) -> list[Loop]:
    """Linearise plants of the published box along plans."""
    low, high = np.array(list(BOX.values())).T
    arm, found = FlexibleArm(task.arm), []
    states = np.concatenate([plan.states[:-1] for plan in plans])
    torques = np.concatenate([plan.torques for plan in plans])
    for drawn in low + (high - low) * qmc.Sobol(len(BOX), seed=seed).random(count):
        values = dict(zip(BOX, drawn.tolist(), strict=True))
        kalman = KalmanFilter(arm, task.period, values["delay"], task.sensor_position)
        moves = kalman.linearise(states, torques, **{name: values[name] for name in OF_THE_ARM})
        matrix, by_torque = (part.reshape(len(plans), -1, *part.shape[1:]) for part in (moves.matrix, moves.by_torque))
        found.append(Loop(matrix, by_torque, kalman.sensors()[0], values["actuation_delay"] / task.period))
    return found


def decay(controller: LQG, plant: Loop, plan: int) -> float:
    """Return how fast deviations from a plan decay [1/s]; negative: they grow.

    The mean rate over the periods from FIRST to LAST of the closed loop of a plant, its late motors and sensor, and the
    controller's filter and regulator, all linear.
    """
    tables, gains, known = controller.filter, controller.regulator.gain[plan], controller.filter.matrix.shape[-1]
    actual = np.random.default_rng(0).normal(size=(plant.matrix.shape[-1], 3))
    estimate, before, log = np.zeros((tables.nominal.shape[-1], 3)), np.zeros((2, 3)), 0.0
    for k in range(FIRST, LAST):
        estimate = estimate + tables.gain[plan, k] @ (actual[plant.rows] - estimate[tables.rows])
        torque = gains[k] @ np.concatenate([estimate[:known], before])
        acting = (1.0 - plant.late) * torque + plant.late * before
        actual = plant.matrix[plan, k] @ actual + plant.by_torque[plan, k] @ acting
        moved = tables.matrix[plan, k] @ estimate[:known] + tables.by_torque[plan, k] @ torque
        estimate, before = np.concatenate([moved, estimate[known:-2]]), torque
        if (k + 1) % BLOCK == 0:
            size = np.linalg.norm(actual)
            log, actual, estimate, before = log + np.log(size), actual / size, estimate / size, before / size
    return float(-log / ((LAST - FIRST) * controller.task.period))


def decays(controller: LQG, sample: list[Loop]) -> Floats:
    """Return the decay of each plant of a sample along each plan. Shape (plants, plans)."""
    return np.array([[decay(controller, plant, plan) for plan in range(len(controller.plans))] for plant in sample])


def nominal_task() -> Task:
    """Return the task of the main id, as `LQG` reads it."""
    with gymnasium.make(ENVIRONMENT, **LQG.options()) as env:
        task = Task.of(env)
    return task


def searched() -> dict[str, Any]:
    """Search the design whose slowest decay is fastest, by Nelder and Mead's method in logarithms."""
    task = nominal_task()
    sample = plants(task, LQG(task).plans)
    start = np.log([1.0 / 3.0, 1.0, 10.0, 1.0])
    simplex = start + np.vstack([np.zeros(4), 0.7 * np.diag([-1.0, -1.0, 1.0, 1.0])])

    def growth(numbers: Floats) -> float:
        return -float(decays(LQG(task, **Design(*np.exp(numbers)).arguments()), sample).min())

    options = {"maxfev": EVALUATIONS, "initial_simplex": simplex}
    found = minimize(growth, start, method="Nelder-Mead", options=options)
    return {**Design(*np.exp(found.x).tolist())._asdict(), "slowest": -float(found.fun)}


def run_unknown(
    make: Callable[[Any], TorqueController], options: Mapping[str, Any], episodes: int = EPISODES
) -> list[list[float] | None]:
    """Return errors over the lap and after 2 s [m] of episodes on unknown arms, laps in turn; None for lost ones.

    `make` returns the policy for vector environments, which need some options for it.
    """
    envs = gymnasium.make_vec(ENVIRONMENT, num_envs=episodes, **{**options, **UNKNOWN_PLANT})
    policy, sides = make(envs), [lap.elbow_branch for lap in LAPS.values()] * (episodes // len(LAPS))
    observations, infos = envs.reset(seed=0, options={"start": "corner", "elbow_branch": sides})
    squares, running, state = [infos["tip_error"] ** 2], np.ones(episodes, dtype=bool), None
    starting, over = np.ones(episodes, dtype=bool), np.zeros(episodes, dtype=bool)
    while not over.all():
        actions, state = policy.predict(observations, state, starting)
        observations, _, terminated, truncated, infos = envs.step(actions)
        starting, running = terminated | truncated, running & ~terminated
        squares.append(np.where(running, infos["tip_error"] ** 2, np.nan))
        over |= starting
    envs.close()
    errors = [np.sqrt(np.mean(squares[first:], axis=0)) for first in (0, round(SETTLED / policy.task.period))]
    return [None if np.isnan(pair).any() else pair.tolist() for pair in np.stack(errors, axis=1)]


def losses(errors: Sequence[Sequence[float] | None]) -> list[str]:
    """Write how many episodes of `run_unknown` are lost, and the quantiles of their errors; see `LOSSES`."""
    values = np.array([np.inf if pair is None else pair[0] for pair in errors])
    quantiles = np.quantile(values, [0.5, 0.9], method="higher").tolist()
    return [f"{np.sum(np.isinf(values))} of {len(values)}", *map(millimetres, quantiles)]


def measured(design: Mapping[str, Any]) -> dict[str, Any]:
    """Return what keyword arguments of `LQG` come to: decays, both nominal laps, and episodes on unknown arms."""
    task = nominal_task()
    controller = LQG(task, **design)
    rates, make = decays(controller, plants(task, controller.plans)), partial(LQG.for_env, **design)
    return {"decays": rates, "nominal": run_laps("lqg", design), "unknown": run_unknown(make, LQG.options())}


def _trials() -> dict[str, Trial]:
    named = {f"{name} {label}": one for name, designs in SERIES.items() for label, one in designs.items()}
    series = {label: partial(measured, design.arguments()) for label, design in named.items()}
    return {"search": searched, **series, "shipped": partial(measured, {"noise": NOISE, "weights": WEIGHTS})}


def figures(result: Mapping[str, Any]) -> dict[str, float]:
    """Return a design's figures: slowest decay [1/s], share of lost laps, median of all [mm], nominal r.m.s. [mm]."""
    errors = np.array([np.inf if pair is None else pair[0] for pair in result["unknown"]])
    nominal = [lap[0]["rms"] for lap in result["nominal"].values()]
    return {
        "decay": float(np.min(result["decays"])),
        "lost": float(np.mean(~np.isfinite(errors))),
        "median": 1e3 * float(np.median(errors)),
        "nominal": 1e3 * float(np.mean(nominal)),
    }


def robust_table(results: Any) -> str:
    """Tabulate the last design of each series, what was found and what ships, and where the search ends."""
    *last, _ = (f"{name} {[*some][-1]}" for name, some in SERIES.items())  # the last one goes on beyond what is found
    shown = {label.removesuffix(" 0"): label for label in last}
    shown |= {"found": "from quick to found 100%", "shipped": "shipped"}
    lines = []
    for name, label in shown.items():
        one = figures(results[label])
        median = f"{one['median']:.0f}" if np.isfinite(one["median"]) else "lost"
        lines.append([name, f"{one['decay']:.2f}", f"{one['lost']:.1%}", median, f"{one['nominal']:.2f}"])
    *numbers, slowest = (f"{value:.3g}" for value in results["search"].values())
    lines.append([f"the search's end: {' / '.join(numbers)}", slowest, "-", "-", "-"])
    return table(["design", "slowest decay [1/s]", "unknown arms: lost", "median [mm]", "default arm [mm]"], lines)


def robust_picture(results: Any) -> Figure:
    """Draw lost laps against the slowest decay: each design a point, each series a colour."""
    figure, axis = plt.subplots(figsize=(WIDTH, 3.8))
    for (name, designs), colour in zip(SERIES.items(), COLOURS, strict=False):
        points = [figures(results[f"{name} {label}"]) for label in designs]
        x, y = [one["decay"] for one in points], [100.0 * one["lost"] for one in points]
        axis.plot(x, y, "o-", color=colour, label=name, markersize=5)
    shipped = figures(results["shipped"])
    axis.plot(shipped["decay"], 100.0 * shipped["lost"], "*", color="black", markersize=12, label="shipped")
    axis.axvline(0.0, color="0.6", linewidth=0.8)
    axis.set(xlabel="slowest decay over the published arms [1/s]; negative: deviations grow", ylabel="lost laps [%]")
    axis.set_ylim(bottom=-2.0)
    axis.legend()
    return figure


TEXT = "LQG for unknown arms: how its four numbers follow from the slowest decay"
STUDIES = study(__name__, "lqg_robust", TEXT, _trials, robust_table, robust_picture)
