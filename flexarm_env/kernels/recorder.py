"""Records formulas for a kernel module: straight-line code over the lanes of an arena (`codegen.tracing`).

A recorded kernel (`recorded`) is declared by its signature and its record, and called like any driver.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from typing import Any, ParamSpec, TypeVar

from flexarm_env.codegen.declarations import Recorded, called_in, recorded
from flexarm_env.codegen.elementary import arctan2, exp_minus, sincos
from flexarm_env.codegen.intrinsics import fused, quarter_turns
from flexarm_env.codegen.tracing import Expression, Trace, recorded_name
from flexarm_env.codegen.vectors import Lowered, VectorWriter, kernel_text, lowered
from flexarm_env.control import jacobian_transpose
from flexarm_env.kernels.layout import elimination_count
from flexarm_env.kernels.variants import Variant
from flexarm_env.physics import dynamics as dyn
from flexarm_env.physics.bent_link import PointShape
from flexarm_env.physics.constants import ARM_QUANTITIES, Constants
from flexarm_env.physics.modal_elimination import Elimination
from flexarm_env.physics.sensing import Mount

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

    def mount(self, n: int) -> Mount:
        """Return where the further sensor n is."""
        values, slopes, foreshortening = (
            rows[n * len(rows) // count : (n + 1) * len(rows) // count]
            for count in [len(self.variant.sensors)]
            for rows in map(self.read, ("FURTHER_VALUES", "FURTHER_SLOPES", "FURTHER_FORESHORTENING"))
        )
        point = PointShape(self.read("FURTHER_DISTANCE")[n], values, foreshortening)
        return Mount(self.variant.sensors[n][1], point, slopes)

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
    """Compute of one arm v, and p' without the motors' part, from its constants (`layout.arm_rows`), y, p, S and C."""
    trace, size = Trace(), variant.size
    counts = {
        "k": variant.constants,
        "e": elimination_count(variant.modes, variant.foreshortened),
        "y": size,
        "p": size,
        "turn": 2,
    }
    names = [[f"{name}{n}" for n in range(count)] for name, count in counts.items()]
    constants, known, y, p, (sin, cos) = map(trace.inputs, names)
    k, e = Constants.unflat(constants, variant.modes, variant.foreshortened), _elimination(variant, known)
    v = dyn.solve(k, e, dyn.inertia(k, e, y, cos, sin), p)
    rate = dyn.momentum_rate(k, variant.complete, y, v, (0.0, 0.0), (cos, sin, sine_of_theta2(variant, k, y)))
    return trace, [name for group in names for name in group], [*v, *rate]


def sine_of_theta2(variant: Variant, k: Constants, y: Sequence[Any]) -> Any:
    """Return the sine that the paper's C_r needs; None where it does not act."""
    return None if variant.complete else sincos(dyn.joint_angles(k, y)[1])[0]


INTRINSICS = (fused, quarter_turns)
ELEMENTARY = tuple(_elementary(inspect.unwrap(function)) for function in (sincos, exp_minus, arctan2))
slope = RecordedFunction("slope", slope_record, (*INTRINSICS, *ELEMENTARY))
CALLED = (*INTRINSICS, *ELEMENTARY, slope)  # what recorded kernels may call
