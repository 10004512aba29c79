"""The second independent engine by itself: do Exudyn's cables converge, and do they give what was recorded of them?"""

from collections.abc import Callable

import matplotlib.pyplot as plt
import numpy as np
import pytest

from flexarm_env.extras import install_command
from scripts.common.plotting import COLOURS, SOFT, THRESHOLD, WIDTH, number_ticks
from tests.validation import recorded
from tests.validation.conftest import Check, Page, checked
from tests.validation.kept import kept
from tests.validation.motion import Motion, apart, rms

pytest.importorskip(
    "exudyn",
    reason=f"run `{install_command('validate')}`; on Debian and Ubuntu Exudyn needs libgl1, too",
    exc_type=ImportError,
)

from tests.validation.cables import AXIAL_STIFFNESS, ELEMENTS, STEP, cable_motion

pytestmark = [pytest.mark.validation, pytest.mark.slow]

COARSER = (2, 3, 4, 6, 8, ELEMENTS)  # elements of a cable, against `FINEST`
FINEST = 24
TENTH = "a choice: a tenth of the 1 mm required of the models"


@kept
def motion(name: str, elements: int = ELEMENTS, step: float = STEP, axial_stiffness: float = AXIAL_STIFFNESS) -> Motion:
    return cable_motion(recorded.cases()[name], elements, step, axial_stiffness)


def changes(name: str, elements: int = ELEMENTS) -> float:
    """Return the largest change of the tip when a cable has the finest mesh [mm]."""
    return 1e3 * float(apart(motion(name, elements).tip, motion(name, FINEST).tip).max())


def halved(name: str) -> float:
    """Return the largest change of the tip with half the step [mm]."""
    return 1e3 * float(apart(motion(name).tip, motion(name, step=0.5 * STEP).tip).max())


def softened(name: str) -> float:
    """Return the r.m.s. change of the tip with a third of the axial stiffness [mm]."""
    return 1e3 * rms(apart(motion(name).tip, motion(name, axial_stiffness=AXIAL_STIFFNESS / 3.0).tip))


def from_record(name: str) -> float:
    """Return the largest distance of the tip from the recorded one [mm]."""
    return 1e3 * float(apart(recorded.thinned(motion(name)).tip, recorded.load()["exudyn"][name].tip).max())


def largest(change: Callable[[str], float]) -> Callable[[], float]:
    return lambda: max(map(change, recorded.DOUBLED))


MESH = f"smooth torques: the tip with {FINEST} elements a cable instead of {ELEMENTS}"
test_checks = checked(
    Check(MESH, largest(changes), TENTH, "mm", most=0.1),
    Check("the same with the step halved", largest(halved), TENTH, "mm", most=0.1),
    Check("the same with a third of the axial stiffness, r.m.s.", largest(softened), TENTH, "mm", most=0.1),
    Check(
        "the tip as recorded",
        largest(from_record),
        "the same programme again; Newton's method stops at 1e-4 N, and records are rounded to 1e-6 m",
        "mm",
        most=0.01,
    ),
)


def test_table(page: Page) -> None:
    names = recorded.DOUBLED
    rows = [["largest deflection / length", *(f"{100.0 * motion(name).bend:.1f} %" for name in names)]]
    rows += [[f"{n} elements a cable, from {FINEST}", *(f"{changes(name, n):.2g}" for name in names)] for n in COARSER]
    rows.append(["step halved", *(f"{halved(name):.2g}" for name in names)])
    titles = [name.replace("_", " ") for name in names]
    page.table("cables_convergence", ["largest change of the tip [mm]", *titles], rows)


def test_picture(page: Page) -> None:
    figure, axis = plt.subplots(figsize=(WIDTH, 3.8))
    for name, colour in zip(recorded.DOUBLED, COLOURS, strict=False):
        axis.loglog(COARSER, [changes(name, n) for n in COARSER], "o-", color=colour, label=name.replace("_", " "))
    counts = np.array([2.0, 12.0])
    axis.loglog(counts, 30.0 * counts**-4.0, color=SOFT, linestyle="--", label="order 4")
    axis.axhline(0.1, **THRESHOLD)
    axis.text(2.0, 0.11, "threshold of the check", color=SOFT)
    axis.set(xlabel="elements a cable", ylabel="largest change of the tip [mm]")
    axis.set_title("How far the tip moves when Exudyn's cables have more elements")
    number_ticks(axis.xaxis, COARSER)
    axis.minorticks_off()
    axis.legend()
    page.picture(figure, "cables")
