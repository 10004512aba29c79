"""Drivers of disturbances: pulses of force at the tip, and drift of the strain gauges.

`imex` explains lanes, blocks and arenas.
"""

from __future__ import annotations

from numpy import floor

from flexarm_env.kernels.entries import clock_row, setting
from flexarm_env.kernels.layout import row
from flexarm_env.kernels.variants import Block, variant


def overlap(begin: float, end: float, first: float, last: float) -> float:
    """Return how long two intervals of time overlap [s]."""
    return max(0.0, min(end, last) - max(begin, first))


def push_tips(block: Block, done: int) -> None:
    """Write each lane's force at the tip in the integration step after `done` of the period: its mean over the step."""
    settings, arena, clock = block.settings, block.arena, block.clock
    h = settings[setting.STEP]
    for i in range(variant.lanes):
        begin = (clock[clock_row.STEPS, i] - clock[clock_row.BEGAN, i] + done) * h
        first, duration, period = (
            arena[row.PULSE_TIMES, i],
            arena[row.PULSE_TIMES + 1, i],
            arena[row.PULSE_TIMES + 2, i],
        )
        if period > 0.0:  # the latest one that has begun; the next one may begin within the step
            first += max(0.0, floor((begin - first) / period)) * period
        share = overlap(begin, begin + h, first, first + duration)
        if period > 0.0:
            share += overlap(begin, begin + h, first + period, first + period + duration)
        for r in range(2):
            arena[row.TIP_FORCE + r, i] = share / h * arena[row.PULSE_FORCE + r, i]


def read_gauges(block: Block) -> None:
    """Write what each lane's strain gauges read: modal coordinates and rates, the links' first ones drifting."""
    arena = block.arena
    for at in range(4 * variant.modes):
        rates, mode = at // (2 * variant.modes), at % (2 * variant.modes)
        state = row.STATE + 2 + mode + rates * variant.size
        drifts = mode % variant.modes == 0
        link = mode // variant.modes
        for i in range(variant.lanes):
            off = arena[row.GAUGE_DRIFT + link, i] if drifts else 0.0
            off *= 1.0 if rates == 1 else arena[row.TIME, i]
            arena[row.GAUGES + at, i] = arena[state, i] + off
