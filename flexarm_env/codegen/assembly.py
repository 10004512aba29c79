"""Assembles the kernels: one module per variant, made when first used; `cache` compiles and keeps them.

A variant fixes what is constant for the compiler: program, modes, velocity forces, sensor model, lanes of a block
(`variants`). Its module is one text: the program's entry points and all that they call, drivers as they are lowered for
the variant (`lowering`), recorded kernels (`recorded`), intrinsics of the processor (`intrinsics`).
The module's name carries a hash of its text.
"""

from __future__ import annotations

import hashlib
from functools import lru_cache
from types import FunctionType, ModuleType
from typing import Any

from flexarm_env.codegen import cache
from flexarm_env.codegen.declarations import AnyVariant, Intrinsic, Recorded, called_in, plain_python
from flexarm_env.codegen.lowering import Lowered, class_text

# Strict IEEE arithmetic: no fast-math, and nothing is fused but what the recorder writes so (`tracing`); "numpy" only
# drops the checks for division by zero, which would keep the compiler from vectorising.
_STRICT = {"error_model": "numpy", "boundscheck": False}
_IMPORTS = """\
from math import log, sqrt

import numpy as np
from llvmlite import ir
from numba import njit
from numba.core import types
from numba.extending import intrinsic
from numba.np.arrayobj import populate_array
from numpy import floor

from flexarm_env.codegen.pipelines import EntryCompiler, PartCompiler
"""
_LIBRARY: dict[str, Any] = {}
exec(_IMPORTS, _LIBRARY)


class _Assembly:
    """Collects the functions of a module."""

    def __init__(self, variant: AnyVariant) -> None:
        self.variant = variant
        self.constants: dict[str, Any] = {}
        self.texts: list[str] = []
        self._functions: dict[str, Any] = {}
        for entry in variant.program.entries(variant.lanes):
            self.collect(entry)

    def collect(self, function: Any) -> None:
        """Write a function after those that it calls."""
        name = function.__name__
        if name in self._functions:
            if self._functions[name] is not function:
                raise ValueError(f"two functions of a kernel module are called {name}")
            return
        self._functions[name] = function
        if function is _LIBRARY.get(name):
            return
        if isinstance(function, Recorded):
            text = function.compiled_text(self.variant)
            calls = called_in(text, function.calls)
        elif isinstance(function, type):
            text, calls = class_text(function), {}
        elif not isinstance(function, FunctionType | Intrinsic):
            raise TypeError(f"{name} of a library: kernel modules do not import it (`assembly._IMPORTS`)")
        else:
            lowered = Lowered(function)
            text, calls = str(lowered), lowered.calls
            for constant, value in lowered.constants.items():
                if self.constants.setdefault(constant, value) != value:
                    raise ValueError(f"two constants of a kernel module are called {constant}")
        for called in calls.values():
            self.collect(called)
        self.texts.append(f"{self._decorator(function)}\n{text}")

    def _decorator(self, function: Any) -> str:
        """Return the decorator that compiles a function; a class, which code of intrinsics uses, has none."""
        if isinstance(function, type):
            return ""
        if isinstance(function, Intrinsic) or (isinstance(function, Recorded) and function.code):
            return "@intrinsic"
        program, lanes, marks = self.variant.program, self.variant.lanes, vars(function)
        if marks.get("inlined_in_its_caller"):
            return _njit("EntryCompiler", inline="always", **_STRICT)
        options: dict[str, Any] = {"nogil": True, **_STRICT, "no_cfunc_wrapper": True}
        if marks.get("per_lane") and lanes > 1:
            options["forceinline"] = True
        if program.closed:
            # Nothing allocates: counting references to arrays, atomically for each lane, takes time.
            options["_nrt"] = False
            if function not in program.entries(lanes):  # a wrapper, and a place of its own in the cache, would as well
                return _njit("PartCompiler", no_cpython_wrapper=True, **options)
            if lanes == 1:  # a step is so short that releasing the interpreter's lock would count
                del options["nogil"]
        return _njit("EntryCompiler", cache=True, **options)


def _njit(compiler: str, **options: Any) -> str:
    listed = ", ".join(f"{name}={value!r}" for name, value in options.items())
    return f"@njit({listed}, pipeline_class={compiler})"


def render(variant: AnyVariant) -> str:
    """Return the source text of a variant's module."""
    with plain_python(variant):
        assembly = _Assembly(variant)
    head = f'"""Assembled by flexarm_env.codegen.assembly for {variant}; do not edit."""\n\n{_IMPORTS}\n'
    constants = "".join(f"{name} = {value!r}\n" for name, value in sorted(assembly.constants.items()))
    return "\n\n".join([head + constants, *assembly.texts])


@lru_cache
def load(variant: AnyVariant) -> ModuleType:
    """Load the module of a variant; its functions are compiled, or found on disk, when they are first called."""
    text = render(variant)
    digest = hashlib.sha256(text.encode()).hexdigest()[:16]
    name = f"flexarm_{variant.kind}_{variant.modes}_{variant.lanes}_{digest}"
    return cache.load_module(name, text, variant.words)
