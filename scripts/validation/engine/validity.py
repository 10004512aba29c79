"""Up to which deflection and spin each model is good: limits from the programmes' amplitudes, and a map."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexarm_env import ArmParameters, FlexibleArm
from scripts.validation.engine.models import Model, model
from scripts.validation.engine.motion import peak_bend
from scripts.validation.engine.programmes import Programme
from scripts.validation.engine.study import QUICK_ELEMENTS, case, tip_rms

Array = NDArray[np.float64]
TOLERANCES = (0.01, 0.05)  # r.m.s. tip error that a limit allows [m]: about 0.1 and 0.5 % of the reach
KINDS = {  # of programmes; a limit is the least of its kind
    "smooth torques": ("multi_sine", "spin_up"),
    "torques that jump": ("doublet", "bang_bang", "payload"),
    "release": ("release",),
}
FIRST_CLAMPED = float(FlexibleArm(ArmParameters()).modes[0].frequencies[0])  # [rad/s], of a link (5)
SPINS = (0.0, 0.1, 0.2, 0.27, 0.33, 0.4, 0.6, 1.0)  # of FIRST_CLAMPED
KICKS = (2.0, 6.0, 20.0, 60.0)  # amplitudes
STRONG = 2  # the kick that bends a link by 5 %
FASTEST = 10.0  # of FIRST_CLAMPED; stability is looked at up to there
GROWTH = 0.1  # [1/s]; rounding splits the double eigenvalue 0 by less
MAPPED = (model("linear", 2), model("linear", 3), model("foreshortened", 2), model("foreshortened", 3))


def limits(rows: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Find the deflection, as a part of a link's length, at which a model's r.m.s. error passes each tolerance.

    Between amplitudes a power law is assumed. None: not within the amplitudes tried.

    Args:
        rows: of `study.error_rows`.

    Returns:
        A row for each model: its label and, for each kind and tolerance, the limit.
    """
    found = []
    for label in dict.fromkeys(row["model"] for row in rows):
        here = [row for row in rows if row["model"] == label]
        entry: dict[str, Any] = {"model": label}
        for kind, names in KINDS.items():
            for tolerance in TOLERANCES:
                each = [_crossing([row for row in here if row["programme"] == name], tolerance) for name in names]
                passed = [limit for limit in each if limit is not None]
                entry[f"{kind}, {1e3 * tolerance:g} mm"] = min(passed) if passed else None
        found.append(entry)
    return found


def _crossing(rows: Sequence[dict[str, Any]], tolerance: float) -> float | None:
    rows = sorted(rows, key=lambda row: row["bend"])
    if rows and rows[0]["rms"] > tolerance:
        return rows[0]["bend"] * tolerance / rows[0]["rms"]  # of first order below
    for low, high in zip(rows, rows[1:], strict=False):
        if low["rms"] <= tolerance < high["rms"]:
            if not np.isfinite(high["rms"]):
                return low["bend"]
            share = np.log(tolerance / low["rms"]) / np.log(high["rms"] / low["rms"])
            return float(low["bend"] * (high["bend"] / low["bend"]) ** share)
    return None


def kick(time: Array) -> Array:
    """One smooth turn of torque in 0.6 s; the elbow against the shoulder."""
    wave = np.where(
        time < 0.6, np.sin(2.0 * np.pi * time / 0.6) * np.sin(np.pi * np.minimum(time / 0.6, 1.0)) ** 2, 0.0
    )
    return np.column_stack([5.0 * wave, -1.5 * wave])


def spin_map(quick: bool, progress: Callable[[str], None]) -> tuple[list[dict[str, Any]], dict[str, Array]]:
    """Measure the r.m.s. tip error over 1 s after a kick of some strength to the straight arm turning at a rate.

    Returns:
        Rows with the limits of spin, and arrays: spins, peak deflections (spins, kicks), errors of each model.
    """
    spins, kicks = ((0.0, 0.6), (1.0, 4.0)) if quick else (SPINS, KICKS)
    shape, mapped = (len(spins), len(kicks)), MAPPED[::2] if quick else MAPPED
    bends, errors = np.zeros(shape), {m: np.zeros(shape) for m in mapped}
    for i, spin in enumerate(spins):
        progress(f"spin at {spin:g} of the first clamped frequency")
        for j, strength in enumerate(kicks):
            programme = Programme(
                "spin", "spin and kick", kick, 1.0, amplitude=strength, elbow=0.0, spin=spin * FIRST_CLAMPED
            )
            found = case(programme, QUICK_ELEMENTS if quick else (10, 20), mapped)
            bends[i, j] = peak_bend(found.reference.deflection)
            for m, error in found.errors.items():
                errors[m][i, j] = tip_rms(error)
    arrays = {"map spins": np.array(spins), "map bends": bends} | {f"map {m.label}": e for m, e in errors.items()}
    return [_spin_limit(m, np.array(spins), errors[m]) for m in mapped], arrays


def _spin_limit(which: Model, spins: Array, errors: Array) -> dict[str, Any]:
    """Where straight spin turns unstable; up to which spin tried a weak and a strong kick stay within tolerances."""
    entry: dict[str, Any] = {"model": which.label, "unstable from": critical_spin(which)}
    for kick_of, name in ((0, "hardly bent"), (STRONG, "bent by 5 %")):
        for tolerance in TOLERANCES:
            within = errors[:, min(kick_of, errors.shape[1] - 1)] <= tolerance
            count = len(spins) if within.all() else int(np.argmin(within))
            entry[f"{name}, {1e3 * tolerance:g} mm"] = float(spins[count - 1]) if count else None
    return entry


def critical_spin(which: Model) -> float | None:
    """Find the lowest spin of the straight arm at which a small motion grows, as a part of the first frequency.

    None if there is none up to `FASTEST`. The true arm's spin is stable: its ends are pulled outwards.
    """
    arm = FlexibleArm(ArmParameters(damping_ratio=0.0, **which.fields))

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


def largest_bends(rows: Sequence[dict[str, Any]]) -> dict[str, float]:
    """How far links were bent at most in each kind of programme: in that of its programmes which bent them least.

    Args:
        rows: of `study.error_rows`.
    """
    most = {name: max(row["bend"] for row in rows if row["programme"] == name) for name in _tried(rows)}
    return {
        kind: min(most[name] for name in names if name in most) for kind, names in KINDS.items() if {*names} & {*most}
    }


def _tried(rows: Sequence[dict[str, Any]]) -> list[str]:
    return list(dict.fromkeys(row["programme"] for row in rows))
