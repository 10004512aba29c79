"""Compiles the drivers of a variant as they stand; `cache` keeps what numba makes of them.

A variant fixes what is constant for the compiler: program, modes, velocity forces, sensor model, lanes of a block
(`variants`). Each function that a driver names is replaced by what numba takes for it (`Kernels.compiled`), and each
number of the variant by a constant (`pipelines`). The kernels are identified by a hash of all that they are made from.
"""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Callable, Iterator
from functools import cache, lru_cache
from math import log, sqrt
from types import BuiltinFunctionType, CellType, CodeType, FunctionType, SimpleNamespace
from typing import Any

import numpy as np
from numba import njit, types
from numba.core.registry import cpu_target
from numba.extending import intrinsic

from flexarm_env.codegen import intrinsics, memory, pipelines, rows, scalars, tracing, vectors
from flexarm_env.codegen.cache import KernelFolder, check_compiler, keep
from flexarm_env.codegen.declarations import (
    AnyVariant,
    Chosen,
    Intrinsic,
    Names,
    PresentVariant,
    Recorded,
    plain_python,
)
from flexarm_env.lazy import cached_property

# Strict IEEE arithmetic: no fast-math, and nothing is fused but what the recorder writes so (`tracing`); "numpy" only
# drops the checks for division by zero, which would keep the compiler from vectorising.
_STRICT = {"error_model": "numpy", "boundscheck": False, "no_cfunc_wrapper": True}
Entries = SimpleNamespace
# What numba takes for functions of numbers, arrays and expressions.
_OF_NUMBERS: dict[Callable[..., Any], Any] = {
    tracing.root: scalars.root,
    tracing.magnitude: scalars.magnitude,
    tracing.where_less: scalars.where_less,
    tracing.clip: scalars.clip,
    tracing.at_least: scalars.at_least,
    tracing.floor: np.floor,
    tracing.quarter_turns: intrinsics.quarter_turns,
}
_LIBRARY = (sqrt, log, np.floor)  # all other elementary functions are our own (`elementary`)


