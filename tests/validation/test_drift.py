"""Energy and angular momentum of the undamped free arm over ten minutes of simulated time, by integration step.

The classical Runge-Kutta method takes a vibration at omega for one that loses the part ``(omega h)^6 / 72`` of its
energy in every step h, so ``omega^6 h^5 / 72`` a second: the arm's fastest frequency gives a bound. The angular
momentum is the sum of two of the momenta that are integrated. No inner force changes that sum: it is kept to rounding.
"""

from typing import Any, NamedTuple

import matplotlib.pyplot as plt
import numpy as np
import pytest

from flexarm_env import ArmParameters, FlexibleArm
from scripts.common.plotting import COLOURS, SOFT, WIDTH, number_ticks
from tests.validation.conftest import Check, Page, checked
from tests.validation.kept import kept
from tests.validation.motion import Array, Model, bent_state
from tests.validation.small_motion import rate

pytestmark = [pytest.mark.validation, pytest.mark.slow]


DURATION = 600.0  # simulated time [s]
RECORDED = 0.1  # [s]
BENT, BOTH = "bent", "bent and spinning"
STARTS = (BENT, "spinning", BOTH)
STEPS = (2e-3, 1e-3, 5e-4, 2.5e-4)
ROUNDING = 1e-9  # of ten million steps, 1e-16 each, and room
FLOOR = 1e-13  # below it, rounding; for the picture


class Case(NamedTuple):
    model: Model
    start: str
    step: float
    damping: float = 0.0

    @property
    def label(self) -> str:
        return self.model.label.removeprefix("linear, ")

    def arm(self) -> FlexibleArm:
        return FlexibleArm(ArmParameters.linear(damping_ratio=self.damping, **self.model._asdict()))


class Drift(NamedTuple):
    energy: Array  # over that of the start, minus 1, every `RECORDED`
    # change of the angular momentum over what the arm would have if it turned stiffly with all its energy
    momentum: Array


TRIED: list[tuple[Model, tuple[str, ...], tuple[float, ...]]] = [
    (Model("linear", 1), STARTS, STEPS),
    (Model("linear", 2), STARTS, STEPS),
    # 3 and 4 modes, whose fastest rates ask for shorter steps: one start, two steps
    (Model("linear", 3), (BOTH,), (2.5e-4, 1.25e-4)),
    (Model("linear", 4), (BOTH,), (1.25e-4, 6.25e-5)),
    (Model("foreshortened", 2), (BENT, BOTH), (5e-4, 2.5e-4)),
    (Model("foreshortened", 2, "polynomial"), (BENT, BOTH), (5e-4, 2.5e-4)),
    (Model("foreshortened", 3), (BOTH,), (2.5e-4, 1.25e-4)),
]
UNDAMPED = [Case(model, start, step) for model, starts, steps in TRIED for start in starts for step in steps]
DAMPED = Case(Model("linear", 2), BOTH, 1e-3, damping=ArmParameters.linear().damping_ratio)


@kept
def drift(case: Case) -> Drift:
    arm = case.arm()
    start = start_state(arm, case.start)
    run = arm.simulate(start, None, DURATION, RECORDED, round(RECORDED / case.step))
    total = run.kinetic_energy + run.strain_energy
    inertia = arm.mass_matrix(start[: arm.size])[0, 0]
    momentum = arm.angular_momentum(run.state) / np.sqrt(2.0 * total[0] * inertia)
    return Drift(total / total[0] - 1.0, momentum - momentum[0])


def start_state(arm: FlexibleArm, start: str) -> Array:
    tips = (0.3, -0.2) if "bent" in start else (0.0, 0.0)
    return bent_state(arm, tips, (1.0, -0.7) if "spinning" in start else (0.0, 0.0))


def loss_bound(arm: FlexibleArm, step: float, duration: float) -> float:
    """Return the part of the energy that is lost if all of it vibrates at the arm's fastest frequency."""
    return -float(np.expm1(-duration * arm.fastest_rate() ** 6 * step**5 / 72.0))


BOUNDS = {(case.label, case.step): loss_bound(case.arm(), case.step, DURATION) for case in UNDAMPED}


def largest(change: Array) -> float:
    return float(np.abs(change).max())


def runs(label: str, **wanted: Any) -> list[Case]:
    own = [case for case in UNDAMPED if case.label == label]
    return [case for case in own if all(getattr(case, name) == value for name, value in wanted.items())]


def energy_check(label: str, step: float) -> Check:
    """Bound the energy's drift, worst of all starts, by the method's own loss."""
    cases = runs(label, step=step)
    return Check(
        f"energy, {label}, {1e3 * step:g} ms: largest relative change",
        lambda: max(largest(drift(case).energy) for case in cases),
        f"the method's own loss of a vibration at the arm's fastest rate ({cases[0].arm().fastest_rate():.3g} rad/s), "
        "omega^6 h^5 / 72 a second",
        most=BOUNDS[label, step] + ROUNDING,
    )


