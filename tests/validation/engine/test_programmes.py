"""The arm's models against a chain of rigid segments in MuJoCo, an engine that nobody here wrote."""

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from matplotlib.figure import Figure

from flexarm_env import ArmParameters, SquareParameters, inverse_kinematics, square
from flexarm_env.extras import install_command

pytest.importorskip("mujoco", reason=f"run `{install_command('validate')}`")

from tests.validation.arms import CHAIN_ANGLE, chain_motion
from tests.validation.conftest import Check, Page, checked
from tests.validation.engine import pictures, study
from tests.validation.engine.study import FINEST, FIRST_CLAMPED, KINDS, NAMES, case, critical_spin
from tests.validation.finite_elements import critical_spin as spin_of_elements
from tests.validation.motion import HELD, MODEL_ANGLE, MODELS, PROGRAMMES, Model, Motion, apart, model_motion

pytestmark = [pytest.mark.validation, pytest.mark.slow]

DOUBLET = PROGRAMMES[0]
TENTH = "a choice: a tenth of the 1 mm required of the models"
SMOOTH = KINDS["smooth torques"]
LINEAR, BEST = Model("linear", 4), Model("foreshortened", 3)
SLOW = 0.1 * FIRST_CLAMPED  # up to there the linear model keeps 10 mm where links bend by 5 % [rad/s]


def _chain(factor: float) -> Motion:
    return chain_motion(DOUBLET, FINEST[0], factor * CHAIN_ANGLE)


def _model(factor: float) -> Motion:
    return model_motion(DOUBLET, BEST, factor * MODEL_ANGLE)


def halved(motion: Callable[[float], Motion]) -> Callable[[], float]:
    """Return what finds how far the tip moves with the step halved [mm]."""
    return lambda: 1e3 * apart(motion(1.0).tip, motion(0.5).tip).max()


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
    Check("the tip under a doublet with the chain's step halved", halved(_chain), TENTH, "mm", most=0.1),
    Check("the tip under a doublet with the model's step halved", halved(_model), TENTH, "mm", most=0.1),
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
        least = [f"> {floored(beyond[what.rpartition(', ')[0]])} %" for what in own]
        pairs = zip(own.values(), least, strict=True)
        rows.append([label, *(more if x is None else f"{100.0 * x:.2g} %" for x, more in pairs)])
        page.quote({f"limit, {label}, {what}": 100.0 * x for what, x in own.items() if x is not None})
    page.quote({f"tried, {kind}": bend for kind, bend in beyond.items()})
    page.table("engine_limits", ["deflection / length", *next(iter(found.values()))], rows)


def floored(value: float) -> str:
    """Write one decimal, not rounded up."""
    return f"{int(10.0 * value) / 10.0:.1f}"


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


@pytest.mark.parametrize("draw", [pictures.convergence, pictures.programmes, pictures.validity])
def test_picture(draw: Callable[[], tuple[Figure, str]], page: Page) -> None:
    page.picture(*draw())
