"""Drivers of an environment's kernels: actions, sensing, observation, termination.

`imex` explains lanes, blocks and arenas.
"""

from __future__ import annotations

from numpy import floor

from flexarm_env.codegen.arrays import (
    Actions,
    Arena,
    LaneRow,
    LaneRows,
    Mask,
    Observations,
    Table,
)
from flexarm_env.codegen.declarations import per_lane
from flexarm_env.codegen.elementary import normal
from flexarm_env.codegen.intrinsics import TILE, write_tile
from flexarm_env.codegen.scalars import clip
from flexarm_env.episode.actuation import make_room
from flexarm_env.episode.disturbances import read_gauges
from flexarm_env.episode.features import features_kernel, joint_kernel
from flexarm_env.episode.further_sensors import sense_further
from flexarm_env.episode.payload import NEAR
from flexarm_env.episode.race import FINISHED, note_finish
from flexarm_env.episode.sensor import CHANNELS_OF_NOISE, joint_motion, noise_place, sense
from flexarm_env.kernels.entries import clock_row, segment, setting, word
from flexarm_env.kernels.layout import row
from flexarm_env.kernels.recorded import truth_kernel
from flexarm_env.kernels.reference import follow_reference, lap_of, path_time
from flexarm_env.kernels.variants import Block, variant
from flexarm_env.physics.inverse_kinematics import elbow_side
from flexarm_env.physics.polyline import AHEAD, reference_at

FINAL_REST = 0.25  # of the lap; the rest after the move back (`reset.draw_moves`)


def push_actions(block: Block, actions: Actions) -> None:
    """Write the actions of a block, limited to [-1, 1], in front of the earlier ones, and their squared change."""
    first, header, arena = block.first, block.header, block.arena
    newest = row.TAIL + 2 * header[word.PREVIEWS]
    make_room(arena, header, newest)
    changes: LaneRow = arena[row.ACTION_CHANGE]
    for i in range(variant.lanes):
        changes[i] = 0.0
    ours = actions[first : first + variant.lanes]
    for r in range(header[word.CHANNELS]):
        last: LaneRow = arena[newest + r]
        for i in range(variant.lanes):
            action = clip(ours[i, r], -1.0, 1.0)
            change = action - last[i]
            last[i] = action
            changes[i] += change * change


