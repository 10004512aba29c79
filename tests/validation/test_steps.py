"""Error of the integration step against its cost: the tip after a second of random torques, by steps in a period.

Torques are drawn uniformly within the limits, held for 50 ms and the same for every step; the finest step is exact. The
environments choose the fewest steps whose expected error (`flexarm_env.simulation.step_error`) is 0.1 mm.
"""

from collections.abc import Sequence
from dataclasses import asdict, replace
from functools import cache
from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np
import pytest

from flexarm_env import ArmParameters, FlexibleArm
from flexarm_env.actions import TORQUE_LIMIT
from flexarm_env.envs.settings import Settings
from flexarm_env.simulation.step_error import HELD, SECONDS, TOLERANCE
from scripts.common.plotting import COLOURS, SOFT, THRESHOLD, WIDTH, number_ticks
from tests.validation.conftest import Check, Page, checked
from tests.validation.motion import Array

pytestmark = pytest.mark.validation

PERIOD, SEED, EPISODES = 0.01, 20081, 200
COUNTS = (4, 5, 7, 10, 14, 20, 28)  # steps in a period
FINER = 4  # the solution that counts as exact has so many times the steps of the finest
STABLE = 2.0  # h omega, above which the environments refuse a step
SCATTER = 3.0  # of medians about what the linear arm predicts, times the tolerance

OWN = ArmParameters()
STIFF, STRONG = ((10.0 * one, 10.0 * two) for one, two in (OWN.flexural_rigidities, TORQUE_LIMIT))
CASES = {  # arms, and the torques that drive them
    "default arm": (OWN, TORQUE_LIMIT),
    "payload 2 kg": (replace(OWN, payload_mass=2.0), TORQUE_LIMIT),
    "undamped": (replace(OWN, damping_ratio=0.0), TORQUE_LIMIT),
    "10 times as stiff, 10 times the torque": (replace(OWN, flexural_rigidities=STIFF), STRONG),
    "linear arm": (ArmParameters.linear(), TORQUE_LIMIT),
}


class Errors(NamedTuple):
    default: int  # steps in a period that the environments take
    median: dict[int, float]  # of all motions [m], by steps in a period
    largest: dict[int, float]  # likewise

    def shown(self, count: int) -> str:
        """Write median and largest error of a number of steps [mm]."""
        known = count in self.median
        return f"{1e3 * self.median[count]:.3g} / {1e3 * self.largest[count]:.3g}" if known else "refused"


@cache
def measured(name: str) -> Errors:
    parameters, limits = CASES[name]
    default = Settings.of({"arm": asdict(parameters), "torque_limit": limits}).integration.substeps
    least = int(np.ceil(PERIOD * FlexibleArm(parameters).fastest_rate() / STABLE))
    counts = sorted({count for count in (*COUNTS, default) if count >= least})
    errors = tip_errors(parameters, limits, counts, EPISODES, SEED)
    median, largest = ({n: float(of(each)) for n, each in errors.items()} for of in (np.median, np.max))
    return Errors(default, median, largest)


def tip_errors(
    parameters: ArmParameters, limits: tuple[float, float], counts: Sequence[int], episodes: int, seed: int
) -> dict[int, Array]:
    """Return errors of the tip after a second of random torques [m], by steps in a period. Shape (episodes,) each."""
    arm, rng = FlexibleArm(parameters), np.random.default_rng(seed)
    start = np.zeros((episodes, 2 * arm.size))
    start[:, 1] = rng.uniform(-2.5, 2.5, episodes)
    drawn = rng.uniform(-1.0, 1.0, (episodes, round(SECONDS / HELD), 2)) * limits
    torques = np.repeat(drawn, round(HELD / PERIOD), axis=1)

    def tips(count: int) -> Array:
        states = arm.rollout(start, torques, period=PERIOD, step=PERIOD / count).states
        return arm.tip(states[:, -1, : arm.size])

    exact = tips(FINER * counts[-1])
    return {count: np.linalg.norm(tips(count) - exact, axis=1) for count in counts}


test_checks = checked(
    *(
        Check(
            f"tip after a second of random torques, {name}, default step: median error",
            lambda name=name: 1e3 * measured(name).median[measured(name).default],
            f"the default step is the longest whose expected error is {1e3 * TOLERANCE:g} mm; medians of random "
            "torques scatter about what the linear arm predicts",
            "mm",
            most=SCATTER * 1e3 * TOLERANCE,
        )
        for name in CASES
    )
)


def test_table(page: Page) -> None:
    rows = []
    for name in CASES:
        found = measured(name)
        n = found.default
        rows.append([name, f"{n} steps: {found.shown(n)}", *(found.shown(count) for count in COUNTS)])
        figures = {"median": 1e3 * found.median[n], "largest": 1e3 * found.largest[n], "steps": n}
        page.quote({f"{name}, {what}": figure for what, figure in figures.items()})
    page.table("step_errors", ("arm", "default [mm]", *(f"{count} steps ({4 * count})" for count in COUNTS)), rows)


def test_picture(page: Page) -> None:
    """Median error by evaluations in a control period, one line an arm; a ring marks the default."""
    figure, axis = plt.subplots(figsize=(WIDTH, 5.0))
    for name, colour in zip(CASES, COLOURS, strict=False):
        found = measured(name)
        cost, error = 4 * np.array(list(found.median)), 1e3 * np.array(list(found.median.values()))
        axis.loglog(cost, error, "o-", color=colour, markersize=4)
        axis.annotate(name, (cost[-1], error[-1]), xytext=(6, 0), textcoords="offset points", color=colour)
        ring = 4 * found.default, 1e3 * found.median[found.default]
        axis.plot(*ring, "o", color=colour, markersize=12, fillstyle="none")
    axis.axhline(0.1, **THRESHOLD)
    axis.annotate("0.1 mm", (300.0, 0.1), xytext=(0, 4), textcoords="offset points", color=SOFT)
    axis.set(
        xlabel="evaluations of the equations in a control period of 10 ms",
        ylabel="error of the tip after a second [mm]",
        title="Median error under full random torques; rings: the environments' default",
    )
    number_ticks(axis.xaxis, (16, 20, 28, 40, 56, 80, 112))
    axis.minorticks_off()
    axis.set_xlim(14.0, 450.0)
    page.picture(figure, "steps")
