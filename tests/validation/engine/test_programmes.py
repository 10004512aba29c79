"""The arm's models against a chain of rigid segments in MuJoCo, an engine that nobody here wrote."""

from collections.abc import Callable
from functools import cache
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pytest

from flexarm_env import ArmParameters, SquareParameters, inverse_kinematics, square
from flexarm_env.extras import install_command

pytest.importorskip("mujoco", reason=f"run `{install_command('validate')}`")

from scripts.common.plotting import BLUE, COLOURS, GREEN, ORANGE, SOFT, THRESHOLD, WIDTH, number_ticks, running_rms
from tests.validation.arms import CHAIN_ANGLE, chain_motion
from tests.validation.conftest import Check, Page, checked
from tests.validation.engine import study
from tests.validation.engine.study import FINEST, FIRST_CLAMPED, KINDS, NAMES, SMALLEST, SPINS, case, critical_spin
from tests.validation.finite_elements import critical_spin as spin_of_elements
from tests.validation.motion import DEFAULT, HELD, MODEL_ANGLE, MODELS, PROGRAMMES, Model, apart, model_motion

pytestmark = [pytest.mark.validation, pytest.mark.slow]

DOUBLET = PROGRAMMES[0]
TENTH = "a choice: a tenth of the 1 mm required of the models"
SMOOTH = KINDS["smooth torques"]
LINEAR, BEST = Model("linear", 4), Model("foreshortened", 3)
TITLES = {programme.name: programme.title for programme in PROGRAMMES}
WINDOW = 100  # instants of 1 ms
LINES = {  # the models that are drawn over time
    Model("linear", 2): ("linear arm: 2 modes", ORANGE),
    Model("foreshortened", 3): ("links keep their length, 3 modes", GREEN),
    DEFAULT: ("default arm: 3 polynomials", BLUE),
    Model("foreshortened", 4, "polynomial"): ("4 polynomials", COLOURS[5]),
}
SHAPES = (("linear", "cantilever", "-"), ("foreshortened", "cantilever", "--"), ("foreshortened", "polynomial", ":"))
PERCENT = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0)
LIMIT = 10.0  # [mm], drawn as the threshold
SLOW = 0.1 * FIRST_CLAMPED  # up to there the linear model keeps 10 mm where links bend by 5 % [rad/s]


def halved(motion: Callable[..., Any], of: Any, angle: float) -> Callable[[], float]:
    """Return what finds how far the tip moves under a doublet with the step halved [mm]."""
    return lambda: 1e3 * apart(motion(DOUBLET, of, angle).tip, motion(DOUBLET, of, 0.5 * angle).tip).max()


CHAIN_HALVED, MODEL_HALVED = halved(chain_motion, FINEST[0], CHAIN_ANGLE), halved(model_motion, BEST, MODEL_ANGLE)


@cache
def linear_theory() -> float:
    """Return the spin at which finite elements of linear theory turn unstable, of the first clamped frequency."""
    return spin_of_elements(ArmParameters.linear()) / FIRST_CLAMPED


test_checks = checked(
    Check(
        "the finest chain's tip from the extrapolated one",
        lambda: 1e3 * max(case(name).chain_error(FINEST[1]).max() for name in NAMES),
        "a choice: the 1 mm required of the models; the extrapolation, which takes most of this away, must not matter",
        "mm",
        most=1.0,
    ),
    Check(
        "joint angles below 10 Hz, of the two finest chains",
        lambda: 1e3 * max(case(name).between_the_finest(smooth=True) for name in NAMES),
        "a choice: the angle that moves the tip of the stiff straight arm by 5 mm; raw angles have no limit to "
        "converge to",
        "mrad",
        most=1e3 * 0.005 / 9.0,
    ),
    Check("the tip under a doublet with the chain's step halved", CHAIN_HALVED, TENTH, "mm", most=0.1),
    Check("the tip under a doublet with the model's step halved", MODEL_HALVED, TENTH, "mm", most=0.1),
    Check(
        "order in amplitude of the linear model's tip error (multi-sine, 4 modes)",
        lambda: study.order("multi_sine", LINEAR),
        "what it leaves out, foreshortening, is of second order in the deflection",
        least=1.8,
        most=2.3,
    ),
    Check(
        "smooth torques at 4 %: r.m.s. tip error with foreshortening and 3 modes",
        lambda: 1e3 * max(case(name).rms(BEST) for name in SMOOTH),
        "its own next order is the third: 4 % cubed of 4.5 m is 0.3 mm; three times that is a choice, for growth "
        "over two seconds",
        "mm",
        most=1.0,
    ),
    Check(
        "the same, linear over foreshortened",
        lambda: min(case(name).rms(LINEAR) / case(name).rms(BEST) for name in SMOOTH),
        "at 4 % a second-order error is 25 times a third-order one of equal coefficient; a fifth of that is a "
        "choice, for truncation takes a part",
        least=5.0,
    ),
    Check(
        "spin at which the linear model with 2 modes turns unstable, above finite elements' of linear theory",
        lambda: (critical_spin(Model("linear", 2)) or np.inf) / linear_theory() - 1.0,
        "fewer shapes are stiffer (Rayleigh and Ritz), for free joints and 2 modes by 1 % of a frequency at most",
        least=0.0,
        most=0.01,
    ),
)

