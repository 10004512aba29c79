"""Records the physics for a kernel module: straight-line code over the lanes of an arena (`codegen.tracing`)."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from flexarm_env.codegen.elementary import arctan2, exp_minus, sincos
from flexarm_env.codegen.tracing import Expression, Trace, clip, recorded_name
from flexarm_env.control import jacobian_transpose, joint_tracking
from flexarm_env.episode import features, reward
from flexarm_env.kernels import imex
from flexarm_env.kernels.layout import constant_count, elimination_count, layout
from flexarm_env.kernels.rk4 import RK4_NODES, RK4_WEIGHTS
from flexarm_env.physics import dynamics as dyn
from flexarm_env.physics import sensing
from flexarm_env.physics.bent_link import Place
from flexarm_env.physics.constants import Constants
from flexarm_env.physics.modal_elimination import Elimination, elimination

# Strict IEEE arithmetic: no fast-math, and nothing is fused but what the recorder writes so (`tracing`); "numpy" only
# drops the checks for division by zero, which would keep the compiler from vectorising.
DECORATOR = '@njit(cache=True, nogil=True, error_model="numpy", boundscheck=False, no_cfunc_wrapper=True)\n'
# A function that must become a part of its caller, or the caller's loop over lanes is not vectorised.
INLINED = DECORATOR.replace(")\n", ", forceinline=True)\n")


@dataclass(frozen=True)
class Variant:
    """What a kernel module is compiled for.

    Attributes:
        kind: see `rows`.
        modes: per link.
        complete: complete velocity forces, or C_r.
        lanes: environments in a block.
        sensor: "rigid" or "true" ("collocated" is "rigid" without delay).
        rate_jacobian: "delayed" or "current" (where the law acts).
        late: the law acts on the sensor's late readings; False: on the joints' own, whatever the sensor.
        own_paths: each episode draws a path of its own (environments only).
        foreshortened: kinematics (`links`).
        disturbed: noise, jitter, dropouts, a sensor with a clock of its own, or late torques can occur (environments
            only); to compile them takes a tenth of the time that all takes.
    """

    kind: str
    modes: int
    complete: bool
    lanes: int
    sensor: str = "rigid"
    rate_jacobian: str = "delayed"
    late: bool = True
    own_paths: bool = False
    foreshortened: bool = False
    disturbed: bool = False

    @property
    def rows(self) -> dict[str, tuple[int, int]]:
        """Layout of its arenas."""
        return layout(self.kind, self.modes, self.foreshortened)


class _Recorder:
    """Records one kernel over the lanes of an arena."""

    def __init__(self, variant: Variant) -> None:
        self.variant = variant
        self.trace = Trace()
        self.stores: list[tuple[str, Any]] = []
        self.shared: list[str] = []

    def read(self, name: str) -> list[Any]:
        first, count = self.variant.rows[name]
        lanes = self.variant.lanes
        return self.trace.inputs([f"arena[i + {row * lanes}]" for row in range(first, first + count)])

    def elements(self, array: str, count: int) -> list[Any]:
        """The first elements of an array that all lanes share, read before the loop.

        Within it the compiler would have to make sure that no lane's results overwrite them, at a cost that keeps it
        from vectorising short loops.
        """
        self.shared += [f"{array}_{n} = {array}[{n}]" for n in range(count)]
        return self.trace.inputs([f"{array}_{n}" for n in range(count)])

    def one(self, name: str) -> Any:
        return self.read(name)[0]

    def write(self, name: str, values: Sequence[Any]) -> None:
        first, count = self.variant.rows[name]
        assert len(values) == count, f"{name}: {len(values)} values for {count} rows"
        self.store("arena", values, first)

    def store(self, array: str, values: Sequence[Any], first: int = 0) -> None:
        """Into rows of an array, from the first on."""
        places = (f"{array}[i + {row * self.variant.lanes}]" for row in range(first, first + len(values)))
        self.stores += zip(places, values, strict=True)

    def constants(self) -> Constants:
        return Constants.unflat(self.read("CONSTANTS"), self.variant.modes, self.variant.foreshortened)

    def elimination(self) -> Elimination | None:
        return _elimination(self.variant, self.read("ELIMINATION"))

    def law(self) -> jacobian_transpose.Law:
        fields = {}
        for name, count in jacobian_transpose.Law.sizes(self.variant.modes, self.variant.foreshortened).items():
            values = self.read(name.upper())
            scalar = count == 1 and name not in ("sensor_values", "sensor_foreshortening")
            fields[name] = values[0] if scalar else values
        return jacobian_transpose.Law(**fields)

    def place(self, name: str) -> Place:
        return Place(self.one(f"{name}_DISTANCE"), self.read(f"{name}_VALUES"), self.read(f"{name}_FORESHORTENING"))

    def sensor(self) -> Place:
        return self.place("SENSOR" if self.variant.kind == "loop" else "PLACE")

    def truth(self) -> sensing.Truth:
        return sensing.truth(self.constants(), self.place("TIP"), self.read("Y"), self.read("V"))

    def source(self, header: str, fusing: bool = True) -> str:
        """Text of the kernel: for each lane, what was recorded, then the stores; `fusing` as in `Trace.lines`."""
        body = self.trace.lines([value for _, value in self.stores], fusing)
        for place, value in self.stores:
            code = value.name if isinstance(value, Expression) else repr(float(value))
            body.append(f"{place} = {code}")
        lines = "".join(f"        {line}\n" for line in body)
        before = ["aligned_stack()"] * (self.variant.lanes > 1) + self.shared
        head = "".join(f"    {line}\n" for line in before)
        return f"{DECORATOR}def {header}:\n{head}    for i in range({self.variant.lanes}):\n{lines}\n\n"


def _elimination(variant: Variant, numbers: Sequence[Any]) -> Elimination | None:
    return None if variant.foreshortened else Elimination.unflat(numbers, variant.modes)


def elementary_source(variant: Variant) -> str:
    """The elementary functions that the kernels call."""
    text = ""
    for function in (sincos, exp_minus, arctan2):
        formula, trace = inspect.unwrap(function), Trace()
        names = list(inspect.signature(formula).parameters)
        found = formula(*trace.inputs(names))
        results = found if isinstance(found, tuple) else (found,)
        lines = [*trace.lines(results), f"return ({', '.join(result.name for result in results)},)"]
        text += f"{INLINED}def {recorded_name(formula)}({', '.join(names)}):\n"
        text += "".join(f"    {line}\n" for line in lines) + "\n\n"
    return text


def slope_source(variant: Variant) -> str:
    """v' of one arm from what kernels know of it (`rows.arm_rows`), y, v, torques, S and C, in this order."""
    trace, size = Trace(), 2 * variant.modes + 2
    counts = {
        "k": constant_count(variant.modes, variant.foreshortened),
        "e": elimination_count(variant.modes, variant.foreshortened),
        "y": size,
        "v": size,
        "tau": 2,
        "turn": 2,
    }
    names = [[f"{name}{n}" for n in range(count)] for name, count in counts.items()]
    constants, known, y, v, tau, (sin, cos) = map(trace.inputs, names)
    k, e = Constants.unflat(constants, variant.modes, variant.foreshortened), _elimination(variant, known)
    sin_theta2 = None if variant.complete else sincos(dyn.joint_angles(k, y)[1])[0]
    slope = dyn.acceleration(k, e, variant.complete, y, v, tau, (cos, sin, sin_theta2))
    lines = [*trace.lines(slope), f"return {', '.join(value.name for value in slope)}"]
    parameters = ", ".join(name for group in names for name in group)
    return f"{INLINED}def slope({parameters}):\n" + "".join(f"    {line}\n" for line in lines) + "\n\n"