class Kernels:
    """The functions of a variant, as numba takes them; it compiles one when it is first called."""

    def __init__(self, variant: AnyVariant) -> None:
        """Begin with none."""
        self.variant = variant
        self._entries = variant.program.entries(variant.lanes)
        self._made: dict[Any, Any] = {}
        self._entry_compiler, self._part_compiler = pipelines.compilers(variant, self.compiled)

    def compiled(self, value: Any) -> Any:
        """Return what numba takes for a global of a driver."""
        value = self._chosen(value)
        if not isinstance(value, FunctionType | Intrinsic | Recorded):
            return value
        if value not in self._made:
            self._made[value] = self._make(value)
        return self._made[value]

    def _chosen(self, value: Any) -> Any:
        """Return the function that stands for another one in this variant."""
        if isinstance(value, Chosen):
            return self.variant.program.hooks[value.__name__]
        return _OF_NUMBERS.get(value, value) if isinstance(value, FunctionType) else value

    def _make(self, function: Any) -> Any:
        if isinstance(function, FunctionType):
            compiler = self._entry_compiler if self._is_entry(function) else self._part_compiler
            made = njit(self._named(inspect.unwrap(function)), pipeline_class=compiler, **self._options(function))
            return _of_types(made)
        if isinstance(function, Recorded):
            made = vectors.vector_kernel(function.__name__, self.variant.lanes, function.recording(self.variant))
        else:
            made = intrinsic(prefer_literal=True)(function.code)
        cpu_target.typing_context.refresh()
        return made

    def _named(self, function: FunctionType) -> FunctionType:
        """Copy a function under a name of its own, which its machine code has as a symbol.

        numba numbers functions within a process. Two kernels from disk that different processes compiled would have the
        same symbols, and one would run as the other.
        """
        own = FunctionType(function.__code__, function.__globals__, function.__name__, function.__defaults__)
        own.__qualname__ = f"{self.identity}.{function.__qualname__}"
        own.__module__, own.__annotations__ = function.__module__, function.__annotations__
        return own

    def _is_entry(self, function: Any) -> bool:
        return function in self._entries or not self.variant.program.allocation_free

    def _options(self, function: FunctionType) -> dict[str, Any]:
        options: dict[str, Any] = {"nogil": True, **_STRICT}
        marks = vars(function)
        if marks.get("per_lane") and self.variant.lanes > 1:
            options["forceinline"] = True
        if self.variant.program.allocation_free:
            # Nothing allocates: counting references to arrays, atomically for each lane, takes time.
            options["_nrt"] = False
            if not self._is_entry(function):  # a wrapper would take time
                options["no_cpython_wrapper"] = True
            elif self.variant.lanes == 1:  # a step is so short that releasing the interpreter's lock would count
                del options["nogil"]
        return options

    # --- identity -----------------------------------------------------------------------------------------------------

    @cached_property
    def identity(self) -> str:
        """Hash all that the kernels are made from: bytecode of drivers, recordings, constants, and this compiler."""
        with plain_python(self.variant):
            return self._hashed()

    def _hashed(self) -> str:
        digest, seen = hashlib.sha256(_own_source()), set()
        waiting: list[Any] = list(self._entries)
        while waiting:
            function = waiting.pop()
            if function in seen:
                continue
            seen.add(function)
            if isinstance(function, Recorded):
                digest.update(self._recorded(function).encode())
                continue
            plain = inspect.unwrap(function.code if isinstance(function, Intrinsic) else function)
            options = self._options(function) if isinstance(function, FunctionType) else None
            digest.update(repr((plain.__qualname__, options, plain.__defaults__)).encode())
            for code in _codes(plain.__code__):
                digest.update(repr((code.co_code, _constants(code), code.co_names, code.co_varnames)).encode())
                for name in code.co_names:
                    value = self._chosen(plain.__globals__.get(name))
                    if isinstance(value, FunctionType | Intrinsic | Recorded):
                        waiting.append(value)
                    else:
                        digest.update(self._constant(plain, name, value, code).encode())
        return digest.hexdigest()[:16]

    def _recorded(self, kernel: Recorded[..., Any]) -> str:
        try:
            return repr(kernel.recording(self.variant))
        except LookupError:  # a branch that this variant leaves out calls it
            return f"no {kernel.__name__}"

    def _constant(self, function: FunctionType, name: str, value: Any, code: CodeType) -> str:
        if isinstance(value, Names):
            return repr(value.layout(value.shape()))
        if isinstance(value, PresentVariant):
            return repr([getattr(value, one, None) for one in code.co_names])
        if isinstance(value, int | float | tuple):
            return repr(value)
        if isinstance(value, type):
            return repr((name, getattr(value, "_fields", ())))
        if isinstance(value, BuiltinFunctionType | np.ufunc) and value not in _LIBRARY:
            raise TypeError(
                f"{function.__qualname__}: {name} of a library: kernels do not call it (`compiler._LIBRARY`)"
            )
        return name


def _of_types(dispatcher: Any) -> Any:
    """Let a function be compiled once for the types of its arguments, not for each constant that one of them is."""
    found = dispatcher.get_call_template
    dispatcher.get_call_template = lambda args, kws: found([types.unliteral(one) for one in args], kws)
    return dispatcher


def _codes(code: CodeType) -> Iterator[CodeType]:
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _codes(constant)


def _constants(code: CodeType) -> list[Any]:
    """Return the constants of a function's code, but for its docstring and the code of functions within."""
    constants = [one for one in code.co_consts if not isinstance(one, CodeType)]
    free = tuple(CellType() for _ in code.co_freevars)
    if FunctionType(code, {}, closure=free).__doc__ is not None and code.co_name.isidentifier():
        return constants[1:]  # that of a comprehension or lambda would be an ordinary text
    return constants


@cache
def _own_source() -> bytes:
    modules = (memory, pipelines, rows, vectors, inspect.getmodule(Kernels))
    return "".join(inspect.getsource(module) for module in modules if module is not None).encode()


@lru_cache
def load(variant: AnyVariant) -> Entries:
    """Return the entry points of a variant by name; they are compiled, or found on disk, when they are first called."""
    check_compiler()
    kernels = Kernels(variant)
    name = f"flexarm_{variant.kind}_{variant.modes}_{variant.lanes}_{kernels.identity}"
    folder = KernelFolder(name, variant.description)
    entries: dict[str, Callable[..., Any]] = {}
    for entry in variant.program.entries(variant.lanes):
        entries[entry.__name__] = kernels.compiled(entry)
        keep(entries[entry.__name__], folder)
    return Entries(**entries)
