"""`DAggerConfig`: everything that decides the result of an imitation, with tuned defaults."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from flexarm_agents.environments import check_options
from flexarm_agents.policies.encoders import LONGEST_LAG, checked_increasing
from flexarm_agents.training.config import RunConfig, optional, setting, text
from flexarm_env.validation import integer, mapping, number, pair, shown


def _counts(name: str, value: object) -> tuple[int, ...]:
    counts: Any = value
    pair(name, counts, least=2)
    return tuple(integer(f"{name}[{n}]", count, 2) for n, count in enumerate(counts))


@dataclass(frozen=True, kw_only=True)
class DAggerConfig(RunConfig):
    """DAgger: a student imitates a teacher with full knowledge, in the situations that the student gets into."""

    algorithm: ClassVar[str] = "dagger"
    training: ClassVar[str] = "flexarm_agents.teaching.training:DAggerTraining"

    rounds: int = setting(4, integer, least=1)
    """Rounds of laps, each with a fit to the data of all rounds so far."""
    arms: int = setting(64, integer, least=2)
    """Arms side by side, each of which runs a lap in a round."""
    updates: int = setting(1000, integer, least=1)
    """Steps of the optimiser in a round."""
    batch: int = setting(1024, integer, least=1)
    """Samples in a step of the optimiser."""
    learning_rate: float = setting(2e-3, number, above=0.0, most=1.0)
    """Learning rate at the beginning; it falls to 0 as half a cosine."""
    averaging: float = setting(0.998, number, least=0.0, most=1.0)
    """The student is the average of the network's weights, which forgets by this factor in each update."""
    teacher_share: float = setting(0.2, number, least=0.0, most=1.0)
    """Share of the time in which the teacher drives, from the half of the rounds on; all of it in the first round."""
    torque_noise: float = setting(0.04, number, least=0.0, most=1.0)
    """Largest standard deviation of the disturbance of the torques in a lap, as a share of their limits."""
    knee: float = setting(0.06, number, above=0.0)
    """Correction by the teacher's feedback, as a share of the limits, that halves the weight of a sample."""
    lags: tuple[int, ...] = setting((), checked_increasing, least=1, most=LONGEST_LAG)
    """Ages of the past readings that the student sees [control periods]; none: it sees the present ones only."""
    change_weight: float = setting(0.1, number, unit="m^2", least=0.0)
    """Weight of changes of the torques in the teacher's plans [m^2], see `TrackingProblem`."""
    deflection_limit: float = setting(1.4, number, unit="m", above=0.0)
    """Deflection of a link's tip above which the cost in the teacher's plans rises steeply [m]."""
    tip_weight: float = setting(0.03, number, unit="m", above=0.0)
    """Deviation of the tip that the teacher's feedback weighs as 1 [m]; a smaller one makes it stiffer."""
    plants: tuple[int, int] = setting((3, 3), _counts)
    """How many payloads and stiffnesses the teacher has plans for, where they are drawn."""
    drawn_paths: int = setting(0, integer, least=0)
    """How many drawn paths the student is taught on (`teaching.drawn_paths`), each on its own arm; 0: the square."""
    alternate_options: dict[str, Any] = setting({}, mapping)
    """Options in which every second drawn path and round differ from the others, e.g. `payload_changes`."""
    plans: str | None = setting(None, optional, check=text, what="the path of a folder", kept=False)
    """Folder for the teacher's plans, which several trainings can share; None: `plans` in the folder of the results."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.arms % 2:
            raise ValueError(f"arms = {shown(self.arms)}: must be even, half of them for each lap")
        own = {"start", *(("reference", "waypoints", "lap_time") if self.drawn_paths else ())}
        whole = check_options(self.environment, self.options | self.curriculum_options | self.alternate_options)
        object.__setattr__(self, "alternate_options", {name: whole[name] for name in self.alternate_options})
        for field in ("curriculum_options", "alternate_options"):
            given = getattr(self, field)
            for name in own & given.keys():
                raise ValueError(
                    f"{field}[{name!r}] = {shown(given[name])}: must be left out, since the teacher's plans decide it"
                )
        if self.alternate_options and self.drawn_paths < 2:
            raise ValueError(f"drawn_paths = {self.drawn_paths}: must be >= 2 with alternate_options")
        if self.drawn_paths and self.plants != type(self).plants:
            raise ValueError(f"plants = {self.plants}: must be left out with drawn_paths, which have own arms")

    @property
    def all_rounds(self) -> int:
        """Rounds of the whole training."""
        return self.rounds
