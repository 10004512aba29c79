"""What drivers declare for the compiler (`compiler`): places in tables, recorded kernels, intrinsics, programs.

A driver is a plain function of numpy arrays. Where its numbers lie, and what its recorded kernels compute, depends on
the present variant of the kernels, which `plain_python` sets; in compiled kernels these are constants.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from functools import cache, update_wrapper
from typing import Any, ClassVar, Generic, ParamSpec, Protocol, Self, TypeVar, overload

from flexarm_env.codegen.plain import python_kernel
from flexarm_env.codegen.tracing import Recording

Function = Callable[..., Any]
F = TypeVar("F", bound=Callable[..., Any])
P = ParamSpec("P")
R = TypeVar("R", covariant=True)


@dataclass
class _Present:
    """The variant that drivers run for.

    Attributes:
        variant: the variant.
        known: its attributes, and first places of parts of its tables: drivers read thousands in a period.
    """

    variant: Any
    known: dict[Any, Any] = field(default_factory=dict)


_PRESENT: ContextVar[_Present] = ContextVar("variant")


@contextmanager
def plain_python(variant: Any) -> Iterator[None]:
    """Let drivers run in plain Python for a variant, on arrays as their annotations say (`arrays`)."""
    token = _PRESENT.set(_present(variant))
    try:
        yield
    finally:
        _PRESENT.reset(token)


@cache
def _present(variant: Any) -> _Present:
    return _Present(variant)


def _of_context() -> _Present:
    try:
        return _PRESENT.get()
    except LookupError:
        raise RuntimeError("no variant is set: drivers run within `with plain_python(variant):`") from None


def present_variant() -> Any:
    """Return the variant that drivers run for.

    Raises:
        RuntimeError: outside `plain_python`.
    """
    return _of_context().variant


class PresentVariant:
    """The variant that drivers run for, as a name that they import; compiled, its attributes are constants."""

    def __getattr__(self, name: str) -> Any:
        known = _of_context().known
        if name not in known:
            known[name] = getattr(present_variant(), name)
        return known[name]


# --- places -----------------------------------------------------------------------------------------------------------


class Entry:
    """A named part of a table; a driver reads the number of its first place.

    Attributes:
        name: that it is declared under.
        meaning: what lies there.
        unit: unit of the numbers.
        size: how many places, a number or a function of the table's shape.
        groups: tables whose shape has one of these groups have the part; none: all have it.
    """

    name: str

    def __init__(
        self, meaning: str, unit: str, size: int | Callable[[Any], int] = 1, groups: Iterable[str] = ()
    ) -> None:
        self.meaning, self.unit, self.size, self.groups = meaning, unit, size, frozenset(groups)

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    @overload
    def __get__(self, instance: None, owner: type) -> Self: ...
    @overload
    def __get__(self, instance: Names, owner: type) -> int: ...
    def __get__(self, instance: Names | None, owner: type) -> Self | int:
        """Return the number of the first place, or the declaration itself when read from the class."""
        if instance is None:
            return self
        present = _PRESENT.get(None)
        if present is None:  # a fixed table's places are the same in all variants
            return instance.first(self.name)
        if self not in present.known:
            present.known[self] = instance.first(self.name)
        place: int = present.known[self]
        return place

    def count(self, shape: Any) -> int | None:
        """Return how many places it takes in a table of this shape; None if the table does not have it."""
        if self.groups and not self.groups & shape.groups:
            return None
        return self.size if isinstance(self.size, int) else self.size(shape)


class Names:
    """The parts of a table in their order; the present variant says where each lies.

    Attributes:
        entries: all that are declared.
    """

    entries: ClassVar[tuple[Entry, ...]] = ()

    def __init_subclass__(cls) -> None:
        cls.entries += tuple(part for part in vars(cls).values() if isinstance(part, Entry))

    @classmethod
    def layout(cls, shape: Any) -> dict[str, tuple[int, int]]:
        """Return the first place and number of places of each part that a table of this shape has."""
        return _layout(cls.entries, shape)

    def shape(self) -> Any:
        """Return what the layout depends on: the present variant."""
        return present_variant()

    def first(self, name: str) -> int:
        """Return the first place of a part.

        Raises:
            LookupError: where the table does not have the part.
        """
        shape = self.shape()
        layout = self.layout(shape)
        if name not in layout:
            kind = shape.program.name
            raise LookupError(f"{type(self).__name__}.{name}: programs of kind {kind!r} do not have it")
        return layout[name][0]


@cache
def _layout(parts: tuple[Entry, ...], shape: Any) -> dict[str, tuple[int, int]]:
    return in_a_row({part.name: count for part in parts if (count := part.count(shape)) is not None})


def in_a_row(sizes: Mapping[str, int]) -> dict[str, tuple[int, int]]:
    """Return the first place and number of places of parts of these sizes that follow each other."""
    places, first = {}, 0
    for name, count in sizes.items():
        places[name] = (first, count)
        first += count
    return places


class FixedNames(Names):
    """The parts of a table that is the same for all variants."""

    def shape(self) -> None:
        """Return None: the layout depends on nothing."""
        return None

    def first(self, name: str) -> int:
        """Return the first place of a part."""
        return self.layout(None)[name][0]


# --- functions --------------------------------------------------------------------------------------------------------


class Intrinsic(Generic[P, R]):
    """A function that numba cannot express: its meaning in plain Python, and the code that compiles it."""

    __name__: str

    def __init__(self, meaning: Callable[P, R], code: Function) -> None:
        self.meaning, self.code = meaning, code
        update_wrapper(self, meaning)

    def __call__(self, *arguments: P.args, **named: P.kwargs) -> R:
        """Run it in plain Python."""
        return self.meaning(*arguments, **named)


def intrinsic(code: Function) -> Callable[[Callable[P, R]], Intrinsic[P, R]]:
    """Declare a function as an intrinsic; `code`: what `numba.extending.intrinsic` takes."""
    return lambda meaning: Intrinsic(meaning, code)


class Recorded(Generic[P, R]):
    """A kernel whose formula is recorded for each variant.

    Attributes:
        recording: its recording for a variant.
    """

    __name__: str

    def __init__(self, signature: Callable[P, R], recording: Callable[[Any], Recording]) -> None:
        self.recording = recording
        update_wrapper(self, signature)

    def __call__(self, *arguments: P.args, **named: P.kwargs) -> R:
        """Run the recording for the present variant in plain Python."""
        function: Callable[P, R] = _in_python(self, present_variant())
        return function(*arguments, **named)


@cache
def _in_python(function: Recorded[..., Any], variant: Any) -> Function:
    return python_kernel(function.recording(variant), variant.lanes)


class Chosen(Generic[P, R]):
    """A function that is declared by its signature; each program names the one that it has (`Program.hooks`)."""

    __name__: str

    def __init__(self, signature: Callable[P, R]) -> None:
        update_wrapper(self, signature)

    def __call__(self, *arguments: P.args, **named: P.kwargs) -> R:
        """Run the one of the present variant's program."""
        function: Callable[P, R] = present_variant().program.hooks[self.__name__]
        return function(*arguments, **named)


