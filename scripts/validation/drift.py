"""Energy and angular momentum of the undamped free arm over ten minutes of simulated time, by integration step.

The classical Runge-Kutta method takes a vibration at omega for one that loses the part ``(omega h)^6 / 72`` of its
energy in every step h, so ``omega^6 h^5 / 72`` a second: the arm's fastest frequency gives a bound. The angular
momentum is the sum of two of the momenta that are integrated. No inner force changes that sum: it is kept to rounding.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexarm_env import ArmParameters, FlexibleArm
from flexarm_env.parameters import Kinematics, ModeShapes
from scripts.common.markdown import table
from scripts.validation.checks import Check, Findings, Settings, shown
from scripts.validation.small_motion import rate

Array = NDArray[np.float64]

LONG, SHORT = 600.0, 20.0  # simulated time [s]
RECORDED = 0.1  # [s]
STARTS = ("bent", "spinning", "bent and spinning")
STEPS = (2e-3, 1e-3, 5e-4, 2.5e-4)
# of 3 and 4 modes, whose fastest rates ask for shorter steps: one start, two steps
FAST = {3: (2.5e-4, 1.25e-4), 4: (1.25e-4, 6.25e-5)}
ROUNDING = 1e-9  # of ten million steps, 1e-16 each, and room
USEFUL = 0.1  # a bound above this says nothing


class Case(NamedTuple):
    """One run."""

    modes: int
    start: str
    step: float
    kinematics: Kinematics = "linear"
    shapes: ModeShapes = "cantilever"
    damping: float = 0.0

    @property
    def arm(self) -> str:
        """The arm in words."""
        kind = "" if self.kinematics == "linear" else f"{self.kinematics}, "
        return f"{kind}{self.modes} {'polynomial' if self.shapes == 'polynomial' else 'mode'}{'s' * (self.modes > 1)}"

    @property
    def name(self) -> str:
        """For keys of arrays."""
        return f"{self.arm}, {self.start}, {1e3 * self.step:g} ms, {self.damping:g}"


def cases(quick: bool) -> list[Case]:
    """All runs; the quick version leaves out 3 and 4 modes."""
    undamped = [Case(m, start, step) for m in (1, 2) for start in STARTS for step in STEPS]
    fast = [] if quick else [Case(m, STARTS[2], step) for m, steps in FAST.items() for step in steps]
    others: list[tuple[Kinematics, ModeShapes]] = [("foreshortened", "cantilever"), ("foreshortened", "polynomial")]
    short = [
        Case(2, start, step, *other)
        for other in (others[:1] if quick else others)
        for start in (STARTS[0], STARTS[2])
        for step in STEPS[2:]
    ]
    short += [] if quick else [Case(3, STARTS[2], step, *others[0]) for step in FAST[3]]
    return [*undamped, *fast, *short, Case(2, STARTS[2], 1e-3, damping=ArmParameters.linear().damping_ratio)]


def run(settings: Settings) -> Findings:
    """Ten minutes of every case (20 s in the quick run)."""
    arrays: dict[str, Array] = {}
    rows = []
    for case in cases(settings.quick):
        settings.progress(case.name)
        time, energy, momentum, row = simulated(case, SHORT if settings.quick else LONG)
        arrays |= {f"energy {case.name}": energy, f"momentum {case.name}": momentum, "time": time}
        rows.append(row)
    quoted = {f"{what}, {row['name']}": row[what] for row in rows for what in ("energy", "momentum")}
    return Findings(_checks(rows), arrays, {"rows": rows}, quoted)


def tables(findings: Findings) -> dict[str, str]:
    """Largest changes by arm and step, worst of all starts."""
    rows = [row for row in findings.records["rows"] if row["damping"] == 0.0]
    steps = sorted({row["step"] for row in rows}, reverse=True)

    def cell(arm: str, step: float) -> str:
        same = [row for row in rows if (row["arm"], row["step"]) == (arm, step)]
        return " / ".join(shown(max(row[what] for row in same)) for what in ("energy", "momentum")) if same else ""

    lines = [[arm, *(cell(arm, step) for step in steps)] for arm in dict.fromkeys(row["arm"] for row in rows)]
    return {"drift_steps": table(("undamped arm", *(f"{1e3 * step:g} ms" for step in steps)), lines)}


def start_state(arm: FlexibleArm, start: str) -> Array:
    """Elbow at 1 rad; tips bent by 0.3 and -0.2 m in the first shape; joints turning at 1 and -0.7 rad/s."""
    m, n = arm.parameters.modes_per_link, arm.size
    state = np.zeros(2 * n)
    state[1] = 1.0
    if "bent" in start:
        state[2], state[2 + m] = 0.3 / arm.modes[0].tip_values[0], -0.2 / arm.modes[1].tip_values[0]
    if "spinning" in start:
        state[n : n + 2] = 1.0, -0.7
    return state


def simulated(case: Case, duration: float) -> tuple[Array, Array, Array, dict[str, Any]]:
    """Run a case.

    Returns:
        Times; energy over its start's, minus 1; angular momentum's change over what the arm would have if it turned
        stiffly with all its energy; and a row of figures.
    """
    arm = FlexibleArm(
        ArmParameters.linear(
            modes_per_link=case.modes,
            damping_ratio=case.damping,
            kinematics=case.kinematics,
            mode_shapes=case.shapes,
        )
    )
    start = start_state(arm, case.start)
    run = arm.simulate(start, None, duration, RECORDED, round(RECORDED / case.step))
    total = run.kinetic_energy + run.strain_energy
    inertia = arm.mass_matrix(start[: arm.size])[0, 0]
    momentum = arm.angular_momentum(run.state) / np.sqrt(2.0 * total[0] * inertia)
    energy, momentum = total / total[0] - 1.0, momentum - momentum[0]
    row = {
        **case._asdict(),
        "arm": case.arm,
        "name": case.name,
        "energy": float(np.abs(energy).max()),
        "momentum": float(np.abs(momentum).max()),
        "bound": loss_bound(arm, case.step, duration),
        "fastest": arm.fastest_rate(),
    }
    return run.time, energy, momentum, row


def loss_bound(arm: FlexibleArm, step: float, duration: float) -> float:
    """Part of the energy that is lost if all of it vibrates at the arm's fastest frequency."""
    return -float(np.expm1(-duration * arm.fastest_rate() ** 6 * step**5 / 72.0))