def update_measurements(block: Block) -> None:
    """Update a block's measurements, reward and termination status; repeating it changes nothing."""
    settings, arena, keys = block.settings, block.arena, block.keys
    if not variant.hosted:
        truth_kernel(arena)
    follow_reference(block, settings[setting.STEP])
    note_times(block)
    if variant.drifting:
        read_gauges(block)
    sense(block)
    if variant.further_readings:
        sense_further(block)
    for r in range(4):
        at = r if r < 2 else variant.size + r - 2
        for i in range(variant.lanes):
            if variant.hosted:
                arena[row.ENCODERS + r, i] = arena[row.JOINTS + r, i]
            else:
                arena[row.ENCODERS + r, i] = arena[row.STATE + at, i]
        if variant.disturbed:
            noisy = 0
            for i in range(variant.lanes):
                noisy += arena[row.ENCODER_NOISE + r // 2, i] > 0.0
            for i in range(variant.lanes if noisy > 0 else 0):
                deviation = arena[row.ENCODER_NOISE + r // 2, i]
                if deviation > 0.0:
                    noise = normal(keys[i], noise_place(block, i) + CHANNELS_OF_NOISE + 2 * r)
                    arena[row.ENCODERS + r, i] += deviation * noise
    if variant.disturbed:
        count_encoders(arena, settings)
    joint_kernel(arena, settings[setting.LENGTHS], settings[setting.LENGTHS + 1])
    note_elbow(arena)
    aim_on_present_side(arena, settings)
    features_kernel(
        arena,
        settings[setting.LENGTHS],
        settings[setting.LENGTHS + 1],
        settings[setting.WEIGHTS : setting.WEIGHTS + variant.reward_terms],
    )
    if variant.own_paths:
        note_rest(block)
    termination_status(arena, settings)
    if variant.racing:
        note_finish(block)


def count_encoders(arena: Arena, settings: Table) -> None:
    """Round each lane's joint angles to the encoders' counts, and compute rates from changes of the counts.

    A rate is the count's change over a control period in which the joint turned at its present rate, per second.
    """
    period = settings[setting.PERIOD]
    for r in range(2):
        step = settings[setting.ENCODER_RESOLUTION + r]
        for i in range(variant.lanes if step > 0.0 else 0):
            angle, rate = arena[row.ENCODERS + r, i], arena[row.ENCODERS + 2 + r, i]
            count = floor(angle / step + 0.5)
            arena[row.ENCODERS + r, i] = step * count
            arena[row.ENCODERS + 2 + r, i] = step * (count - floor((angle - period * rate) / step + 0.5)) / period


def note_times(block: Block) -> None:
    """Compute each lane's time of the episode, its phase of the lap, and the times since and until its side changes."""
    settings, arena, clock = block.settings, block.arena, block.clock
    h = settings[setting.STEP]
    for i in range(variant.lanes):
        now = path_time(arena, clock, h, 0.0, i)
        within = now - arena[row.PRESENT_SEGMENT + segment.LAP, i]
        passed = within - arena[row.PRESENT_SEGMENT + segment.BEGIN, i]
        arena[row.SEGMENT_PASSED, i] = min(passed, (clock[clock_row.STEPS, i] - clock[clock_row.SINCE, i]) * h)
        arena[row.SEGMENT_LEFT, i] = arena[row.PRESENT_SEGMENT + segment.END, i] - within
        laps = now / lap_of(block, i)
        arena[row.PHASE, i] = laps - floor(laps)
        arena[row.TIME, i] = (clock[clock_row.STEPS, i] - clock[clock_row.BEGAN, i]) * h


def note_elbow(arena: Arena) -> None:
    """Update each lane's elbow side, the number of its changes, and the side by the encoders.

    An elbow that is on neither side (`elbow_side`), or whose state is not finite, keeps its last side; at the start of
    an episode, that is 0.
    """
    for i in range(variant.lanes):
        side, before = elbow_side(arena[row.STATE + 1, i]), arena[row.ELBOW_SIDE, i]
        arena[row.ELBOW_CHANGES, i] += 1.0 if side * before < 0.0 else 0.0
        arena[row.ELBOW_SIDE, i] = before if side == 0.0 else side
        measured = elbow_side(arena[row.ENCODERS + 1, i])
        arena[row.MEASURED_SIDE, i] = arena[row.MEASURED_SIDE, i] if measured == 0.0 else measured


def aim_on_present_side(arena: Arena, settings: Table) -> None:
    """Compute each lane's joint angles and rates of the rigid arm on the reference, with the elbow's present side.

    They equal `REFERENCE_JOINTS`, unless the elbow has left the side that inverse kinematics uses.
    """
    for r in range(4):
        for i in range(variant.lanes):
            arena[row.PRESENT_JOINT + r, i] = arena[row.REFERENCE_JOINTS + r, i]
    swung = 0
    for i in range(variant.lanes):
        swung += arena[row.MEASURED_SIDE, i] * arena[row.BRANCH, i] < 0.0
    for i in range(variant.lanes if swung > 0 else 0):
        side = arena[row.MEASURED_SIDE, i]
        if side * arena[row.BRANCH, i] < 0.0:
            x, y = arena[row.REFERENCE, i], arena[row.REFERENCE + 1, i]
            vx, vy = arena[row.REFERENCE + 2, i], arena[row.REFERENCE + 3, i]
            present = joint_motion(settings, side, (x, y, vx, vy))
            for r in range(4):
                arena[row.PRESENT_JOINT + r, i] = present[r]


def note_rest(block: Block) -> None:
    """Determine for each lane whether the tip stayed near the reference during the final rest of a lap of moves.

    The result is set at the first instant after the lap and kept until the next lap ends; before that it is 0.
    """
    settings, arena, clock = block.settings, block.arena, block.clock
    h = settings[setting.STEP]
    for i in range(variant.lanes):
        lap = arena[row.LAP, i]
        now = (clock[clock_row.STEPS, i] + AHEAD) * h
        if not arena[row.TIP_ERROR, i] <= NEAR:
            arena[row.AWAY, i] = now
        end = floor(now / lap) * lap  # of the latest complete lap
        if now - end < settings[setting.PERIOD]:
            arena[row.SUCCESS, i] = 1.0 if arena[row.AWAY, i] < end - FINAL_REST * lap else 0.0


def termination_status(arena: Arena, settings: Table) -> None:
    """Set each lane's status: that of the state (`state_status`), -2 for a link bent too far, -3 for a large error."""
    state_status(arena)
    for i in range(variant.lanes):
        status = arena[row.STATUS, i]
        bent = max(abs(arena[row.DEFLECTION, i]), abs(arena[row.DEFLECTION + 1, i]))
        far = arena[row.TIP_ERROR, i] > settings[setting.ERROR_LIMIT]
        outside = -2.0 if bent > settings[setting.DEFLECTION_LIMIT] else (-3.0 if far else 0.0)
        arena[row.STATUS, i] = outside if status == 0.0 else status
        reward = arena[row.REWARD, i]
        arena[row.REWARD, i] = reward if status == 0.0 else 0.0  # an invalid state has no reward
        for n in range(variant.reward_terms):
            term = arena[row.REWARD_TERMS + n, i]
            arena[row.REWARD_TERMS + n, i] = term if status == 0.0 else 0.0


def state_status(arena: Arena) -> None:
    """Write each lane's status: 0 if its state is valid, -1 if not finite, n if entry n - 1 is beyond its limit."""
    for i in range(variant.lanes):
        status = 0.0
        for r in range(2 * variant.size - 1, -1, -1):
            beyond = not abs(arena[row.STATE + r, i]) <= arena[row.LIMITS + r, i]
            status = r + 1.0 if beyond else status
        for r in range(2 * variant.size):
            value = arena[row.STATE + r, i]
            status = status if value - value == 0.0 else -1.0
        arena[row.STATUS, i] = status


def failures(size: int) -> dict[float, str | None]:
    """Return the reason for which the kernels end an episode, by its status; 0 is that of a valid state.

    Args:
        size: number of internal coordinates.
    """
    entries = ("angle", "angle", *["deflection"] * (size - 2), *["rate"] * size)
    others = {0.0: None, -1.0: "diverged", -2.0: "deflection", -3.0: "error", FINISHED: "finished"}
    return others | {1.0 + n: reason for n, reason in enumerate(entries)}


def write_previews(block: Block) -> None:
    """Write the displacement of the reference until each horizon, in the frame; of a race, horizons are distances.

    The velocities of the present side and the next are cached, so that this is vectorised over the lanes; the path is
    searched only for horizons beyond them.
    """
    header, settings, arena, clock, paths = block.header, block.settings, block.arena, block.clock, block.paths
    for n in range(header[word.PREVIEWS]):
        horizon = settings[setting.HORIZONS + n]
        at = row.TAIL + 2 * n
        preview: LaneRows = arena[at : at + 2]
        beyond = 0
        for i in range(variant.lanes):
            along = min(horizon, arena[row.SEGMENT_LEFT, i])
            after = horizon - along
            x = along * arena[row.PRESENT_SEGMENT + segment.VELOCITY, i] + after * arena[row.NEXT_VELOCITY, i]
            y = along * arena[row.PRESENT_SEGMENT + segment.VELOCITY + 1, i] + after * arena[row.NEXT_VELOCITY + 1, i]
            write_preview(arena, preview, i, x, y)
            beyond += after > arena[row.NEXT_TIME, i]
        for i in range(variant.lanes if beyond > 0 else 0):
            if horizon - arena[row.SEGMENT_LEFT, i] > arena[row.NEXT_TIME, i]:
                time = path_time(arena, clock, settings[setting.STEP], 0.0, i) + horizon
                there = reference_at(paths, clock[clock_row.PATH, i], time, time, -1e18)
                x, y = there[0] - arena[row.REFERENCE, i], there[1] - arena[row.REFERENCE + 1, i]
                write_preview(arena, preview, i, x, y)


@per_lane
def write_preview(arena: Arena, preview: LaneRows, i: int, x: float, y: float) -> None:
    """Write a displacement of lane i's reference [m], turned into the frame."""
    cosine, sine = arena[row.FRAME_AXIS, i], arena[row.FRAME_AXIS + 1, i]
    preview[0, i] = cosine * x + sine * y
    preview[1, i] = cosine * y - sine * x


def write_observations(block: Block, observations: Observations) -> None:
    """Write the observations of a block's active lanes; a lane whose state is not valid keeps its last one."""
    first, header, settings, arena, active = block.first, block.header, block.settings, block.arena, block.active
    factors = setting.HORIZONS + header[word.PREVIEWS]
    ours = observations[first : first + variant.lanes]
    count = 0
    for i in range(variant.lanes):
        count += is_written(arena, active, i)
    observed = header[word.OBSERVED]
    if variant.batch and count == variant.lanes and observed >= TILE:
        for i in range(0, variant.lanes, TILE):
            for n in range(0, observed, TILE):
                begin = min(n, observed - TILE)  # the last tile overlaps the one before
                write_tile(arena[:, i:], variant.lanes, header[word.PLACES :], settings[factors:], begin, ours[i:])
        return
    for i in range(variant.lanes):
        for n in range(header[word.OBSERVED] if is_written(arena, active, i) else 0):
            ours[i, n] = arena[header[word.PLACES + n], i] * settings[factors + n]


@per_lane
def is_written(arena: Arena, active: Mask, i: int) -> bool:
    """Return whether lane i is active and its state is valid."""
    status = arena[row.STATUS, i]
    return active[i] and (status == 0.0 or status < -1.5)
