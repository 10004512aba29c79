"""The paper's claims: what each sentence means in figures, and whether it holds in one column; from plain numbers.

Every check takes one column's `measures` and `differences` and the controller to look at, so that the sentences about
FLSAC can be put to a constant gain as well.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from scripts.paper.cases import CONTROLLERS, PLACES, SENSINGS

SIDE = 12.6  # [m]
VISIBLE = 0.05  # [m]; a difference that the eye sees on the paper's axes, about 1/300 of their width
SIGNIFICANT = 0.9  # a ratio to IFDC up to which something is called reduced, suppressed or enhanced
RESOLUTION = 0.005  # [m]; smaller differences of overshoots are not told apart (integration error: below 1 mm)

Measures = dict[str, dict[str, Any]]
Differences = dict[str, dict[str, float]]


@dataclass(frozen=True)
class Finding:
    """What a check found in one column.

    Attributes:
        holds: whether the sentence is true there.
        values: the figures it was decided from.
        merit: one figure for comparing controllers, smaller is better; None where there is no better.
    """

    holds: bool
    values: dict[str, Any]
    merit: float | None = None


Check = Callable[[Measures, Differences, str], Finding]


@dataclass(frozen=True)
class Claim:
    """One sentence of the paper.

    Attributes:
        id: stable name.
        quote: the sentence as printed.
        measure: what it is taken to mean.
        check: decides.
        fuzzy: whether it says what FLSAC gains, so that constant gains are put beside it.
        condition: a reading under which a check that fails in the paper's own column is still reported as met; the
            check says so in `values["under_condition"]`.
        note: what a reader must know.
    """

    id: str
    quote: str
    measure: str
    check: Check
    fuzzy: bool = False
    condition: str = ""
    note: str = ""


def _first(m: Measures, controller: str, sensing: str) -> float:
    return float(m[f"{controller}_{sensing}_tip"]["rigid_overshoot"][0])


def _stable(m: Measures, d: Differences, controller: str) -> Finding:
    growth = {}
    for name in (f"{c}_{s}_{p}" for c in CONTROLLERS for p in PLACES for s in SENSINGS):
        sides = m[name]["vibration_by_side"]
        whole = m[name]["ended"] == "truncated" and len(sides) == 4
        growth[name] = sides[3] / max(sides[:3]) if whole else float("inf")
    worst = max(growth, key=lambda name: growth[name])
    return Finding(growth[worst] <= 2.0, {"largest_ratio": growth[worst], "run": worst.replace("_", " ")})


def _pronounced(m: Measures, d: Differences, controller: str) -> Finding:
    found = {s: m[f"ifdc_{s}_tip"]["rigid_overshoot"] for s in SENSINGS}
    return Finding(min(min(v) for v in found.values()) > 0.01 * SIDE, {"overshoot": found})


def _shift_right(m: Measures, d: Differences, controller: str) -> Finding:
    found = {s: m[f"ifdc_{s}_tip"]["rigid_overshoot"][1] for s in SENSINGS}
    shift = {s: found[s] - found["collocated"] for s in ("nmp", "corrected")}
    return Finding(min(shift.values()) > VISIBLE, {"overshoot_top_right": found, "shift": shift})


def _rest(m: Measures, d: Differences, controller: str) -> Finding:
    found = {s: d[f"ifdc_tip_{s}"] for s in ("nmp", "corrected")}
    return Finding(max(f["rest"] for f in found.values()) <= VISIBLE, {"path_difference": found})


def _nmp_greater(m: Measures, d: Differences, controller: str) -> Finding:
    found = {s: _first(m, "ifdc", s) for s in SENSINGS}
    return Finding(found["nmp"] > found["collocated"] + RESOLUTION, {"overshoot_top_left": found})


def _corrected_greater(m: Measures, d: Differences, controller: str) -> Finding:
    over = {s: _first(m, "ifdc", s) for s in SENSINGS}
    error = {s: m[f"ifdc_{s}_tip"]["rigid_tip_max"] for s in SENSINGS}
    values = {
        "overshoot_top_left": over,
        "largest_error": error,
        "under_condition": error["corrected"] > error["nmp"] + RESOLUTION,
    }
    return Finding(over["corrected"] > over["nmp"] + RESOLUTION, values)


def _little_and_much(m: Measures, d: Differences, controller: str) -> Finding:
    found = {s: _first(m, controller, s) for s in SENSINGS}
    little = abs(found["nmp"] - found["corrected"])
    much = min(abs(found[s] - found["collocated"]) for s in ("nmp", "corrected"))
    return Finding(little <= VISIBLE and much >= 2.0 * VISIBLE, {"overshoot_top_left": found})


def _amplitude(m: Measures, d: Differences, controller: str) -> Finding:
    found = {c: {s: _first(m, c, s) for s in SENSINGS} for c in ("ifdc", controller)}
    ratio = max(found[controller][s] / found["ifdc"][s] for s in SENSINGS)
    values = {"overshoot_top_left": found, "largest_ratio": ratio}
    return Finding(ratio <= SIGNIFICANT, values, merit=max(found[controller].values()))


def _circle(m: Measures, d: Differences, controller: str) -> Finding:
    found = {
        f"{c}_{s}": m[f"{c}_{s}_elbow"]["circle_deviation"] / m[f"{c}_{s}_elbow"]["circle_radius"]
        for c in CONTROLLERS
        for s in SENSINGS
    }
    return Finding(max(found.values()) <= 0.01, {"deviation_over_radius": found})


def _smooth(m: Measures, d: Differences, controller: str) -> Finding:
    found = {c: {s: m[f"{c}_{s}_elbow"]["vibration"] for s in SENSINGS} for c in ("ifdc", controller)}
    ratio = max(found[controller][s] / found["ifdc"][s] for s in SENSINGS)
    values: dict[str, Any] = {"vibration": found, "largest_ratio": ratio}
    for other in ("tip_acceleration", "circle_deviation"):
        values[other] = {c: {s: m[f"{c}_{s}_elbow"][other] for s in SENSINGS} for c in ("ifdc", controller)}
    return Finding(ratio <= 0.5, values, merit=max(found[controller].values()))


def _same_circle(m: Measures, d: Differences, controller: str) -> Finding:
    found = {c: d[f"{c}_elbow_corrected"]["all"] for c in CONTROLLERS}
    return Finding(max(found.values()) <= VISIBLE, {"path_difference": found})


def _suppresses(m: Measures, d: Differences, controller: str) -> Finding:
    late = ("nmp", "corrected")
    found = {c: {s: m[f"{c}_{s}_tip"]["vibration"] for s in late} for c in ("ifdc", controller)}
    ratio = max(found[controller][s] / found["ifdc"][s] for s in late)
    return Finding(
        ratio <= SIGNIFICANT, {"vibration": found, "largest_ratio": ratio}, merit=max(found[controller].values())
    )


def _tracking(tip: str) -> Check:
    def check(m: Measures, d: Differences, controller: str) -> Finding:
        """Whether the late sensors' errors are significantly below IFDC's."""
        late = ("nmp", "corrected")
        found = {c: {s: m[f"{c}_{s}_tip"][f"{tip}_tip_rms"] for s in late} for c in ("ifdc", controller)}
        ratio = max(found[controller][s] / found["ifdc"][s] for s in late)
        merit = max(found[controller].values())
        return Finding(ratio <= SIGNIFICANT, {f"{tip}_tip_rms": found, "largest_ratio": ratio}, merit)

    return check


CLAIMS = (
    Claim(
        "1-stable",
        "All trajectories shown in Figs. 5 (a), (b), 6 (a), (b) and 7 (a), (b) are stable.",
        "every run completes the lap within the state's limits, and vibrates on the last side at most twice as much "
        "as on the worst side before",
        _stable,
    ),
    Claim(
        "2-overshoot",
        "The IFDC strategy produces pronounced overshoots at each direction [switch]",
        "advance of the rigid tip past the corner above 1 % of the side (0.126 m) at all three switches, all three "
        "sensings",
        _pronounced,
    ),
    Claim(
        "3a-shift",
        "The overshoot at the second (top right) direction in Fig. 5 (a) switch shows a distinct "
        "rightward shift attributable to the asynchronous control action in response to time-delayed "
        "end-effector positions.",
        f"advance past the corner to the right, NMP cases more than collocated by over {VISIBLE} m",
        _shift_right,
    ),
    Claim(
        "3b-rest",
        "The remainder of the trajectory exhibits minimal difference between collocated, noncollocated "
        "(NMP) and NMP corrected case.",
        f"r.m.s. distance between the paths, but for the side around the top right switch, at most {VISIBLE} m",
        _rest,
        note="The first corner alone differs by more than that, as claim 4 itself says.",
    ),
    Claim(
        "4a-nmp",
        "The trajectory for the IFDC noncollocated (NMP) case has a greater amplitude than for the collocated case.",
        "advance of the rigid tip past the top left corner",
        _nmp_greater,
    ),
    Claim(
        "4b-corrected",
        "But, the amplitude for the NMP corrected case is even greater thereby demonstrating a true "
        "representation of NMP response to control action.",
        f"advance past the top left corner, by more than {RESOLUTION} m; condition: largest error against the "
        "undelayed reference",
        _corrected_greater,
        condition="if the amplitude is the error against the undelayed reference",
        note="One delay shared by both joints shifts the whole closed loop in time: the path stays, the error grows.",
    ),
    Claim(
        "5-flsac-sensings",
        "[FLSAC] demonstrate[s] minimal difference between noncollocated (NMP) and NMP corrected "
        "amplitudes but a large difference between them and the amplitude for the collocated case.",
        f"advances past the top left corner: the former within {VISIBLE} m, the latter over {2 * VISIBLE} m",
        _little_and_much,
        fuzzy=True,
    ),
    Claim(
        "6-amplitude",
        "However, the FLSAC strategy significantly reduces the amplitudes for all three cases.",
        "advance past the top left corner at least 10 % below IFDC's in each case",
        _amplitude,
        fuzzy=True,
    ),
    Claim(
        "7a-circle",
        "For the sensor located 0.5m from the elbow joint a circular trajectory is obtained",
        "r.m.s. distance of the rigid tip from its least-squares circle at most 1 % of the radius, all six runs",
        _circle,
        note="The sensor cannot reach the square, so the arm stays nearly straight and its tip goes round at full "
        "reach.",
    ),
    Claim(
        "7b-smooth",
        "For IFDC the trajectory exhibits erratic vibratory tracking behavior shown in Fig. 7 (a), "
        "whereas FLSAC produces a smooth circular trajectory",
        "r.m.s. rate of the tip deflections: FLSAC's at most half of IFDC's in each case",
        _smooth,
        fuzzy=True,
        note="Other measures stand beside it: the r.m.s. acceleration of the rigid tip (m/s^2) says the same more "
        "strongly, its r.m.s. distance from the circle (m) the opposite.",
    ),
    Claim(
        "7c-same",
        "The difference between noncollocated (NMP) and NMP corrected results is minimal for both control strategies.",
        f"r.m.s. distance between the two paths at most {VISIBLE} m",
        _same_circle,
    ),
    Claim(
        "8a-vibration",
        "FLSAC effectively suppresses link flexural vibrations [...] with noncollocated sensors.",
        "r.m.s. rate of the tip deflections, end-effector sensor: at least 10 % below IFDC's in both NMP cases",
        _suppresses,
        fuzzy=True,
    ),
    Claim(
        "8b-tracking-true",
        "FLSAC [...] enhances tracking control with noncollocated sensors. (Read for the true tip.)",
        "r.m.s. error of the true tip, end-effector sensor: at least 10 % below IFDC's in both NMP cases",
        _tracking("true"),
        fuzzy=True,
        note="The sensor near the elbow is left out: the path it asks for can be tracked by neither.",
    ),
    Claim(
        "8c-tracking-rigid",
        "FLSAC [...] enhances tracking control with noncollocated sensors. (Read for the tip that the paper plots.)",
        "r.m.s. error of the rigid-kinematics tip: at least 10 % below IFDC's in both NMP cases",
        _tracking("rigid"),
        fuzzy=True,
    ),
)
