"""Inputs of the kernels of a batch: header, settings, paths, and the rows of the arena that no episode changes."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from operator import or_
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexarm_env.envs.choices import MOVE_POINTS, STARTS, move_ring
from flexarm_env.envs.corners import ends
from flexarm_env.envs.observation import ObservationLayout
from flexarm_env.envs.own_paths import first_rows
from flexarm_env.envs.settings import Settings
from flexarm_env.episode import reset
from flexarm_env.episode.reward import TERMS
from flexarm_env.kernels.entries import DRAWN, LaneSetting, Setting, column, in_order, word
from flexarm_env.kernels.layout import place_rows
from flexarm_env.kernels.variants import Variant
from flexarm_env.parameters import DIRECTIONS, EITHER, Compensation
from flexarm_env.physics.constants import ConstantChanges
from flexarm_env.physics.motors import response
from flexarm_env.physics.paths import same_length
from flexarm_env.physics.sensing import POSITION
from flexarm_env.simulation.lanes import ALL_READINGS
from flexarm_env.simulation.limits import state_limits

Array = NDArray[np.float64]
NAN = float("nan")
# Codes in the tables `LANE_SETTINGS` and `RESET_REQUESTS`.
BRANCH_CODES = {"positive": 1.0, "negative": -1.0, EITHER: 0.0}
COMPENSATIONS: tuple[Compensation, ...] = ("none", "shared", "per_joint")  # by their numbers in the arena
START_CODES = {name: getattr(reset, name.upper()) for name in STARTS}
DIRECTION_CODES = {name: float(n) for n, name in enumerate(DIRECTIONS)} | {EITHER: -1.0}


def _readings_of(settings: Settings) -> int:
    """Return, as bits, the integration steps of a control period after which a reading is kept (bit 0: its end).

    If the delay is constant, each sample lies between the same two steps of a period; other readings are not needed.
    """
    s = settings
    cases = s, *ends(s)
    varies = "delay" in s.randomisation or s.mode.law == "tip" or any(one.jitter or one.sensor_period for one in cases)
    delays = {(*one.sensor_delays, *(each.delay for each in one.further_sensors)) for one in cases}
    if varies or len(delays) > 1 or s.substeps > 62:
        return ALL_READINGS
    bits = 0
    for delay in delays.pop():
        back = delay / (s.control_period / s.substeps)
        # with a tolerance on both sides: a whole number of steps may be rounded up or down
        for steps in range(int(np.floor(back - 1e-6)), int(np.floor(back + 1e-6)) + 2):
            bits |= 1 << (-steps % s.substeps)
    return bits


def path_tables(kinds: Sequence[Settings], lanes: int) -> tuple[Array, tuple[str, ...], list[int]]:
    """Return the paths of some kinds of environments.

    Returns:
        The table of both directions, or memory for one path for each lane, shape (paths, n, 5); names of the paths in
        one direction; which of these is the first of each kind.

    Raises:
        ValueError: if their paths differ and one has several.
    """
    settings = kinds[0]
    if settings.has_own_path:
        if settings.path_rows:
            rows = max(one.path_rows for one in kinds)
            room = np.tile(first_rows(settings, 0, rows), (lanes, 1, 1))
        else:
            points = min(MOVE_POINTS, round(settings.lap_time / settings.control_period)) + 1
            room = np.zeros((lanes, points, 5))
            room[..., 0] = np.arange(points)  # kernels read the lap time before the first path is drawn
        return room, settings.reference, [0] * len(kinds)
    keys = [repr((one.reference, one.waypoints, one.side, one.start_corner)) for one in kinds]
    distinct = dict(zip(reversed(keys), reversed(kinds), strict=True))
    if len(distinct) > 1 and any(len(one.reference) > 1 for one in kinds):
        raise ValueError("per_env: environments with different paths must each have one, not several to draw from")
    paths = [one.paths for one in distinct.values()]
    names = tuple(name for one in distinct.values() for name in one.reference)
    in_turn = [path for turn in (0, 1) for each in paths for path in each[turn * len(each) // 2 :][: len(each) // 2]]
    return same_length(in_turn), names, [list(distinct).index(key) for key in keys]


def usual_requests(settings: Settings, first_paths: NDArray[np.int64], shape: tuple[int, int]) -> Array:
    """Return the reset requests that follow from settings and the environments' first paths. Shape (lanes, columns)."""
    count = len(first_paths)
    usual = np.full(shape, NAN)
    usual[:, column.START] = START_CODES[settings.start]
    usual[count:, column.START] = START_CODES["corner"]  # lanes without an environment stay at rest
    if settings.path_rows:  # each lane has its own; a named one is chosen first (`draws`)
        first = count if settings.paths else 0
        usual[first:, column.PATH], usual[first:, column.DIRECTION] = np.arange(first, len(usual)), 0.0
    elif first_paths.any():
        usual[:count, column.PATH] = first_paths
    return usual


