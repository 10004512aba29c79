"""The default arm on the chain: laps under agents, along the best plans and under the paper's laws; damping."""

from dataclasses import replace
from functools import cache
from itertools import pairwise

import matplotlib.pyplot as plt
import numpy as np
import pytest

from flexarm_env import ArmParameters, FlexibleArm
from flexarm_env.extras import install_command
from flexarm_env.laps import LAPS

pytest.importorskip("mujoco", reason=f"run `{install_command('validate')}`")

from scripts.common.plotting import BLUE, COLOURS, GREEN, ORANGE, WIDTH, label_ends, plain_ticks, running_rms
from tests.validation import laps, laws
from tests.validation.arms import Modal
from tests.validation.conftest import Check, Page, checked
from tests.validation.kept import kept
from tests.validation.laps import CHAIN, DEFAULT, GENTLY, Away, Lap, away, from_chain, lap_of
from tests.validation.motion import HELD

pytestmark = [pytest.mark.validation, pytest.mark.slow]

CONTROLLERS = (*laps.AGENTS, GENTLY, laps.AGGRESSIVELY)
AHEAD, EVERY = 0.5, 0.25  # a prediction's length, and how often one starts [s]
DAMPED = {"material": ArmParameters(), "modal": ArmParameters.linear()}
DAMPED_ELEMENTS = (5, 10, 20)
WINDOW = 50  # control periods that the picture takes together: half a second
TEXTS = ("2 shapes", "default arm:\n3 shapes", "4 shapes", "linear arm")
# text and colour of each arm's line
LOOKS = dict(zip(laps.ARMS, zip(TEXTS, (GREEN, BLUE, COLOURS[5], ORANGE), strict=True), strict=True))


test_checks = checked(
    Check(
        "the plain lap under gentle feedback: the coarser chain from the finer one, r.m.s.",
        lambda: from_chain("plain", GENTLY, laps.COARSE).rms,
        "a choice: a tenth of the 10 mm that the validity range allows a model",
        "mm",
        most=1.0,
    ),
    Check(
        "the plain lap under gentle feedback: the default arm from the chain, r.m.s.",
        lambda: from_chain("plain", GENTLY, DEFAULT).rms,
        "a choice: the 10 mm that the validity range allows a model",
        "mm",
        most=10.0,
    ),
    Check(
        "the same, linear arm over default arm",
        lambda: from_chain("plain", GENTLY, laps.FORMER).rms / from_chain("plain", GENTLY, DEFAULT).rms,
        "a choice: the default arm must have at most a quarter of the error",
        least=4.0,
    ),
    Check(
        "the paper's laws, undamped: the default arm from the chain, r.m.s.",
        lambda: max(found.rms for found in under_the_laws()[DEFAULT].values()),
        "a choice: three times the 10 mm of the validity range, since the stiff law excites modes beyond the arm's",
        "mm",
        most=30.0,
    ),
)


def half_a_second_ahead(lap: str, name: str, model: str) -> float:
    """Return how far a model's tip is off half a second after it was set on the chain's state, median [mm]."""
    chain, arm = lap_of(lap, name, CHAIN), FlexibleArm(laps.MODELS[model])
    states = chain.states[list(laps.MODELS).index(model)]
    periods, found = round(AHEAD / (HELD * laps.PERIODS)), []
    for first in range(0, len(chain.torque) - periods + 1, round(EVERY / (HELD * laps.PERIODS))):
        plant = Modal(arm)
        plant.state = states[first]
        tip = plant.follow(np.repeat(chain.torque[first : first + periods], laps.PERIODS, axis=0))[-1]
        found.append(np.linalg.norm(tip - chain.tip[(first + periods) * laps.PERIODS]))
    return 1e3 * float(np.median(found))


