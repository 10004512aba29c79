"""Records the physics for a kernel module: straight-line code over the lanes of an arena (`codegen.tracing`).

A recorded kernel is declared by its signature and its formula, and called like any driver.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from typing import Any, ParamSpec, TypeVar

from flexarm_env.codegen.arrays import Arena, Four, LaneRows
from flexarm_env.codegen.declarations import Recorded, called_in, recorded
from flexarm_env.codegen.elementary import arctan2, exp_minus, sincos
from flexarm_env.codegen.intrinsics import fused, quarter_turns
from flexarm_env.codegen.tracing import Expression, Trace, clip, recorded_name
from flexarm_env.codegen.vectors import Lowered, VectorWriter, kernel_text, lowered
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

    def __init__(self, variant: Variant, inlining: bool = False, fusing: bool = True) -> None:
        """Begin one for a variant; `inlining` as in `Trace`, `fusing` as in `Trace.lines`."""
        self.variant, self.fusing = variant, fusing
        self.trace = Trace(inlining)
        self.stores: list[tuple[str, Any]] = []

    def read(self, name: str) -> list[Any]:
        """Read the numbers of a part of the arena."""
        first, count = self._part(name)
        lanes = self.variant.lanes
        return self.trace.inputs([f"arena[i + {row * lanes}]" for row in range(first, first + count)])

    def elements(self, array: str, count: int) -> list[Any]:
        """Read the first elements of an array that all lanes share."""
        return self.trace.inputs([f"{array}[{n}]" for n in range(count)])

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

    def sensor(self) -> PointShape:
        """Return where the sensor is."""
        return self.place("SENSOR_POINT" if "SENSOR_POINT_VALUES" in self.variant.rows else "SENSOR")

    def truth(self) -> sensing.Truth:
        """Compute the arm's state, tips and deflections."""
        return sensing.truth(self.constants(), self.place("TIP"), self.read("Y"), self.read("V"))

    def _part(self, name: str) -> tuple[int, int]:
        if name not in self.variant.rows:
            raise LookupError(f"a formula needs Row.{name}: programs of kind {self.variant.kind!r} do not have it")
        return self.variant.rows[name]

    def source(self, name: str, arguments: Sequence[str]) -> str:
        """Write the kernel in plain Python: for each lane, what was recorded, then the stores."""
        body = self.trace.lines([value for _, value in self.stores], self.fusing)
        for place, value in self.stores:
            code = value.name if isinstance(value, Expression) else repr(float(value))
            body.append(f"{place} = {code}")
        lines = "".join(f"        {line}\n" for line in body)
        return f"def {name}({', '.join(arguments)}):\n    for i in range({self.variant.lanes}):\n{lines}"

    def vectors(self, name: str, arguments: Sequence[str]) -> str:
        """Write the kernel as it is compiled (`vectors`)."""
        places, values = [place for place, _ in self.stores], [value for _, value in self.stores]
        kernel = lowered(self.trace, values, arguments, places, self.fusing)
        return kernel_text(name, arguments, self.variant.lanes, kernel, _functions(self.variant, kernel))


def _elimination(variant: Variant, numbers: Sequence[Any]) -> Elimination | None:
    return None if variant.foreshortened else Elimination.unflat(numbers, variant.modes)


class RecordedFunction(Recorded[..., Any]):
    """A function of numbers that recorded kernels call."""

    def __init__(
        self, name: str, record: Callable[[Variant], tuple[Trace, list[str], Sequence[Any]]], calls: Sequence[Any]
    ) -> None:
        """Declare it; `record` gives trace, parameters and results for a variant."""
        super().__init__(name, self._source, calls)
        self._record = record

    def _source(self, variant: Variant) -> str:
        """Write it in plain Python."""
        trace, names, results = self._record(variant)
        lines = [*trace.lines(results), f"return ({', '.join(result.name for result in results)},)"]
        return f"def {self.__name__}({', '.join(names)}):\n" + "".join(f"    {line}\n" for line in lines)

    def lowered(self, variant: Variant) -> Lowered:
        """Return it as it is compiled."""
        trace, names, results = self._record(variant)
        return lowered(trace, results, names)


def _functions(variant: Variant, caller: Lowered) -> dict[str, Lowered]:
    """Find the functions that a record calls, and those that they call."""
    functions = {called.__name__: called for called in CALLED if isinstance(called, RecordedFunction)}
    found: dict[str, Lowered] = {}
    for name in called_in(" ".join(str(operation[0]) for operation in caller.operations), functions):
        function = functions[name].lowered(variant)
        found |= {name: function} | _functions(variant, function)
    return found


def _elementary(formula: Callable[..., Any]) -> RecordedFunction:
    """Declare an elementary function with its sums and products fused."""

    def record(_: Variant) -> tuple[Trace, list[str], Sequence[Any]]:
        """Record it; it is the same for all variants."""
        trace, names = Trace(), list(inspect.signature(formula).parameters)
        found = formula(*trace.inputs(names))
        return trace, names, found if isinstance(found, tuple) else (found,)

    return RecordedFunction(recorded_name(formula), record, INTRINSICS)


def recorded_kernel(record: Callable[[Variant], Recorder]) -> Callable[[Callable[P, R]], Recorded[P, R]]:
    """Declare a kernel by its signature and its record; an argument with a default is dropped if nothing reads it."""

    def declare(signature: Callable[P, R]) -> Recorded[P, R]:
        """Declare the kernel of this signature."""
        name, parameters = signature.__name__, inspect.signature(signature).parameters

        def written(variant: Variant, write: Callable[[Recorder, str, list[str]], str]) -> str:
            r = record(variant)
            arguments = [word for word, one in parameters.items() if one.default is one.empty or r.trace.reads(word)]
            return write(r, name, arguments)

        return recorded(
            lambda variant: written(variant, Recorder.source),
            (*CALLED, VectorWriter),
            lambda variant: written(variant, Recorder.vectors),
        )(signature)

    return declare


