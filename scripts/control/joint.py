"""Joint control at 100 Hz: the gains that were tried, on readings as they are and on filtered ones."""

from __future__ import annotations

import numpy as np

from flexarm_baselines.arrays import Floats
from flexarm_baselines.joint_space.tracking import DECOUPLED, STIFF, JointFeedback
from flexarm_env.simulation.arm import FlexibleArm
from scripts.common.markdown import table
from scripts.control.trials import ERRORS, Scores, Study, Trial, Trials, errors

ELBOWS = (0.28, 0.8, 1.2, 1.57)  # [rad]; what a lap of the square passes through
PERIOD = 0.01  # [s]
AS_READ, ONE, TWO = (0.0, 0.0), (0.07, 0.19), (0.2, 0.15)  # time constants of the filters of angles and rates [s]
TRIED: list[tuple[str, JointFeedback]] = [
    *(
        ("joint_pd", JointFeedback(stiffness, resistance, *filters))
        for stiffness, resistance, filters in [
            ((1000.0, 130.0), (40.0, 30.0), AS_READ),
            ((15.0, 7.7), (17.0, 0.1), AS_READ),
            ((103.0, 140.0), (106.0, 36.0), ONE),
            ((56.0, 74.0), (110.0, 19.0), TWO),
            ((65.0, 30.0), (234.0, 52.0), (0.12, 0.33)),
        ]
    ),
    ("joint_pd", STIFF),
    *(
        ("computed_torque", JointFeedback(stiffness, resistance, *filters, decoupled=True))
        for stiffness, resistance, filters in [
            ((1.0, 1.0), (2.0, 2.0), AS_READ),
            ((1.0, 1.0), (2.0, 2.0), ONE),
            ((1.0, 1.0), (1.0, 1.0), TWO),
        ]
    ),
    ("computed_torque", DECOUPLED),
]


def trials(quick: bool) -> Trials:
    """Return both laws with all gains."""
    found = {_label(n): Trial(name, {"feedback": feedback}) for n, (name, feedback) in enumerate(TRIED)}
    return dict(list(found.items())[:1]) if quick else found


def rows(scores: Scores) -> str:
    """Write the table."""
    head = ["law", "stiffness", "damping gain", "filters of angle and rate [s]", "slowest decay [1/s]", *ERRORS]
    lines = []
    for n, (name, feedback) in enumerate(TRIED):
        if _label(n) in scores:
            pairs = [f"{a:g} / {b:g}" for a, b in (feedback.stiffness, feedback.resistance)]
            filters = f"{feedback.angle_filter:g} / {feedback.rate_filter:g}"
            decay = f"{slowest_decay(feedback):.2f}"
            lines.append([f"`{name}`", *pairs, filters, decay, *errors(scores[_label(n)])])
    return table(head, lines)


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


def _label(n: int) -> str:
    return f"{n}: {TRIED[n][0]}"


STUDY = Study("joint control: gains tried, the registered ones last", trials, rows, "controllers.md")
