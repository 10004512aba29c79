"""Joint control at 100 Hz: gains, command shaping, and what the gains of command shaping trade."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from flexarm_baselines.arrays import Floats
from flexarm_baselines.joint_space.tracking import DECOUPLED, STIFF, JointFeedback, Shape
from flexarm_env.laps import LAPS
from flexarm_env.simulation.arm import FlexibleArm
from scripts.common.markdown import table
from scripts.common.study import Trial
from scripts.control.trials import ERRORS, cell, run_laps, study

ELBOWS = (0.28, 0.8, 1.2, 1.57)  # [rad]; what a lap of the square passes through
PERIOD = 0.01  # [s]
AS_READ, ONE, TWO = (0.0, 0.0), (0.07, 0.19), (0.2, 0.15)  # time constants of the filters of angles and rates [s]
TRIED = (
    ("joint_pd", JointFeedback((1000.0, 130.0), (40.0, 30.0), *AS_READ)),
    ("joint_pd", JointFeedback((15.0, 7.7), (17.0, 0.1), *AS_READ)),
    ("joint_pd", JointFeedback((103.0, 140.0), (106.0, 36.0), *ONE)),
    ("joint_pd", JointFeedback((56.0, 74.0), (110.0, 19.0), *TWO)),
    ("joint_pd", JointFeedback((65.0, 30.0), (234.0, 52.0), 0.12, 0.33)),
    ("joint_pd", STIFF),
    ("computed_torque", JointFeedback((1.0, 1.0), (2.0, 2.0), *AS_READ, decoupled=True)),
    ("computed_torque", JointFeedback((1.0, 1.0), (2.0, 2.0), *ONE, decoupled=True)),
    ("computed_torque", JointFeedback((1.0, 1.0), (1.0, 1.0), *TWO, decoupled=True)),
    ("computed_torque", DECOUPLED),
)
SHAPES = (
    *(Shape(shaper, window=0.05) for shaper in ("none", "ZV", "ZVD", "EI")),
    *(Shape(shaper, window=0.15) for shaper in ("none", "EI")),
    Shape(),
    Shape(window=0.3),
    Shape(ramp=0.8),
    Shape(ramp=1.6),
)
FEEDFORWARDS = ("rigid", "flexible")
GAINS = {
    "stiffer": JointFeedback((103.0, 140.0), (106.0, 36.0), 0.07, 0.19),
    "as registered": JointFeedback(),
    "softer": JointFeedback((7.0, 6.0), (36.0, 3.3), 0.2, 0.5),
}
CHANGES: dict[str, dict[str, float]] = {
    "default arm": {},
    "motors 5 ms late": {"actuation_delay": 0.005},
    "motors 10 ms late": {"actuation_delay": 0.01},
    "payload 0.5 kg": {"payload_mass": 0.5},
}


def _gains_tried() -> dict[str, Trial]:
    return {f"{n}: {name}": partial(run_laps, name, {"feedback": feedback}) for n, (name, feedback) in enumerate(TRIED)}


def _values(feedback: JointFeedback) -> list[str]:
    """Write gains and filters."""
    pairs = (feedback.stiffness, feedback.resistance, (feedback.angle_filter, feedback.rate_filter))
    return [f"{a:g} / {b:g}" for a, b in pairs]


def gains_table(results: Any) -> str:
    """Tabulate the gains that were tried."""
    lines = [
        [f"`{name}`", *_values(feedback), f"{slowest_decay(feedback):.2f}", *(cell(lap) for lap in laps.values())]
        for (name, feedback), laps in zip(TRIED, results.values(), strict=True)
    ]
    head = ["law", "stiffness", "damping gain", "filters of angle and rate [s]", "slowest decay [1/s]", *ERRORS]
    return table(head, lines)


def _shapes_tried() -> dict[str, Trial]:
    return {
        f"{n}: {way}": partial(run_laps, "shaped", {"shape": shape, "feedforward": way})
        for n, shape in enumerate(SHAPES)
        for way in FEEDFORWARDS
    }


def shapes_table(results: Any) -> str:
    """Tabulate shapers, windows and starts with each feed-forward."""
    lines = [
        [
            *(shape.shaper, f"{shape.times} x {shape.window:g}", f"{shape.ramp:g}"),
            *(cell(lap) for way in FEEDFORWARDS for lap in results[f"{n}: {way}"].values()),
        ]
        for n, shape in enumerate(SHAPES)
    ]
    heads = (f"{way}: {lap}" for way in FEEDFORWARDS for lap in ERRORS)
    return table(["shaper", "windows [s]", "start [s]", *heads], lines)


def _feedback_tried() -> dict[str, Trial]:
    return {
        f"{name}, {change}": partial(run_laps, "shaped", {"feedback": feedback}, drawn(**quantities))
        for name, feedback in GAINS.items()
        for change, quantities in CHANGES.items()
    }


def drawn(**quantities: float) -> dict[str, Any]:
    """Return options of an arm some of whose quantities differ from what is published."""
    return {"randomisation": {name: (value, value) for name, value in quantities.items()}} if quantities else {}


def feedback_table(results: Any) -> str:
    """Tabulate other arms and late motors, a line for each lap."""
    lines = [
        [name, *_values(feedback), f"{slowest_decay(feedback):.2f}", lap]
        + [cell(results[f"{name}, {change}"][lap]) for change in CHANGES]
        for name, feedback in GAINS.items()
        for lap in LAPS
    ]
    head = ["gains", "stiffness [N m/rad]", "damping gain [N m s/rad]", "filters [s]", "slowest decay [1/s]", "lap"]
    return table([*head, *CHANGES], lines)


def slowest_decay(feedback: JointFeedback, elbows: tuple[float, ...] = ELBOWS) -> float:
    """Return the least decay rate of the loop at rest, with torques that are held [1/s]; negative: it is unstable.

    Args:
        feedback: gains and filters.
        elbows: angles of the elbow at which the arm rests [rad].
    """
    arm = FlexibleArm()
    states = np.zeros((len(elbows), 2 * arm.size))
    states[:, 1] = elbows
    found = arm.step_jacobians(states, (0.0, 0.0), PERIOD)
    slowest = np.inf
    for state, by_state, by_torque in zip(states, found.by_state, found.by_torque, strict=True):
        mass = arm.mass_matrix(state[: arm.size])[:2, :2] if feedback.decoupled else np.eye(2)
        poles = np.linalg.eigvals(_loop(by_state, by_torque, mass, feedback))
        slowest = min(slowest, float(-np.log(np.abs(poles).max()) / PERIOD))
    return slowest


def _loop(by_state: Floats, by_torque: Floats, mass: Floats, feedback: JointFeedback) -> Floats:
    """Return the matrix that carries state and filters over a period."""
    size = len(by_state)
    read = np.zeros((4, size))
    read[[0, 1, 2, 3], [0, 1, size // 2, size // 2 + 1]] = 1.0
    gains = mass @ np.concatenate([np.diag(feedback.stiffness), np.diag(feedback.resistance)], axis=1)
    with np.errstate(divide="ignore"):
        keep = np.diag(np.exp(-PERIOD / np.repeat([feedback.angle_filter, feedback.rate_filter], 2)))
    passed = (np.eye(4) - keep) @ read
    return np.block([[by_state - by_torque @ gains @ passed, -by_torque @ gains @ keep], [passed, keep]])


TEXT = "r.m.s. over the lap / after 2 s [mm]"
STUDIES = {
    **study(__name__, "joint_gains", "joint control: gains tried, the registered ones last", _gains_tried, gains_table),
    **study(__name__, "command_shaping", f"command shaping: {TEXT}", _shapes_tried, shapes_table),
    **study(__name__, "joint_feedback", f"the gains of command shaping: {TEXT}", _feedback_tried, feedback_table),
}
