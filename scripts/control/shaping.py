"""Command shaping: shapers, windows, starts and feed-forward that were tried, with one joint feedback."""

from __future__ import annotations

from flexarm_baselines.joint_tracking import Shape
from scripts.common.markdown import table
from scripts.control.trials import ERRORS, Scores, Study, Trial, Trials, errors

SHAPES = [
    Shape(window=0.05),
    Shape(window=0.1),
    Shape(window=0.15),
    Shape(),
    Shape(window=0.3),
    *(Shape(shaper, window=0.05) for shaper in ("ZV", "ZVD", "EI")),
    *(Shape(shaper, window=0.15) for shaper in ("ZV", "ZVD", "EI")),
    Shape(ramp=0.8),
    Shape(ramp=1.6),
]
FEEDFORWARDS = ("rigid", "flexible")


def trials(quick: bool) -> Trials:
    """Return every shape with each feed-forward."""
    found = {
        _label(n, way): Trial("shaped", {"shape": shape, "feedforward": way})
        for n, shape in enumerate(SHAPES)
        for way in FEEDFORWARDS
    }
    return dict(list(found.items())[:1]) if quick else found


def rows(scores: Scores) -> str:
    """Write the table."""
    lines = [
        [shape.shaper, f"{shape.times} x {shape.window:g}", f"{shape.ramp:g}", way, *errors(scores[_label(n, way)])]
        for n, shape in enumerate(SHAPES)
        for way in FEEDFORWARDS
        if _label(n, way) in scores
    ]
    return table(["shaper", "windows [s]", "start [s]", "feed-forward", *ERRORS], lines)


def _label(n: int, way: str) -> str:
    return f"{n}: {way}"


STUDY = Study("command shaping: what was tried, with the feedback of `shaped`", trials, rows, "controllers.md")
