"""The square on MuJoCo's chain and on our models, undamped, under the paper's laws with their late sensor.

The same law drives each of them, so that a model's error shows as it does in use: with feedback.
`tests.validation.test_plant` compares the damped default arm.
"""

from functools import cache

import matplotlib.pyplot as plt
import numpy as np
import pytest

from flexarm_env import ArmParameters
from flexarm_env.extras import install_command

pytest.importorskip("mujoco", reason=f"run `{install_command('validate')}`")

from scripts.common.plotting import INK, THRESHOLD, WIDTH, plain_ticks
from tests.validation import laws
from tests.validation.conftest import Check, Page, checked
from tests.validation.engine.test_programmes import LINES, smoothed
from tests.validation.laps import Lap, away
from tests.validation.motion import HELD, Array, Model, apart, rms

pytestmark = [pytest.mark.validation, pytest.mark.slow]

MODELS = (
    Model("linear", 1),
    Model("linear", 2),
    Model("linear", 3),
    Model("foreshortened", 2),
    Model("foreshortened", 3),
    Model("linear", 3, "polynomial"),
    Model("foreshortened", 3, "polynomial"),
)
TITLES = {"ifdc": "IFDC, undamped", "flsac": "FLSAC, undamped"}


@cache
def tips() -> dict[str, dict[str, Array]]:
    """Return the tip of each arm by its name, under each law."""
    fine, truth = laws.on_chains()
    found = {"chain": truth, f"chain, {laws.ELEMENTS[1]} elements": fine}
    return found | {m.label: laws.on_model(ArmParameters.linear(damping_ratio=0.0, **m._asdict())) for m in MODELS}


def from_chain(name: str, law: str) -> Array:
    """Return the distance of an arm's tip from the extrapolated chain's [m]. Shape (n,)."""
    return apart(tips()[name][law], tips()["chain"][law])


test_checks = checked(
    Check(
        "the square: the finer chain from the extrapolated one",
        lambda: 1e3 * max(rms(from_chain(f"chain, {laws.ELEMENTS[1]} elements", law)) for law in laws.LAWS),
        "a choice: half of the 10 mm that the validity range allows a model",
        "mm",
        most=5.0,
    ),
)


def test_table(page: Page) -> None:
    """Distances from the chain, and the score as the benchmark has it, every 10 ms."""
    rows, chain = [], tips()["chain"]
    for name, found in tips().items():
        for law in laws.LAWS:
            lap, off = Lap(found[law][: len(chain[law])], np.empty((0, 2)), []), away(found[law], chain[law])
            mm = {"rms": off.rms, "maximum": off.maximum, "score": lap.score, "score_after_2s": lap.score_after_2s}
            page.quote({f"square, {law}, {name}, {what}": value for what, value in mm.items() if value})
            short = [f"{x:.2g}" if x < 100.0 else f"{x:.0f}" for x in (mm["rms"], mm["maximum"])]
            distance = "" if name == "chain" else " / ".join(short)
            rows.append([name, law, distance, f"{mm['score']:.1f} / {mm['score_after_2s']:.1f}"])
    header = ("tip on the square [mm]", "law", "from the chain: r.m.s. / largest", "score: lap / after 2 s")
    page.table("engine_square", header, rows)


def test_picture(page: Page) -> None:
    """The chain's lap, and some models' distance from it over time."""
    figure, axes = plt.subplots(2, len(TITLES), figsize=(WIDTH, 7.6), height_ratios=(1.2, 1.0), sharey="row")
    for (law, title), (path, error) in zip(TITLES.items(), axes.T, strict=True):
        path.plot(*tips()["chain"][law].T, color=INK, linewidth=1.2)
        path.plot([-6.3, -6.3, 6.3, 6.3, -6.3], [-6.3, 6.3, 6.3, -6.3, -6.3], **THRESHOLD)
        path.set(title=f"{title}: the chain's tip", aspect="equal", xlabel="x [m]")
        for m in MODELS:
            if m in LINES:
                found = smoothed(from_chain(m.label, law))
                text, colour = LINES[m]
                error.semilogy(HELD * np.arange(len(found)), found, color=colour, linewidth=1.6, label=text)
        error.set(xlabel="time [s]", ylim=(0.1, 2e3))
        plain_ticks(error.yaxis)
    axes[0, 0].set_ylabel("y [m]")
    axes[1, 0].set_ylabel("tip from the chain's,\nr.m.s. over 0.1 s [mm]")
    figure.legend(*axes[1, 0].get_legend_handles_labels(), loc="outside lower left", ncols=2)
    page.picture(figure, "engine_square", "The paper's laws on the MuJoCo chain, and how far models are from it")
