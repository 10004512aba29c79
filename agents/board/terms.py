"""The terms of the board, the same for all entries: plant, tasks, limits, seeds. What changes them raises `BOARD`."""

import hashlib
import json
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, NamedTuple

from flexarm_agents.board import carry, race
from flexarm_agents.board.figures import ERRORS, Figure, Record, of_lap
from flexarm_agents.environments import INTERFACE, settings_of
from flexarm_agents.evaluation.scoring import COMPLETE
from flexarm_baselines.lqg.race import race_plan
from flexarm_baselines.optimal.plan import PLANS
from flexarm_env.envs.registration import IDS
from flexarm_env.laps import LAPS
from flexarm_env.validation import shown

BOARD = 3  # version; raise it where scores change, and name the cause in the changelog
SEEDS = range(2_000_000_000, 4_000_000_000)  # trainings and evaluations do not use such ones by default
SQUARE, RACE = "FlexArm/Square-v0", "FlexArm/Race-v0"

# Options that the board sets for entries of an action mode: the gain's law overshoots corners and has no torque limit.
_BY_MODE: dict[str, tuple[str, ...]] = {"gain": ("physics_step", "deflection_limit", "error_limit")}


Best = Mapping[str, Mapping[str, float]]  # of each lap, of each figure


class BoardTask(NamedTuple):
    """A task that entries are measured on."""

    environment: str = SQUARE  # id of the environment that it is made with; its options say the rest
    options: Mapping[str, Any] = {}  # options in which it differs from `FlexArm/Square-v0`
    # Names of the laps that its episodes are (`flexarm_env.laps.LAPS`); (None,): the environment begins them
    laps: tuple[str | None, ...] = tuple(LAPS)
    hosted: bool = False  # whether another engine has the arm; controllers are then made for the nominal arm
    figures: Mapping[str, Figure] = ERRORS  # what a complete episode is measured by, the headline first
    # Returns at least these, as plain values, of an environment and a complete episode's record. Its module's source is
    # part of the cells' keys
    measure: Callable[[Any, Record], Mapping[str, Any]] = of_lap
    recorded: tuple[str, ...] = ()  # infos that the record has beside those of `figures.of_lap`
    complete: tuple[str, ...] = (COMPLETE,)  # how an episode ends that is not lost
    steps: int | None = None  # most control periods of an episode; None: those of a lap
    best: Callable[[], Best] = dict  # returns the best values known for its laps ("all" without laps)

    @property
    def headline(self) -> str:
        """Name of the figure that tables show."""
        return next(iter(self.figures))


def best_plans(name: str = "default") -> Best:
    """Return the errors of the best plan known for each lap of a square [m]; `name` is how its plans' names begin."""
    found = {}
    for lap in LAPS:
        score = json.loads((PLANS / f"{name}_{lap}.json").read_text(encoding="utf-8"))["score"]
        found[lap] = {"rms": score["true_tip_rms"], "rms_after_2s": score["true_tip_rms_after_2s"]}
    return found


def best_race() -> Best:
    """Return the times of the best plan known for a race [s]."""
    first, fastest, whole = race_plan().notes["lap_times"]
    return {"all": {"three_laps": whole, "fastest_lap": fastest, "first_lap": first}}


def task_options(name: str) -> dict[str, Any]:
    """Return the options of an id that are the task's, not an entry's own."""
    return {option: value for option, value in IDS[name].options.items() if option not in INTERFACE}


def pace(lap_time: float) -> str:
    """Name the task of a lap of the square in so many seconds."""
    return f"pace{lap_time:g}" if lap_time != LAP_TIMES[-1] else "square"


LAP_TIMES = (5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 12.0, 14.0, 16.0)  # of the square [s]; there are plans for each
TASKS: dict[str, BoardTask] = {
    "square": BoardTask(best=best_plans),
    "track": BoardTask(options=IDS["Track-v0"].options),
    "reach": BoardTask(options=IDS["Reach-v0"].options, laps=(None,)),
    "chain": BoardTask("FlexArm/SquareChain-v0", hosted=True),
    **{
        pace(x): BoardTask(options={"lap_time": x}, best=partial(best_plans, f"default_pace{x:g}"))
        for x in LAP_TIMES[:-1]
    },
    # designed on the data sheet's arm; with a step that is short enough for the gain's law
    "lab": BoardTask(
        options=task_options("Lab-v0") | {"arm": "quanser", "physics_step": None},
        laps=("plain",),
        best=partial(best_plans, "quanser_lab"),
    ),
    "smooth": BoardTask(options=IDS["SmoothSquare-v0"].options, best=partial(best_plans, "default_smooth")),
    "carry": BoardTask("FlexArm/Carry-v0", task_options("Carry-v0"), figures=carry.FIGURES, measure=carry.of_rests),
    "race": BoardTask(
        RACE,
        task_options("Race-v0"),
        laps=(None,),
        figures=race.FIGURES,
        measure=race.of_race,
        recorded=race.RECORDED,
        complete=race.COMPLETE,
        steps=IDS["Race-v0"].steps,
        best=best_race,
    ),
}


def limits() -> dict[str, Any]:
    """Return the limits of torque [N m], error and deflection [m] under which entries play."""
    settings = settings_of(SQUARE, {})
    names = ("error_limit", "deflection_limit")
    return {"torque_limit": settings.motor_limit, **{name: getattr(settings, name) for name in names}}


def interface_of(options: Mapping[str, Any], strict: bool = False) -> dict[str, Any]:
    """Return the part of an environment's options that is an entry's own; if strict, refuse all others."""
    for name, value in options.items():
        if strict and name not in INTERFACE:
            raise ValueError(
                f"options[{name!r}] = {shown(value)}: is the board's to choose; "
                f"an entry may choose {', '.join(INTERFACE)}"
            )
    return {name: value for name, value in options.items() if name in INTERFACE}


def entry_options(interface: Mapping[str, Any]) -> dict[str, Any]:
    """Return the options that an entry brings to any environment: its own, and what the board sets for its actions."""
    gain = IDS["SquareGain-v0"].options
    own = _BY_MODE.get(interface.get("action_mode", "torque"), ())
    return {**{name: gain[name] for name in own}, **interface}


def seed_of(*stream: str) -> int:
    """Return a seed that follows from the board's version and some texts, the same on every machine."""
    digest = hashlib.sha256("\n".join((str(BOARD), *stream)).encode()).digest()
    return SEEDS[int.from_bytes(digest[:8]) % len(SEEDS)]


def home_of(environment: str) -> str:
    """Return the home task of entries made for an environment: the first one with that environment, else "square"."""
    own = (name for name, task in TASKS.items() if task.environment == environment and not task.hosted)
    return next(own, "square")


def nominal_options(interface: Mapping[str, Any], task: str) -> dict[str, Any]:
    """Return the options of an entry's nominal environment on a task."""
    return {"start": "corner", **entry_options(interface), **TASKS[task].options}
