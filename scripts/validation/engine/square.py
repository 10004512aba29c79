"""The square on the chain and on our models, undamped, under the paper's laws.

The same law drives each of them, so that a model's error shows as it does in use: with feedback. The benchmark's own
arm under torques is compared in `scripts.validation.plant`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from flexarm_baselines import FLSAC, IFDC
from flexarm_baselines.paper_law.flsac import REFERENCE_DEFLECTION
from flexarm_baselines.paper_law.fuzzy import paper_system
from flexarm_env import ArmParameters, SquareParameters, inverse_kinematics, run_batch, square
from flexarm_env.laps import SETTLED
from scripts.validation.engine.laws import law_lap
from scripts.validation.engine.models import Model
from scripts.validation.engine.motion import rms
from scripts.validation.engine.programmes import HELD

Array = NDArray[np.float64]
SAMPLED = 10  # `HELD` in a control period; the score counts these instants


# --- the paper's laws -------------------------------------------------------------------------------------------------


def fuzzy_gain(deflection: Array) -> float:
    """FLSAC's lambda from the links' tip deflections [m]."""
    return float(paper_system(1.0).evaluate(5.0 * deflection[None] / REFERENCE_DEFLECTION)[0])


LAWS: dict[str, Callable[[Array], float]] = {"ifdc": lambda deflection: 1.0, "flsac": fuzzy_gain}


def laws_on_model(parameters: ArmParameters, seconds: float) -> dict[str, Array]:
    """Return the tip under each law, every `HELD`. Shape (n, 2) each."""
    envs = gymnasium.make_vec("FlexArm/Paper-v0", num_envs=len(LAWS), arm=parameters)
    runs = run_batch(envs, [IFDC(), FLSAC.for_env(envs)], max_steps=round(seconds / HELD))  # type: ignore[arg-type]
    return {name: run.tip for name, run in zip(LAWS, runs, strict=True)}


def laws_on_chain(elements: int, seconds: dict[str, float]) -> dict[str, Array]:
    """Return the tip of a chain under each law, each for its own time [s]."""
    arm = ArmParameters.linear(damping_ratio=0.0)
    return {
        name: np.array([sight.tip for sight in law_lap(elements, arm, gain, seconds[name])])
        for name, gain in LAWS.items()
    }


# --- the reference --------------------------------------------------------------------------------------------


def reference_rates(limit: float) -> dict[str, float]:
    """How fast the links of a rigid arm turn on the square: the largest rate of one [rad/s], and how long it is above.

    Args:
        limit: [rad/s]; the part of the lap counts during which a link turns faster.
    """
    path, arm = square(SquareParameters()), ArmParameters.linear()
    points = path.position(np.arange(0.0, path.lap_time, HELD))
    joints = np.unwrap([inverse_kinematics(arm, point, "positive") for point in points], axis=0)
    rates = np.abs(np.diff(np.cumsum(joints, axis=1), axis=0)).max(axis=1) / HELD
    return {"largest": float(rates.max()), "share": float((rates > limit).mean())}


# --- what is compared -------------------------------------------------------------------------------------------------


def laws(
    models: Sequence[Model], seconds: dict[str, float], elements: tuple[int, int], progress: Callable[[str], None]
) -> tuple[list[dict[str, Any]], dict[str, Array]]:
    """Laps under the paper's laws.

    Args:
        models: to be compared with the chain.
        seconds: how long a lap is followed, by law [s].
        elements: of the two chains that the reference is extrapolated from.
        progress: called with a few words.

    Returns:
        Rows, and the tips' errors over time.
    """
    progress("the laws on the chain")
    coarse, fine = (laws_on_chain(n, seconds) for n in elements)
    truth = {name: fine[name] + (fine[name] - coarse[name]) / 3.0 for name in LAWS}
    rows = [_lap_row(name, "chain", truth[name], truth[name]) for name in LAWS]
    rows += [_lap_row(name, f"chain, {elements[1]} elements", fine[name], truth[name]) for name in LAWS]
    arrays = {f"{name} chain": truth[name] for name in LAWS}
    for m in models:
        progress(f"the laws on {m.label}")
        tips = laws_on_model(ArmParameters.linear(damping_ratio=0.0, **m.fields), max(seconds.values()))
        for name in LAWS:
            rows.append(_lap_row(name, m.label, tips[name], truth[name]))
            arrays[f"{name} {m.label}"] = _distance(tips[name], truth[name])
    return rows, arrays


def _away(tip: Array, other: Array) -> dict[str, float]:
    away = _distance(tip, other)
    return {"rms": rms(away), "maximum": float(away.max())}


def _distance(tip: Array, other: Array) -> Array:
    count = min(len(tip), len(other))
    return np.linalg.norm(tip[:count] - other[:count], axis=1)


def _lap_row(driver: str, which: str, tip: Array, truth: Array) -> dict[str, Any]:
    """Distance from the chain and from the reference [m]; the score as the benchmark has it, every 10 ms."""
    away = _away(tip, truth)
    tip = tip[: len(truth)]
    miss = _distance(tip, square(SquareParameters()).position(HELD * np.arange(len(tip))))[::SAMPLED]
    settled = round(SETTLED / HELD)
    return {
        "driver": driver,
        "model": which,
        **away,
        "score": rms(miss),
        "score_after_2s": rms(miss[settled // SAMPLED :]) if len(tip) > settled else None,
    }
