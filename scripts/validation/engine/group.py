"""The arm's models against a chain of rigid segments in MuJoCo, an engine that nobody here wrote."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from flexarm_env import ArmParameters
from scripts.validation.checks import Check, Findings, Settings
from scripts.validation.engine import square, study, validity
from scripts.validation.engine.models import MODELS, Model, model
from scripts.validation.engine.tables import error_of, tables
from scripts.validation.spinning import critical_spin

__all__ = ["run", "tables"]
GROUP = "engine"
SMOOTH = ("multi_sine", "spin_up")
ON_THE_SQUARE = (
    model("linear", 1),
    model("linear", 2),
    model("linear", 3),
    model("foreshortened", 2),
    model("foreshortened", 3),
    model("linear", 3, "polynomial"),
    model("foreshortened", 3, "polynomial"),
)
# From 8 s on, IFDC's undamped arm is through the straight pose, where millimetres decide which way the elbow goes.
LAW_SECONDS = {"ifdc": 7.9, "flsac": 16.0}
BENCHMARKED = (model("linear", 2), model("foreshortened", 2))
SLOW = 0.1  # of the first clamped frequency: up to there the linear model keeps 10 mm where links bend by 5 %
QUICK_MODELS = (model("linear", 4), model("foreshortened", 3))


def run(settings: Settings) -> Findings:
    """Programmes at all amplitudes, the map of spin and deflection, the square."""
    quick = settings.quick
    models: Sequence[Model] = QUICK_MODELS if quick else MODELS
    records, arrays = study.study(models, quick, settings.progress)
    settings.progress("steps halved")
    records["steps"] = study.step_errors(quick)
    records["limits"] = validity.limits(records["errors"])
    records["tried"] = validity.largest_bends(records["errors"])
    records["critical"] = critical_spin(ArmParameters()) / validity.FIRST_CLAMPED
    records["spins"], mapped = validity.spin_map(quick, settings.progress)
    arrays |= mapped
    records["reference"] = square.reference_rates(SLOW * validity.FIRST_CLAMPED)
    on_square = [m for m in ON_THE_SQUARE if m in BENCHMARKED] if quick else ON_THE_SQUARE
    elements = study.QUICK_ELEMENTS if quick else (10, 20)
    seconds = dict.fromkeys(LAW_SECONDS, 0.5) if quick else LAW_SECONDS
    laps, found = square.laws(on_square[:1] if quick else on_square, seconds, elements, settings.progress)
    arrays |= found
    agent, found = square.agent(on_square, 1.0 if quick else 16.0, elements, settings.progress)
    arrays |= found
    records["square"] = [*laps, *agent]
    return Findings(_checks(records, quick), arrays, records, _quoted(records))


# --- checks -----------------------------------------------------------------------------------------------------------


def _checks(records: dict[str, Any], quick: bool) -> list[Check]:
    checks = [*_reference_checks(records), *_model_checks(records), *_square_checks(records)]
    return [*checks, *([] if quick else _lap_checks(records))]


def _reference_checks(records: dict[str, Any]) -> list[Check]:
    rows = records["convergence"]
    finest = max(row["tip"][max(row["tip"], key=int)] for row in rows)
    angles = max(row["low_passed_angles"] for row in rows)
    return [
        Check(
            GROUP,
            "the finest chain's tip from the extrapolated one",
            1e3 * finest,
            "a choice: the 1 mm that the models are asked for; the extrapolation, which takes most of this away, "
            "must not matter",
            "mm",
            most=1.0,
        ),
        Check(
            GROUP,
            "joint angles below 10 Hz, of the two finest chains",
            1e3 * angles,
            "a choice: the angle that moves the tip of the stiff straight arm by 5 mm; raw angles have no limit to "
            "converge to",
            "mrad",
            most=1e3 * 0.005 / 9.0,
        ),
        *(
            Check(
                GROUP,
                f"the tip under a doublet with the {name}'s step halved",
                1e3 * error,
                "a choice: a tenth of the 1 mm that the models are asked for",
                "mm",
                most=0.1,
            )
            for name, error in records["steps"].items()
        ),
    ]


def _model_checks(records: dict[str, Any]) -> list[Check]:
    linear, best = model("linear", 4).label, model("foreshortened", 3).label
    orders = [row["order"] for row in records["parts"] if (row["programme"], row["model"]) == ("multi_sine", linear)]
    good = [error_of(records, name, best)["rms"] for name in SMOOTH]
    gains = [error_of(records, name, linear)["rms"] / error for name, error in zip(SMOOTH, good, strict=True)]
    spins = {row["model"]: row["unstable from"] for row in records["spins"]}
    return [
        Check(
            GROUP,
            "order in amplitude of the linear model's tip error (multi-sine, 4 modes)",
            orders[0],
            "what it leaves out, foreshortening, is of second order in the deflection",
            least=1.8,
            most=2.3,
        ),
        Check(
            GROUP,
            "smooth torques at 4 %: r.m.s. tip error with foreshortening and 3 modes",
            1e3 * max(good),
            "its own next order is the third: 4 % cubed of 4.5 m is 0.3 mm; three times that is a choice, for growth "
            "over two seconds",
            "mm",
            most=1.0,
        ),
        Check(
            GROUP,
            "the same, linear over foreshortened",
            min(gains),
            "at 4 % a second-order error is 25 times a third-order one of equal coefficient; a fifth of that is a "
            "choice, for truncation takes a part",
            least=5.0,
        ),
        Check(
            GROUP,
            "spin at which the linear model with 2 modes turns unstable, above finite elements' of linear theory",
            (spins[model("linear", 2).label] or np.inf) / records["critical"] - 1.0,
            "fewer shapes are stiffer (Rayleigh and Ritz), for free joints and 2 modes by 1 % of a frequency at most",
            least=0.0,
            most=0.01,
        ),
    ]


def _square_checks(records: dict[str, Any]) -> list[Check]:
    finest = list(dict.fromkeys(row["model"] for row in records["square"]))[1]
    chains = [row for row in records["square"] if row["model"] == finest]
    return [
        Check(
            GROUP,
            "the square: the finer chain from the extrapolated one",
            1e3 * max(row["rms"] for row in chains),
            "a choice: half of the 10 mm that the validity range allows a model",
            "mm",
            most=5.0,
        )
    ]


def _lap_checks(records: dict[str, Any]) -> list[Check]:
    """Of a whole lap."""
    linear, better = (
        next(row for row in records["square"] if (row["driver"], row["model"]) == ("agent", m.label))
        for m in BENCHMARKED
    )
    return [
        Check(
            GROUP,
            "the square under the agent: r.m.s. tip distance of the foreshortened model with 2 modes from the chain",
            1e3 * better["rms"],
            "a choice: the 10 mm that the validity range allows a model",
            "mm",
            most=1e3 * validity.TOLERANCES[0],
        ),
        Check(
            GROUP,
            "the same, linear over foreshortened",
            linear["rms"] / better["rms"],
            "a choice: foreshortening, which costs up to twice the time, shall halve the error at least",
            least=2.0,
        ),
    ]


def _quoted(records: dict[str, Any]) -> dict[str, float]:
    """Collect what the docs quote: lengths in mm, deflections in %, spins as parts of the first frequency."""
    quoted = {}
    for row in records["errors"]:
        for amplitude, prefix in ((1.0, ""), (2.0, "twice ")):
            if row["amplitude"] == amplitude:
                quoted[f"{prefix}{row['programme']}, bend"] = 100.0 * row["bend"]
                for name in ("rms", "maximum"):
                    quoted[f"{prefix}{row['programme']}, {row['model']}, {name}"] = 1e3 * row[name]
    for row in records["square"]:
        which = f"square, {row['driver']}, {row['model']}"
        quoted |= {f"{which}, {n}": 1e3 * row[n] for n in ("rms", "maximum", "score", "score_after_2s") if row[n]}
        for part in ("modal", "kinematics", "ahead"):
            quoted |= {f"{which}, {part}, {name}": 1e3 * value for name, value in row.get(part, {}).items()}
        quoted |= {"square, bend": 100.0 * row["bend"]} if "bend" in row else {}
        quoted |= {f"{which}, torque change": row["torque_change"]} if "torque_change" in row else {}
    quoted |= {f"tried, {kind}": 100.0 * bend for kind, bend in records["tried"].items()}
    quoted |= {f"reference, {name}": value for name, value in records["reference"].items()}
    quoted |= {"first clamped": validity.FIRST_CLAMPED, "critical spin": records["critical"]}
    for row in records["limits"]:
        quoted |= {f"limit, {row['model']}, {n}": 100.0 * row[n] for n in row if n != "model" and row[n] is not None}
    for row in records["spins"]:
        quoted |= {f"spin, {row['model']}, {n}": row[n] for n in row if n != "model" and row[n] is not None}
    return quoted
