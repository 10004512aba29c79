"""The paper's claims: each sentence, what it is taken to mean, the runs that it is about, and what decides it."""

from dataclasses import dataclass
from typing import Any

from scripts.paper import checks
from scripts.paper.cases import CONTROLLERS, PLACES, SENSINGS
from scripts.paper.checks import LATE, PRONOUNCED, RESOLUTION, VISIBLE, Check, Differences, Finding, Measures

ANY = "any"  # in a claim's `controllers`: FLSAC, or a constant gain that the check is put to beside it


@dataclass(frozen=True)
class Claim:
    """One sentence of the paper."""

    id: str  # stable name
    quote: str  # the sentence as printed
    measure: str  # what it is taken to mean
    check: Check  # decides; raises `checks.UndecidedError` where too few runs are left
    places: tuple[str, ...] = ("tip",)  # where the sensor is in the runs that it looks at
    controllers: tuple[str, ...] = ("ifdc",)  # theirs; `ANY` stands for the one that the check is put to
    sensings: tuple[str, ...] = SENSINGS  # theirs
    until: float = 1.0  # the part of the lap that it looks at ends here, as a share of the lap
    # A reading under which a check that fails in the paper's own column is still reported as met; the check says so in
    # `values["under_condition"]`
    condition: str = ""
    note: str = ""  # what a reader must know

    def runs(self, controller: str) -> list[str]:
        """Return the names of the runs that the claim looks at."""
        controllers = [controller if c == ANY else c for c in self.controllers]
        return [f"{c}_{s}_{p}" for c in controllers for p in self.places for s in self.sensings]

    def find(self, m: Measures, d: Differences, controller: str) -> Finding:
        """Decide from all its runs. If one of them ended early, a claim about laps does not hold."""
        names = self.runs(controller)
        early = [name for name in names if m[name]["ended_early"]]
        if early:
            return Finding(False, {"ended_early": [name.replace("_", " ") for name in early]})
        return self.check({name: m[name] for name in names}, d, controller)

    def find_on_one_side(self, m: Measures, d: Differences, controller: str) -> tuple[Finding | None, list[str]]:
        """Decide from those of its runs whose elbow keeps its side in the part looked at; return their names, too."""
        kept = [name for name in self.runs(controller) if self._keeps_side(m[name])]
        try:
            return self.check({name: m[name] for name in kept}, d, controller), kept
        except checks.UndecidedError:
            return None, kept

    def _keeps_side(self, row: dict[str, Any]) -> bool:
        return not row["ended_early"] and all(time > self.until * row["duration"] for time in row["elbow_changes"])


