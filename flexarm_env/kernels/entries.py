"""The places of the tables that kernels read beside their arenas (`layout`), each declared once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexarm_env.codegen.declarations import Entry, FixedNames, Names, in_a_row
from flexarm_env.physics.constants import Constants

STATE_UNIT = "rad, 1, rad/s, 1/s"
CONSTANTS_UNIT = "as in `Constants`"
_ENVIRONMENT = ("environment",)


_constants, _payloads = attrgetter("constants"), attrgetter("payloads")  # of a `Variant`
_PAYLOADS = ("payloads",)


def extent(places: dict[str, tuple[int, int]]) -> int:
    """How many places a layout takes."""
    first, count = list(places.values())[-1]
    return first + count


def in_order(places: Mapping[str, tuple[int, int]], values: Mapping[str, Sequence[float]]) -> NDArray[np.float64]:
    """Return the numbers of a table's parts, one after the other."""
    assert all(len(values[name]) == count for name, (_, count) in places.items())
    return np.concatenate([np.asarray(values[name], dtype=float) for name in places])


class Drawn(FixedNames):
    """What may be drawn anew for each episode."""

    DELAY = Entry("delay of the sensor", "s")
    PAYLOAD_MASS = Entry("payload at the tip", "kg")
    STIFFNESS = Entry("factor on the links' stiffness", "1")
    DAMPING = Entry("damping ratio of the free arm's first elastic mode", "1")
    NOISE = Entry("standard deviation of the sensor's noise", "m")
    ACTUATION_DELAY = Entry("delay of the action", "s")


drawn = Drawn()
DRAWN = {part.name.lower(): part.unit for part in Drawn.entries}  # names and units for users
DRAWN_COUNT = len(DRAWN)


class Setting(Names):
    """Numbers of the table `settings` that all lanes of a batch share."""

    STEP = Entry("integration step", "s")
    LENGTHS = Entry("of the links", "m", 2)
    PERIOD = Entry("control period", "s", 1, _ENVIRONMENT)
    IDLE_ACTION = Entry("the action that commands nothing", "1", 1, _ENVIRONMENT)
    ENCODER_RESOLUTION = Entry("of the encoders of shoulder and elbow; 0: any angle", "rad", 2, _ENVIRONMENT)
    DEFLECTION_LIMIT = Entry("of a link's tip", "m", 1, _ENVIRONMENT)
    ERROR_LIMIT = Entry("of the tip's distance from the reference", "m", 1, _ENVIRONMENT)
    START_SPREAD = Entry("of joint angles, and of the links' tips, at a start on the move", "rad, m", 2, _ENVIRONMENT)
    MOVES = Entry("radii of the ring that end points of moves are drawn from", "m", 2, _ENVIRONMENT)
    CHANGE_PHASES = Entry("of the lap, at which the payload changes", "1", _payloads, _PAYLOADS)
    CHANGE_MASSES = Entry("payload from then on; NaN: the episode's", "kg", _payloads, _PAYLOADS)
    WEIGHTS = Entry("of the reward's terms", "1", lambda s: s.program.reward_terms, _ENVIRONMENT)
    HORIZONS = Entry("horizons of previews, then the observations' factors", "s or m, 1 over the unit", 0, _ENVIRONMENT)


class LaneSetting(Names):
    """Numbers that a reset reads and that lanes may have for themselves: a row for each lane, or one for all."""

    BRANCH = Entry("sign of theta2 in inverse kinematics; 0: drawn", "1")
    DIRECTION = Entry("of the lap, by its place among `parameters.DIRECTIONS`; -1: drawn", "1")
    SENSOR_DELAYS = Entry("delays of the sensor unless drawn or requested", "s", 2)
    BASE = Entry("values of the quantities unless requested (`Drawn`)", "as in `Drawn`", DRAWN_COUNT)
    ARM = Entry("constants of the arm as set", CONSTANTS_UNIT, _constants)
    PER_PAYLOAD = Entry("their change with the payload", CONSTANTS_UNIT + ", per kg", _constants)
    PER_DAMPING = Entry("their change with the damping ratio", CONSTANTS_UNIT, _constants)


class Constant(Names):
    """Some of the arm's constants, by their places among all of them (`Constants`)."""

    @classmethod
    def layout(cls, variant: Any) -> dict[str, tuple[int, int]]:
        """Return where each field of `Constants` lies."""
        sizes = zip(Constants._fields, Constants.sizes(variant.modes, variant.foreshortened, variant.dry), strict=True)
        return in_a_row({name.upper(): 1 if n is None else n for name, n in sizes})

    ELBOW_VALUES = Entry("link 1's mode shapes at the elbow", "m")
    ELBOW_SLOPES = Entry("their slopes", "1")
    STIFFNESS_1 = Entry("first of all modal stiffnesses", "N m")
    DAMPING_1 = Entry("first number after them: damping of the modes", "N m s")


