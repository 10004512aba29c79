"""Drivers of an environment's kernels: actions, sensing, observation, termination; one control period of a batch.

Assembled and compiled like `stepping`, which explains lanes, blocks and arenas; names in capitals are rows of the
arena and places in the tables `settings` and `plan` (`rows`).
"""

from __future__ import annotations

from math import floor
from typing import Any

from flexarm_env.elementary import sincos
from flexarm_env.random_stream import normal, uniform
from flexarm_env.reporting import write_observations, write_previews
from flexarm_env.scalars import clip
from flexarm_env.stepping import (
    BEGAN,
    HEAD,
    PATH,
    SINCE,
    STEPS,
    past_reading,
    reference_at,
    reference_now,
    state_status,
)

LANES = 1
SIZE = 4
STEP = PERIOD = JITTER = HOLD = DROPOUT = ENCODER_NOISE = DEFLECTION_LIMIT = ERROR_LIMIT = LENGTHS = BRANCH = 0
WEIGHTS = SUBSTEPS = CHANNELS = KEPT_ACTIONS = PREVIEWS = 0
TAIL = NOISE = PLACE_DISTANCE = 0
DRAWN_NOISE = TERMS = 0  # place of the noise among the quantities drawn for an episode; terms of the reward
LATE = TRUE_SENSOR = False
SENSOR_DELAY = EPISODE = SAMPLE_TIME = SENSOR_ERROR = SENSOR_ERROR_RATE = SENSED = ACTION_CHANGE = MEASURED = 0
STATE = REFERENCE = SIDE_PASSED = SIDE_LEFT = PHASE = TIME = STATUS = DEFLECTION = TRUE_TIP = REWARD = REWARD_TERMS = 0
CHANNELS_OF_NOISE = 8  # random numbers set aside for each control period
FIRST_NOISE = 64  # random numbers set aside for the start of an episode


def truth_kernel(arena: Any) -> None:
    """State, tips and deflections of every lane (recorded)."""
    raise NotImplementedError("the recorded kernel exists in assembled modules only")


def joint_kernel(arena: Any, length_1: float, length_2: float, branch: float) -> None:
    """Joint angles and rates of the rigid arm on the reference, of every lane (recorded)."""
    raise NotImplementedError("the recorded kernel exists in assembled modules only")


def features_kernel(arena: Any, length_1: float, length_2: float, weights: Any) -> None:
    """Parts of observations and terms of the reward, of every lane (recorded)."""
    raise NotImplementedError("the recorded kernel exists in assembled modules only")


def sensed_point(
    arena: Any, history: Any, clock: Any, settings: Any, i: int, late: float, later: float
) -> tuple[float, float]:
    """Position that the sensor of lane i measured `late` (its elbow's angle `later`) seconds ago [m]."""
    h = settings[STEP]
    slots = history.shape[0] // (4 * LANES)
    slot = clock[HEAD, 0]
    first, second = 0.0, 0.0
    for j in range(2):
        value, _ = past_reading(history, slots, slot, i, j, h, (late if j == 0 else later) / h)
        if j == 0:
            first = value
        else:
            second = value
    if TRUE_SENSOR:
        return first, second
    one, both = sincos(first), sincos(first + second)
    distance = arena[i + PLACE_DISTANCE * LANES]
    length_1 = settings[LENGTHS]
    return length_1 * one[1] + distance * both[1], length_1 * one[0] + distance * both[0]


def take_actions(arena: Any, actions: Any, first: int, plan: Any) -> None:
    """Enter the actions of a block, limited to [-1, 1], before the earlier ones, and note their squared change."""
    channels = plan[CHANNELS]
    newest = TAIL + 2 * plan[PREVIEWS]
    for row in range(newest + plan[KEPT_ACTIONS] * channels - 1, newest + channels - 1, -1):
        for i in range(LANES):
            arena[i + row * LANES] = arena[i + (row - channels) * LANES]
    for r in range(channels):
        for i in range(LANES):
            action = clip(actions[first + i, r], -1.0, 1.0)
            change = action - arena[i + (newest + r) * LANES]
            before = arena[i + ACTION_CHANGE * LANES] if r > 0 else 0.0
            arena[i + (newest + r) * LANES] = action
            arena[i + ACTION_CHANGE * LANES] = before + change * change