def header_and_settings(
    kinds: Sequence[Settings], variant: Variant, observed: ObservationLayout
) -> tuple[NDArray[np.int64], Array]:
    """Make the header and the settings of the kernels; `LaneBatch` adds the places of the arrays.

    Returns:
        The header (`entries.Header`) with the rows of the observation; the settings (`entries.Setting`) with the
        horizons and the factors of the observation.
    """
    s = kinds[0]
    horizons = s.previews if "previews" in s.observation else ()
    kept, channels = max(one.kept_actions for one in kinds), len(s.action_limit)
    whole = {
        "SUBSTEPS": s.substeps,
        "CHANNELS": channels,
        "KEPT_ACTIONS": kept,
        "PREVIEWS": len(horizons),
        "COMMANDS": 2 * len(horizons) + s.mode.accumulates * kept * channels,
        "OBSERVED": len(observed.rows),
        "SHIFTING": int(s.mode.shifts),
        "KEPT_READINGS": reduce(or_, map(_readings_of, kinds)),  # for any of the lanes
        "DRIVING": 1,
    }
    header = np.zeros(word.PLACES + len(observed.rows), dtype=np.int64)
    for name, value in whole.items():
        header[getattr(word, name)] = value
    # without the block of previews, the tail begins with the actions
    in_tail = observed.rows >= variant.rows["TAIL"][0]
    header[word.PLACES :] = observed.rows - in_tail * 2 * (len(s.previews) - len(horizons))
    return header, np.concatenate([_numbers(s, variant), horizons, 1.0 / observed.scale])


def tail_rows(kinds: Sequence[Settings], hosted: bool) -> int:
    """Return the number of rows of the tail: previews, kept actions, and kept commands if they are not the actions.

    Where another engine advances the plant, a period's commands follow, for each step (`actuation.host_commands`).
    """
    settings = kinds[0]
    channels = len(settings.action_limit)
    kept = max(one.kept_actions for one in kinds) * channels
    return 2 * len(settings.previews) + kept * (1 + settings.mode.accumulates) + hosted * settings.substeps * channels


def _numbers(settings: Settings, variant: Variant) -> Array:
    s = settings
    arm = s.flexible_arm
    p = arm.parameters
    values: dict[str, Any] = {
        "STEP": [s.control_period / s.substeps],
        "PERIOD": [s.control_period],
        "IDLE_ACTION": [s.mode.idle],
        "ENCODER_RESOLUTION": s.encoder_resolution,
        "DEFLECTION_LIMIT": [np.inf if s.deflection_limit is None else s.deflection_limit],
        "ERROR_LIMIT": [np.inf if s.error_limit is None else s.error_limit],
        "LENGTHS": p.link_lengths,
        "START_SPREAD": s.start_spread,
        "MOVES": move_ring(p),
        "CHANGE_PHASES": [phase for phase, _ in s.payload_changes or ()],
        "CHANGE_MASSES": [NAN if mass is None else mass for _, mass in s.payload_changes or ()],
        "WEIGHTS": [s.reward_weights.get(name, 0.0) for name in list(TERMS)[: variant.reward_terms]],
    }
    *places, (last, _) = Setting.layout(variant).items()
    assert last == "HORIZONS"
    return in_order(dict(places), values)


def lane_numbers(settings: Settings, variant: Variant, changes: ConstantChanges | None = None) -> Array:
    """Return the settings of a lane (`entries.LaneSetting`), by the own arm or the constants of an episode's arm."""
    s, changes = settings, changes or settings.flexible_arm.changes
    parts = {"ARM": changes.base, "PER_PAYLOAD": changes.payload_mass, "PER_DAMPING": changes.damping}
    values: dict[str, Any] = {
        "BRANCH": [BRANCH_CODES[s.elbow_branch]],
        "DIRECTION": [DIRECTION_CODES[s.direction]],
        "SENSOR_DELAYS": s.sensor_delays,
        # None: each joint has its own delay, `SENSOR_DELAYS`
        "BASE": [s.own_value(name) if name != "delay" or isinstance(s.delay, float) else NAN for name in DRAWN],
        # those of dry friction come last: 0 where only other episodes have some
        **{name: np.pad(part, (0, variant.constants - len(part))) for name, part in parts.items()},
    }
    return in_order(LaneSetting.layout(variant), values)


