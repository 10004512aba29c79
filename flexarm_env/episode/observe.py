"""Drivers of an environment's kernels: actions, sensing, observation, termination; one control period of a batch.

Assembled and compiled like `stepping`, which explains lanes, blocks and arenas; names in capitals are rows of the
arena and places in the tables `settings` and `plan` (`rows`).
"""

from __future__ import annotations

from math import floor
from typing import Any

from flexarm_env.codegen.random_stream import normal
from flexarm_env.codegen.scalars import clip
from flexarm_env.episode.sensor import CHANNELS_OF_NOISE, noise_place, sense
from flexarm_env.episode.write_observation import write_observations, write_previews
from flexarm_env.kernels.imex import BEGAN, PATH, SINCE, STEPS, state_status
from flexarm_env.kernels.path_cache import AHEAD, SIDE_BEGIN, SIDE_END, SIDE_LAP, SIDE_VELOCITY, note_side, on_side

LANES = 1
SIZE = 4
STEP = ENCODER_NOISE = DEFLECTION_LIMIT = ERROR_LIMIT = LENGTHS = BRANCH = LAP = 0
WEIGHTS = CHANNELS = KEPT_ACTIONS = PREVIEWS = TAIL = 0
TERMS = 0  # of the reward
DISTURBED = False
ACTION_CHANGE = MEASURED = STATE = REFERENCE = PHASE = TIME = STATUS = DEFLECTION = TRUE_TIP = REWARD = REWARD_TERMS = 0
PRESENT_SIDE = SIDE_PASSED = SIDE_LEFT = NEXT_TIME = NEXT_VELOCITY = 0


def truth_kernel(arena: Any) -> None:
    """State, tips and deflections of every lane (recorded)."""
    raise NotImplementedError("the recorded kernel exists in assembled modules only")


def joint_kernel(arena: Any, length_1: float, length_2: float, branch: float) -> None:
    """Joint angles and rates of the rigid arm on the reference, of every lane (recorded)."""
    raise NotImplementedError("the recorded kernel exists in assembled modules only")


def features_kernel(arena: Any, length_1: float, length_2: float, weights: Any) -> None:
    """Parts of observations and terms of the reward, of every lane (recorded)."""
    raise NotImplementedError("the recorded kernel exists in assembled modules only")


