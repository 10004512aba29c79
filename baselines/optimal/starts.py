"""Runs to start the search from: the arm follows rigid inverse kinematics on a sequence of elbow branches.

Which side the elbow is on along a lap is the discrete part of the problem: a local search does not leave its sequence.
A start is made in two steps. Joint angles follow from the reference by rigid inverse kinematics, on one branch after
the other, with a smooth change through the straight pose between them. A preview controller then tracks the reference
about these angles: the same backward sweep as the solver's, of the arm linearised along them, with what they miss of
the dynamics as defects (the first step of multiple shooting, see Giftthaler et al., *A family of iterative Gauss-Newton
shooting methods for nonlinear optimal control*, IROS 2018).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flexarm_baselines.arrays import Floats
from flexarm_baselines.optimal.kernels import Model
from flexarm_baselines.optimal.problem import TrackingProblem
from flexarm_baselines.optimal.solver import rollout
from flexarm_baselines.optimal.sweep import sweep
from flexarm_env.physics.inverse_kinematics import joint_angles_for
from flexarm_env.simulation.feedback import Rollout
from flexarm_env.validation import choice, finite_array, number

SIDES = ("positive", "negative")
SWING = 0.4  # [s], of a change of sides


class Branch(NamedTuple):
    """A side of the elbow from some time on.

    Attributes:
        since: when the change to it begins [s].
        side: "positive" or "negative" theta2.
        duration: of the change [s].
    """

    since: float
    side: str
    duration: float = 0.5


def both_sides(own: str, since: float) -> tuple[tuple[Branch, ...], ...]:
    """Return the sequences that stay on a side, and that change to the other one at a time [s]."""
    other = SIDES[own == "positive"]
    return (Branch(0.0, own),), (Branch(0.0, own), Branch(since, other, SWING))


def joint_path(problem: TrackingProblem, branches: Sequence[Branch]) -> Floats:
    """Return joint angles that follow the reference by rigid inverse kinematics [rad]. Shape (n + 1, 2).

    Args:
        problem: with the reference.
        branches: in the order of time; the first counts from the start on.

    Raises:
        ValueError: if there is no branch, their times do not increase, or an entry is not allowed.
    """
    if not branches:
        raise ValueError("branches: must hold one at least")
    times = [number(f"branches[{n}].since", branch.since, "s", least=0.0) for n, branch in enumerate(branches)]
    if np.any(np.diff(times) <= 0.0):
        raise ValueError(f"branches: times must increase, got {times} s")
    time, found = problem.time, np.zeros((problem.periods + 1, 2))
    for n, branch in enumerate(branches):
        choice(f"branches[{n}].side", branch.side, SIDES)
        number(f"branches[{n}].duration", branch.duration, "s", above=0.0)
        angles = _inverse_kinematics(problem, 1.0 if branch.side == "positive" else -1.0)
        if n == 0:
            found = angles
            continue
        angles[:, 0] += 2.0 * np.pi * np.round((found[0, 0] - angles[0, 0]) / (2.0 * np.pi))
        share = np.clip((time - branch.since) / branch.duration, 0.0, 1.0)
        smooth = share * share * (3.0 - 2.0 * share)
        found = found + smooth[:, None] * (angles - found)
    return found


def _inverse_kinematics(problem: TrackingProblem, sign: float) -> Floats:
    lengths = problem.arm.parameters.link_lengths
    pairs = [joint_angles_for(*lengths, sign, float(x), float(y)) for x, y in problem.reference]
    return np.unwrap(np.array(pairs), axis=0)


def along(problem: TrackingProblem, branches: Sequence[Branch]) -> Rollout:
    """Run the arm along the reference on a sequence of branches; see `joint_path` and `follow`."""
    return follow(problem, joint_path(problem, branches))


def follow(problem: TrackingProblem, joints: Floats, damping: float = 0.1) -> Rollout:
    """Run the arm under a preview controller about a motion of its joints with straight links.

    Args:
        problem: what is tracked.
        joints: theta1, theta2 at each instant [rad]. Shape (n + 1, 2).
        damping: regularisation of the controller [m^2], as the problem's weight on torques.

    Returns:
        A run from the problem's initial state, within its limits.
    """
    angles = finite_array("joints", joints, (problem.periods + 1, 2))
    size = problem.arm.size
    states = np.zeros((problem.periods + 1, 2 * size))
    states[:, :2] = angles
    states[:, 0] += 2.0 * np.pi * np.round((problem.initial_state[0] - angles[0, 0]) / (2.0 * np.pi))
    states[:, size : size + 2] = np.gradient(angles, problem.period, axis=0)
    found = problem.arm.step_jacobians(states[:-1], (0.0, 0.0), problem.period, step=problem.step)
    expansion = problem.expand(states)
    limits = np.array(problem.limits)
    model = Model(
        found.by_state,
        found.by_torque,
        expansion.gradient,
        expansion.hessian,
        expansion.weights,
        np.zeros((problem.periods + 1, 2)),
        defects=found.state - states[1:],
    )
    forward, gains, *_ = sweep(model, regularisation=2.0 * damping / (problem.periods * limits**2))
    on_state, on_torque = gains[:, :, : 2 * size], gains[:, :, 2 * size :]
    return rollout(problem, forward, gains=on_state, references=states[:-1], torque_gains=on_torque)
