"""Drivers of a race: the action sets the speed at which the reference moves along the path; laps and their times.

Contouring control with progress as an action (Lam, Manzie & Good, *Model predictive contouring control*, CDC 2010;
Liniger, Domahidi & Morari, *Optimization-based autonomous racing of 1:43 scale RC cars*, 2015). The tables of the paths
have distances in place of times (`paths.by_distance`), so that their velocities are directions. `imex` explains lanes,
blocks and arenas.
"""

from __future__ import annotations

from numpy import floor

from flexarm_env.kernels.entries import clock_row, setting, word
from flexarm_env.kernels.layout import row
from flexarm_env.kernels.reference import lap_of
from flexarm_env.kernels.variants import Block, variant

FINISHED = -5.0  # the status of a race whose laps are done
DONE = 1e-9  # of a lap; a way that is shorter by it is a whole lap, whatever the rounding


def begin_race(block: Block, i: int) -> None:
    """Put lane i's reference at rest where its race begins."""
    arena = block.arena
    arena[row.PROGRESS, i] = 0.0
    arena[row.REFERENCE_SPEED, i] = 0.0
    arena[row.LAP_BEGUN, i] = 0.0
    for r in range(3):
        arena[row.LAP_TIMES + r, i] = 0.0


def move_references(block: Block) -> None:
    """Move each lane's reference as far as it gets in the control period that begins; note when it ends laps."""
    header, settings, arena, clock = block.header, block.settings, block.arena, block.clock
    wanted = row.TAIL + 2 * header[word.PREVIEWS] + 2
    period = settings[setting.PERIOD]
    for i in range(variant.lanes):
        before, change = arena[row.REFERENCE_SPEED, i], arena[row.PACE + 1, i] * period
        speed = arena[row.PACE, i] * max(arena[wanted, i], 0.0)
        speed = min(max(speed, before - change), before + change)
        arena[row.REFERENCE_SPEED, i] = speed
        lap, start = lap_of(block, i), arena[row.PROGRESS, i]
        arena[row.PROGRESS, i] = start + speed * period
        laps = floor(arena[row.PROGRESS, i] / lap + DONE)
        if laps > floor(start / lap + DONE) and laps <= arena[row.RACE_LAPS, i]:
            now = (clock[clock_row.STEPS, i] - clock[clock_row.BEGAN, i] + header[word.SUBSTEPS]) * settings[
                setting.STEP
            ]
            ended = now - max(arena[row.PROGRESS, i] - laps * lap, 0.0) / speed
            time = ended - arena[row.LAP_BEGUN, i]
            arena[row.LAP_BEGUN, i] = ended
            if laps == 1.0:
                arena[row.LAP_TIMES, i] = time
            fastest = arena[row.LAP_TIMES + 1, i]
            arena[row.LAP_TIMES + 1, i] = time if laps == 1.0 else min(time, fastest)
            arena[row.LAP_TIMES + 2, i] = ended if laps == arena[row.RACE_LAPS, i] else 0.0


def note_finish(block: Block) -> None:
    """Set the status of the lanes whose race is done, unless something else ends it at the same instant."""
    arena = block.arena
    for i in range(variant.lanes):
        laps = arena[row.PROGRESS, i] / lap_of(block, i) + DONE
        done = arena[row.STATUS, i] == 0.0 and laps >= arena[row.RACE_LAPS, i]
        arena[row.STATUS, i] = FINISHED if done else arena[row.STATUS, i]