def slope_record(variant: Variant) -> tuple[Trace, list[str], Sequence[Any]]:
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
    return trace, [name for group in names for name in group], slope


INTRINSICS = (fused, quarter_turns)
ELEMENTARY = tuple(_elementary(inspect.unwrap(function)) for function in (sincos, exp_minus, arctan2))
slope = RecordedFunction("slope", slope_record, (*INTRINSICS, *ELEMENTARY))
CALLED = (*INTRINSICS, *ELEMENTARY, slope)  # what recorded kernels may call


def slope_kernel_record(variant: Variant) -> Recorder:
    """Record the acceleration alone."""
    r = Recorder(variant)
    known, y, v = [*r.read("CONSTANTS"), *r.read("ELIMINATION")], r.read("Y"), r.read("V")
    turn = sincos(dyn.elbow_turn(y))
    r.store("rates", r.trace.call("slope", [*known, *y, *v, *r.read("TAU"), *turn], len(v)))
    return r


@recorded_kernel(slope_kernel_record)
def slope_kernel(arena: Arena, rates: LaneRows) -> None:
    """Acceleration of the torque-driven arm of every lane.

    Args:
        arena: arena of one block.
        rates: receives v'. Shape (size, lanes).
    """


def step_record(variant: Variant) -> Recorder:
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
    return r


def _tracking_torque(r: Recorder, k: Constants, basis_of: int, state: tuple[Sequence[Any], Sequence[Any]]) -> list[Any]:
    basis = r.trace.inputs([f"bases[{basis_of}][{n}]" for n in range(8)])
    aim = joint_tracking.interpolated(r.read("INNER_FROM"), r.read("INNER_TO"), basis)
    gains = (r.read("STIFFNESS"), r.read("RESISTANCE"))
    tau = joint_tracking.tracking_torque(k, gains, aim, r.read("TAU"), state)
    return [clip(value, -limit, limit) for value, limit in zip(tau, r.read("TORQUE_LIMIT"), strict=True)]


@recorded_kernel(step_record)
def step_kernel(arena: Arena, h: float, bases: tuple[Sequence[float], ...] = ()) -> None:
    """Advance the torque-driven arm of every lane by one step with held torques.

    Args:
        arena: arena of one block.
        h: step [s].
        bases: see `actuation.spline_factors`, at the step's start, middle and end; under the joint-space law only.
    """


def law_record(variant: Variant) -> Recorder:
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
    return r


@recorded_kernel(law_record)
def law_kernel(arena: Arena, h: float, ahead: float, explicit: Four, implicit: Four) -> None:
    """Compute one stage of the closed loop of every lane: earlier stages, then `jacobian_transpose.law_stage`.

    Args:
        arena: arena of one block; results in Y_STAGE, V_STAGE, MECHANICAL, FEEDBACK, TAU.
        h: step [s].
        ahead: time of the stage after the step's start [s].
        explicit: coefficients of the stages before, explicit part.
        implicit: the same, implicit part.
    """


def elimination_record(variant: Variant) -> Recorder:
    """Record the elimination's numbers, from the constants of an arm.

    Rounded as Python rounds it for the kernels whose arms never change (`layout.arm_rows`).
    """
    r = Recorder(variant, fusing=False)
    e = elimination(r.constants())
    assert e is not None
    r.write("ELIMINATION", e.flat())
    return r


@recorded_kernel(elimination_record)
def elimination_kernel(arena: Arena) -> None:
    """Compute the elimination's numbers of every lane's arm, with linear kinematics."""


def reading_record(variant: Variant) -> Recorder:
    """Record what the sensor measures now."""
    r = Recorder(variant)
    r.store("readings", sensing.reading(r.constants(), r.sensor(), variant.sensor, r.read("Y"), r.read("V")))
    return r


@recorded_kernel(reading_record)
def reading_kernel(arena: Arena, readings: LaneRows) -> None:
    """Measure without delay, on every lane: two readings, two rates. Shape (4, lanes)."""


def second_reading_record(variant: Variant) -> Recorder:
    """Record the kernel of the second sensor's present reading."""
    r = Recorder(variant)
    place, link = r.place("SECOND"), variant.second_sensor
    r.store("readings", sensing.point_reading(r.constants(), place, r.read("Y"), r.read("V"), link))
    return r


@recorded_kernel(second_reading_record)
def second_reading_kernel(arena: Arena, readings: LaneRows) -> None:
    """Compute the second sensor's present reading, as `reading_kernel` does for the first. Shape (4, lanes)."""


def outputs_record(variant: Variant) -> Recorder:
    """Record observation, state and tips of a closed loop."""
    r = Recorder(variant)
    truth, reference = r.truth(), r.read("REFERENCE")
    observed = jacobian_transpose.observation(r.constants(), r.law(), variant.sensor, (r.read("Y"), r.read("V")))
    r.write("OBSERVATION", [*observed, *reference])
    r.write("STATE", truth.state)
    r.write("TRUE_TIP", truth.true_tip)
    r.write("RIGID_TIP", truth.rigid_tip)
    return r


@recorded_kernel(outputs_record)
def outputs_kernel(arena: Arena) -> None:
    """Compute sensed position and tips of every lane."""
