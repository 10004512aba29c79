"""Plans with smoother and smoother torques on the chain and on the models: how near the default arm is to the chain."""

import matplotlib.pyplot as plt
import pytest

from flexarm_baselines.optimal.laps import CHANGE_WEIGHT
from flexarm_env.extras import install_command
from flexarm_env.laps import LAPS

pytest.importorskip("mujoco", reason=f"run `{install_command('validate')}`")

from scripts.common.plotting import BLUE, COLOURS, WIDTH, headline
from tests.validation.conftest import Check, Page, checked
from tests.validation.laps import CHAIN, DEFAULT, FOUR, controller, from_chain, lap_of

pytestmark = [pytest.mark.validation, pytest.mark.slow]

CHANGE_WEIGHTS = (CHANGE_WEIGHT, 0.03, 0.1, 0.3, 1.0)  # on changes of the torques [m^2]; first the shipped plans'
SMOOTH = 0.3  # the least of them with which both laps stay within 5 mm
LOOKS = {DEFAULT: ("default arm:\n3 shapes", BLUE, 8), FOUR: ("4 shapes", COLOURS[5], -18)}


test_checks = checked(
    *(
        Check(
            f"the {lap} lap: the default arm from the chain under a plan with smooth torques, r.m.s.",
            lambda lap=lap: from_chain(lap, SMOOTH, DEFAULT).rms,
            "a choice: half of the 10 mm that the validity range allows a model",
            "mm",
            most=5.0,
        )
        for lap in LAPS
    )
)


def test_table(page: Page) -> None:
    rows = []
    for lap in LAPS:
        for weight in CHANGE_WEIGHTS:
            plants = {DEFAULT: DEFAULT, "chain": CHAIN, FOUR: FOUR}
            scores = {name: lap_of(lap, weight, plant).score for name, plant in plants.items()}
            first = abs(controller(lap, weight).plan.torques[0, 0])
            distances = {plant: from_chain(lap, weight, plant) for plant in LOOKS}
            shown = f"{scores[DEFAULT]:.1f}, {scores['chain']:.1f}"
            rows.append([lap, f"{weight:g}", f"{first:.0f}", shown, *map(str, distances.values())])
            page.quote({f"{lap}, {plant}, {weight:g}, score": score for plant, score in scores.items()})
            for plant, found in distances.items():
                which = f"{lap}, {plant}, {weight:g}"
                page.quote({f"{which}, rms": found.rms, f"{which}, after_2s": found.after_2s})
    header = (
        "lap",
        "weight on changes of the torques [m^2]",
        "first torque of the shoulder [N m]",
        "score on the default arm, on the chain [mm]",
        "default arm from the chain [mm]: r.m.s. / after 2 s",
        "4 polynomials from the chain [mm]",
    )
    page.table("plant_smooth", header, rows)


def test_picture(page: Page) -> None:
    figure, axes = plt.subplots(1, len(LAPS), figsize=(WIDTH, 4.0), sharey=True)
    for axis, lap in zip(axes, LAPS, strict=True):
        for plant, (text, colour, above) in LOOKS.items():
            scores = [lap_of(lap, weight, plant).score for weight in CHANGE_WEIGHTS]
            distances = [from_chain(lap, weight, plant).rms for weight in CHANGE_WEIGHTS]
            axis.plot(scores, distances, "o-", color=colour)
            if axis is axes[0]:
                look = {"textcoords": "offset points", "color": colour, "ha": "right"}
                axis.annotate(text, (scores[-1], distances[-1]), (0, above), **look)
            if plant == DEFAULT:
                for weight, *point in zip(CHANGE_WEIGHTS, scores, distances, strict=True):
                    axis.annotate(f"{weight:g}", point, (4, 6), textcoords="offset points")
        axis.set(title=f"{lap} lap", xlabel="error of the lap [mm]", ylim=(0.0, 8.5))
        axis.margins(x=0.12)
    axes[0].set_ylabel("tip from the chain's, r.m.s. [mm]")
    headline(figure, "Distance from the MuJoCo chain under smoother plans; numbers: weight on smoothness [m²]")
    page.picture(figure, "smooth_plans")