def _checks(rows: list[dict[str, Any]]) -> list[Check]:
    undamped = [row for row in rows if row["damping"] == 0.0]
    (damped,) = [row for row in rows if row["damping"] > 0.0]
    checks = []
    for arm, step in dict.fromkeys((row["arm"], row["step"]) for row in undamped):
        same = [row for row in undamped if (row["arm"], row["step"]) == (arm, step)]
        checks += _drift_checks(f"{arm}, {1e3 * step:g} ms", same)
    checks.append(_momentum_check("of the damped linear arm, 2 modes, 1 ms", [damped]))
    checks.append(_momentum_check("of the undamped arms, any step", undamped))
    return [*checks, *_order_checks(undamped)]


def _momentum_check(label: str, rows: list[dict[str, Any]]) -> Check:
    return Check(
        "drift",
        f"angular momentum {label}: largest change",
        max(row["momentum"] for row in rows),
        "no inner force changes the sum of the two momenta, in any stage; rounding of up to ten million steps",
        most=ROUNDING,
    )


def _drift_checks(label: str, same: list[dict[str, Any]]) -> list[Check]:
    """Worst of all starts for one number of modes and one step; where the bound says something."""
    if same[0]["bound"] >= USEFUL:
        return []
    fastest = f"at the arm's fastest rate ({shown(same[0]['fastest'])} rad/s)"
    return [
        Check(
            "drift",
            f"energy, {label}: largest relative change",
            max(row["energy"] for row in same),
            f"the method's own loss of a vibration {fastest}, omega^6 h^5 / 72 a second",
            most=same[0]["bound"] + ROUNDING,
        )
    ]


def _energy_order(where: str, order: float) -> Check:
    """Check the order of the energy's drift in the step."""
    why = "a loss of (omega h)^6 / 72 in each of 1 / h steps a second: order 5"
    return Check("drift", f"order of the energy's drift in the step, {where}", order, why, least=4.7, most=5.3)


def _order_checks(undamped: list[dict[str, Any]]) -> list[Check]:
    """How the drift goes with the step: the arm of one mode from the bent start, and the foreshortened arms."""
    rows = [row for row in undamped if row["arm"] == "1 mode" and row["start"] == "bent"]
    steps = [1.0 / row["step"] for row in rows]
    return [
        _energy_order("1 mode, bent start", rate(steps, [row["energy"] for row in rows])),
        *(
            _energy_order(f"{arm}, that furthest from 5", max(orders, key=lambda order: abs(order - 5.0)))
            for arm, orders in foreshortened_orders(undamped).items()
        ),
    ]


def foreshortened_orders(rows: list[dict[str, Any]]) -> dict[str, list[float]]:
    """Order of the energy's drift of each foreshortened arm, from each of its starts, by its two steps."""
    found: dict[str, list[float]] = {}
    for arm, start in dict.fromkeys((row["arm"], row["start"]) for row in rows if row["kinematics"] != "linear"):
        same = [row for row in rows if (row["arm"], row["start"]) == (arm, start)]
        order = rate([1.0 / row["step"] for row in same], [row["energy"] for row in same])
        found.setdefault(arm, []).append(order)
    return found
