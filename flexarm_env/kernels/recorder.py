"""Records formulas for a kernel module: straight-line code over the lanes of an arena (`codegen.tracing`).

A recorded kernel (`recorded`) is declared by a formula that takes a recorder first, and called like any driver.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any, Concatenate, ParamSpec, cast

from flexarm_env.codegen.declarations import Recorded
from flexarm_env.codegen.elementary import arctan2, exp_minus, sincos
from flexarm_env.codegen.tracing import Recording, Trace, recorded_name
from flexarm_env.control import jacobian_transpose
from flexarm_env.kernels.variants import Variant
from flexarm_env.physics import dynamics as dyn
from flexarm_env.physics.bent_link import PointShape
from flexarm_env.physics.constants import ARM_QUANTITIES, Constants
from flexarm_env.physics.modal_elimination import Elimination
from flexarm_env.physics.sensing import Mount

P = ParamSpec("P")


class Recorder:
    """Records one kernel over the lanes of an arena."""

    def __init__(self, variant: Variant, inlining: bool = False, fusing: bool = True) -> None:
        """Begin one for a variant; `inlining` as in `Trace`, `fusing` as in `Trace.recording`."""
        self.variant, self.fusing = variant, fusing
        self.trace = Trace(inlining)
        self.stores: list[tuple[tuple[str, int], Any]] = []

    def read(self, name: str) -> list[Any]:
        """Read the numbers of a part of the arena."""
        first, count = self._part(name)
        return self.rows_of("arena", count, first)

    def rows_of(self, array: str, count: int, first: int = 0) -> list[Any]:
        """Read rows of an array, from the first on."""
        return [self.trace.row(array, row) for row in range(first, first + count)]

    def one(self, name: str) -> Any:
        """Read the number of a part of one row."""
        return self.read(name)[0]

    def write(self, name: str, values: Sequence[Any]) -> None:
        """Write a part of the arena."""
        first, count = self._part(name)
        assert len(values) == count, f"{name}: {len(values)} values for {count} rows"
        self.store("arena", values, first)

    def store(self, array: str, values: Sequence[Any], first: int = 0) -> None:
        """Store into rows of an array, from the first on."""
        self.stores += (((array, first + n), value) for n, value in enumerate(values))

    def constants(self) -> Constants:
        """Read the constants of the arm."""
        return self._constants_of(self.read("CONSTANTS"))

    def constant_derivatives(self) -> list[Constants]:
        """Read the derivatives of the arm's constants by each quantity."""
        changes = self.read("CHANGES")
        each = len(changes) // len(ARM_QUANTITIES)
        parts = [changes[n : n + each] for n in range(0, len(changes), each)]
        return [self._constants_of(part) for part in parts]

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

    def _constants_of(self, numbers: Sequence[Any]) -> Constants:
        return Constants.unflat(numbers, self.variant.modes, self.variant.foreshortened, self.variant.dry)

    def _part(self, name: str) -> tuple[int, int]:
        if name not in self.variant.rows:
            raise LookupError(f"a formula needs Row.{name}: programs of kind {self.variant.kind!r} do not have it")
        return self.variant.rows[name]

    def recording(self, parameters: Sequence[str]) -> Recording:
        """Complete the recording of a kernel with these parameters."""
        places, values = [place for place, _ in self.stores], [value for _, value in self.stores]
        kernel = self.trace.recording(parameters, values, places, self.fusing)
        return kernel._replace(functions=_functions(self.variant, kernel))


def _elimination(variant: Variant, numbers: Sequence[Any]) -> Elimination | None:
    return None if variant.foreshortened else Elimination.unflat(numbers, variant.modes)


def _functions(variant: Variant, caller: Recording) -> dict[str, Recording]:
    """Return the recordings of the functions that one calls, and of those that they call."""
    found: dict[str, Recording] = {}
    for name in {str(one.what[0]) for one in caller.operations if one.name == "call"} & set(_FUNCTIONS):
        function = _recorded_function(name, variant)
        found |= {name: function} | _functions(variant, function)
    return dict(sorted(found.items()))


@cache
def _recorded_function(name: str, variant: Variant) -> Recording:
    return _FUNCTIONS[name](variant)


def _elementary(formula: Callable[..., Any]) -> Callable[[Variant], Recording]:
    """Return what records an elementary function, with its sums and products fused."""

    def record(_: Variant) -> Recording:
        trace, names = Trace(), list(inspect.signature(formula).parameters)
        found = formula(*map(trace.number, names))
        return trace.recording(names, found if isinstance(found, tuple) else (found,))

    return record


def recorded_by(make: Callable[[Variant], Any]) -> Callable[[Callable[Concatenate[Any, P], None]], Recorded[P, None]]:
    """Declare a kernel by its formula: a function of a recorder and of the kernel's arguments; numbers are symbols.

    An argument with a default is dropped if nothing reads it.

    Args:
        make: makes the recorder.
    """

    def declare(formula: Callable[Concatenate[Any, P], None]) -> Recorded[P, None]:
        _, *parameters = inspect.signature(formula).parameters.values()

        def recording(variant: Variant) -> Recording:
            r: Recorder = make(variant)
            numbers = (r.trace.number(one.name) if one.annotation in (float, "float") else None for one in parameters)
            formula(r, *numbers)  # type: ignore[arg-type, call-arg]
            read = (one.name for one in parameters if one.default is one.empty or r.trace.reads(one.name))
            return r.recording(list(read))

        return Recorded(cast(Callable[P, None], formula), recording)

    return declare


def _slope(variant: Variant) -> Recording:
    """Record v, and p' without the motors' part, of one arm from its constants (`layout.arm_rows`), y, p, S and C."""
    trace, size = Trace(), variant.size
    counts = {
        "k": variant.constants,
        "e": variant.rows["ELIMINATION"][1],
        "y": size,
        "p": size,
        "turn": 2,
    }
    names = [[f"{name}{n}" for n in range(count)] for name, count in counts.items()]
    constants, known, y, p, (sin, cos) = ([trace.number(name) for name in group] for group in names)
    k = Constants.unflat(constants, variant.modes, variant.foreshortened, variant.dry)
    e = _elimination(variant, known)
    v = dyn.solve(k, e, dyn.inertia(k, e, y, cos, sin), p)
    rate = dyn.momentum_rate(k, variant.complete, y, v, (0.0, 0.0), (cos, sin, sine_of_theta2(variant, k, y)))
    return trace.recording([name for group in names for name in group], [*v, *rate])


def sine_of_theta2(variant: Variant, k: Constants, y: Sequence[Any]) -> Any:
    """Return the sine that the paper's C_r needs; None where it does not act."""
    return None if variant.complete else sincos(dyn.joint_angles(k, y)[1])[0]


recorded_kernel = recorded_by(Recorder)
# What recorded kernels may call, by name.
_FUNCTIONS: dict[str, Callable[[Variant], Recording]] = {
    recorded_name(formula): _elementary(formula) for formula in map(inspect.unwrap, (sincos, exp_minus, arctan2))
}
_FUNCTIONS["slope"] = _slope
