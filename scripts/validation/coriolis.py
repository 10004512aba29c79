"""What the paper's dropped Coriolis and centrifugal terms cost: energy and trajectory, by amplitude.

The paper's arm (`velocity_forces="rigid"`) keeps the rigid arm's velocity forces C_r (7) alone. Both arms start at
rest and get the same doublet of torque at the shoulder. Errors are taken until the doublet ends; what follows is drawn.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexarm_env import ArmParameters, DivergenceError, FlexibleArm, Trajectory
from flexarm_env.parameters import VelocityForces
from scripts.common.markdown import table
from scripts.validation.checks import Check, Findings, Settings, shown
from scripts.validation.drift import loss_bound
from scripts.validation.small_motion import rate

Array = NDArray[np.float64]

PULSE = 0.2  # [s], each half of the doublet
TIME = 1.0  # [s]
STEP, SUBSTEPS = 1e-3, 4
ELBOW = 1.0  # theta2 at the start [rad]
AMPLITUDES = (0.045, 0.14, 0.45, 1.4, 4.5, 14.0, 45.0)  # [N m]
SMALL = AMPLITUDES[:3]  # where second order is to be seen


def run(settings: Settings) -> Findings:
    """All amplitudes, both arms; the same in the quick run."""
    rows: list[dict[str, Any]] = []
    arrays: dict[str, Array] = {}
    for amplitude in AMPLITUDES:
        settings.progress(f"{amplitude} N m")
        complete, rigid = (doublet(forces, amplitude) for forces in ("complete", "rigid"))
        away = np.linalg.norm(rigid.tip - complete.tip[: len(rigid)], axis=1)
        arrays |= {f"away {amplitude}": away, "time": complete.time}
        for name, trajectory in (("complete", complete), ("rigid", rigid)):
            arrays[f"balance {name} {amplitude}"] = balance(trajectory)
        rows.append(_row(amplitude, complete, rigid, away))
    quoted = {f"{what}, {row['amplitude']:g} N m": row[what] for row in rows for what in ("away", "moved", "ended")}
    return Findings(_checks(rows), arrays, {"rows": rows}, quoted)


def tables(findings: Findings) -> dict[str, str]:
    """Tabulate each amplitude's motion until the doublet ends."""
    header = ("doublet [N m]", "largest deflection [m]", "tip's way [m]", "tip error [m]", "energy error / energy")
    names = ("amplitude", "deflection", "moved", "away")
    lines = [
        [*(shown(row[name]) for name in names), shown(row["rigid_balance"] / row["energy"])]
        for row in findings.records["rows"]
    ]
    return {"coriolis_amplitudes": table(header, lines)}


def doublet(forces: VelocityForces, amplitude: float) -> Trajectory:
    """Run a torque of +amplitude, then -amplitude, on the shoulder of the paper's arm at rest."""
    arm = FlexibleArm(ArmParameters.paper(velocity_forces=forces))
    state = np.zeros(2 * arm.size)
    state[1] = ELBOW
    torque = np.zeros((round(TIME / STEP), 2))
    half = round(PULSE / STEP)
    torque[:half, 0], torque[half : 2 * half, 0] = amplitude, -amplitude
    try:
        return _while_sensible(arm.simulate(state, torque, TIME, STEP, SUBSTEPS))
    except DivergenceError as error:
        return _while_sensible(error.trajectory)


def _while_sensible(run: Trajectory) -> Trajectory:
    """Cut the run where a link's tip is off its root tangent by more than both links are long."""
    wild = np.append(np.abs(run.tip_deflection).max(axis=1) > run.parameters.reach, True)
    shorter: dict[str, Any] = {name: array[: int(np.argmax(wild))] for name, array in run.arrays().items()}
    return replace(run, **shorter)


def balance(run: Trajectory) -> Array:
    """Energy minus the work of the torques [J]: 0 for equations that are those of a mechanical system."""
    turned = np.diff(run.state[:, :2], axis=0)
    work = np.concatenate([[0.0], np.cumsum((run.torque[:-1] * turned).sum(axis=1))])
    return run.kinetic_energy + run.strain_energy - work


def _row(amplitude: float, complete: Trajectory, rigid: Trajectory, away: Array) -> dict[str, Any]:
    energy = complete.kinetic_energy + complete.strain_energy
    pulse = round(2.0 * PULSE / STEP) + 1  # instants until the torque ends
    return {
        "amplitude": amplitude,
        "energy": float(energy.max()),
        "complete_balance": float(np.abs(balance(complete)).max()),
        "rigid_balance": float(np.abs(balance(rigid)[:pulse]).max()),
        "away": float(away[:pulse].max()),
        "away_later": float(away.max()),
        "ended": float(rigid.time[-1]),
        "moved": float(np.linalg.norm(complete.tip - complete.tip[0], axis=1).max()),
        "deflection": float(np.abs(complete.tip_deflection).max()),
    }


def _checks(rows: list[dict[str, Any]]) -> list[Check]:
    small = [row for row in rows if row["amplitude"] in SMALL]
    amplitudes = [row["amplitude"] for row in small]
    return [
        Check(
            "coriolis",
            "complete forces: energy minus work of the torques, over energy, any amplitude",
            max(row["complete_balance"] / row["energy"] for row in rows),
            "nothing else gives or takes energy; the method itself loses omega^6 h^5 / 72 a second at the fastest rate",
            most=loss_bound(FlexibleArm(ArmParameters.paper()), STEP / SUBSTEPS, TIME),
        ),
        Check(
            "coriolis",
            "paper's forces: order of the energy error in the amplitude",
            -rate(amplitudes, [row["rigid_balance"] for row in small]),
            "the forces dropped are of second order, their power, times a rate, of third",
            least=2.7,
            most=3.3,
        ),
        Check(
            "coriolis",
            "paper's forces: order of the trajectory error in the amplitude",
            -rate(amplitudes, [row["away"] for row in small]),
            "the forces dropped are of second order: a tenth of the torque, a hundredth of the error",
            least=1.8,
            most=2.2,
        ),
    ]