class Word(Entry):
    """A whole number of the plan that says where an array begins in a batch's memory (`memory`)."""

    def __init__(self, meaning: str) -> None:
        """Declare it; `meaning`: of the array."""
        super().__init__(f"first word of {meaning}", "words")


class Header(FixedNames):
    """Whole numbers of the table `header`: what is to be done; how large arrays are, and where they lie.

    A simulator that lacks one of the arrays leaves its words 0; its drivers read none of them.
    """

    SUBSTEPS = Entry("integration steps in a control period", "1")
    CHANNELS = Entry("of an action", "1")
    KEPT_ACTIONS = Entry("how many actions are kept", "1")
    PREVIEWS = Entry("how many horizons are observed", "1")
    COMMANDS = Entry("place in an arena's tail of the newest command: an action, or what the actions add up to", "1")
    OBSERVED = Entry("numbers of an observation", "1")
    SHIFTING = Entry("1 where the action shifts the aim of the joint-space law", "1")
    KEPT_READINGS = Entry("bits: after which steps of a period a reading is kept; bit 0: at its end", "1")
    DRIVING = Entry("0 where episodes begin and no time passes", "1")
    HEADER_WORDS = Entry("of this table", "1")
    SETTING_NUMBERS = Entry("of the settings", "1")
    ARENA_ROWS = Entry("of an arena, its tail included", "1")
    HISTORY_ROWS = Entry("of a delay line", "1")
    PATH_NAMES = Entry("how many paths have a name; the table has each of these in both directions", "1")
    PATH_COUNT = Entry("how many paths", "1")
    PATH_POINTS = Entry("way-points of a path", "1")
    REQUEST_COLUMNS = Entry("of a reset request", "1")
    LANE_SETTING_ROWS = Entry("of the lanes' own settings: one for each lane, or one for all", "1")
    LANE_SETTING_COLUMNS = Entry("of the lanes' own settings", "1")
    ARENAS = Word("the arenas")
    HISTORIES = Word("the delay lines")
    CLOCKS = Word("the clocks")
    KEYS = Word("the episodes' keys")
    STARTS = Word("the mask of lanes that begin an episode")
    ACTIVE = Word("the mask of lanes that observe")
    ACTIONS = Word("the actions")
    OBSERVATIONS = Word("the observations")
    SETTINGS = Word("the settings")
    LANE_SETTINGS = Word("the lanes' own settings")
    PATHS = Word("the paths")
    RESET_REQUESTS = Word("the reset requests")
    PLACES = Entry("rows of the observation's numbers", "1", 0)


class ClockRow(FixedNames):
    """What a lane's clock counts and points to."""

    STEPS = Entry("integration steps of path time", "1")
    PATH = Entry("its path", "1")
    SINCE = Entry("the step before which the reference rests", "1")
    BEGAN = Entry("the step at which the episode began", "1")
    HEAD = Entry("the delay line's newest slot, the same for a whole block", "1")


class ReadingRow(FixedNames):
    """What a slot of the delay line holds of a sensor of a position.

    The sensor on link 2 comes first, then the further sensors, last the numbers of those that read something else.
    """

    VALUE = Entry("two readings", "rad or m", 2)
    RATE = Entry("their rates", "rad/s or m/s", 2)


class Column(FixedNames):
    """Columns of a reset request; NaN where the environment decides. What only Python reads follows the state."""

    START = Entry("how it starts (`reset.CORNER`)", "1")
    PHASE = Entry("moment of the lap", "s")
    PATH = Entry("which of the named paths", "1")
    BRANCH = Entry("see `LaneSetting`", "1")
    DIRECTION = Entry("see `LaneSetting`", "1")
    DRAWN = Entry("quantities of the episode (`Drawn`)", "as in `Drawn`", DRAWN_COUNT)
    STATE = Entry("initial public state", STATE_UNIT, 0)


class Segment(FixedNames):
    """What a lane notes of a side of its path, in rows of its arena that follow each other."""

    LAP = Entry("when its lap began", "s")
    BEGIN = Entry("when in the lap it begins", "s")
    END = Entry("when in the lap it ends", "s")
    START = Entry("where it begins", "m", 2)
    VELOCITY = Entry("of the reference on it", "m/s", 2)


setting, lane_setting, constant = Setting(), LaneSetting(), Constant()
word, clock_row, reading_row, column = Header(), ClockRow(), ReadingRow(), Column()
segment = Segment()
MEMORY = tuple(part.name for part in Header.entries if isinstance(part, Word))  # arrays after the plan
CLOCK_ROWS = len(ClockRow.entries)
READING_ROWS = extent(ReadingRow.layout(None))  # of one sensor in a slot of the delay line
SEGMENT_ROWS = extent(Segment.layout(None))
