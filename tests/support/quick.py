"""Recorded kernels as Python runs them sooner: on its own numbers, which take a third of the time of numpy's.

The numbers are the same to the last bit. `run_quickly` exchanges how `Recorded` and `Names` do their work.
"""

from __future__ import annotations

import ast
from collections.abc import Callable
from functools import cache
from math import isfinite, sqrt
from typing import Any

import numpy as np
import pytest

from flexarm_env.codegen import declarations, intrinsics
from flexarm_env.codegen.declarations import Names, Recorded, called_in

_usual_interpreted, _usual_first = declarations._interpreted, Names.first
_places: dict[tuple[type, int], tuple[Any, dict[str, int]]] = {}  # of a table for a variant, which keeps its address


def run_quickly(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let plain Python take its own numbers in recorded kernels, and remember where parts of tables lie."""
    monkeypatch.setattr(declarations, "_interpreted", _interpreted)
    monkeypatch.setattr(Names, "first", _first)


def run_as_usual(monkeypatch: pytest.MonkeyPatch) -> None:
    """Undo `run_quickly`."""
    monkeypatch.setattr(declarations, "_interpreted", _usual_interpreted)
    monkeypatch.setattr(Names, "first", _usual_first)


def _first(names: Names, name: str) -> int:
    """Do as `Names.first`, and remember it for the variant: drivers ask thousands of times in a period."""
    variant = declarations._PRESENT.get(None)  # none: of what is the same for all variants
    _, known = _places.setdefault((type(names), id(variant)), (variant, {}))
    if name not in known:
        known[name] = _usual_first(names, name)
    return known[name]


@cache
def _interpreted(function: Recorded[..., Any], variant: Any) -> Callable[..., Any]:
    """Do as `declarations._interpreted`."""
    quick = _on_own_numbers(function, variant)

    def run(*arguments: Any, **named: Any) -> Any:
        """Give numpy's numbers for numpy's: unlike Python's they divide by zero, and drivers do."""
        found = quick(*map(_own, arguments), **named)
        return tuple(map(_numpys, found)) if isinstance(found, tuple) else _numpys(found)

    return run


@cache
def _on_own_numbers(function: Recorded[..., Any], variant: Any) -> Callable[..., Any]:
    text = function.formula(variant)
    names: dict[str, Any] = {"sqrt": sqrt, "floor": _floor, "quotient": _quotient}
    for name, called in called_in(text, function.calls).items():
        names[name] = _on_own_numbers(called, variant) if isinstance(called, Recorded) else _QUICK.get(name, called)
    tree = ast.fix_missing_locations(_Rewritten().visit(ast.parse(text)))
    exec(compile(tree, f"<{function.__name__} in plain Python>", "exec"), names)
    made: Callable[..., Any] = names[function.__name__]
    return made


class _Rewritten(ast.NodeTransformer):
    """Fused sums in line; numbers of arrays as Python's own; quotients that may divide by zero."""

    def visit_Call(self, node: ast.Call) -> ast.expr:
        self.generic_visit(node)
        if not isinstance(node.func, ast.Name) or node.func.id != "fused":
            return node
        a, b, c = node.args
        return ast.BinOp(ast.BinOp(a, ast.Mult(), b), ast.Add(), c)

    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        self.generic_visit(node)
        if not isinstance(node.op, ast.Div):
            return node
        return ast.Call(ast.Name("quotient", ast.Load()), [node.left, node.right], [])

    def visit_Subscript(self, node: ast.Subscript) -> ast.expr:
        self.generic_visit(node)
        if not isinstance(node.ctx, ast.Load) or isinstance(node.slice, ast.Constant):  # that of a tuple of results
            return node
        return ast.Call(ast.Attribute(node.value, "item", ast.Load()), [node.slice], [])


def _own(number: Any) -> Any:
    return number.item() if isinstance(number, np.float64) else number


def _numpys(number: Any) -> Any:
    return np.float64(number) if isinstance(number, float) else number


def _quotient(a: Any, b: Any) -> Any:
    try:
        return a / b
    except ZeroDivisionError:
        return float(np.float64(a) / b)


def _floor(x: Any) -> Any:
    return float(np.floor(x)) if isinstance(x, float) else np.floor(x)


def _quarter_turns(k: Any, sine: Any, cosine: Any) -> Any:
    if not isinstance(k, float) or not isfinite(k):
        return intrinsics.quarter_turns(k, sine, cosine)
    return ((sine, cosine), (cosine, -sine), (-sine, -cosine), (-cosine, sine))[int(k % 4.0)]


_QUICK = {"quarter_turns": _quarter_turns}