HEADER = [name.replace("_", " ") for name in NAMES]


def _mm(value: float) -> str:
    return f"{1e3 * value:.2g}" if value < 0.1 else f"{1e3 * value:.0f}"


def test_table_of_errors(page: Page) -> None:
    finest, chain = FINEST[1], []
    for found in map(case, NAMES):
        angles = " / ".join(_mm(found.between_the_finest(smooth)) for smooth in (True, False))
        chain.append(f"{_mm(found.chain_error(finest).max())}; {angles}")
    rows = [
        ["largest deflection / length", *(f"{100.0 * case(name).reference.bend:.1f} %" for name in NAMES)],
        [f"the chain, {finest} elements: largest; angles low-passed / raw", *chain],
    ]
    for m in MODELS:
        found = [(case(name).rms(m), case(name).tip(m).max(), case(name).angles(m)) for name in NAMES]
        rows.append([m.label, *(f"{_mm(rms)} / {_mm(largest)}; {_mm(angles)}" for rms, largest, angles in found)])
    page.table("engine_errors", ["tip [mm]: r.m.s. / largest; angles [mrad]", *HEADER], rows)
    for name in NAMES:
        for amplitude, which in ((1.0, name), (2.0, f"twice {name}")):
            found = case(name, amplitude)
            page.quote({f"{which}, bend": 100.0 * found.reference.bend})
            for m in MODELS:
                figures = {"rms": found.rms(m), "maximum": found.tip(m).max()}
                page.quote({f"{which}, {m.label}, {what}": 1e3 * value for what, value in figures.items()})


def test_table_of_their_order(page: Page) -> None:
    rows = []
    for m in MODELS:
        found = {name: study.parts(name, m) for name in NAMES}
        growth = {name: f"{study.order(name, m):.1f}" for name in NAMES}
        cells = ["" if p is None else f"{_mm(p[0])} + {_mm(p[1])}, {growth[name]}" for name, p in found.items()]
        rows.append([m.label, *cells])
    page.table("engine_parts", ["truncation + rest [mm], order", *HEADER], rows)


def test_table_of_limits_of_deflection(page: Page) -> None:
    found = {m.label: study.limits(m) for m in MODELS}
    beyond = {kind: 100.0 * study.tried(kind) for kind in KINDS}
    rows = []
    for label, own in found.items():
        least = [f"> {int(10.0 * beyond[what.rpartition(', ')[0]]) / 10.0:.1f} %" for what in own]  # not rounded up
        pairs = zip(own.values(), least, strict=True)
        rows.append([label, *(more if x is None else f"{100.0 * x:.2g} %" for x, more in pairs)])
        page.quote({f"limit, {label}, {what}": 100.0 * x for what, x in own.items() if x is not None})
    page.quote({f"tried, {kind}": bend for kind, bend in beyond.items()})
    page.table("engine_limits", ["deflection / length", *next(iter(found.values()))], rows)


def test_table_of_limits_of_spin(page: Page) -> None:
    found = {m.label: study.spin_limits(m) for m in study.MAPPED}
    beyond = f"> {study.FASTEST:g}"
    rows = [[label, *(beyond if x is None else f"{x:.2g}" for x in own.values())] for label, own in found.items()]
    page.table("engine_spins", [f"spin / {FIRST_CLAMPED:.2f} rad/s", *next(iter(found.values()))], rows)
    for label, own in found.items():
        page.quote({f"spin, {label}, {what}": x for what, x in own.items() if x is not None})
    largest, share = reference_rates(SLOW)
    page.quote({"first clamped": FIRST_CLAMPED, "critical spin": linear_theory()})
    page.quote({"reference, largest": largest, "reference, share": share})


def reference_rates(limit: float) -> tuple[float, float]:
    """Return the largest rate of a link of a rigid arm on the square [rad/s], and the part of the lap above a limit."""
    path, arm = square(SquareParameters()), ArmParameters.linear()
    points = path.position(np.arange(0.0, path.lap_time, HELD))
    joints = np.unwrap([inverse_kinematics(arm, point, "positive") for point in points], axis=0)
    rates = np.abs(np.diff(np.cumsum(joints, axis=1), axis=0)).max(axis=1) / HELD
    return float(rates.max()), float((rates > limit).mean())


def smoothed(error: study.Array) -> study.Array:
    """Return the r.m.s. over a tenth of a second in mm; what is exactly zero is not drawn."""
    size = 1e3 * running_rms(error, WINDOW)
    return np.where(size > 0.0, size, np.nan)


