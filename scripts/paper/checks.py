"""What decides the paper's claims: plain numbers of one column's runs -> whether a sentence holds there.

Every check takes one column's `measures` and `differences` and the controller to look at, so that the sentences about
FLSAC can be put to a constant gain as well. It decides from those runs that it is given, so that a sentence can also be
put to fewer: those whose elbow keeps its side.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from scripts.paper.cases import CONTROLLERS, SENSINGS

SIDE = 12.6  # [m]
PRONOUNCED = 0.01 * SIDE  # [m]; a choice
VISIBLE = 0.05  # [m]; a difference that the eye sees on the paper's axes, about 1/300 of their width
SIGNIFICANT = 0.9  # a ratio to IFDC up to which something is called reduced, suppressed or enhanced
RESOLUTION = 0.005  # [m]; smaller differences of overshoots are not told apart (integration error: below 1 mm)
LATE = ("nmp", "corrected")
TOP_LEFT = "overshoot_top_left"  # of the rigid tip, past the first corner

Measures = Mapping[str, dict[str, Any]]
Differences = Mapping[str, dict[str, float]]


class UndecidedError(Exception):
    """The runs that are left do not decide a claim."""


@dataclass(frozen=True)
class Finding:
    """What a check found in one column."""

    holds: bool  # whether the sentence is true there
    values: dict[str, Any]  # the figures it was decided from
    merit: float | None = None  # one figure for comparing controllers, smaller is better; None where there is no better


Check = Callable[[Measures, Differences, str], Finding]


def _by_sensing(m: Measures, controller: str, figure: str) -> dict[str, Any]:
    """Return one figure of each of a controller's runs that are there; a claim's have one place."""
    rows = {s: row for s in SENSINGS for name, row in m.items() if name.startswith(f"{controller}_{s}_")}
    return {s: float(row["rigid_overshoot"][0]) if figure == TOP_LEFT else row[figure] for s, row in rows.items()}


def _beyond(found: dict[str, float]) -> dict[str, float]:
    """Return by how much the late sensors' figures exceed the collocated one's."""
    return {s: found[s] - _needed(found, "collocated") for s in LATE if s in found}


def _needed(found: dict[str, float], sensing: str) -> float:
    if sensing not in found:
        raise UndecidedError
    return found[sensing]


def _some(values: dict[str, Any]) -> list[Any]:
    """Return the values; an empty list is an error."""
    if not values:
        raise UndecidedError
    return list(values.values())


def stable(m: Measures, d: Differences, controller: str) -> Finding:
    """Check that vibration does not grow from side to side."""
    growth = {name: row["vibration_by_side"][3] / max(row["vibration_by_side"][:3]) for name, row in m.items()}
    largest = max(_some(growth))
    worst = next(name for name in growth if growth[name] == largest)
    return Finding(largest <= 2.0, {"largest_ratio": largest, "run": worst.replace("_", " ")})


def pronounced(m: Measures, d: Differences, controller: str) -> Finding:
    """Check that IFDC passes every corner by a good way."""
    found = _by_sensing(m, "ifdc", "rigid_overshoot")
    return Finding(min(min(v) for v in _some(found)) > PRONOUNCED, {"overshoot": found})


def shift_right(m: Measures, d: Differences, controller: str) -> Finding:
    """Check that a late sensor moves IFDC's overshoot at the second corner to the right."""
    found = {sensing: three[1] for sensing, three in _by_sensing(m, "ifdc", "rigid_overshoot").items()}
    shift = _beyond(found)
    return Finding(min(_some(shift)) > VISIBLE, {"overshoot_top_right": found, "shift": shift})


def rest(m: Measures, d: Differences, controller: str) -> Finding:
    """Check that late sensors leave IFDC's path as it is, but for the second corner."""
    found = _apart(m, d, "ifdc", "tip")
    return Finding(max(f["rest"] for f in _some(found)) <= VISIBLE, {"path_difference": found})


def _apart(m: Measures, d: Differences, controller: str, place: str) -> dict[str, dict[str, float]]:
    """Return path differences between two runs that are both there: NMP from collocated, corrected from NMP."""
    pairs = {"nmp": "collocated", "corrected": "nmp"}
    names: dict[str, str] = {s: f"{controller}_{s}_{place}" for s in SENSINGS}
    return {s: d[f"{controller}_{place}_{s}"] for s, other in pairs.items() if names[s] in m and names[other] in m}


def nmp_greater(m: Measures, d: Differences, controller: str) -> Finding:
    """Check that a late sensor increases IFDC's overshoot at the first corner."""
    found = _by_sensing(m, "ifdc", TOP_LEFT)
    more = _needed(found, "nmp") - _needed(found, "collocated")
    return Finding(more > RESOLUTION, {TOP_LEFT: found})


def corrected_greater(m: Measures, d: Differences, controller: str) -> Finding:
    """Check that a late command increases it further; or, under the condition, IFDC's largest error."""
    over = _by_sensing(m, "ifdc", TOP_LEFT)
    error = _by_sensing(m, "ifdc", "rigid_tip_max")
    more = {name: _needed(v, "corrected") - _needed(v, "nmp") for name, v in (("over", over), ("error", error))}
    values = {TOP_LEFT: over, "largest_error": error, "under_condition": more["error"] > RESOLUTION}
    return Finding(more["over"] > RESOLUTION, values)


def little_and_much(m: Measures, d: Differences, controller: str) -> Finding:
    """Check that the two late sensings agree at the first corner, and differ much from the collocated one."""
    found = _by_sensing(m, controller, TOP_LEFT)
    little = abs(_needed(found, "nmp") - _needed(found, "corrected"))
    much = min(abs(more) for more in _some(_beyond(found)))
    return Finding(little <= VISIBLE and much >= 2.0 * VISIBLE, {TOP_LEFT: found})


def circle(m: Measures, d: Differences, controller: str) -> Finding:
    """Check that the tips go round on circles."""
    found = {name.removesuffix("_elbow"): row["circle_deviation"] / row["circle_radius"] for name, row in m.items()}
    return Finding(max(_some(found)) <= 0.01, {"deviation_over_radius": found})


def same_circle(m: Measures, d: Differences, controller: str) -> Finding:
    """Check that both late sensings make the same path."""
    apart = {c: _apart(m, d, c, "elbow") for c in CONTROLLERS}
    found: dict[str, float] = {c: pairs["corrected"]["all"] for c, pairs in apart.items() if "corrected" in pairs}
    return Finding(max(_some(found)) <= VISIBLE, {"path_difference": found})


def reduced(figure: str, most: float = SIGNIFICANT, beside: tuple[str, ...] = ()) -> Check:
    """Make a check that a figure is at most a share of IFDC's with each sensing; `beside` are shown, too."""

    def check(m: Measures, d: Differences, controller: str) -> Finding:
        found = {name: {c: _by_sensing(m, c, name) for c in ("ifdc", controller)} for name in (figure, *beside)}
        ours, theirs = found[figure][controller], found[figure]["ifdc"]
        ratio = float(max(_some({s: ours[s] / theirs[s] for s in ours if s in theirs})))
        values = {figure: found.pop(figure), "largest_ratio": ratio, **found}
        return Finding(ratio <= most, values, merit=max(ours.values()))

    return check
