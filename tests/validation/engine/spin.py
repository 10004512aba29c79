"""Up to which spin each model is good: the straight arm turning at a rate gets a kick of some strength."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from flexarm_env import ArmParameters, FlexibleArm
from tests.validation.engine.study import TOLERANCES, Case, compared
from tests.validation.kept import kept
from tests.validation.programmes import Model, Programme

Array = NDArray[np.float64]
FIRST_CLAMPED = float(FlexibleArm(ArmParameters.linear()).modes[0].frequencies[0])  # [rad/s], of a link (5)
SPINS = (0.0, 0.1, 0.2, 0.27, 0.33, 0.4, 0.6, 1.0)  # of FIRST_CLAMPED
KICKS = (2.0, 6.0, 20.0, 60.0)  # amplitudes
STRENGTHS = {"hardly bent": KICKS[0], "bent by 5 %": KICKS[2]}
FASTEST = 10.0  # of FIRST_CLAMPED; stability is looked at up to there
GROWTH = 0.1  # [1/s]; rounding splits the double eigenvalue 0 by less
MAPPED = (Model("linear", 2), Model("linear", 3), Model("foreshortened", 2), Model("foreshortened", 3))


def kick(time: Array) -> Array:
    """One smooth turn of torque in 0.6 s; the elbow against the shoulder."""
    turns = np.minimum(time / 0.6, 1.0)
    wave = np.where(time < 0.6, np.sin(2.0 * np.pi * time / 0.6) * np.sin(np.pi * turns) ** 2, 0.0)
    return np.column_stack([5.0 * wave, -1.5 * wave])


@kept
def spinning(spin: float, strength: float) -> Case:
    """Run chain and models over 1 s after a kick; `spin`: of `FIRST_CLAMPED`."""
    rate = spin * FIRST_CLAMPED
    programme = Programme("spin", "spin and kick", kick, 1.0, amplitude=strength, elbow=0.0, spin=rate)
    return compared(programme, (10, 20), MAPPED)


def limits(model: Model) -> dict[str, float | None]:
    """Return where straight spin turns unstable, and up to which spin tried a kick stays within each tolerance."""
    found = {"unstable from": critical_spin(model)}
    for name, strength in STRENGTHS.items():
        for tolerance in TOLERANCES:
            beyond = [k for k, spin in enumerate(SPINS) if spinning(spin, strength).rms(model) > tolerance]
            within = SPINS[: min(beyond, default=len(SPINS))]
            found[f"{name}, {1e3 * tolerance:g} mm"] = within[-1] if within else None
    return found


@cache
def critical_spin(model: Model) -> float | None:
    """Find the lowest spin of the straight arm at which a small motion grows, as a part of the first frequency.

    None if there is none up to `FASTEST`. The true arm's spin is stable: its ends are pulled outwards.
    """
    arm = FlexibleArm(ArmParameters.linear(damping_ratio=0.0, **model._asdict()))

    def grows(spin: float) -> bool:
        state = np.zeros(2 * arm.size)
        state[arm.size] = spin * FIRST_CLAMPED
        return bool(np.linalg.eigvals(arm.linearise(state).A).real.max() > GROWTH)

    tried = np.concatenate([np.arange(0.0, 1.0, 0.05), np.linspace(1.0, FASTEST, 37)])
    first = next((k for k, spin in enumerate(tried) if grows(spin)), None)
    if first is None:
        return None
    stable, unstable = float(tried[first - 1]), float(tried[first])
    while unstable - stable > 1e-4:
        middle = 0.5 * (stable + unstable)
        stable, unstable = (stable, middle) if grows(middle) else (middle, unstable)
    return unstable