def step_source(variant: Variant) -> str:
    """One step of the classical Runge-Kutta method; under the inner law where the kind is "tracking".

    All four stages in one pass over the lanes, so that slopes and their sum stay in registers. A stage's positions need
    the velocities of the stage before, but not its slope, so its sine is at hand early: the two are worked out side by
    side. (After the last stage comes none: what is written for it no result needs, and `Trace.lines` leaves it out.)
    Twice a slope is a sum, since units that only add are idle while others multiply.
    """
    r = _Recorder(variant)
    known, h, y, v = [*r.read("CONSTANTS"), *r.read("ELIMINATION")], r.trace.input("h"), r.read("Y"), r.read("V")
    stage_y, stage_v, turn = y, v, sincos(dyn.elbow_turn(y))
    total: list[Any] = []
    for node, next_node, weight in zip(RK4_NODES, (*RK4_NODES[1:], 0.0), RK4_WEIGHTS, strict=True):
        assert weight in (1.0, 2.0)
        ahead = h * next_node
        next_y = [a + ahead * b for a, b in zip(y, stage_v, strict=True)]
        next_turn = sincos(dyn.elbow_turn(next_y))
        acting = r.read("TAU")
        if variant.kind == "tracking":
            acting = _tracking_torque(r, r.constants(), round(2 * node), (stage_y, stage_v))
            if not total:
                r.write("STAGE_TORQUE", acting)
        slope = r.trace.call("slope", [*known, *stage_y, *stage_v, *acting, *turn], len(v))
        each = [*stage_v, *slope] if weight == 1.0 else [a + a for a in (*stage_v, *slope)]
        total = [a + b for a, b in zip(total, each, strict=True)] if total else each
        stage_y, stage_v, turn = next_y, [a + ahead * b for a, b in zip(v, slope, strict=True)], next_turn
    sixth = h / 6.0
    moved = [a + sixth * b for a, b in zip([*y, *v], total, strict=True)]
    r.write("Y", moved[: len(y)])
    r.write("V", moved[len(y) :])
    return r.source("step_kernel(arena, h" + (", bases)" if variant.kind == "tracking" else ")"))