def noise_place(clock: Any, plan: Any, i: int) -> int:
    """First of the random numbers set aside for the control period that lane i has reached."""
    return FIRST_NOISE + CHANNELS_OF_NOISE * 2 * ((clock[STEPS, i] - clock[BEGAN, i]) // plan[SUBSTEPS])


def newest_reading(
    arena: Any, clock: Any, keys: Any, plan: Any, settings: Any, i: int, now: float, before: float
) -> tuple[float, int]:
    """Age of the newest reading that has arrived at lane i [s], negative if there is none to take over.

    A continuous sensor gives one for each control instant. One with a clock of its own gives one for each of its ticks,
    delayed and lost by the tick's own draws, and a tick may arrive after a later one.

    Args:
        arena: of one block.
        clock: of each lane.
        keys: of each lane's episode.
        plan: see `rows`.
        settings: see `rows`.
        i: the lane.
        now: [s].
        before: when the reading that is known was taken [s].

    Returns:
        The age, and the first random number that belongs to the reading.
    """
    delay = arena[i + SENSOR_DELAY * LANES]
    least = before + 0.5 * settings[PERIOD]
    if settings[HOLD] == 0.0:
        if settings[DROPOUT] == 0.0 and settings[JITTER] == 0.0 and arena[i + (EPISODE + DRAWN_NOISE) * LANES] == 0.0:
            return (delay if now - delay >= least else -1.0), 0  # nothing random: the division is spared
        place = noise_place(clock, plan, i)
        if settings[DROPOUT] > 0.0 and uniform(keys[i], place) < settings[DROPOUT]:
            return -1.0, place
        late = delay
        if settings[JITTER] > 0.0:
            late += settings[JITTER] * uniform(keys[i], place + 1)
        return (late if now - late >= least else -1.0), place
    hold = settings[HOLD]
    first = floor(clock[BEGAN, i] * settings[STEP] / hold) - 2 - floor(delay / hold)
    newest = floor((now - delay) / hold + 1e-9)
    for back in range(int((settings[JITTER] + settings[PERIOD]) / hold) + 2):
        tick = newest - back
        late = now - tick * hold
        if tick * hold < least or tick < first:
            return -1.0, place
        place = FIRST_NOISE + 2 * CHANNELS_OF_NOISE * int(tick - first)
        arrived = delay + settings[JITTER] * uniform(keys[i], place + 1) <= late + 1e-9 * hold
        if arrived and uniform(keys[i], place) >= settings[DROPOUT]:
            return late, place
    return -1.0, place


def sample(arena: Any, history: Any, clock: Any, keys: Any, paths: Any, plan: Any, settings: Any, i: int) -> None:
    """Take over the latest reading that has arrived at lane i: its position, error, and the error's change.

    One that is not newer than the one before by half a control period is not taken over, so that the change per second
    stays meaningful.

    Args:
        arena: of one block.
        history: readings at past steps.
        clock: of each lane.
        keys: of each lane's episode.
        paths: of all lanes.
        plan: see `rows`.
        settings: see `rows`.
        i: the lane.
    """
    h = settings[STEP]
    now = clock[STEPS, i] * h
    later = arena[i + (SENSOR_DELAY + 1) * LANES] - arena[i + SENSOR_DELAY * LANES]
    before = arena[i + SAMPLE_TIME * LANES]
    late, place = newest_reading(arena, clock, keys, plan, settings, i, now, before)
    if late < 0.0:
        return
    taken = now - late
    x, y = sensed_point(arena, history, clock, settings, i, late, late + later)
    deviation = arena[i + (EPISODE + DRAWN_NOISE) * LANES]
    if deviation > 0.0:
        noise_x = deviation * normal(keys[i], place + 2)
        noise_y = deviation * normal(keys[i], place + 4)
        x += noise_x
        y += noise_y
        if LATE:  # the law sees the same noise until the next reading
            arena[i + NOISE * LANES] = noise_x
            arena[i + (NOISE + 1) * LANES] = noise_y
    # on the present side where it was follows from where it is, without a search
    then_x = arena[i + REFERENCE * LANES] - late * arena[i + (REFERENCE + 2) * LANES]
    then_y = arena[i + (REFERENCE + 1) * LANES] - late * arena[i + (REFERENCE + 3) * LANES]
    if late > arena[i + SIDE_PASSED * LANES]:
        then = reference_at(paths, clock[PATH, i], taken, taken + 1e-9 * h, clock[SINCE, i] * h)
        then_x, then_y = then[0], then[1]
    per_second = 1.0 / (taken - before)
    for r in range(2):
        error = then_x - x if r == 0 else then_y - y
        arena[i + (SENSOR_ERROR_RATE + r) * LANES] = (error - arena[i + (SENSOR_ERROR + r) * LANES]) * per_second
        arena[i + (SENSOR_ERROR + r) * LANES] = error
    arena[i + SENSED * LANES] = x
    arena[i + (SENSED + 1) * LANES] = y
    arena[i + SAMPLE_TIME * LANES] = taken


def observe(
    arena: Any,
    history: Any,
    clock: Any,
    keys: Any,
    paths: Any,
    plan: Any,
    settings: Any,
    observations: Any,
    first: int,
    who: Any,
) -> None:
    """Sense, judge and report the present instant.

    Args: as `look`, and
        observations: to be filled, of all lanes.
        first: lane of the block among all.
    """
    look(arena, history, clock, keys, paths, plan, settings, who)
    write_previews(arena, clock, paths, plan, settings)
    write_observations(arena, observations, first, plan, settings, who)


def look(arena: Any, history: Any, clock: Any, keys: Any, paths: Any, plan: Any, settings: Any, who: Any) -> None:
    """Sense, and judge the present instant, on a block; doing it again changes nothing.

    Args:
        arena: of one block.
        history: readings at past steps.
        clock: of each lane.
        keys: of each lane's episode.
        paths: of all lanes.
        plan: see `rows`.
        settings: see `rows`.
        who: lanes that sense; the others have done so already. Shape (LANES,).
    """
    h = settings[STEP]
    truth_kernel(arena)
    for i in range(LANES):
        reference = reference_now(clock, paths, h, i)
        for r in range(4):
            arena[i + (REFERENCE + r) * LANES] = reference[r]
        arena[i + SIDE_PASSED * LANES] = min(reference[4], (clock[STEPS, i] - clock[SINCE, i]) * h)
        arena[i + SIDE_LEFT * LANES] = reference[5]
        laps = clock[STEPS, i] * h / paths[clock[PATH, i], paths.shape[1] - 1, 0]
        arena[i + PHASE * LANES] = laps - int(laps)
        arena[i + TIME * LANES] = (clock[STEPS, i] - clock[BEGAN, i]) * h
        if who[i]:
            sample(arena, history, clock, keys, paths, plan, settings, i)
    for r in range(4):
        row = r if r < 2 else SIZE + r - 2
        deviation = settings[ENCODER_NOISE + r // 2]
        for i in range(LANES):
            arena[i + (MEASURED + r) * LANES] = arena[i + (STATE + row) * LANES]
        for i in range(LANES if deviation > 0.0 else 0):
            noise = normal(keys[i], noise_place(clock, plan, i) + CHANNELS_OF_NOISE + 2 * r)
            arena[i + (MEASURED + r) * LANES] += deviation * noise
    joint_kernel(arena, settings[LENGTHS], settings[LENGTHS + 1], settings[BRANCH])
    features_kernel(arena, settings[LENGTHS], settings[LENGTHS + 1], settings[WEIGHTS : WEIGHTS + TERMS])
    judge(arena, settings)


def judge(arena: Any, settings: Any) -> None:
    """Status of every lane: the state's (`state_status`), -2 for a link bent too far, -3 for too large an error."""
    state_status(arena)
    for i in range(LANES):
        if arena[i + STATUS * LANES] == 0.0:
            x = arena[i + TRUE_TIP * LANES] - arena[i + REFERENCE * LANES]
            y = arena[i + (TRUE_TIP + 1) * LANES] - arena[i + (REFERENCE + 1) * LANES]
            if x * x + y * y > settings[ERROR_LIMIT] * settings[ERROR_LIMIT]:
                arena[i + STATUS * LANES] = -3.0
            bent = max(abs(arena[i + DEFLECTION * LANES]), abs(arena[i + (DEFLECTION + 1) * LANES]))
            if bent > settings[DEFLECTION_LIMIT]:
                arena[i + STATUS * LANES] = -2.0
        else:  # no state, no reward
            arena[i + REWARD * LANES] = 0.0
            for n in range(TERMS):
                arena[i + (REWARD_TERMS + n) * LANES] = 0.0
