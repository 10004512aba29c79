"""Both independent engines, as recorded, and the arm's models: needs neither engine.

MuJoCo's chain of rigid segments (extrapolated) and Exudyn's cables share no method and no author. How far they are
apart is what either can be trusted with; a model's distance from both is its own.
"""

from collections.abc import Callable
from functools import cache

import matplotlib.pyplot as plt
import numpy as np
import pytest

from scripts.common.plotting import COLOURS, WIDTH, running_rms
from tests.validation import recorded
from tests.validation.conftest import Check, Page, checked
from tests.validation.motion import HELD, Array, Model, Motion, apart, model_motion, rms

pytestmark = [pytest.mark.validation, pytest.mark.slow]

BEST = Model("foreshortened", 4, "polynomial")
MODELS = (Model("linear", 2), Model("foreshortened", 2), Model("foreshortened", 3, "polynomial"), BEST)
SMOOTH = recorded.DOUBLED
TWICE = tuple(f"{name}, twice" for name in SMOOTH)
JUMPS = tuple(name for name in recorded.cases() if name not in SMOOTH + TWICE)
KEPT = recorded.load()
WINDOW = round(0.1 / (recorded.EVERY * HELD))  # instants


@cache
def motion(name: str, model: Model) -> Motion:
    return recorded.thinned(model_motion(recorded.cases()[name], model))


def engines_apart(name: str) -> Array:
    """Return the distance of the engines' tips [mm]. Shape (n,)."""
    chain, cables = (KEPT[engine][name] for engine in recorded.ENGINES)
    return 1e3 * apart(chain.tip, cables.tip)


def model_apart(name: str, engine: str, model: Model = BEST) -> Array:
    """Return the distance of a model's tip from an engine's [mm]. Shape (n,)."""
    return 1e3 * apart(motion(name, model).tip, KEPT[engine][name].tip)


REQUIRED = "a choice: the 1 mm required of the models"


def furthest(cases: tuple[str, ...]) -> Callable[[], float]:
    """Return what finds the largest distance of the engines' tips [mm]."""
    return lambda: max(engines_apart(case).max() for case in cases)


def best_from_either(cases: tuple[str, ...]) -> float:
    """Return the r.m.s. distance of the best model's tip from the engine that is further [mm]."""
    return max(rms(model_apart(case, engine)) for case in cases for engine in recorded.ENGINES)


test_checks = checked(
    Check("the two engines' tips apart, smooth torques at 4 %: largest", furthest(SMOOTH), REQUIRED, "mm", most=1.0),
    Check("the same at 7.5 %", furthest(TWICE), REQUIRED, "mm", most=1.0),
    Check(
        "torques that jump, 4 %: r.m.s.",
        lambda: max(rms(engines_apart(case)) for case in JUMPS),
        "a choice: the 10 mm of the validity range; undamped vibrations beyond either's mesh drift apart",
        "mm",
        most=10.0,
    ),
    Check(
        "smooth torques at 4 %: four polynomials with foreshortening from either engine, r.m.s.",
        lambda: best_from_either(SMOOTH),
        "its own next order is the third: 4 % cubed of 4.5 m is 0.3 mm; three times that is a choice, for growth "
        "over two seconds",
        "mm",
        most=1.0,
    ),
    Check(
        "the same of four polynomials at 7.5 %",
        lambda: best_from_either(TWICE),
        "the same: 7.5 % cubed of 4.5 m is 1.9 mm; three times that",
        "mm",
        most=5.7,
    ),
)


def test_table(page: Page) -> None:
    names = list(recorded.cases())
    rows = [
        ["largest deflection / length", *(f"{100.0 * KEPT['exudyn'][name].bend:.1f} %" for name in names)],
        ["MuJoCo from Exudyn", *(_both(engines_apart(name)) for name in names)],
    ]
    for model in MODELS:
        for engine, title in zip(recorded.ENGINES, ("MuJoCo", "Exudyn"), strict=True):
            cells = [_both(model_apart(name, engine, model)) for name in names]
            rows.append([f"{model.label}, from {title}", *cells])
    header = ["tips apart [mm]: r.m.s. / largest", *(name.replace("_", " ") for name in names)]
    page.table("two_engines_distances", header, rows)
    for name in names:
        found = engines_apart(name)
        page.quote({f"{name}, engines, rms": rms(found), f"{name}, engines, maximum": found.max()})
        page.quote({f"{name}, best, {engine}": rms(model_apart(name, engine)) for engine in recorded.ENGINES})


def _both(away: Array) -> str:
    return f"{rms(away):.2g} / {away.max():.2g}"


def test_picture(page: Page) -> None:
    """One line a case: the engines on the left, the best model on the right."""
    figure, axes = plt.subplots(1, 2, figsize=(WIDTH, 4.8), sharex=True, sharey=True)
    for name, colour in zip(recorded.cases(), COLOURS, strict=False):
        for axis, away in zip(axes, (engines_apart(name), model_apart(name, "exudyn")), strict=True):
            time = recorded.EVERY * HELD * np.arange(1, len(away))
            axis.semilogy(time, running_rms(away[1:], WINDOW), color=colour, label=name.replace("_", " "))
    for axis, title in zip(axes, ("MuJoCo", "the best model"), strict=True):
        axis.set(title=f"{title} against Exudyn", xlabel="time [s]", ylim=(1e-4, 30.0))
    axes[0].set_ylabel("r.m.s. over 0.1 s [mm]")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower left", ncol=3)
    title = "Distance of two tips: two engines; and four polynomials a link against an engine"
    page.picture(figure, "two_engines", title)
