"""Drivers of the torque-driven arm: the classical Runge-Kutta method over lanes, steps and control periods.

Torques are held over each period, or a function's, which gives them in Python at each stage. `imex` explains lanes,
blocks and arenas.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexarm_env.codegen.arrays import Arena
from flexarm_env.codegen.declarations import Program, per_lane
from flexarm_env.codegen.rows import lane_rows
from flexarm_env.kernels.layout import row
from flexarm_env.kernels.recorded import momentum_kernel, slope_kernel, step_kernel
from flexarm_env.kernels.states import ArmTable, load_arms, load_states, store_state
from flexarm_env.kernels.variants import variant


def find_momenta(arena: Arena) -> None:
    """Compute the momenta of a block's arms, and their rates without the motors' part; see `momentum_kernel`."""
    momentum_kernel(lane_rows(arena, variant.lanes))


def find_slopes(arena: Arena) -> None:
    """Compute the rates of a block's arms, and those of their momenta; see `slope_kernel`."""
    slope_kernel(lane_rows(arena, variant.lanes))


OPEN = Program("open", entry_points=(find_momenta, find_slopes), description="an arm driven by a function of its state")


Sequences = NDArray[np.float64]  # numbers of each arm, or of all in one, period by period. Shape (arms or 1, n, ...)


@per_lane
def feedback_torque(
    feedforward: NDArray[np.float64],
    gains: NDArray[np.float64],
    references: NDArray[np.float64],
    torque_gains: NDArray[np.float64],
    limits: NDArray[np.float64],
    state: NDArray[np.float64],
    before: NDArray[np.float64],
    torque: NDArray[np.float64],
) -> None:
    """Compute the torque of one arm over a period.

    It is ``clip(feedforward + gains (state - reference) + torque_gains before)``.

    Args:
        feedforward: [N m]. Shape (2,).
        gains: on the state. Shape (2, 2 * size), or (0, 0) for none.
        references: state that the gains refer to. Shape (2 * size,), or (0,) without gains.
        torque_gains: on the torque of the period before. Shape (2, 2), or (0, 0) for none.
        limits: largest magnitudes [N m]. Shape (2,).
        state: present public state. Shape (2 * size,).
        before: torque of the period before [N m]. Shape (2,).
        torque: receives the torque [N m]. Shape (2,).
    """
    for j in range(2):
        value = feedforward[j]
        for n in range(references.shape[0]):
            value += gains[j, n] * (state[n] - references[n])
        for n in range(torque_gains.shape[0]):
            value += torque_gains[j, n] * before[n]
        value = limits[j] if value > limits[j] else value
        torque[j] = -limits[j] if value < -limits[j] else value


def run_feedback(
    arena: Arena,
    arms: ArmTable,
    feedforward: Sequences,
    gains: Sequences,
    references: Sequences,
    torque_gains: Sequences,
    limits: NDArray[np.float64],
    h: float,
    steps: int,
    states: NDArray[np.float64],
    torques: NDArray[np.float64],
) -> None:
    """Drive many arms by linear feedback, each torque held over a period of some steps.

    Args:
        arena: to work in.
        arms: what kernels know of each (`layout.arm_rows`), or of all. Shape (arms or 1, numbers).
        feedforward: see `feedback_torque`. Shape (arms or 1, n, 2).
        gains: Shape (arms or 1, n, 2, 2 * size), or (1, n, 0, 0) for none.
        references: Shape (arms or 1, n, 2 * size), or (1, n, 0) without gains.
        torque_gains: Shape (arms or 1, n, 2, 2), or (1, n, 0, 0) for none.
        limits: Shape (2,) [N m].
        h: step [s].
        steps: in each period.
        states: public; the first of each arm is where it starts, the others are received.
            Shape (arms, n + 1, 2 * size).
        torques: of the period before the first in the first place; receives those of the periods in the others [N m].
            Shape (arms, n + 1, 2).
    """
    arena = lane_rows(arena, variant.lanes)
    last = states.shape[0] - 1
    for first in range(0, states.shape[0], variant.lanes):
        load_arms(arena, row.CONSTANTS, arms, first)
        load_states(arena, states[:, 0], first)
        momentum_kernel(arena)
        for period in range(states.shape[1] - 1):
            for i in range(variant.lanes):
                arm = min(first + i, last)
                feedback_torque(
                    feedforward[min(arm, feedforward.shape[0] - 1), period],
                    gains[min(arm, gains.shape[0] - 1), period],
                    references[min(arm, references.shape[0] - 1), period],
                    torque_gains[min(arm, torque_gains.shape[0] - 1), period],
                    limits,
                    states[arm, period],
                    torques[arm, period],
                    torques[arm, period + 1],
                )
                for j in range(2):
                    arena[row.TAU + j, i] = torques[arm, period + 1, j]
            for _ in range(steps):
                step_kernel(arena, h)
            for i in range(min(variant.lanes, states.shape[0] - first)):
                store_state(arena, i, row.Y, states[first + i, period + 1])


FEEDBACK = Program(
    "feedback",
    entry_points=(run_feedback,),
    allocation_free=True,
    description="an arm driven by torques",
)