def _tracking_torque(
    r: _Recorder, k: Constants, basis_of: int, state: tuple[Sequence[Any], Sequence[Any]]
) -> list[Any]:
    basis = r.trace.inputs([f"bases[{basis_of}][{n}]" for n in range(8)])
    aim = joint_tracking.interpolated(r.read("INNER_FROM"), r.read("INNER_TO"), basis)
    gains = (r.read("STIFFNESS"), r.read("RESISTANCE"))
    tau = joint_tracking.tracking_torque(k, gains, aim, r.read("TAU"), state)
    return [clip(value, -limit, limit) for value, limit in zip(tau, r.read("TORQUE_LIMIT"), strict=True)]


def law_source(variant: Variant) -> str:
    """One stage of the closed loop."""
    r = _Recorder(variant)
    h, ahead = r.trace.input("h"), r.trace.input("ahead")
    y, v_known = r.read("Y"), r.read("V")
    size = len(y)
    slots = [r.read(name) for name in ("V_SLOTS", "MECHANICAL_SLOTS", "FEEDBACK_SLOTS")]
    for slot in range(imex.STAGES):
        explicit, implicit = (h * r.trace.input(f"{name}[{slot}]") for name in ("explicit", "implicit"))
        v, mechanical, feedback = (values[slot * size : (slot + 1) * size] for values in slots)
        y = [a + explicit * b for a, b in zip(y, v, strict=True)]
        v_known = [a + (explicit * b + implicit * c) for a, b, c in zip(v_known, mechanical, feedback, strict=True)]
    law = r.law()
    here = [[x + vx * ahead, y + vy * ahead, vx, vy] for x, y, vx, vy in (law.command_1, law.command_2)]
    law = law._replace(command_1=here[0], command_2=here[1])
    options = (variant.complete, variant.sensor if variant.late else "rigid", variant.rate_jacobian)
    stage = jacobian_transpose.law_stage(r.constants(), r.elimination(), law, options, y, v_known, h * imex.GAMMA)
    r.write("Y_STAGE", y)
    r.write("V_STAGE", stage.v)
    r.write("MECHANICAL", stage.mechanical)
    r.write("FEEDBACK", stage.feedback)
    r.write("TAU", stage.tau)
    return r.source("law_kernel(arena, h, ahead, explicit, implicit)")


