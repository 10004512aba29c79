"""Command shaping: shapers, windows, starts and feed-forward, with one joint feedback."""

from __future__ import annotations

from flexarm_baselines.joint_space.tracking import Shape
from scripts.common.markdown import table
from scripts.control.trials import ERRORS, Scores, Study, Trial, Trials, errors

SHAPES = [
    *(Shape(shaper, window=0.05) for shaper in ("none", "ZV", "ZVD", "EI")),
    *(Shape(shaper, window=0.15) for shaper in ("none", "EI")),
    Shape(),
    Shape(window=0.3),
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
    ways = [way for way in FEEDFORWARDS if _label(0, way) in scores]
    lines = [
        [
            *(shape.shaper, f"{shape.times} x {shape.window:g}", f"{shape.ramp:g}"),
            *(error for way in ways for error in errors(scores[_label(n, way)])),
        ]
        for n, shape in enumerate(SHAPES)
        if _label(n, FEEDFORWARDS[0]) in scores
    ]
    return table(["shaper", "windows [s]", "start [s]", *(f"{way}: {lap}" for way in ways for lap in ERRORS)], lines)


def _label(n: int, way: str) -> str:
    return f"{n}: {way}"


STUDY = Study("command shaping: r.m.s. over the lap / after 2 s [mm]", trials, rows, "controllers.md")
