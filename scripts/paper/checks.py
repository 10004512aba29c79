"""What decides the paper's claims: plain numbers of one column's runs -> whether a sentence holds there.

Every check takes one column's `measures` and `differences` and the controller to look at, so that the sentences about
FLSAC can be put to a constant gain as well. It decides from those runs that it is given, so that a sentence can also be
put to fewer: those whose elbow keeps its side.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from operator import itemgetter
from typing import Any

from scripts.paper.cases import CONTROLLERS, SENSINGS

SIDE = 12.6  # [m]
PRONOUNCED = 0.01 * SIDE  # [m]; a choice
VISIBLE = 0.05  # [m]; a difference that the eye sees on the paper's axes, about 1/300 of their width
SIGNIFICANT = 0.9  # a ratio to IFDC up to which something is called reduced, suppressed or enhanced
RESOLUTION = 0.005  # [m]; smaller differences of overshoots are not told apart (integration error: below 1 mm)
LATE = ("nmp", "corrected")

Measures = Mapping[str, dict[str, Any]]
Differences = Mapping[str, dict[str, float]]


class UndecidedError(Exception):
    """The runs that are left do not decide a claim."""


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


def _by_sensing(m: Measures, controller: str, place: str, pick: Callable[[dict[str, Any]], Any]) -> dict[str, Any]:
    """Return one figure of each of a controller's runs that are there."""
    names: dict[str, str] = {s: f"{controller}_{s}_{place}" for s in SENSINGS}
    return {s: pick(m[name]) for s, name in names.items() if name in m}


def _first(row: dict[str, Any]) -> float:
    return float(row["rigid_overshoot"][0])


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


def _ratio(found: dict[str, dict[str, float]], controller: str) -> float:
    """Return the largest ratio of a controller's figure to IFDC's, over the sensings that both have."""
    ours, theirs = found[controller], found["ifdc"]
    return float(max(_some({s: ours[s] / theirs[s] for s in ours if s in theirs})))


def stable(m: Measures, d: Differences, controller: str) -> Finding:
    """Check that vibration does not grow from side to side."""
    growth = {name: row["vibration_by_side"][3] / max(row["vibration_by_side"][:3]) for name, row in m.items()}
    largest = max(_some(growth))
    worst = next(name for name in growth if growth[name] == largest)
    return Finding(largest <= 2.0, {"largest_ratio": largest, "run": worst.replace("_", " ")})


def pronounced(m: Measures, d: Differences, controller: str) -> Finding:
    """Check that IFDC passes every corner by a good way."""
    found = _by_sensing(m, "ifdc", "tip", lambda row: row["rigid_overshoot"])
    return Finding(min(min(v) for v in _some(found)) > PRONOUNCED, {"overshoot": found})


def shift_right(m: Measures, d: Differences, controller: str) -> Finding:
    """Check that a late sensor moves IFDC's overshoot at the second corner to the right."""
    found = _by_sensing(m, "ifdc", "tip", lambda row: row["rigid_overshoot"][1])
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
    found = _by_sensing(m, "ifdc", "tip", _first)
    more = _needed(found, "nmp") - _needed(found, "collocated")
    return Finding(more > RESOLUTION, {"overshoot_top_left": found})


def corrected_greater(m: Measures, d: Differences, controller: str) -> Finding:
    """Check that a late command increases it further; or, under the condition, IFDC's largest error."""
    over = _by_sensing(m, "ifdc", "tip", _first)
    error = _by_sensing(m, "ifdc", "tip", lambda row: row["rigid_tip_max"])
    more = {name: _needed(v, "corrected") - _needed(v, "nmp") for name, v in (("over", over), ("error", error))}
    values = {
        "overshoot_top_left": over,
        "largest_error": error,
        "under_condition": more["error"] > RESOLUTION,
    }
    return Finding(more["over"] > RESOLUTION, values)


def little_and_much(m: Measures, d: Differences, controller: str) -> Finding:
    """Check that the two late sensings agree at the first corner, and differ much from the collocated one."""
    found = _by_sensing(m, controller, "tip", _first)
    little = abs(_needed(found, "nmp") - _needed(found, "corrected"))
    much = min(abs(more) for more in _some(_beyond(found)))
    return Finding(little <= VISIBLE and much >= 2.0 * VISIBLE, {"overshoot_top_left": found})


def amplitude(m: Measures, d: Differences, controller: str) -> Finding:
    """Check that the overshoot at the first corner is significantly below IFDC's."""
    found = {c: _by_sensing(m, c, "tip", _first) for c in ("ifdc", controller)}
    ratio = _ratio(found, controller)
    values = {"overshoot_top_left": found, "largest_ratio": ratio}
    return Finding(ratio <= SIGNIFICANT, values, merit=max(found[controller].values()))


def circle(m: Measures, d: Differences, controller: str) -> Finding:
    """Check that the tips go round on circles."""
    found = {name.removesuffix("_elbow"): row["circle_deviation"] / row["circle_radius"] for name, row in m.items()}
    return Finding(max(_some(found)) <= 0.01, {"deviation_over_radius": found})


def smooth(m: Measures, d: Differences, controller: str) -> Finding:
    """Check that vibration is at most half of IFDC's."""
    figures = ("vibration", "tip_acceleration", "circle_deviation")
    found = {
        figure: {c: _by_sensing(m, c, "elbow", itemgetter(figure)) for c in ("ifdc", controller)} for figure in figures
    }
    ratio = _ratio(found["vibration"], controller)
    values = {"vibration": found["vibration"], "largest_ratio": ratio} | {f: found[f] for f in figures[1:]}
    return Finding(ratio <= 0.5, values, merit=max(found["vibration"][controller].values()))


def same_circle(m: Measures, d: Differences, controller: str) -> Finding:
    """Check that both late sensings make the same path."""
    apart = {c: _apart(m, d, c, "elbow") for c in CONTROLLERS}
    found: dict[str, float] = {c: pairs["corrected"]["all"] for c, pairs in apart.items() if "corrected" in pairs}
    return Finding(max(_some(found)) <= VISIBLE, {"path_difference": found})


def suppresses(m: Measures, d: Differences, controller: str) -> Finding:
    """Check that vibration is significantly below IFDC's."""
    found = {c: _by_sensing(m, c, "tip", lambda row: row["vibration"]) for c in ("ifdc", controller)}
    ratio = _ratio(found, controller)
    return Finding(
        ratio <= SIGNIFICANT, {"vibration": found, "largest_ratio": ratio}, merit=max(found[controller].values())
    )


def tracking(tip: str) -> Check:
    """Make a check of the r.m.s. error of the "true" or the "rigid" tip."""

    def check(m: Measures, d: Differences, controller: str) -> Finding:
        """Check that the errors are significantly below IFDC's."""
        found = {c: _by_sensing(m, c, "tip", lambda row: row[f"{tip}_tip_rms"]) for c in ("ifdc", controller)}
        ratio = _ratio(found, controller)
        merit = max(found[controller].values())
        return Finding(ratio <= SIGNIFICANT, {f"{tip}_tip_rms": found, "largest_ratio": ratio}, merit)

    return check
