"""Records the physics for a kernel module: straight-line code over the lanes of an arena (`codegen.tracing`).

A recorded kernel is declared by its signature and its formula, and called like any driver.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from typing import Any, ParamSpec, TypeVar

from flexarm_env.codegen.arrays import Arena, Four, LaneRows
from flexarm_env.codegen.declarations import Recorded, always_inlined, recorded
from flexarm_env.codegen.elementary import arctan2, exp_minus, sincos
from flexarm_env.codegen.intrinsics import aligned_stack, fused, quarter_turns
from flexarm_env.codegen.tracing import Expression, Trace, clip, recorded_name
from flexarm_env.codegen.vectors import VectorWriter, kernel_text
from flexarm_env.control import jacobian_transpose, joint_tracking
from flexarm_env.kernels.layout import elimination_count
from flexarm_env.kernels.tableau import GAMMA, RK4_NODES, RK4_WEIGHTS, STAGES
from flexarm_env.kernels.variants import Variant
from flexarm_env.physics import dynamics as dyn
from flexarm_env.physics import sensing
from flexarm_env.physics.bent_link import PointShape
from flexarm_env.physics.constants import ARM_QUANTITIES, Constants
from flexarm_env.physics.modal_elimination import Elimination, elimination

P = ParamSpec("P")
R = TypeVar("R")


class Recorder:
    """Records one kernel over the lanes of an arena."""

    def __init__(self, variant: Variant, inlining: bool = False) -> None:
        """Begin one for a variant; `inlining` as in `Trace`."""
        self.variant = variant
        self.trace = Trace(inlining)
        self.stores: list[tuple[str, Any]] = []
        self.shared: list[str] = []

    def read(self, name: str) -> list[Any]:
        """Read the numbers of a part of the arena."""
        first, count = self._part(name)
        lanes = self.variant.lanes
        return self.trace.inputs([f"arena[i + {row * lanes}]" for row in range(first, first + count)])

    def elements(self, array: str, count: int) -> list[Any]:
        """Read the first elements of an array that all lanes share, before the loop.

        Within it the compiler would have to make sure that no lane's results overwrite them, at a cost that keeps it
        from vectorising short loops.
        """
        self.shared += [f"{array}_{n} = {array}[{n}]" for n in range(count)]
        return self.trace.inputs([f"{array}_{n}" for n in range(count)])

    def rows_of(self, array: str, count: int, first: int = 0) -> list[Any]:
        """Rows of another array than the arena, from the first on."""
        rows = range(first, first + count)
        return self.trace.inputs([f"{array}[i + {row * self.variant.lanes}]" for row in rows])

    def one(self, name: str) -> Any:
        """Read the number of a part of one row."""
        return self.read(name)[0]

    def write(self, name: str, values: Sequence[Any]) -> None:
        """Enter a part of the arena."""
        first, count = self._part(name)
        assert len(values) == count, f"{name}: {len(values)} values for {count} rows"
        self.store("arena", values, first)

    def store(self, array: str, values: Sequence[Any], first: int = 0) -> None:
        """Store into rows of an array, from the first on."""
        places = (f"{array}[i + {row * self.variant.lanes}]" for row in range(first, first + len(values)))
        self.stores += zip(places, values, strict=True)

    def constants(self) -> Constants:
        """Read the constants of the arm."""
        return Constants.unflat(self.read("CONSTANTS"), self.variant.modes, self.variant.foreshortened)

    def constant_derivatives(self) -> list[Constants]:
        """Of the constants, by each quantity."""
        changes = self.read("CHANGES")
        each = len(changes) // len(ARM_QUANTITIES)
        parts = [changes[n : n + each] for n in range(0, len(changes), each)]
        return [Constants.unflat(part, self.variant.modes, self.variant.foreshortened) for part in parts]

    def elimination(self) -> Elimination | None:
        """Read the elimination that follows from the constants."""
        return _elimination(self.variant, self.read("ELIMINATION"))

    def law(self) -> jacobian_transpose.Law:
        """Read the numbers of the law."""
        fields = {}
        for name, count in jacobian_transpose.Law.sizes(self.variant.modes, self.variant.foreshortened).items():
            values = self.read(name.upper())
            scalar = count == 1 and name not in ("sensor_values", "sensor_foreshortening")
            fields[name] = values[0] if scalar else values
        return jacobian_transpose.Law(**fields)

    def place(self, name: str) -> PointShape:
        """Return a point of a link, by its name."""
        return PointShape(
            self.one(f"{name}_DISTANCE"), self.read(f"{name}_VALUES"), self.read(f"{name}_FORESHORTENING")
        )

    def _part(self, name: str) -> tuple[int, int]:
        if name not in self.variant.rows:
            raise LookupError(f"a formula needs Row.{name}: programs of kind {self.variant.kind!r} do not have it")
        return self.variant.rows[name]

    def source(self, word: str, fusing: bool = True) -> str:
        """Write the kernel: for each lane, what was recorded, then the stores; `fusing` as in `Trace.lines`."""
        body = self.trace.lines([value for _, value in self.stores], fusing)
        for place, value in self.stores:
            code = value.name if isinstance(value, Expression) else repr(float(value))
            body.append(f"{place} = {code}")
        lines = "".join(f"        {line}\n" for line in body)
        before = ["aligned_stack()"] * (self.variant.lanes > 1) + self.shared
        head = "".join(f"    {line}\n" for line in before)
        return f"def {word}:\n{head}    for i in range({self.variant.lanes}):\n{lines}"

    def vectors(self, name: str, arguments: Sequence[str]) -> str:
        """Text of the kernel as an intrinsic in vectors of lanes, for a record without calls (`vectors`)."""
        return kernel_text(self.trace, self.stores, name, arguments, self.variant.lanes)


def _elimination(variant: Variant, numbers: Sequence[Any]) -> Elimination | None:
    return None if variant.foreshortened else Elimination.unflat(numbers, variant.modes)


def _elementary(formula: Callable[..., Any]) -> Recorded[..., Any]:
    """Declare an elementary function with its sums and products fused, which the recorded kernels call."""

    def text(variant: Variant) -> str:
        """Return the text, which is the same for all variants."""
        trace = Trace()
        names = list(inspect.signature(formula).parameters)
        found = formula(*trace.inputs(names))
        results = found if isinstance(found, tuple) else (found,)
        lines = [*trace.lines(results), f"return ({', '.join(result.name for result in results)},)"]
        return f"def {recorded_name(formula)}({', '.join(names)}):\n" + "".join(f"    {line}\n" for line in lines)

    return always_inlined(Recorded(recorded_name(formula), text, INTRINSICS))


INTRINSICS = (fused, quarter_turns, aligned_stack)
ELEMENTARY = tuple(_elementary(inspect.unwrap(function)) for function in (sincos, exp_minus, arctan2))
SHARED = (*INTRINSICS, *ELEMENTARY)  # what recorded kernels may call


def recorded_in_vectors(record: Callable[[Variant], Recorder]) -> Callable[[Callable[P, R]], Recorded[P, R]]:
    """Declare a kernel by its signature and its record without calls; it is compiled in vectors of lanes."""

    def declare(signature: Callable[P, R]) -> Recorded[P, R]:
        """Declare the kernel of this signature."""
        name, arguments = signature.__name__, list(inspect.signature(signature).parameters)
        word = f"{name}({', '.join(arguments)})"
        return recorded(
            lambda variant: record(variant).source(word),
            (*INTRINSICS, VectorWriter),
            lambda variant: record(variant).vectors(name, arguments),
        )(signature)

    return declare


def slope_source(variant: Variant) -> str:
    """Compute v' of one arm from its constants (`layout.arm_rows`), y, v, torques, S and C, in this order."""
    trace, size = Trace(), variant.size
    counts = {
        "k": variant.constants,
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
    return f"def slope({parameters}):\n" + "".join(f"    {line}\n" for line in lines)


slope: Recorded[..., Any] = always_inlined(Recorded("slope", slope_source, SHARED))


def step_source(variant: Variant) -> str:
    """Record one step of the classical Runge-Kutta method; with the joint-space law for the kind "tracking".

    All four stages in one pass over the lanes, so that slopes and their sum stay in registers. A stage's positions need
    the velocities of the stage before, but not its slope, so its sine is at hand early: the two are worked out side by
    side. (After the last stage comes none: what is written for it no result needs, and `Trace.lines` leaves it out.)
    Twice a slope is a sum, since units that only add are idle while others multiply.
    """
    r = Recorder(variant)
    known, h, y, v = [*r.read("CONSTANTS"), *r.read("ELIMINATION")], r.trace.input("h"), r.read("Y"), r.read("V")
    stage_y, stage_v, turn = y, v, sincos(dyn.elbow_turn(y))
    total: list[Any] = []
    for node, next_node, weight in zip(RK4_NODES, (*RK4_NODES[1:], 0.0), RK4_WEIGHTS, strict=True):
        assert weight in (1.0, 2.0)
        ahead = h * next_node
        next_y = [a + ahead * b for a, b in zip(y, stage_v, strict=True)]
        next_turn = sincos(dyn.elbow_turn(next_y))
        acting = r.read("TAU")
        if variant.tracking:
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
    return r.source("step_kernel(arena, h" + (", bases)" if variant.tracking else ")"))


def _tracking_torque(r: Recorder, k: Constants, basis_of: int, state: tuple[Sequence[Any], Sequence[Any]]) -> list[Any]:
    basis = r.trace.inputs([f"bases[{basis_of}][{n}]" for n in range(8)])
    aim = joint_tracking.interpolated(r.read("INNER_FROM"), r.read("INNER_TO"), basis)
    gains = (r.read("STIFFNESS"), r.read("RESISTANCE"))
    tau = joint_tracking.tracking_torque(k, gains, aim, r.read("TAU"), state)
    return [clip(value, -limit, limit) for value, limit in zip(tau, r.read("TORQUE_LIMIT"), strict=True)]


@recorded(step_source, (slope, *SHARED))
def step_kernel(arena: Arena, h: float, bases: tuple[Sequence[float], ...] = ()) -> None:
    """Advance the torque-driven arm of every lane by one step with held torques.

    Args:
        arena: arena of one block.
        h: step [s].
        bases: see `actuation.spline_factors`, at the step's start, middle and end; under the joint-space law only.
    """


def law_source(variant: Variant) -> str:
    """Record one stage of the closed loop."""
    r = Recorder(variant)
    h, ahead = r.trace.input("h"), r.trace.input("ahead")
    y, v_known = r.read("Y"), r.read("V")
    size = len(y)
    slots = [r.read(name) for name in ("V_SLOTS", "MECHANICAL_SLOTS", "FEEDBACK_SLOTS")]
    for slot in range(STAGES):
        explicit, implicit = (h * r.trace.input(f"{name}[{slot}]") for name in ("explicit", "implicit"))
        v, mechanical, feedback = (values[slot * size : (slot + 1) * size] for values in slots)
        y = [a + explicit * b for a, b in zip(y, v, strict=True)]
        v_known = [a + (explicit * b + implicit * c) for a, b, c in zip(v_known, mechanical, feedback, strict=True)]
    law = r.law()
    here = [[x + vx * ahead, y + vy * ahead, vx, vy] for x, y, vx, vy in (law.command_1, law.command_2)]
    law = law._replace(command_1=here[0], command_2=here[1])
    options = (variant.complete, variant.sensor if variant.law_on_sensor else "rigid", variant.rate_jacobian)
    stage = jacobian_transpose.law_stage(r.constants(), r.elimination(), law, options, y, v_known, h * GAMMA)
    r.write("Y_STAGE", y)
    r.write("V_STAGE", stage.v)
    r.write("MECHANICAL", stage.mechanical)
    r.write("FEEDBACK", stage.feedback)
    r.write("TAU", stage.tau)
    return r.source("law_kernel(arena, h, ahead, explicit, implicit)")


@recorded(law_source, SHARED)
def law_kernel(arena: Arena, h: float, ahead: float, explicit: Four, implicit: Four) -> None:
    """Compute one stage of the closed loop of every lane: earlier stages, then `jacobian_transpose.law_stage`.

    Args:
        arena: arena of one block; results in Y_STAGE, V_STAGE, MECHANICAL, FEEDBACK, TAU.
        h: step [s].
        ahead: time of the stage after the step's start [s].
        explicit: coefficients of the stages before, explicit part.
        implicit: the same, implicit part.
    """


def elimination_source(variant: Variant) -> str:
    """Record the elimination's numbers, from the constants of an arm.

    Rounded as Python rounds it for the kernels whose arms never change (`layout.arm_rows`).
    """
    r = Recorder(variant)
    e = elimination(r.constants())
    assert e is not None
    r.write("ELIMINATION", e.flat())
    return r.source("elimination_kernel(arena)", fusing=False)


@recorded(elimination_source, SHARED)
def elimination_kernel(arena: Arena) -> None:
    """Compute the elimination's numbers of every lane's arm, with linear kinematics."""


def reading_source(variant: Variant) -> str:
    """Record what the sensor measures now."""
    r = Recorder(variant)
    place = r.place("SENSOR_POINT")
    r.store("readings", sensing.reading(r.constants(), place, variant.sensor, r.read("Y"), r.read("V")))
    return r.source("reading_kernel(arena, readings)")


@recorded(reading_source, SHARED)
def reading_kernel(arena: Arena, readings: LaneRows) -> None:
    """Measure without delay, on every lane: two readings, two rates. Shape (4, lanes)."""


def second_reading_source(variant: Variant) -> str:
    """Record the kernel of the second sensor's present reading."""
    r = Recorder(variant)
    place, link = r.place("SECOND"), variant.second_sensor
    r.store("readings", sensing.point_reading(r.constants(), place, r.read("Y"), r.read("V"), link))
    return r.source("second_reading_kernel(arena, readings)")


@recorded(second_reading_source, SHARED)
def second_reading_kernel(arena: Arena, readings: LaneRows) -> None:
    """Compute the second sensor's present reading, as `reading_kernel` does for the first. Shape (4, lanes)."""


def truth_source(variant: Variant) -> str:
    """Record state, tips and deflections."""
    r = Recorder(variant)
    truth = sensing.truth(r.constants(), r.place("TIP"), r.read("Y"), r.read("V"))
    for name, values in truth._asdict().items():
        r.write(name.upper(), values)
    return r.source("truth_kernel(arena)")


@recorded(truth_source, SHARED)
def truth_kernel(arena: Arena) -> None:
    """Compute state, tips and deflections of every lane."""
