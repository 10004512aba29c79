"""The torque programmes at several amplitudes, on MuJoCo's chain and on every model.

A model's tip error is split by its order in the amplitude a. To first order both theories are the same, so what is
first order, 8 e(a / 8), comes from the shapes' small number (modal truncation); the rest, e(a) - 8 e(a / 8), is the
small-deflection assumption (and what it does to the truncated shapes).
"""

from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np

from flexarm_env import ArmParameters, DivergenceError, FlexibleArm
from tests.validation import motion as motions
from tests.validation.arms import chain_motion
from tests.validation.kept import kept
from tests.validation.motion import MODELS, PROGRAMMES, Array, Model, Motion, Programme, rms

SMALLEST = 0.125
AMPLITUDES = (SMALLEST, 0.25, 0.5, 1.0, 2.0, 4.0)
FINEST = (20, 40)  # elements of the reference at amplitude 1; at the others half as many
TOLERANCES = (0.01, 0.05)  # r.m.s. tip error that a limit allows [m]: about 0.1 and 0.5 % of the reach
KINDS = {  # of programmes; a limit is the least of its kind
    "smooth torques": ("multi_sine", "spin_up"),
    "torques that jump": ("doublet", "bang_bang", "payload"),
    "release": ("release",),
}


# Up to which spin is each model good? The straight arm turns at a rate and gets a kick of some strength.
FIRST_CLAMPED = float(FlexibleArm(ArmParameters.linear()).modes[0].frequencies[0])  # [rad/s], of a link (5)
SPINS = (0.0, 0.1, 0.2, 0.27, 0.33, 0.4, 0.6, 1.0)  # of FIRST_CLAMPED
KICKS = (2.0, 6.0, 20.0, 60.0)  # amplitudes
STRENGTHS = {"hardly bent": KICKS[0], "bent by 5 %": KICKS[2]}
FASTEST = 10.0  # of FIRST_CLAMPED; stability is looked at up to there
GROWTH = 0.1  # [1/s]; rounding splits the double eigenvalue 0 by less
MAPPED = (Model("linear", 2), Model("linear", 3), Model("foreshortened", 2), Model("foreshortened", 3))


class Case(NamedTuple):
    reference: Motion  # the extrapolated chain
    chains: dict[int, Motion]  # by number of elements
    errors: dict[Model, Motion | None]  # of each model, its motion less the reference; None for one that diverged

    def tip(self, model: Model) -> Array:
        """Return the distance of a model's tip from the reference [m]; infinite if it diverged. Shape (n,)."""
        error = self.errors[model]
        return np.full(1, np.inf) if error is None else np.linalg.norm(error.tip, axis=1)

    def rms(self, model: Model) -> float:
        """Return the r.m.s. tip error of a model [m]."""
        return rms(self.tip(model))

    def angles(self, model: Model) -> float:
        """Return the r.m.s. error of a model's low-passed joint angles [rad]."""
        error = self.errors[model]
        return np.inf if error is None else rms(np.linalg.norm(motions.low_passed(error.joints), axis=1))

    def chain_error(self, elements: int) -> Array:
        """Return the distance of a chain's tip from the reference [m]. Shape (n,)."""
        return np.linalg.norm(self.chains[elements].tip - self.reference.tip, axis=1)

    def between_the_finest(self, smooth: bool) -> float:
        """Return the largest difference of the two finest chains' joint angles, low-passed or as they are [rad]."""
        angles = [chain.joints for chain in list(self.chains.values())[-2:]]
        coarse, fine = map(motions.low_passed, angles) if smooth else angles
        return float(np.abs(fine - coarse).max())


def compared(programme: Programme, elements: Sequence[int], models: Sequence[Model]) -> Case:
    """Run a programme on models and chains; each chain has twice the elements of the one before."""
    chains = {n: chain_motion(programme, n) for n in elements}
    reference = motions.extrapolated(*list(chains.values())[-2:])
    return Case(reference, chains, {model: _error(programme, model, reference) for model in models})


def _error(programme: Programme, model: Model, reference: Motion) -> Motion | None:
    try:
        motion = motions.model_motion(programme, model)
    except DivergenceError:
        return None
    return Motion(*(ours - theirs for ours, theirs in zip(motion, reference, strict=True)))


NAMES = tuple(programme.name for programme in PROGRAMMES)


@kept
def case(name: str, amplitude: float = 1.0) -> Case:
    """Run a programme at an amplitude on all models."""
    coarse = (FINEST[0] // 2, FINEST[0])
    elements = (*coarse, FINEST[1]) if amplitude == 1.0 else coarse
    return compared(PROGRAMMES[NAMES.index(name)].times(amplitude), elements, MODELS)


def order(name: str, model: Model) -> float:
    """Return the order of growth of a model's tip error from amplitude 1/2 to 1."""
    return float(np.log2(case(name).rms(model) / case(name, 0.5).rms(model)))


def parts(name: str, model: Model) -> tuple[float, float] | None:
    """Return the parts of a model's tip error at amplitude 1: of first order, and the rest [m]. None: it diverged."""
    whole, small = case(name).errors[model], case(name, SMALLEST).errors[model]
    if whole is None or small is None:
        return None
    first = small.tip / SMALLEST
    return rms(np.linalg.norm(first, axis=1)), rms(np.linalg.norm(whole.tip - first, axis=1))


def limits(model: Model) -> dict[str, float | None]:
    """Find the deflections, as parts of a link's length, at which a model's r.m.s. error passes each tolerance.

    Between amplitudes a power law is assumed. None: not within the amplitudes tried.
    """
    found = {}
    for kind, names in KINDS.items():
        for tolerance in TOLERANCES:
            curves = [[(case(n, a).reference.bend, case(n, a).rms(model)) for a in AMPLITUDES] for n in names]
            passed = [limit for curve in curves if (limit := crossing(curve, tolerance)) is not None]
            found[f"{kind}, {1e3 * tolerance:g} mm"] = min(passed, default=None)
    return found


def crossing(curve: Sequence[tuple[float, float]], tolerance: float) -> float | None:
    """Return the deflection at which an error passes a tolerance, from a curve of deflections and errors [m]."""
    curve = sorted(curve)
    bend, error = curve[0]
    if error > tolerance:
        return bend * tolerance / error  # of first order below
    for (bend, error), (more, worse) in zip(curve, curve[1:], strict=False):
        if error <= tolerance < worse:
            share = np.log(tolerance / error) / np.log(worse / error)  # 0 for a model that diverges
            return float(bend * (more / bend) ** share)
    return None


def tried(kind: str) -> float:
    """Return how far links were bent in a kind of programme: in that of its programmes which bent them least."""
    return min(max(case(name, a).reference.bend for a in AMPLITUDES) for name in KINDS[kind])


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


def spin_limits(model: Model) -> dict[str, float | None]:
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
