"""Further controllers on the chain and on the models, and what the start of a lap consists of."""

from functools import cache

import gymnasium
import numpy as np
import pytest

from flexarm_agents.board.entries import Entry
from flexarm_env.extras import install_command
from flexarm_env.laps import LAPS
from flexarm_env.metrics import summary
from flexarm_env.rollout import run_policy

pytest.importorskip("mujoco", reason=f"run `{install_command('validate')}`")

from scripts.common.plotting import COLOURS, INK, SOFT
from tests.validation.conftest import Check, Page, checked
from tests.validation.kept import kept
from tests.validation.laps import (
    CHAIN,
    DEFAULT,
    ERROR_LIMIT,
    FINER,
    FOUR,
    GENTLY,
    MODELS,
    PERIODS,
    controller,
    from_chain,
    lap_of,
    on_start,
    over_time,
    run_lap,
)
from tests.validation.motion import Array, apart, rms

pytestmark = [pytest.mark.validation, pytest.mark.slow]

# Controllers of the board within 60 mm on the swing lap that read sensors, by their names there; `test_plant` has
# another one, the student of unknown arms.
OTHERS = ("lqg_adaptive", "nmpc", "lqg", "student", "lqg_gauges", "student_gauges")
START = 0.5  # [s]; the torques of so long are also applied open loop, and parts of them
SHARES = (1.0, 0.5, 0.25, 0.125)
CHATTERS = "student"  # the controller of which scores are also taken on chains with finer steps
CHAIN_STEPS = (5e-4, 1e-4, 2e-5)  # [s], the first one the environment's own


@cache
def torques(lap: str) -> Array:
    """Return the first torques of a lap on the chain under gentle feedback [N m]."""
    return run_lap(controller(lap, GENTLY), on_start(lap, CHAIN), seconds=START).torque


@kept
def pushed(lap: str, share: float, plant: str) -> tuple[Array, float]:
    """Apply a share of a lap's first torques open loop; return tips, and the largest deflection of a link [m].

    What the shapes cannot follow is linear in the torques, and its share stays as they become less; what the kinematics
    leave out of the bent links' geometry goes faster than they do.
    """
    arm, tips, bend = on_start(lap, plant), [], 0.0
    for torque in torques(lap):
        tips.append(arm.advance(share * torque, PERIODS))
        bend = max(bend, float(np.abs(arm.look().deflection).max()))
    return np.concatenate(tips), bend


def from_chain_at_start(lap: str, share: float, plant: str) -> float:
    """Return how far an arm's tip is from the chain's, over the share of the torques, r.m.s. [mm]."""
    return 1e3 * rms(apart(pushed(lap, share, plant)[0], pushed(lap, share, CHAIN)[0])) / share


def test_table_of_starts(page: Page) -> None:
    rows, plants = [], (FINER, *MODELS)
    for lap in LAPS:
        for share in SHARES:
            found = {plant: from_chain_at_start(lap, share, plant) for plant in plants}
            bend = pushed(lap, share, CHAIN)[1]
            rows.append([lap, f"{share:g}", f"{bend:.2f}", *(f"{mm:.3g}" for mm in found.values())])
            page.quote({f"{lap}, start, {plant}, share {share:g}, rms": mm for plant, mm in found.items()})
            page.quote({f"{lap}, start, share {share:g}, bend": 1e3 * bend})
    page.table("plant_start", ["lap", "share of the torques", "largest deflection [m]", *plants], rows)


test_checks = checked(
    Check(
        "starts of both laps: twice the elements from the chain, r.m.s.",
        lambda: max(from_chain_at_start(lap, 1.0, FINER) for lap in LAPS),
        "a choice: a tenth of the 5 mm that the default arm is allowed",
        "mm",
        most=0.5,
    ),
    Check(
        "the plain lap: the default arm from the chain under the controller that does best, r.m.s.",
        lambda: min(from_chain("plain", name, DEFAULT).rms for name in OTHERS),
        "a choice: half of the 10 mm that the validity range allows a model",
        "mm",
        most=5.0,
    ),
)


def test_table_of_laps(page: Page) -> None:
    """A row for each controller and lap, those nearest to the chain first."""
    rows = []
    for lap in LAPS:
        for name in sorted(OTHERS, key=lambda name: from_chain(lap, name, DEFAULT).rms):
            own, chain = lap_of(lap, name, DEFAULT), lap_of(lap, name, CHAIN)
            scores = ", ".join("lost" if one.lost else f"{one.score:.1f}" for one in (own, chain))
            changes = f"{own.torque_change:.3g}, {chain.torque_change:.3g}"
            distances = ["" if chain.lost else str(from_chain(lap, name, plant)) for plant in (DEFAULT, FOUR)]
            rows.append([lap, f"`{name}`", *distances, scores, changes])
            for plant in (CHAIN, DEFAULT, FOUR):
                found, which = from_chain(lap, name, plant), f"{lap}, {name}, {plant}"
                apart = {} if plant == CHAIN else {f"{which}, rms": found.rms, f"{which}, after_2s": found.after_2s}
                page.quote(apart | {f"{which}, score": lap_of(lap, name, plant).score})
    first = "default arm from the chain [mm]: r.m.s. / after 2 s"
    last = "score on the default arm, on the chain [mm]", "torque change there, r.m.s. [N m]"
    page.table("plant_others", ("lap", "controller", first, "4 polynomials from the chain [mm]", *last), rows)


def test_picture(page: Page) -> None:
    """Distance of the default arm over time, until the tip is lost."""
    lines = {}
    for name, colour in zip(OTHERS, (*COLOURS, INK, SOFT), strict=False):
        for lap in LAPS:
            found = apart(lap_of(lap, name, DEFAULT).tip, lap_of(lap, name, CHAIN).tip)[::PERIODS]
            lost = np.flatnonzero(found > ERROR_LIMIT)  # from the chain's, too
            text = f"{name}\n(lost)" if lost.size else name
            lines[lap, (text, colour)] = found[: lost[0] + 1] if lost.size else found
    title = "Distance of the default arm's tip from the MuJoCo chain's under each controller"
    page.picture(over_time(lines, title), "controllers_distance")


@kept
def chattering(lap: str, step: float) -> float | None:
    """Return the score on `FlexArm/SquareChain-v0` with an integration step [mm]; None if the lap ended early."""
    entry = Entry(CHATTERS)
    env = gymnasium.make("FlexArm/SquareChain-v0", **entry.interface, chain_step=step)
    score = summary(run_policy(env, entry.candidate().policy, lap=lap)).get("true_tip_rms")
    env.close()
    return None if score is None else 1e3 * score


def test_chattering_scores_by_the_chains_step(page: Page) -> None:
    """The damping of the fastest vibrations depends on the integration step."""
    found = {f"{lap}, {CHATTERS}, {step:g} s": chattering(lap, step) for step in CHAIN_STEPS for lap in LAPS}
    page.quote({name: score for name, score in found.items() if score is not None})