CLAIMS = (
    Claim(
        "1-stable",
        "All trajectories shown in Figs. 5 (a), (b), 6 (a), (b) and 7 (a), (b) are stable.",
        "every run completes the lap within the state's limits, and vibrates on the last side at most twice as much "
        "as on the worst side before",
        checks.stable,
        places=PLACES,
        controllers=CONTROLLERS,
    ),
    Claim(
        "2-overshoot",
        "The IFDC strategy produces pronounced overshoots at each direction [switch]",
        f"advance of the rigid tip past the corner above 1 % of the side ({PRONOUNCED:.3f} m) at all three switches, "
        "all three sensings",
        checks.pronounced,
    ),
    Claim(
        "3a-shift",
        "The overshoot at the second (top right) direction in Fig. 5 (a) switch shows a distinct "
        "rightward shift attributable to the asynchronous control action in response to time-delayed "
        "end-effector positions.",
        f"advance past the corner to the right, NMP cases more than collocated by over {VISIBLE} m",
        checks.shift_right,
        until=0.75,
    ),
    Claim(
        "3b-rest",
        "The remainder of the trajectory exhibits minimal difference between collocated, noncollocated "
        "(NMP) and NMP corrected case.",
        f"r.m.s. distance between the paths, but for the side around the top right switch, at most {VISIBLE} m",
        checks.rest,
        note="The first corner alone differs by more than that, as claim 4 itself says.",
    ),
    Claim(
        "4a-nmp",
        "The trajectory for the IFDC noncollocated (NMP) case has a greater amplitude than for the collocated case.",
        "advance of the rigid tip past the top left corner",
        checks.nmp_greater,
        until=0.5,
    ),
    Claim(
        "4b-corrected",
        "But, the amplitude for the NMP corrected case is even greater thereby demonstrating a true "
        "representation of NMP response to control action.",
        f"advance past the top left corner, by more than {RESOLUTION} m; condition: largest error against the "
        "undelayed reference",
        checks.corrected_greater,
        condition="if the amplitude is the error against the undelayed reference",
        note="One delay shared by both joints shifts the whole closed loop in time: the path stays, the error grows.",
    ),
    Claim(
        "5-flsac-sensings",
        "[FLSAC] demonstrate[s] minimal difference between noncollocated (NMP) and NMP corrected "
        "amplitudes but a large difference between them and the amplitude for the collocated case.",
        f"advances past the top left corner: the former within {VISIBLE} m, the latter over {2 * VISIBLE} m",
        checks.little_and_much,
        controllers=(ANY,),
        until=0.5,
    ),
    Claim(
        "6-amplitude",
        "However, the FLSAC strategy significantly reduces the amplitudes for all three cases.",
        "advance past the top left corner at least 10 % below IFDC's in each case",
        checks.reduced(checks.TOP_LEFT),
        controllers=("ifdc", ANY),
        until=0.5,
    ),
    Claim(
        "7a-circle",
        "For the sensor located 0.5m from the elbow joint a circular trajectory is obtained",
        "r.m.s. distance of the rigid tip from its least-squares circle at most 1 % of the radius, all six runs",
        checks.circle,
        note="The sensor cannot reach the square, so the arm stays nearly straight and its tip goes round at full "
        "reach.",
        places=("elbow",),
        controllers=CONTROLLERS,
    ),
    Claim(
        "7b-smooth",
        "For IFDC the trajectory exhibits erratic vibratory tracking behavior shown in Fig. 7 (a), "
        "whereas FLSAC produces a smooth circular trajectory",
        "r.m.s. rate of the tip deflections: FLSAC's at most half of IFDC's in each case",
        checks.reduced("vibration", 0.5, ("tip_acceleration", "circle_deviation")),
        note="Two more measures are listed: by the r.m.s. acceleration of the rigid tip (m/s^2) FLSAC is smoother "
        "still; by its r.m.s. distance from the circle (m) IFDC is better.",
        places=("elbow",),
        controllers=("ifdc", ANY),
    ),
    Claim(
        "7c-same",
        "The difference between noncollocated (NMP) and NMP corrected results is minimal for both control strategies.",
        f"r.m.s. distance between the two paths at most {VISIBLE} m",
        checks.same_circle,
        places=("elbow",),
        controllers=CONTROLLERS,
        sensings=LATE,
    ),
    Claim(
        "8a-vibration",
        "FLSAC effectively suppresses link flexural vibrations [...] with noncollocated sensors.",
        "r.m.s. rate of the tip deflections, end-effector sensor: at least 10 % below IFDC's in both NMP cases",
        checks.reduced("vibration"),
        controllers=("ifdc", ANY),
        sensings=LATE,
    ),
    Claim(
        "8b-tracking-true",
        "FLSAC [...] enhances tracking control with noncollocated sensors. (Read for the true tip.)",
        "r.m.s. error of the true tip, end-effector sensor: at least 10 % below IFDC's in both NMP cases",
        checks.reduced("true_tip_rms"),
        note="The sensor near the elbow is left out: no controller can track the square with it.",
        controllers=("ifdc", ANY),
        sensings=LATE,
    ),
    Claim(
        "8c-tracking-rigid",
        "FLSAC [...] enhances tracking control with noncollocated sensors. (Read for the tip that the paper plots.)",
        "r.m.s. error of the rigid-kinematics tip: at least 10 % below IFDC's in both NMP cases",
        checks.reduced("rigid_tip_rms"),
        controllers=("ifdc", ANY),
        sensings=LATE,
    ),
)
