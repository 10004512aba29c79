"""The paper's twelve runs, the columns (arms) in which they are made, and their simulation to npz files."""

import dataclasses
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, get_args

import gymnasium

from flexarm_baselines import FLSAC, IFDC
from flexarm_env import ArmParameters, FlexibleArm, Trajectory, run_batch
from flexarm_env.validation import number

CONTROL_PERIOD = 1e-3  # [s]; the paper's step size
PAPER = "FlexArm/Paper-v0"

Controller = Literal["ifdc", "flsac"]
Sensing = Literal["collocated", "nmp", "corrected"]
Place = Literal["tip", "elbow"]
CONTROLLERS: tuple[Controller, ...] = get_args(Controller)
SENSINGS: tuple[Sensing, ...] = get_args(Sensing)
PLACES: tuple[Place, ...] = get_args(Place)
SENSOR_POSITION = {"tip": 4.5, "elbow": 0.5}  # distance from the elbow [m]


@dataclass(frozen=True)
class Case:
    """One run: who controls, what is sensed, and where."""

    controller: str  # "ifdc", "flsac", or "constant": the constant gain equal to the mean of FLSAC's in the same case
    sensing: str  # "collocated", "nmp" (noncollocated, late), "corrected" (the command is late too, by one delay)
    place: str  # "tip" (end effector) or "elbow" (0.5 m past it)

    @property
    def name(self) -> str:
        """The name in files and tables."""
        return f"{self.controller}_{self.sensing}_{self.place}"

    @property
    def options(self) -> dict[str, Any]:
        """Options of the environment: the sensor, and the delay of the law's target."""
        return {
            "sensor": "collocated" if self.sensing == "collocated" else "rigid",
            "sensor_position": SENSOR_POSITION[self.place],
            "compensation": "shared" if self.sensing == "corrected" else "none",
        }


@dataclass(frozen=True)
class Column:
    """An arm in which all cases are run."""

    title: str  # for tables
    arm: ArmParameters
    elbow_branch: str = "positive"  # sign of theta2 at the start


COLUMNS = {
    "paper": Column("paper's arm", ArmParameters.paper()),
    "complete": Column("1 mode, complete forces", ArmParameters.paper(velocity_forces="complete")),
    "linear": Column("linear arm", ArmParameters.linear()),
    "branch": Column("paper's arm, theta2 < 0", ArmParameters.paper(), elbow_branch="negative"),
}


@dataclass(frozen=True)
class Study:
    """What a reproduction is made with."""

    K_s: float = 1.0  # output scale of FLSAC (14)
    K_n: float = 5.0  # normalising factor of FLSAC
    lap_time: float = 16.0  # of the square [s]
    arm_changes: dict[str, Any] = field(default_factory=dict)  # fields of `ArmParameters` set in every column

    def __post_init__(self) -> None:
        """Validate.

        Raises:
            ValueError: for a value out of range, or a lap that is no whole number of control periods.
        """
        number("K_s", self.K_s, above=0.0)
        number("K_n", self.K_n, above=0.0)
        lap = number("lap_time", self.lap_time, "s", above=0.0)
        if round(lap / CONTROL_PERIOD) < 4 or abs(round(lap / CONTROL_PERIOD) * CONTROL_PERIOD - lap) > 1e-9:
            raise ValueError(f"lap_time = {lap} s: must be a whole number of periods of {CONTROL_PERIOD} s, 4 at least")

    def arm(self, column: Column) -> FlexibleArm:
        """Return the column's arm with the study's changes."""
        return FlexibleArm(dataclasses.replace(column.arm, **self.arm_changes))

    def gain(self, case: Case) -> float:
        """Return lambda at action 1."""
        return self.K_s if case.controller == "flsac" else 1.0

    @property
    def steps(self) -> int:
        """Control periods in a lap."""
        return round(self.lap_time / CONTROL_PERIOD)

    def fuzzy(self, arm: FlexibleArm, **options: Any) -> FLSAC:
        """Return the FLSAC policy of an arm, lambda = fuzzy (scaled by the environment's gain limit)."""
        return FLSAC.for_env(gymnasium.make(PAPER, arm=arm.parameters), **({"K_n": self.K_n} | options))


def all_cases(
    controllers: Iterable[str] = CONTROLLERS, sensings: Iterable[str] = SENSINGS, places: Iterable[str] = PLACES
) -> list[Case]:
    """Return the paper's twelve runs, or a part of them."""
    places, sensings = list(places), list(sensings)
    return [Case(c, s, p) for c in controllers for p in places for s in sensings]


def simulate(
    study: Study,
    column: Column,
    options: Sequence[dict[str, Any]],
    policies: Sequence[Any],
    steps: int | None = None,
    rate_jacobian: str = "delayed",
) -> list[Trajectory]:
    """Run a batch from rest on the start corner, with options of each run's environment, which have the same names.

    Without `steps`, the number of control periods, it is one lap.
    """
    envs = gymnasium.make_vec(
        PAPER,
        num_envs=len(options),
        max_episode_steps=study.steps,
        arm=study.arm(column).parameters,
        lap_time=study.lap_time,
        elbow_branch=column.elbow_branch,
        rate_jacobian=rate_jacobian,
        per_env={name: [each[name] for each in options] for name in options[0]},
    )
    return run_batch(envs, policies, max_steps=steps)  # type: ignore[arg-type]


def simulate_column(study: Study, name: str, cases: Sequence[Case], folder: Path) -> dict[str, float]:
    """Make a column's runs, then the constant gains equal to FLSAC's means, and save them as `<column>__<case>.npz`.

    Returns:
        Clock time of the batch of runs, policies included, and its share of one run [s]; compilation not counted, but
        other worker processes may have run beside it.
    """
    column = COLUMNS[name]
    arm = study.arm(column)
    ifdc, flsac = IFDC(), study.fuzzy(arm)
    policies = [flsac if case.controller == "flsac" else ifdc for case in cases]
    options = [case.options | {"gain_limit": study.gain(case)} for case in cases]
    simulate(study, column, options, policies, steps=2)  # compiles
    start = time.perf_counter()
    runs = simulate(study, column, options, policies)
    clock = time.perf_counter() - start
    named = dict(zip(cases, runs, strict=True))
    fuzzy_cases = [case for case in cases if case.controller == "flsac"]
    if fuzzy_cases:
        means = [float(named[case].gain[:-1].mean()) for case in fuzzy_cases]  # type: ignore[index]
        constant = [dataclasses.replace(case, controller="constant") for case in fuzzy_cases]
        options = [case.options | {"gain_limit": mean} for case, mean in zip(constant, means, strict=True)]
        runs = simulate(study, column, options, [ifdc] * len(constant))
        named |= dict(zip(constant, runs, strict=True))
    for case, run in named.items():
        run.notes.update(column=name, **dataclasses.asdict(case))
        run.save(folder / f"{name}__{case.name}.npz")
    return {"batch": clock, "run": clock / len(cases)}


def load_runs(folder: Path, pattern: str = "*") -> dict[str, dict[str, Trajectory]]:
    """Load the saved runs whose names match a pattern, by column and case name."""
    runs: dict[str, dict[str, Trajectory]] = {}
    for path in sorted(folder.glob(f"{pattern}.npz")):
        column, case = path.stem.split("__")
        runs.setdefault(column, {})[case] = Trajectory.load(path)
    order = [case.name for case in all_cases((*CONTROLLERS, "constant"))]
    return {name: {case: runs[name][case] for case in order if case in runs[name]} for name in COLUMNS if name in runs}