def per_lane(function: F) -> F:
    """Mark a driver that is called for each lane with many arrays: in blocks of several lanes it is inlined.

    To pass the arrays would take longer than the work itself. In a block of one lane the compiler decides, which takes
    it less time.
    """
    function.__dict__["per_lane"] = True
    return function


# --- programs ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False, repr=False)
class Program:
    """What a kind of kernels does, with all that its entry points call.

    Attributes:
        name: name of the kind.
        entry_points: functions that Python calls.
        single_entry_points: those of a block of one lane; none: the same.
        groups: groups of parts that its tables have (`Entry`).
        hooks: functions that it chooses (`Chosen`), by name.
        reward_terms: how many.
        allocation_free: Python calls the entry points only, and nothing allocates memory.
        description: what it does, for the user who waits for the compiler.
    """

    name: str
    entry_points: tuple[Any, ...]
    single_entry_points: tuple[Any, ...] = ()
    groups: frozenset[str] = frozenset()
    hooks: Mapping[str, Function] = field(default_factory=dict)
    reward_terms: int = 0
    allocation_free: bool = False
    description: str = ""

    def __repr__(self) -> str:
        return self.name

    def entries(self, lanes: int) -> tuple[Any, ...]:
        """Return the entry points of a variant."""
        return self.single_entry_points if lanes == 1 and self.single_entry_points else self.entry_points


class AnyVariant(Protocol):
    """What the compiler requires of a variant, which must be hashable."""

    @property
    def program(self) -> Program:
        """What its kernels do."""

    @property
    def kind(self) -> str:
        """Name of the program."""

    @property
    def modes(self) -> int:
        """Per link."""

    @property
    def lanes(self) -> int:
        """Environments in a block."""

    @property
    def description(self) -> str:
        """Description for the user who waits for the compiler."""