def test_table_of_laps(page: Page) -> None:
    others, rows = [laps.COARSE, *(plant for plant in laps.ARMS if plant != DEFAULT)], []
    for lap in LAPS:
        for name in CONTROLLERS:
            driven = {plant: lap_of(lap, name, plant) for plant in (*laps.ARMS, laps.COARSE, CHAIN)}
            apart = {plant: from_chain(lap, name, plant) for plant in driven}
            own, chain = driven[DEFAULT], driven[CHAIN]
            scores = f"{own.score:.1f}, {chain.score:.1f}"
            changes = f"{own.torque_change:.3g}, {chain.torque_change:.3g}"
            rows.append([lap, name, *(f"{apart[plant].rms:.3g}" for plant in (DEFAULT, *others)), scores, changes])
            for plant, found in driven.items():
                figures = {"score": found.score, "score_after_2s": found.score_after_2s}
                figures |= {"torque change": found.torque_change} | ({} if plant == CHAIN else apart[plant]._asdict())
                figures |= {"ahead median": half_a_second_ahead(lap, name, plant)} if plant in laps.MODELS else {}
                page.quote({f"{lap}, {name}, {plant}, {what}": x for what, x in figures.items()})
    first, last = "default arm: from the chain, r.m.s. [mm]", "score on the default arm, on the chain [mm]"
    page.table("plant_control", ["lap", "controller", first, *others, last, "torque change there, r.m.s. [N m]"], rows)


def test_picture(page: Page) -> None:
    figure, axes = plt.subplots(len(LAPS), figsize=(WIDTH, 6.4), sharex=True)
    for axis, lap in zip(axes, LAPS, strict=True):
        ends = []
        for plant, (_, colour) in LOOKS.items():
            tips = (lap_of(lap, GENTLY, one).tip[:: laps.PERIODS] for one in (plant, CHAIN))
            off = 1e3 * running_rms(np.linalg.norm(np.subtract(*tips), axis=1), WINDOW)
            axis.semilogy(HELD * laps.PERIODS * np.arange(len(off)), off, color=colour, linewidth=1.6)
            ends.append(off[-1])
        axis.set(title=f"{lap} lap", ylabel="r.m.s. over 0.5 s [mm]", ylim=(0.5, 1000.0), xlim=(0.0, 16.0))
        plain_ticks(axis.yaxis)
        axis.set_xticks(range(0, 17, 4))
        label_ends(axis, [*LOOKS.values()], ends)
    axes[-1].set_xlabel("time [s]")
    title = "Distance of each model's tip from the MuJoCo chain's along the best plans"
    page.picture(figure, "plant_distance", title)


@cache
def under_the_laws() -> dict[str, dict[str, Away]]:
    """Run the paper's laws on undamped arms; the distance is from the extrapolated chain."""
    fine, truth = laws.on_chains()
    tips = {name: laws.on_model(replace(arm, damping_ratio=0.0)) for name, arm in laps.ARMS.items()} | {CHAIN: fine}
    return {name: {law: away(found[law], truth[law]) for law in laws.LAWS} for name, found in tips.items()}


def test_figures_under_the_laws(page: Page) -> None:
    for name, found in under_the_laws().items():
        page.quote({f"{law}, {name}, rms": one.rms for law, one in found.items()})
        page.quote({f"{law}, {name}, maximum": one.maximum for law, one in found.items()})


@kept
def damped(damping: str, elements: int) -> Lap:
    """Run a student on a chain with one kind of damping."""
    return laps.run_lap(laps.controller("swing", laps.STUDENT), laps.on_corner(DAMPED[damping], "swing", elements))


def test_table_of_damping(page: Page) -> None:
    """A student on chains of more and more elements, damped by their material or by 1 % of every mode."""
    rows = []
    for damping in DAMPED:
        found = [damped(damping, count) for count in DAMPED_ELEMENTS]
        coarser = [away(fine.tip, coarse.tip).rms for coarse, fine in pairwise(found)]
        for count, lap, moved in zip(DAMPED_ELEMENTS, found, (None, *coarser), strict=True):
            scores, change = f"{lap.score:.1f} / {lap.score_after_2s:.1f}", f"{lap.torque_change:.3g}"
            rows.append([damping, str(count), scores, "" if moved is None else f"{moved:.3g}", change])
            figures = {"score": lap.score} | ({} if moved is None else {"from_coarser": moved})
            page.quote({f"{damping}, {count} elements, {what}": x for what, x in figures.items()})
    header = ("damping", "elements a link", "score [mm]: lap / after 2 s", "from the coarser one [mm]: r.m.s.")
    page.table("plant_damping", [*header, "torque change, r.m.s. [N m]"], rows)
