"""The torque programmes at several amplitudes, on the chain and on every model: convergence, and what the errors are.

A model's tip error is split by its order in the amplitude a. To first order both theories are the same, so what is
first order, 8 e(a / 8), comes from the shapes' small number (modal truncation); the rest, e(a) - 8 e(a / 8), is the
small-deflection assumption (and what it does to the truncated shapes).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexarm_env import DivergenceError
from scripts.validation.engine.chain import CHAIN_ANGLE
from scripts.validation.engine.models import DEFAULT, Model, model
from scripts.validation.engine.motion import (
    MODEL_ANGLE,
    Motion,
    apart,
    extrapolated,
    low_passed,
    model_motion,
    peak_bend,
    rms,
)
from scripts.validation.engine.programmes import HELD, PROGRAMMES, Programme
from scripts.validation.engine.runs import chain_motion

Array = NDArray[np.float64]
SMALLEST = 0.125
AMPLITUDES = (SMALLEST, 0.25, 0.5, 1.0, 2.0, 4.0)
FINEST = (20, 40)  # elements of the reference at amplitude 1; at the others half as many
QUICK_ELEMENTS = (5, 10)
SHOWN = (  # errors over time, in the picture
    model("linear", 1),
    model("linear", 2),
    model("linear", 3),
    model("foreshortened", 3),
    DEFAULT,
    model("foreshortened", 4, "polynomial"),
)


class Case(NamedTuple):
    """A programme at an amplitude.

    Attributes:
        reference: the extrapolated chain.
        chains: by number of elements.
        errors: errors of each model, its motion less the reference; None for one that diverged.
    """

    reference: Motion
    chains: dict[int, Motion]
    errors: dict[Model, Motion | None]


def case(programme: Programme, elements: Sequence[int], models: Sequence[Model]) -> Case:
    """Run a programme on chains and models.

    Args:
        programme: the programme.
        elements: numbers of elements of the chains, each twice the one before; the last two make the reference.
        models: to be compared with it.
    """
    chains = {n: chain_motion(programme, n) for n in elements}
    reference = extrapolated(*list(chains.values())[-2:])
    return Case(reference, chains, {m: _error(programme, m, reference) for m in models})


def _error(programme: Programme, which: Model, reference: Motion) -> Motion | None:
    try:
        motion = model_motion(programme, **which.fields)
    except DivergenceError:
        return None
    return Motion(*(ours - theirs for ours, theirs in zip(motion, reference, strict=True)))


def tip_rms(error: Motion | None) -> float:
    """R.m.s. tip error [m]; infinite for a model that diverged."""
    return np.inf if error is None else rms(length(error.tip))


def length(vectors: Array) -> Array:
    """Of each. Shape (n,)."""
    return np.linalg.norm(vectors, axis=1)


def study(
    models: Sequence[Model], quick: bool, progress: Callable[[str], None]
) -> tuple[dict[str, Any], dict[str, Array]]:
    """All programmes, amplitudes and models.

    Returns:
        Records "convergence", "errors", "parts" (lists of rows), and arrays for the pictures.
    """
    programmes = [p for p in PROGRAMMES if p.name in ("multi_sine", "spin_up")] if quick else PROGRAMMES
    amplitudes = (SMALLEST, 0.5, 1.0) if quick else AMPLITUDES
    records: dict[str, Any] = {"convergence": [], "errors": [], "parts": []}
    arrays: dict[str, Array] = {}
    for programme in programmes:
        cases = {}
        for amplitude in amplitudes:
            progress(f"{programme.title}, amplitude {amplitude:g}")
            coarse = QUICK_ELEMENTS if quick else (FINEST[0] // 2, FINEST[0])
            elements = (*coarse, FINEST[1]) if amplitude == 1.0 and not quick else coarse
            found = cases[amplitude] = case(programme.times(amplitude), elements, models)
            records["errors"] += error_rows(programme, amplitude, found)
        records["convergence"].append(convergence_row(programme, cases[1.0]))
        records["parts"] += part_rows(programme, cases)
        arrays |= drawn(programme, cases[1.0])
    return records, arrays


def error_rows(programme: Programme, amplitude: float, found: Case) -> list[dict[str, Any]]:
    """How far each model's tip [m] and low-passed joint angles [rad] are off; infinite where it diverged."""
    bend = peak_bend(found.reference.deflection)
    return [
        {"programme": programme.name, "amplitude": amplitude, "bend": bend, "model": m.label}
        | {"rms": tip_rms(error)}
        | {"maximum": np.inf if error is None else float(length(error.tip).max())}
        | {"angles": np.inf if error is None else rms(length(low_passed(error.joints)))}
        for m, error in found.errors.items()
    ]


def convergence_row(programme: Programme, found: Case) -> dict[str, Any]:
    """How far chains are from the reference; angles of the two finest, as they are and low-passed."""
    coarser, finest = list(found.chains)[-2:]
    raw = [found.chains[n].joints for n in (coarser, finest)]
    smooth = [low_passed(angles) for angles in raw]
    return {
        "programme": programme.name,
        "bend": peak_bend(found.reference.deflection),
        "way": float(np.linalg.norm(found.reference.tip - found.reference.tip[0], axis=1).max()),
        "tip": {str(n): float(apart(chain, found.reference).max()) for n, chain in found.chains.items()},
        "angles": float(np.abs(raw[1] - raw[0]).max()),
        "low_passed_angles": float(np.abs(smooth[1] - smooth[0]).max()),
    }


def part_rows(programme: Programme, cases: dict[float, Case]) -> list[dict[str, Any]]:
    """First order and the rest at amplitude 1; and the order of growth from 1/2 to 1."""
    rows = []
    for m, whole in cases[1.0].errors.items():
        small, half = cases[SMALLEST].errors[m], cases[0.5].errors[m]
        if whole is None or half is None or small is None:
            continue
        first = small.tip / SMALLEST
        rows.append(
            {
                "programme": programme.name,
                "model": m.label,
                "whole": tip_rms(whole),
                "first_order": rms(length(first)),
                "rest": rms(length(whole.tip - first)),
                "order": float(np.log2(tip_rms(whole) / tip_rms(half))),
            }
        )
    return rows


def drawn(programme: Programme, found: Case) -> dict[str, Array]:
    """Collect what the pictures need of a programme at amplitude 1."""
    name = programme.name
    arrays = {f"{name} time": HELD * np.arange(len(found.reference.tip), dtype=float)}
    arrays |= {f"{name} chain {n}": apart(chain, found.reference) for n, chain in found.chains.items()}
    for m in SHOWN:
        error = found.errors.get(m)
        if error is not None:
            arrays[f"{name} {m.label}"] = length(error.tip)
    return arrays


def step_errors(quick: bool) -> dict[str, float]:
    """Measure what halving the step changes at the tip under the doublet [m], for a chain and a model."""
    programme = replace(PROGRAMMES[0], duration=0.5) if quick else PROGRAMMES[0]
    chains = [chain_motion(programme, FINEST[0], angle) for angle in (CHAIN_ANGLE, 0.5 * CHAIN_ANGLE)]
    fields = model("foreshortened", 3).fields
    models = [model_motion(programme, angle, **fields) for angle in (MODEL_ANGLE, 0.5 * MODEL_ANGLE)]
    return {"chain": float(apart(*chains).max()), "model": float(apart(*models).max())}