def momentum_check(name: str, *cases: Case) -> Check:
    """Compare the angular momentum with that of the start."""
    return Check(
        f"angular momentum of the {name}: largest change",
        lambda: max(largest(drift(case).momentum) for case in cases),
        "no inner force changes the sum of the two momenta, in any stage; rounding of up to ten million steps",
        most=ROUNDING,
    )


def order(label: str, *starts: str) -> float:
    """Return the order of the drift in the step, that furthest from 5 of all starts."""
    cases = [runs(label, start=start) for start in starts]
    orders = [rate([1.0 / case.step for case in own], [largest(drift(case).energy) for case in own]) for own in cases]
    return max(orders, key=lambda order: abs(order - 5.0))


def order_check(label: str) -> Check:
    """Compare the order with the method's, of one mode from the bent start, of others from each of theirs."""
    one = label == "1 mode"
    starts = (BENT,) if one else tuple(dict.fromkeys(case.start for case in runs(label)))
    return Check(
        f"order of the energy's drift in the step, {label}, {'bent start' if one else 'that furthest from 5'}",
        lambda: order(label, *starts),
        "a loss of (omega h)^6 / 72 in each of 1 / h steps a second: order 5",
        least=4.7,
        most=5.3,
    )


test_checks = checked(
    # where the bound, 10 % or less, says something
    *(energy_check(label, step) for (label, step), bound in BOUNDS.items() if bound <= 0.1),
    momentum_check("damped linear arm, 2 modes, 1 ms", DAMPED),
    momentum_check("undamped arms, any step", *UNDAMPED),
    *map(order_check, ("1 mode", "foreshortened, 2 modes", "foreshortened, 2 polynomials", "foreshortened, 3 modes")),
)


def test_table(page: Page) -> None:
    steps = sorted({case.step for case in UNDAMPED}, reverse=True)
    rows = []
    for label in dict.fromkeys(case.label for case in UNDAMPED):
        cells = []
        for step in steps:
            found = [drift(case) for case in runs(label, step=step)]
            worst = [max((largest(getattr(d, what)) for d in found), default=None) for what in ("energy", "momentum")]
            cells.append(" / ".join(f"{value:.3g}" for value in worst if value is not None))
        rows.append([label, *cells])
    page.table("drift_steps", ("undamped arm", *(f"{1e3 * step:g} ms" for step in steps)), rows)
    for case in (*UNDAMPED, DAMPED):
        name = f"{case.label}, {case.start}, {1e3 * case.step:g} ms, {case.damping:g}"
        page.quote({f"energy, {name}": largest(drift(case).energy), f"momentum, {name}": largest(drift(case).momentum)})


def test_picture_over_time(page: Page) -> None:
    figure, axes = plt.subplots(1, 2, figsize=(WIDTH, 3.8), sharey=True)
    for axis, label in zip(axes, ("1 mode", "2 modes"), strict=True):
        for case, colour in zip(runs(label, start=BOTH), COLOURS, strict=False):
            found = np.maximum(np.abs(drift(case).energy), FLOOR)[1:]
            time = RECORDED / 60.0 * np.arange(1, len(found) + 1)
            axis.semilogy(time, found, color=colour, linewidth=0.9, label=f"{1e3 * case.step:g} ms")
        axis.set(title=f"{label} a link", xlabel="simulated time [min]")
    axes[0].set_ylabel("energy: relative change [1]")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower left", ncol=4, title="step")
    page.picture(figure, "drift_time", "Drift of an undamped arm that bends and spins, by the integrator's step")


def test_picture_by_step(page: Page) -> None:
    figure, axis = plt.subplots(figsize=(WIDTH, 5.6))
    marks = dict(zip(STARTS, "os^", strict=True))
    for k, label in enumerate(dict.fromkeys(case.label for case in UNDAMPED)):
        style = "--" if "foreshortened" in label else "-"
        look: dict[str, Any] = {"color": COLOURS[k % len(COLOURS)], "linestyle": style}
        for start, mark in marks.items():
            own = runs(label, start=start)
            found = [largest(drift(case).energy) for case in own]
            axis.loglog([1e3 * case.step for case in own], found, marker=mark, markersize=5, **look)
        bounds = {1e3 * case.step: BOUNDS[label, case.step] for case in runs(label)}
        axis.loglog(list(bounds), list(bounds.values()), color=look["color"], linestyle=":", linewidth=1.4)
        axis.plot([], [], label=label, **look)
    for start, mark in marks.items():
        axis.plot([], [], color=SOFT, marker=mark, linestyle="", label=start)
    axis.plot([], [], color=SOFT, linestyle=":", label="bound $\\omega^6 h^5 T / 72$")
    figure.legend(loc="outside lower left", ncol=3)
    axis.set(ylabel="energy: largest relative change [1]", xlabel="step [ms]")
    axis.set_title("Drift of energy over ten minutes by the integrator's step")
    number_ticks(axis.xaxis, sorted({1e3 * case.step for case in UNDAMPED}))
    axis.minorticks_off()
    page.picture(figure, "drift_step")
