"""What lies where: the rows of an arena and the places of the tables that a kernel module reads.

An arena holds LANES environments, one row of LANES numbers for each quantity (`stepping`). Kinds of modules:
"open" (the bare arm driven by torques), "loop" (the arm under the law), and one for each drive of the environments:
"torque", "tracking" (inner joint-space law) and "gain" (the law with a commanded gain).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

from flexarm_env.control.jacobian_transpose import Law
from flexarm_env.episode import reward
from flexarm_env.kernels import imex
from flexarm_env.kernels.path_cache import SIDE_ROWS
from flexarm_env.physics import linear_algebra
from flexarm_env.physics.bent_link import Place
from flexarm_env.physics.constants import Constants
from flexarm_env.physics.modal_elimination import Elimination, elimination

DRIVES = ("torque", "tracking", "gain")

# What may be drawn anew for each episode, with its unit.
DRAWN = {
    "delay": "s",
    "payload_mass": "kg",
    "stiffness": "1",
    "damping": "1",
    "noise": "m",
    "actuation_delay": "s",
}

# Numbers of the table `settings` that every kernel of an environment reads, with their counts.
SETTINGS = {
    "STEP": 1,
    "PERIOD": 1,
    "ACTION_SCALE": 2,
    "JITTER": 1,
    "HOLD": 1,
    "DROPOUT": 1,
    "ENCODER_NOISE": 2,
    "DEFLECTION_LIMIT": 1,
    "ERROR_LIMIT": 1,
    "LENGTHS": 2,
    "BRANCH": 1,
    "START_SPREAD": 2,
    "MOVES": 2,
    "LAP": 1,
    "WEIGHTS": len(reward.TERMS),
    "SENSOR_DELAYS": 2,
    "BASE": len(DRAWN),
    "LOWEST": len(DRAWN),
    "HIGHEST": len(DRAWN),
}
# Arrays that a kernel finds in a fleet's memory after the plan (`memory`).
MEMORY = (
    "ARENAS",
    "HISTORIES",
    "CLOCKS",
    "KEYS",
    "STARTS",
    "LOOKING",
    "ACTIONS",
    "OBSERVATIONS",
    "SETTINGS",
    "PATHS",
    "ORDERS",
)
# Whole numbers of the table `plan`: what is to be done; how large some of these arrays are, and their first words.
PLAN = (
    "SUBSTEPS",
    "CHANNELS",
    "KEPT_ACTIONS",
    "PREVIEWS",
    "OBSERVED",
    "SHIFTING",
    "COMPENSATION",
    "READINGS",
    "DRIVING",
    "ARENA_SIZE",
    "HISTORY_SIZE",
    "PATH_COUNT",
    "PATH_POINTS",
    "ORDER_COLUMNS",
    *MEMORY,
    "PLACES",
)
# Columns of an order for a new episode; NaN where the environment decides. The state's entries follow.
ORDER = ("start", "phase", "path", *DRAWN)


def result_sizes(modes: int) -> dict[str, int]:
    """What a closed loop gives out at an instant: rows that follow each other in the arena."""
    size = 2 * modes + 2
    return {
        "OBSERVATION": 10 + 2 * modes,
        "STATE": 2 * size,
        "TORQUE": 2,
        "TRUE_TIP": 2,
        "RIGID_TIP": 2,
        "REWARD_TERMS": 2,
        "STATUS": 1,
    }


def beginning_sizes() -> dict[str, int]:
    """What an environment gives out where an episode begins."""
    return {"EPISODE": len(DRAWN), "START_TIME": 1}


def episode_sizes(modes: int) -> dict[str, int]:
    """What an environment gives out at an instant: rows that follow each other in the arena."""
    return beginning_sizes() | {
        "STATE": 4 * modes + 4,
        "TORQUE": 2,
        "TRUE_TIP": 2,
        "RIGID_TIP": 2,
        "REFERENCE": 4,
        "SENSED": 2,
        "REWARD_TERMS": len(reward.TERMS),
        "REWARD": 1,
        "TIME": 1,
        "EFFECTIVE_GAIN": 1,
        "STATUS": 1,
    }


def result_rows(rows: dict[str, tuple[int, int]], modes: int) -> tuple[int, int]:
    """First row of what an environment gives out (`episode_sizes`) in an arena with this layout, and how many rows."""
    sizes = episode_sizes(modes)
    return rows[next(iter(sizes))][0], sum(sizes.values())


def feature_sizes() -> dict[str, int]:
    """What observations are made of beside rows that exist anyway."""
    return {
        "F_DIRECTIONS": 4,
        "F_JOINT_ERROR": 2,
        "F_JOINT_ERROR_RATE": 2,
        "F_ENCODER_ERROR": 2,
        "F_REFERENCE": 2,
        "F_REFERENCE_VELOCITY": 2,
        "F_SENSED": 2,
        "F_SENSOR_ERROR": 2,
        "F_SENSOR_ERROR_RATE": 2,
        "F_PHASE": 2,
        "FRAME_AXIS": 2,
    }


def constant_count(modes: int, foreshortened: bool) -> int:
    """How many numbers the constants of an arm are."""
    return linear_algebra.extent(Constants.sizes(modes, foreshortened))


def elimination_count(modes: int, foreshortened: bool) -> int:
    """How many numbers its elimination is; none where it does not apply."""
    return 0 if foreshortened else linear_algebra.extent(Elimination.sizes(modes))


def _physics(kind: str, modes: int, foreshortened: bool) -> dict[str, int]:
    size = 2 * modes + 2
    parts: dict[str, int] = {"Y": size, "V": size, "CONSTANTS": constant_count(modes, foreshortened)}
    parts |= {"ELIMINATION": elimination_count(modes, foreshortened)}
    if kind in ("open", "torque", "tracking"):
        parts |= {"TAU": 2}
    else:
        parts |= {name.upper(): n for name, n in Law.sizes(modes, foreshortened).items()}
        parts |= {"DELAY": 2, "COMMAND_DELAY": 2, "COMMAND_SIDE": SIDE_ROWS, "RATE_LATE": 1}
        parts |= {"Y_STAGE": size, "V_STAGE": size, "MECHANICAL": size, "FEEDBACK": size, "TAU": 2}
        parts |= dict.fromkeys(("V_SLOTS", "MECHANICAL_SLOTS", "FEEDBACK_SLOTS"), imex.STAGES * size)
    if kind == "tracking":
        parts |= {"STIFFNESS": 2, "RESISTANCE": 2, "TORQUE_LIMIT": 2, "INNER_FROM": 4, "INNER_TO": 4, "SHIFT": 2}
        parts |= {"STAGE_TORQUE": 2}
    return parts


@lru_cache
def layout(kind: str, modes: int, foreshortened: bool = False) -> dict[str, tuple[int, int]]:
    """First row and number of rows of each named part of an arena."""
    parts = _physics(kind, modes, foreshortened)
    pairs = foreshortened * modes * (modes + 1) // 2
    if kind != "open":
        parts |= {"LIMITS": 4 * modes + 4}
        parts |= {"TIP_VALUES": modes, "TIP_DISTANCE": 1, "TIP_FORESHORTENING": pairs}
    if kind == "loop":
        parts |= {"REFERENCE": 4} | result_sizes(modes)
    if kind in DRIVES:
        parts |= {"PLACE_DISTANCE": 1, "PLACE_VALUES": modes, "PLACE_FORESHORTENING": pairs}
        parts |= {"SENSOR_DELAY": 2, "MEASURED": 4, "JOINT": 4}
        parts |= {
            "FRAME": 1,
            "PHASE": 1,
            "PRESENT_SIDE": SIDE_ROWS,
            # the next one: how long it takes, how fast
            "NEXT_TIME": 1,
            "NEXT_VELOCITY": 2,
            # time since the reference came onto the present one (or began to move), and until it leaves it
            "SIDE_PASSED": 1,
            "SIDE_LEFT": 1,
            "DEFLECTION": 2,
            "DEFLECTION_RATE": 2,
            "ACTION_CHANGE": 1,
        }
        parts |= {"SAMPLE_TIME": 1, "SAMPLE_AGE": 1, "SAMPLE_POINT": 2, "SAMPLE_REFERENCE": 2}
        parts |= {"SENSOR_ERROR": 2, "SENSOR_ERROR_RATE": 2}
        parts |= feature_sizes() | episode_sizes(modes)
    return _places(parts)


def arena_rows(kind: str, modes: int, foreshortened: bool = False) -> int:
    """Rows of one arena; an environment's previews and actions come after."""
    return extent(layout(kind, modes, foreshortened))


