"""What the kernels of a fleet are told once: whole numbers, settings, paths, and the rows that no episode changes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexarm_env.codegen.declarations import Program
from flexarm_env.codegen.memory import ArraySpec, pack
from flexarm_env.envs.choices import MOVE_POINTS, MOVE_RING
from flexarm_env.envs.observation import ObservationLayout
from flexarm_env.envs.settings import Settings
from flexarm_env.episode.reward import TERMS
from flexarm_env.kernels.entries import DRAWN, MEMORY, settings_layout, word
from flexarm_env.kernels.layout import layout, place_rows
from flexarm_env.physics.paths import same_length
from flexarm_env.simulation.limits import state_limits

Array = NDArray[np.float64]
ALL_READINGS = -1  # as bits
NAN = float("nan")


def kept_readings(settings: Settings) -> int:
    """Integration steps of a control period after which a reading is kept, as bits (bit 0: its end).

    Where each sample is equally late, it lies between the same two steps of a period; the others are not needed.
    """
    s = settings
    varies = s.jitter > 0.0 or s.hold > 0.0 or "delay" in s.randomisation or s.action_mode == "gain"
    if varies or s.substeps > 62:
        return ALL_READINGS
    bits = 0
    for delay in s.sensor_delays:
        back = delay / (s.control_period / s.substeps)
        # a hair more on both sides: rounding may see a whole number of steps from either
        for steps in range(int(np.floor(back - 1e-6)), int(np.floor(back + 1e-6)) + 2):
            bits |= 1 << (-steps % s.substeps)
    return bits


def path_tables(settings: Settings, lanes: int) -> Array:
    """Paths of all lanes, or room for one each. Shape (paths, n, 5)."""
    if settings.paths:
        return same_length(settings.paths)
    points = min(MOVE_POINTS, round(settings.lap_time / settings.control_period)) + 1
    room = np.zeros((lanes, points, 5))
    room[..., 0] = np.arange(points)  # a path has a lap time before it is drawn, too
    return room


def lay_out(arrays: Mapping[str, NDArray[Any]]) -> tuple[Array, dict[str, ArraySpec]]:
    """Memory with the plan and the arrays of `entries.MEMORY`, and where each lies; the plan says it to the kernels."""
    assert tuple(arrays) == ("HEADER", *MEMORY)  # kernels find the plan at the beginning
    memory, parts = pack(arrays)
    lanes = arrays["ARENAS"].shape[-1]
    sizes = {
        "ARENA_ROWS": arrays["ARENAS"][0].size // lanes,
        "HISTORY_ROWS": arrays["HISTORIES"][0].size // lanes,
        "PATH_COUNT": arrays["PATHS"].shape[0],
        "PATH_POINTS": arrays["PATHS"].shape[1],
        "ORDER_COLUMNS": arrays["RESET_REQUESTS"].shape[1],
    }
    header = parts["HEADER"].view(memory)
    for name, value in {**sizes, **{name: parts[name].first for name in MEMORY}}.items():
        header[getattr(word, name)] = value
    return memory, parts


def header_and_settings(
    settings: Settings, program: Program, observed: ObservationLayout, kept: int
) -> tuple[NDArray[np.int64], Array]:
    """`header` and `settings` of the kernels; where arrays lie is left open.

    Args:
        settings: of the environments.
        program: of the kernels.
        observed: the observations.
        kept: actions that are kept.

    Returns:
        Whole numbers (`entries.Header`) and the rows of the observation; numbers (`entries.Setting`), horizons and
        factors.
    """
    horizons = settings.previews if _previews(settings) else ()
    header = np.concatenate([_whole_numbers(settings, observed, kept), _observed_rows(settings, program, observed)])
    return header, np.concatenate([_numbers(settings, program), horizons, 1.0 / observed.scale])


def _previews(settings: Settings) -> int:
    """How many horizons are observed."""
    return len(settings.previews) if "previews" in settings.observation else 0


def _whole_numbers(settings: Settings, observed: ObservationLayout, kept: int) -> NDArray[np.int64]:
    """What is to be done (`entries.Header`)."""
    s = settings
    whole = {
        "SUBSTEPS": s.substeps,
        "CHANNELS": len(s.action_limit),
        "KEPT_ACTIONS": kept,
        "PREVIEWS": _previews(s),
        "OBSERVED": len(observed.rows),
        "SHIFTING": int(s.action_mode == "reference"),
        "COMPENSATION": ("none", "shared", "per_joint").index(s.compensation),
        "READINGS": kept_readings(s),
        "DRIVING": 1,
    }
    numbers = np.zeros(word.PLACES, dtype=np.int64)  # the others are for `lay_out` to fill in
    for name, value in whole.items():
        numbers[getattr(word, name)] = value
    return numbers


def _numbers(settings: Settings, program: Program) -> Array:
    """In the order of `entries.Setting`, without its last part."""
    s = settings
    arm = s.flexible_arm
    p, changes = arm.parameters, arm.changes
    values: dict[str, Any] = {
        "STEP": [s.control_period / s.substeps],
        "PERIOD": [s.control_period],
        "ACTION_SCALE": (*s.action_limit, 0.0)[:2],
        "JITTER": [s.jitter],
        "HOLD": [s.hold],
        "DROPOUT": [s.dropout],
        "ENCODER_NOISE": s.encoder_noise,
        "DEFLECTION_LIMIT": [np.inf if s.deflection_limit is None else s.deflection_limit],
        "ERROR_LIMIT": [np.inf if s.error_limit is None else s.error_limit],
        "LENGTHS": p.link_lengths,
        "BRANCH": [1.0 if s.elbow_branch == "positive" else -1.0],
        "START_SPREAD": s.start_spread,
        "MOVES": [MOVE_RING[0] * p.reach, MOVE_RING[1] * p.reach],
        "LAP": [s.lap_time],
        "WEIGHTS": [s.reward_weights.get(name, 0.0) for name in TERMS],
        "SENSOR_DELAYS": s.sensor_delays,
        **_drawn(s),
        "ARM": arm.constants.flat(),
        "PER_PAYLOAD": changes.payload_mass,
        "PER_DAMPING": changes.damping,
    }
    *places, (last, _) = settings_layout(program, p.modes_per_link, arm.constants.foreshortened).items()
    assert last == "HORIZONS"
    assert all(len(values[name]) == count for name, (_, count) in places)
    return np.concatenate([np.asarray(values[name], dtype=float) for name, _ in places])


def _drawn(settings: Settings) -> dict[str, list[float]]:
    """Of each quantity that an episode may draw, the arm's own value and the bounds of its range."""
    s = settings
    p = s.flexible_arm.parameters
    base = {
        "delay": NAN if s.delay is None or isinstance(s.delay, tuple) else s.delay,
        "payload_mass": p.payload_mass,
        "stiffness": 1.0,
        "damping": p.modal_damping_ratio,
        "noise": s.noise,
        "actuation_delay": s.actuation_delay,
    }
    lowest, highest = zip(*(s.randomisation.get(name, (NAN, NAN)) for name in DRAWN), strict=True)
    return {"BASE": [base[name] for name in DRAWN], "LOWEST": list(lowest), "HIGHEST": list(highest)}