def take_actions(arena: Any, actions: Any, first: int, plan: Any) -> None:
    """Enter the actions of a block, limited to [-1, 1], before the earlier ones, and note their squared change."""
    channels = plan[CHANNELS]
    newest = TAIL + 2 * plan[PREVIEWS]
    for row in range(newest + plan[KEPT_ACTIONS] * channels - 1, newest + channels - 1, -1):
        kept = arena[row * LANES : (row + 1) * LANES]
        later = arena[(row - channels) * LANES : (row - channels + 1) * LANES]
        for i in range(LANES):
            kept[i] = later[i]
    changes = arena[ACTION_CHANGE * LANES : (ACTION_CHANGE + 1) * LANES]
    for i in range(LANES):
        changes[i] = 0.0
    ours = actions[first : first + LANES]
    for r in range(channels):
        last = arena[(newest + r) * LANES : (newest + r + 1) * LANES]
        for i in range(LANES):
            action = clip(ours[i, r], -1.0, 1.0)
            change = action - last[i]
            last[i] = action
            changes[i] += change * change


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

    Args: as `sampling.sense`, and
        observations: to be filled, of all lanes.
        first: lane of the block among all.
    """
    look(arena, history, clock, keys, paths, plan, settings, who)
    write_previews(arena, clock, paths, plan, settings)
    write_observations(arena, observations, first, plan, settings, who)


def look(arena: Any, history: Any, clock: Any, keys: Any, paths: Any, plan: Any, settings: Any, who: Any) -> None:
    """Sense, and judge the present instant, on a block; doing it again changes nothing.

    Args: as `sampling.sense`.
    """
    truth_kernel(arena)
    follow_reference(arena, clock, paths, settings)
    sense(arena, history, clock, keys, paths, plan, settings, who)
    for r in range(4):
        row = r if r < 2 else SIZE + r - 2
        for i in range(LANES):
            arena[i + (MEASURED + r) * LANES] = arena[i + (STATE + row) * LANES]
        if DISTURBED:
            deviation = settings[ENCODER_NOISE + r // 2]
            for i in range(LANES if deviation > 0.0 else 0):
                noise = normal(keys[i], noise_place(clock, plan, i) + CHANNELS_OF_NOISE + 2 * r)
                arena[i + (MEASURED + r) * LANES] += deviation * noise
    joint_kernel(arena, settings[LENGTHS], settings[LENGTHS + 1], settings[BRANCH])
    features_kernel(arena, settings[LENGTHS], settings[LENGTHS + 1], settings[WEIGHTS : WEIGHTS + TERMS])
    judge(arena, settings)


def follow_reference(arena: Any, clock: Any, paths: Any, settings: Any) -> None:
    """The reference of every lane at the present instant, its phase of the lap, and the episode's time.

    A lane knows the side of the path it is on; only where that ends is the next one searched for.
    """
    h = settings[STEP]
    turning = 0
    for i in range(LANES):
        turning += side_time(arena, clock, h, i) >= arena[i + (PRESENT_SIDE + SIDE_END) * LANES]
    for i in range(LANES if turning > 0 else 0):
        if side_time(arena, clock, h, i) >= arena[i + (PRESENT_SIDE + SIDE_END) * LANES]:
            p = clock[PATH, i]
            k = note_side(arena, PRESENT_SIDE, paths, p, (clock[STEPS, i] + AHEAD) * h, i)
            following = k + 1 if k + 2 < paths.shape[1] else 0
            arena[i + NEXT_TIME * LANES] = paths[p, following + 1, 0] - paths[p, following, 0]
            for r in range(2):
                arena[i + (NEXT_VELOCITY + r) * LANES] = paths[p, following, 3 + r]
    lap = settings[LAP]
    for i in range(LANES):
        now = clock[STEPS, i] * h
        within = now - arena[i + (PRESENT_SIDE + SIDE_LAP) * LANES]
        passed = within - arena[i + (PRESENT_SIDE + SIDE_BEGIN) * LANES]
        for r in range(2):
            arena[i + (REFERENCE + r) * LANES] = on_side(arena, PRESENT_SIDE, i, r, now)
            arena[i + (REFERENCE + 2 + r) * LANES] = arena[i + (PRESENT_SIDE + SIDE_VELOCITY + r) * LANES]
        arena[i + SIDE_PASSED * LANES] = min(passed, (clock[STEPS, i] - clock[SINCE, i]) * h)
        arena[i + SIDE_LEFT * LANES] = arena[i + (PRESENT_SIDE + SIDE_END) * LANES] - within
        laps = now / lap
        arena[i + PHASE * LANES] = laps - floor(laps)
        arena[i + TIME * LANES] = (clock[STEPS, i] - clock[BEGAN, i]) * h


def side_time(arena: Any, clock: Any, h: float, i: int) -> float:
    """Time of the lap that says whether lane i's reference is still on its side [s]."""
    return (clock[STEPS, i] + AHEAD) * h - arena[i + (PRESENT_SIDE + SIDE_LAP) * LANES]


def judge(arena: Any, settings: Any) -> None:
    """Status of every lane: the state's (`state_status`), -2 for a link bent too far, -3 for too large an error."""
    state_status(arena)
    for i in range(LANES):
        status = arena[i + STATUS * LANES]
        x = arena[i + TRUE_TIP * LANES] - arena[i + REFERENCE * LANES]
        y = arena[i + (TRUE_TIP + 1) * LANES] - arena[i + (REFERENCE + 1) * LANES]
        bent = max(abs(arena[i + DEFLECTION * LANES]), abs(arena[i + (DEFLECTION + 1) * LANES]))
        far = x * x + y * y > settings[ERROR_LIMIT] * settings[ERROR_LIMIT]
        outside = -2.0 if bent > settings[DEFLECTION_LIMIT] else (-3.0 if far else 0.0)
        arena[i + STATUS * LANES] = outside if status == 0.0 else status
        reward = arena[i + REWARD * LANES]
        arena[i + REWARD * LANES] = reward if status == 0.0 else 0.0  # no state, no reward
        for n in range(TERMS):
            term = arena[i + (REWARD_TERMS + n) * LANES]
            arena[i + (REWARD_TERMS + n) * LANES] = term if status == 0.0 else 0.0