@lru_cache
def settings_layout(modes: int, foreshortened: bool = False) -> dict[str, tuple[int, int]]:
    """First place and number of places of each part of `settings`; previews' horizons and factors come after."""
    constants = dict.fromkeys(("ARM", "PER_PAYLOAD", "PER_DAMPING"), constant_count(modes, foreshortened))
    return _places(SETTINGS | constants)


@lru_cache
def constant_places(modes: int, foreshortened: bool = False) -> dict[str, tuple[int, int]]:
    """Where each field of `Constants` lies in an arm's flat constants."""
    sizes = zip(Constants._fields, Constants.sizes(modes, foreshortened), strict=True)
    return _places({name: 1 if n is None else n for name, n in sizes})


def arm_rows(k: Constants) -> dict[str, Sequence[float]]:
    """What kernels know of an arm, under the names of the arena's parts, which follow each other."""
    e = elimination(k)
    return {"CONSTANTS": k.flat(), "ELIMINATION": e.flat() if e else []}


def place_rows(name: str, place: Place) -> dict[str, Sequence[float]]:
    """What a point of link 2 takes of an arena, under the point's name."""
    return {
        f"{name}_DISTANCE": [place.distance],
        f"{name}_VALUES": place.values,
        f"{name}_FORESHORTENING": place.foreshortening,
    }


def extent(places: dict[str, tuple[int, int]]) -> int:
    """How many places a layout takes."""
    first, count = list(places.values())[-1]
    return first + count


def _places(parts: dict[str, int]) -> dict[str, tuple[int, int]]:
    places, first = {}, 0
    for name, count in parts.items():
        places[name] = (first, count)
        first += count
    return places