def _observed_rows(settings: Settings, program: Program, observed: ObservationLayout) -> NDArray[np.int64]:
    """Rows of the observation; actions move up where there are no previews before them."""
    arm = settings.flexible_arm
    tail, _ = layout(program, arm.parameters.modes_per_link, arm.constants.foreshortened)["TAIL"]
    if "previews" in settings.observation:
        return observed.rows
    return np.where(observed.rows >= tail, observed.rows - 2 * len(settings.previews), observed.rows)


def fixed_rows(settings: Settings) -> dict[str, Any]:
    """Parts of the arena that no episode changes, by name (`rows`)."""
    s = settings
    arm = s.flexible_arm
    length = arm.parameters.link_lengths[1]
    law_point = s.sensor_position if s.law_sensor == "sensor" else length
    return {
        "LIMITS": state_limits(arm),
        **place_rows("TIP", arm.place(2, length)),
        **place_rows("SENSOR_POINT", arm.place(2, s.sensor_position)),
        **place_rows("SENSOR", arm.place(2, law_point)),
        "LINK_FRAME": [float(s.frame == "link")],
        "TORQUE_LIMIT": s.motor_limit,
        "STIFFNESS": s.inner_stiffness,
        "RESISTANCE": s.inner_resistance,
        "PROPORTIONAL_GAIN": [s.proportional_gain],
        "DERIVATIVE_GAIN": [s.derivative_gain],
        "RATE_LATE": [float(s.delayed == "position+rate")],
    }
