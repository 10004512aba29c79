"""The columns of the board: tasks, axes with their points, and unknown arms."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from importlib.util import find_spec
from typing import Any, NamedTuple

from flexarm_agents.board.terms import LAP_TIMES, TASKS, nominal_options, pace, seed_of
from flexarm_env.envs.registration import IDS, LAB_ARM, UNKNOWN_PLANT
from flexarm_env.envs.settings import Settings
from flexarm_env.extras import install_hint
from flexarm_env.parameters import ArmParameters

SEEDS = 2  # episodes of each lap where something is random
DRAWN = 256  # episodes on unknown arms
PART = 16  # of these, in one cell
OWN_DELAY = round(1e3 * max(Settings.of({}).sensor_delays), 3)  # [ms]; of the nominal sensor, between two points
LOADS = {"randomisation": IDS["Carry-v0"].options["randomisation"]}
CARRIED = 16  # episodes of each lap of the tasks "carry" and "race"
PULSES = (5.0, 10.0, 20.0, 40.0)  # largest components of a force of 0.1 s [N]
PACE = 0.1  # error that a lap stays below [m]; the shortest such lap is the *pace*


class Episode(NamedTuple):
    """An episode of a cell."""

    lap: str | None  # name of the lap; None: the environment begins it
    seed: int  # of its reset; in `Point.episodes` the number from which the seed follows (`Point.seeded`)


@dataclass(frozen=True)
class Point:
    """A value on an axis, or a task: an environment that differs from the nominal one, and episodes on it."""

    value: float | str  # number in the column's unit, or a name
    options: Mapping[str, Any] = field(default_factory=dict)  # options of the environment that differ
    arm: Mapping[str, Any] = field(default_factory=dict)  # fields of the arm that differ
    task: str = "square"  # a name in `terms.TASKS`
    # Numbers of its seeds; both laps are run with each, or, where `paired` is False, the laps take turns
    seeds: range = range(1)
    paired: bool = True  # see `seeds`

    @property
    def episodes(self) -> tuple[Episode, ...]:
        """All episodes, with numbers in the place of seeds."""
        laps = TASKS[self.task].laps
        if not self.paired:
            return tuple(Episode(laps[n % len(laps)], n) for n in self.seeds)
        return tuple(Episode(lap, n) for lap in laps for n in self.seeds)

    def seeded(self, content: str) -> list[Episode]:
        """Return all episodes with the seeds that a policy of some content (`Entry.content`) meets.

        Points at which the same options are random share seeds, so that they differ in the value alone.
        """
        stream = [content, self.task, *(sorted(self.options) if len(self.seeds) > 1 else ())]
        return [Episode(lap, seed_of(*stream, str(n))) for lap, n in self.episodes]

    def environment_options(self, interface: Mapping[str, Any]) -> dict[str, Any]:
        """Return the options of the environment in which an entry runs at this point."""
        whole = {**nominal_options(interface, self.task), **self.options}
        return {**whole, "arm": dict(self.arm)} if self.arm else whole


@dataclass(frozen=True)
class Column:
    """A column of the board."""

    title: str  # heading
    unit: str  # unit of the points' values
    points: tuple[Point, ...]  # its points, in order
    # Value of the nominal environment, one of the points' or between two; None: there is none
    nominal: float | str | None = None
    # Error that laps stay below [m] at the values that count as kept (`summary.kept`); None: they are complete
    bound: float | None = None
    sample: bool = False  # the points are parts of one sample, which is added up as a whole
    headline: bool = False  # it is part of the ranking, and is computed first

    @property
    def nominal_index(self) -> int:
        """Index of the point nearest to the nominal value; 0 where there is none."""
        values = [point.value for point in self.points]
        if isinstance(self.nominal, float):
            away = [abs(float(x) - self.nominal) for x in values]
            return away.index(min(away))
        return values.index(self.nominal) if self.nominal in values else 0


def _grid(least: float, most: float, count: int) -> list[float]:
    return [round(least + (most - least) * n / (count - 1), 6) for n in range(count)]


def _option(name: str, values: list[float], seeds: int = 1, scale: float = 1.0) -> tuple[Point, ...]:
    """Return points at which one option has other values; at 0 nothing is random, and one seed is enough."""
    return tuple(Point(x, {name: round(scale * x, 9)}, seeds=range(seeds if x else 1)) for x in values)


def _late(delay: float) -> Point:
    """Return a delay of the late sensor [ms]; blocks of an observation reckon with the nominal one."""
    return Point(delay, {"randomisation": {"delay": (round(1e-3 * delay, 9),) * 2}})


def _factor(name: str, values: list[float]) -> tuple[Point, ...]:
    """Return points at which a field of the arm, a pair, is multiplied."""
    own = getattr(ArmParameters(), name)
    return tuple(Point(x, arm={name: tuple(x * each for each in own)}) for x in values)


def _models() -> Iterator[Point]:
    """Yield arms with other shapes and kinematics, and the chain."""
    yield Point("linear", arm={"preset": "linear"})
    for count in (2, 3, 4):
        # four shapes need a shorter step than the gain's environment has
        yield Point(f"{count} shapes", {"physics_step": None} if count > 3 else {}, {"modes_per_link": count})
    yield Point("chain", task="chain")


def _disturbances() -> Iterator[Point]:
    """Yield what happens once in a lap, at a drawn moment after the start, and gauges that drift all the time."""
    moment, seeds = (2.0, 14.0), range(SEEDS)
    for newtons in PULSES:
        drawn = {"pulse_time": moment, "pulse_force": ((-newtons, newtons),) * 2}
        yield Point(f"pulses to {newtons:g} N", {"randomisation": drawn, "pulse_duration": 0.1}, seeds=seeds)
    lost = {"randomisation": {"outage_time": moment}, "outage_duration": 0.5}
    yield Point("outage of 0.5 s", lost, seeds=seeds)
    drawn = {"gauge_drift": ((-0.05, 0.05),) * 2}  # of a modal coordinate of 0.2 m at the tip
    yield Point("gauges drift to 1 cm/s", {"randomisation": drawn}, seeds=seeds)


def _unknown() -> Iterator[Point]:
    """Yield the parts of the column "unknown": each episode draws all quantities, and is one of the laps in turn."""
    for first in range(0, DRAWN, PART):
        seeds = range(first, first + PART)
        yield Point(f"{seeds.start} to {seeds.stop - 1}", UNKNOWN_PLANT, seeds=seeds, paired=False)


def measurable(columns: Mapping[str, Column]) -> tuple[dict[str, Column], str]:
    """Return columns without the points of an engine that is not installed, and a message about that; "" if it is."""
    if find_spec("mujoco") is not None:
        return dict(columns), ""
    found = {
        name: replace(column, points=tuple(point for point in column.points if not TASKS[point.task].hosted))
        for name, column in columns.items()
    }
    left_out = [name for name, column in columns.items() if found[name] != column]
    message = f"{', '.join(left_out)}: without the chain, for which {install_hint('mujoco', 'chain')}"
    return found, message if left_out else ""


COLUMNS: dict[str, Column] = {
    "nominal": Column(
        "Nominal",
        "",
        (
            Point("square"),
            Point("track", task="track"),
            Point("reach", task="reach", seeds=range(16)),
            Point("chain", task="chain"),
            Point("smooth", task="smooth"),
        ),
        "square",
        headline=True,
    ),
    "delay": Column("Sensor delay", "ms", tuple(_late(x) for x in _grid(0.0, 120.0, 13)), OWN_DELAY),
    "jitter": Column("Jitter of the delay", "ms", _option("jitter", _grid(0.0, 60.0, 4), SEEDS, 1e-3), 0.0),
    "dropout": Column("Lost readings", "1", _option("dropout", [0.0, 0.1, 0.3, 0.5], SEEDS), 0.0),
    "sensor_position": Column(
        "Sensor's distance from the elbow", "m", _option("sensor_position", [0.5, 2.5, 3.5, 4.0, 4.5]), 4.5
    ),
    "noise": Column("Sensor noise", "mm", _option("noise", [0.0, 3.0, 5.0, 10.0], SEEDS, 1e-3), 0.0),
    "payload": Column("Payload", "kg", tuple(Point(x, arm={"payload_mass": x}) for x in _grid(0.0, 1.0, 6)), 0.0),
    "stiffness": Column("Stiffness", "1", _factor("flexural_rigidities", _grid(0.8, 1.2, 5)), 1.0),
    "density": Column("Mass of the links", "1", _factor("masses_per_length", _grid(0.8, 1.2, 5)), 1.0),
    "actuation_delay": Column(
        "Delay of the motors", "ms", _option("actuation_delay", _grid(0.0, 30.0, 7), scale=1e-3), 0.0
    ),
    "model": Column("Model", "", tuple(_models()), "3 shapes"),
    "pace": Column(
        "Lap time, errors below 100 mm",
        "s",
        tuple(Point(x, task=pace(x)) for x in LAP_TIMES),
        LAP_TIMES[-1],
        bound=PACE,
    ),
    "pace_unknown": Column(
        "Lap time, unknown arms, errors below 100 mm",
        "s",
        tuple(Point(x, UNKNOWN_PLANT, task=pace(x), seeds=range(PART), paired=False) for x in LAP_TIMES[-4:]),
        LAP_TIMES[-1],
        bound=PACE,
    ),
    "lab": Column(
        "Laboratory arm",
        "",
        (Point("data sheet", task="lab"), Point("measured", arm={"preset": LAB_ARM}, task="lab")),
        "data sheet",
    ),
    "carry": Column(
        "Carry",
        "",
        (
            Point("nominal mass", {"randomisation": {}}, task="carry"),
            Point("0.2 to 1.5 kg", task="carry", seeds=range(CARRIED)),
            # taken up at the first corner and put down at the third, on the lap of the square; no entry knows of it
            Point(
                "on the lap", {"payload_changes": ((0.25, None), (0.75, 0.0)), **LOADS}, task="square", seeds=range(8)
            ),
        ),
        "nominal mass",
    ),
    "race": Column(
        "Race",
        "",
        (Point("nominal", task="race"), Point("unknown arms", UNKNOWN_PLANT, task="race", seeds=range(CARRIED))),
        "nominal",
    ),
    "disturbances": Column("Disturbances", "", (Point("none"), *_disturbances()), "none"),
    "unknown": Column("Unknown arms", "", tuple(_unknown()), sample=True, headline=True),
}


def phases(columns: Mapping[str, Column]) -> list[dict[str, Column]]:
    """Return what is computed one after the other: the first point of the headline's columns, these whole, all columns.

    A first page is then ready early.
    """
    headline = {name: column for name, column in columns.items() if column.headline}
    first = {name: replace(column, points=column.points[:1]) for name, column in headline.items()}
    found: list[dict[str, Column]] = []
    for some in (first, headline, dict(columns)):
        if some and some not in found:
            found.append(some)
    return found