def _further_rows(settings: Settings) -> dict[str, Any]:
    """Return the rows of the further sensors; empty ones where there are none."""
    arm, sensors = settings.flexible_arm, settings.further_sensors
    places = [arm.place(one.link, one.position) for one in sensors]
    slopes = [arm.modes[one.link - 1].slope(one.position) for one in sensors]
    return {
        "FURTHER_LINK": [one.link for one in sensors],
        "FURTHER_DISTANCE": [place.distance for place in places],
        "FURTHER_VALUES": [x for place in places for x in place.values],
        "FURTHER_SLOPES": [x for each in slopes for x in each],
        "FURTHER_FORESHORTENING": [x for place in places for x in place.foreshortening],
        "FURTHER_DELAY": [one.delay for one in sensors for _ in one.noise],
        "NOMINAL_FURTHER_DELAY": [one.delay for one in sensors if one.sensor.quantity == POSITION],
        "NOMINAL_FURTHER_DISTANCE": [
            place.distance for one, place in zip(sensors, places, strict=True) if one.sensor.quantity == POSITION
        ],
        "FURTHER_NOISE": [x for one in sensors for x in one.noise],
        "FURTHER_DRAW": [one.sensor.noise_offset + n for one in sensors for n in range(len(one.noise))],
        "FURTHER_BIAS_SPREAD": [x for one in sensors for x in one.bias],
        "FURTHER_RANGE": [x for one in sensors for x in one.range],
    }


def _motor_rows(settings: Settings) -> dict[str, Any]:
    s = settings
    step, units, limited = s.control_period / s.substeps, s.torque_resolution, s.torque_speed_limit is not None
    responses = [response(step / time if time else np.inf) for time in s.motor_time_constant]
    scale = (1.0, 1.0) if s.mode.accumulates else s.motor_limit
    return {
        "MOTOR_RESPONSE": np.transpose(responses).ravel(),
        "STALL_TORQUE": s.motor_limit if limited else (np.inf, np.inf),
        "PER_SPEED": [1.0 / speed for speed in s.torque_speed_limit or (np.inf, np.inf)],
        "TORQUE_UNIT": [unit / one for unit, one in zip(units, scale, strict=True)],
        "TORQUE_LEVELS": [
            np.floor(limit / unit + 1e-9) if unit else 0.0 for unit, limit in zip(units, s.motor_limit, strict=True)
        ],
    }


def fixed_rows(settings: Settings) -> dict[str, Any]:
    """Return the values of the rows that no episode changes, by name (`layout`)."""
    s = settings
    arm = s.flexible_arm
    length = arm.parameters.link_lengths[1]
    law_point = s.sensor_position if s.feedback_source == "sensor" else length
    return {
        **_further_rows(s),
        **_motor_rows(s),
        "ACTION_SCALE": (*s.action_limit, 0.0)[:2],
        "COMMAND_SCALE": (1.0, 1.0) if s.mode.accumulates else (*s.action_limit, 0.0)[:2],
        "LIMITS": state_limits(arm),
        "LAP": [s.lap_time],
        "PACE": (s.reference_speed, s.reference_acceleration),
        "RACE_LAPS": [s.race_laps],
        **place_rows("TIP", arm.place(2, length)),
        **place_rows("SENSOR_POINT", arm.place(2, s.sensor_position)),
        "RATE_LATE": [float(s.delayed == "position+rate")],
        **place_rows("SENSOR", arm.place(2, law_point)),
        "GAIN_LIMIT": [s.gain_limit],
        "PROPORTIONAL_GAIN": [s.proportional_gain],
        "DERIVATIVE_GAIN": [s.derivative_gain],
        "COMPENSATION": [COMPENSATIONS.index(s.compensation)],
        "JITTER": [s.jitter],
        "HOLD": [s.sensor_period],
        "DROPOUT": [s.dropout],
        "NOMINAL_DELAY": [s.sensor_delays[0]],
        "NOMINAL_HOLD": [s.sensor_period],
        "OUTAGE": [s.outage_time, s.outage_duration],
        "PULSE_FORCE": s.pulse_force,
        "PULSE_TIMES": [s.pulse_time, s.pulse_duration, s.pulse_period],
        "GAUGE_DRIFT": s.gauge_drift,
        "ENCODER_NOISE": s.encoder_noise,
        "LINK_FRAME": [float(s.frame == "link")],
        "TORQUE_LIMIT": s.motor_limit,
        "STIFFNESS": s.inner_stiffness,
        "RESISTANCE": s.inner_damping,
    }