def elimination_source(variant: Variant) -> str:
    """What elimination knows of an arm, from its constants; nothing with foreshortened kinematics.

    Rounded as Python rounds it for the kernels whose arms never change (`rows.arm_rows`).
    """
    r = _Recorder(variant)
    e = elimination(r.constants())
    if e is None:
        return ""
    r.write("ELIMINATION", e.flat())
    return r.source("elimination_kernel(arena)", fusing=False)


def reading_source(variant: Variant) -> str:
    """What the sensor measures now."""
    r = _Recorder(variant)
    r.store("readings", sensing.reading(r.constants(), r.sensor(), variant.sensor, r.read("Y"), r.read("V")))
    return r.source("reading_kernel(arena, readings)")


def outputs_source(variant: Variant) -> str:
    """Observation, state, tips and tracking terms of a closed loop."""
    r = _Recorder(variant)
    truth, reference = r.truth(), r.read("REFERENCE")
    observed = jacobian_transpose.observation(r.constants(), r.law(), variant.sensor, (r.read("Y"), r.read("V")))
    r.write("OBSERVATION", [*observed, *reference])
    r.write("STATE", truth.state)
    r.write("TRUE_TIP", truth.true_tip)
    r.write("RIGID_TIP", truth.rigid_tip)
    r.write("REWARD_TERMS", [0.5 * term for term in reward.tracking_terms(truth.true_tip, reference)[:2]])
    return r.source("outputs_kernel(arena)")


def truth_source(variant: Variant) -> str:
    """State, tips and deflections of an environment's arm."""
    r = _Recorder(variant)
    truth = r.truth()
    for name, values in truth._asdict().items():
        r.write(name.upper(), values)
    return r.source("truth_kernel(arena)")


def features_source(variant: Variant) -> str:
    """What observations are made of, and the reward's terms."""
    r = _Recorder(variant)
    names = ("measured", "reference", "joint", "sensed", "sensor_error", "sensor_error_rate")
    known = features.Known(
        **{name: r.read(name.upper()) for name in names},
        lengths=(r.trace.input("length_1"), r.trace.input("length_2")),
        phase=r.one("PHASE"),
        frame=r.one("FRAME"),
    )
    for name, values in features.features(known)._asdict().items():
        r.write(("" if name == "frame_axis" else "F_") + name.upper(), values)
    terms = reward.tracking_terms(r.read("TRUE_TIP"), r.read("REFERENCE"))
    terms += reward.regularising_terms(r.one("ACTION_CHANGE"), r.read("TORQUE"), r.read("DEFLECTION_RATE"))
    weighted = [weight * term for weight, term in zip(r.elements("weights", len(terms)), terms, strict=True)]
    r.write("REWARD_TERMS", weighted)
    total = weighted[0]
    for term in weighted[1:]:
        total = total + term
    r.write("REWARD", [total])
    return r.source("features_kernel(arena, length_1, length_2, weights)")


def joint_source(variant: Variant) -> str:
    """Joint angles and rates of the rigid arm whose tip is on the reference."""
    r = _Recorder(variant)
    lengths = (r.trace.input("length_1"), r.trace.input("length_2"))
    r.write("JOINT", features.joint_aim(lengths, r.trace.input("branch"), r.read("REFERENCE"), r.read("JOINT")[0]))
    return r.source("joint_kernel(arena, length_1, length_2, branch)")


_COMMON = (elimination_source, reading_source, truth_source, features_source, joint_source)
RECORDED: dict[str, tuple[Callable[[Variant], str], ...]] = {
    "open": (elementary_source, slope_source, step_source),
    "loop": (elementary_source, law_source, reading_source, outputs_source),
    "torque": (elementary_source, slope_source, step_source, *_COMMON),
    "tracking": (elementary_source, slope_source, step_source, *_COMMON),
    "gain": (elementary_source, law_source, *_COMMON),
}