def test_picture_of_convergence(page: Page) -> None:
    """The tip error of chains by elements; of models by modes, at the smallest and at full amplitude."""
    figure, axes = plt.subplots(1, 3, figsize=(WIDTH, 5.6))
    counts = [*case(NAMES[0]).chains]
    for name, colour in zip(NAMES, COLOURS, strict=False):
        errors = [1e3 * case(name).chain_error(n).max() for n in counts]
        axes[0].loglog(counts, errors, "o-", markersize=4, color=colour, label=TITLES[name])
    axes[0].loglog(counts, [100.0 / n**2 for n in counts], **THRESHOLD, label="second order")
    number_ticks(axes[0].xaxis, counts)
    axes[0].minorticks_off()
    axes[0].set(title="the chain's own error", xlabel="elements a link", ylabel="tip error [mm]")
    for axis, amplitude in zip(axes[1:], (SMALLEST, 1.0), strict=True):
        for name, colour in zip(NAMES, COLOURS, strict=False):
            for kinematics, shapes, style in SHAPES:
                own = [m for m in MODELS if (m.kinematics, m.mode_shapes) == (kinematics, shapes)]
                errors = [1e3 * case(name, amplitude).rms(m) for m in own]
                modes = [m.modes_per_link for m in own]
                axis.semilogy(modes, errors, marker="o", markersize=4, linestyle=style, color=colour)
        bend = 100.0 * max(case(name, amplitude).reference.bend for name in NAMES)
        axis.set(title=f"models, bent by {bend:.2g} %", xlabel="shapes a link", xticks=range(1, 5), ylim=(1e-4, 100.0))
    for name, style in (("linear arm, modes", "-"), ("links keep length, modes", "--"), ("the same, polynomials", ":")):
        axes[2].plot([], [], color=SOFT, linestyle=style, label=name)
    handles = [pair for axis in (axes[0], axes[2]) for pair in zip(*axis.get_legend_handles_labels(), strict=True)]
    figure.legend(*zip(*handles, strict=True), loc="outside lower left", ncols=3)
    page.picture(figure, "engine_convergence", "Tip errors of the chain (largest) and of models against it (r.m.s.)")


def test_picture_of_programmes(page: Page) -> None:
    """The tip error over time of some models, a panel for each programme."""
    figure, axes = plt.subplots(3, 2, figsize=(WIDTH, 8.3), sharey=True)
    for name, axis in zip(NAMES, axes.flat, strict=True):
        found = case(name)
        time = HELD * np.arange(len(found.reference.tip))
        for model, (label, colour) in LINES.items():
            axis.semilogy(time, smoothed(found.tip(model)), color=colour, linewidth=1.8, label=label)
        label = f"the chain of {FINEST[1]} elements, against its limit"
        axis.semilogy(time, smoothed(found.chain_error(FINEST[1])), color=SOFT, linestyle=":", label=label)
        axis.set(title=TITLES[name], ylim=(1e-3, 2e2))
        number_ticks(axis.yaxis, (0.001, 0.01, 0.1, 1, 10, 100))
    plt.setp(axes[-1], xlabel="time [s]")
    plt.setp(axes[:, 0], ylabel="tip error [mm]")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower left", ncols=2)
    title = "Distance of each model's tip from the MuJoCo chain's, r.m.s. over 0.1 s"
    page.picture(figure, "engine_programmes", title)


def test_picture_of_validity(page: Page) -> None:
    """The error by deflection in the programmes; and by deflection and spin."""
    figure, axes = plt.subplots(2, 2, figsize=(WIDTH, 8.4), sharey="row", sharex="row")
    linear = Model("linear", 2)
    for axis, model in zip(axes[0], (linear, DEFAULT), strict=True):
        for name, colour in zip(NAMES, COLOURS, strict=True):
            found = [case(name, amplitude) for amplitude in study.AMPLITUDES]
            bends, errors = [100.0 * one.reference.bend for one in found], [1e3 * one.rms(model) for one in found]
            axis.loglog(bends, errors, "o-", markersize=4, color=colour, label=TITLES[name])
        axis.axhline(LIMIT, **THRESHOLD)
        axis.set(title=LINES[model][0], xlabel="largest deflection / length [%]", xlim=(0.4, 20.0), ylim=(1e-3, 5e3))
        number_ticks(axis.xaxis, PERCENT)
    for axis, model in zip(axes[1], (linear, Model("foreshortened", 3)), strict=True):
        for spin in SPINS:
            for found in (study.spinning(spin, kick) for kick in study.KICKS):
                good = 1e3 * found.rms(model) <= LIMIT
                look: dict[str, Any] = {"marker": "o" if good else "x", "color": BLUE if good else ORANGE}
                axis.plot(spin, 100.0 * found.reference.bend, markersize=7, **look)
        axis.set(title=LINES[model][0], yscale="log", xlabel="spin / first clamped frequency [1]", ylim=(0.2, 25.0))
        number_ticks(axis.yaxis, PERCENT)
    axes[0, 0].set_ylabel("r.m.s. tip error [mm]")
    axes[1, 0].set_ylabel("largest deflection / length [%]")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower left", ncols=3)
    above = "Where models are valid. Above: error by deflection, dotted line at 10 mm."
    below = "Below: a spinning, vibrating arm; dots: below 10 mm, crosses: above"
    page.picture(figure, "engine_validity", f"{above}\n{below}")
