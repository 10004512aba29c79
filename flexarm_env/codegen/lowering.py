"""Turns a driver into the text that is compiled for the present variant, and finds what it calls.

Numbers that the variant settles become constants, branches that it rules out are left out, and arrays with a row of
lanes at the end become flat (`arrays`). What remains of a row that the variant does not have is an error.
"""

from __future__ import annotations

import ast
import inspect
import operator
import re
from collections.abc import Callable
from functools import cache
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np

from flexarm_env.codegen.arrays import LANED
from flexarm_env.codegen.declarations import Chosen, Intrinsic, Names, PresentVariant, Recorded, present_variant
from flexarm_env.codegen.scalars import COMPILED

_COMPARISONS: dict[type[ast.cmpop], Callable[[Any, Any], bool]] = {
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
}
_ARITHMETIC: dict[type[ast.operator], Callable[[int, int], int]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
}
_UNKNOWN = object()
LANES = "VARIANT_LANES"


class Lowered(ast.NodeTransformer):
    """A function as it is compiled.

    Attributes:
        tree: its definition.
        constants: that it uses, by name.
        calls: other functions that it uses, by name.
    """

    def __init__(self, function: Any) -> None:
        """Lower a driver for the present variant; an intrinsic's code as it stands."""
        self.constants: dict[str, Any] = {}
        self.calls: dict[str, Any] = {}
        source = inspect.unwrap(function.code if isinstance(function, Intrinsic) else function)
        self._globals, self._name = source.__globals__, f"{source.__module__}.{source.__qualname__}"
        definition = _definition(source)
        self._locals = _local_names(source.__code__)
        self._zeros: set[str] = set()  # counters of loops of a single turn
        self._laned = {
            argument.arg: LANED[argument.annotation.id]
            for argument in definition.args.args
            if isinstance(argument.annotation, ast.Name) and argument.annotation.id in LANED
        }
        self.tree: ast.FunctionDef = self.visit(definition)
        self.tree.name = function.__name__

    def __str__(self) -> str:
        """Return the text."""
        return ast.unparse(self.tree) + "\n"

    # --- statements ------------------------------------------------------------------------------------------------

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.FunctionDef:
        """Lower a function, without decorators, annotations and documentation."""
        arguments = [ast.arg(argument.arg) for argument in node.args.args]
        defaults = [self.visit(default) for default in node.args.defaults]
        body = _undocumented(node)
        plain = ast.arguments([], arguments, None, [], [], None, defaults)
        return ast.FunctionDef(name=node.name, args=plain, body=self._statements(body), decorator_list=[], lineno=0)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> ast.stmt | list[ast.stmt]:
        """Drop the annotation, and flatten the shape of an array with a row of lanes at its end."""
        if node.value is None:
            return []
        target, value = self.visit(node.target), self.visit(node.value)
        if isinstance(node.annotation, ast.Name) and isinstance(node.target, ast.Name) and node.annotation.id in LANED:
            self._laned[node.target.id] = LANED[node.annotation.id]
            if isinstance(value, ast.Call):
                value.args = [_flat_shape(argument) for argument in value.args]
        return ast.Assign(targets=[target], value=value, lineno=0)

    def visit_If(self, node: ast.If) -> ast.stmt | list[ast.stmt]:
        """Keep only the branch that the variant leaves."""
        known = self._known(node.test)
        if known is not _UNKNOWN:
            return self._statements(node.body if known else node.orelse, empty=False)
        return ast.If(self.visit(node.test), self._statements(node.body), self._statements(node.orelse, empty=False))

    def visit_For(self, node: ast.For) -> ast.stmt | list[ast.stmt]:
        """Lower a loop; one of a single turn becomes what it repeats, which compiles sooner."""
        if isinstance(node.iter, ast.Call) and len(node.iter.args) == 1 and _plain_loop(node):
            (count,) = node.iter.args
            if self._known(count) == 1:
                return self._only_turn(node)
            if isinstance(count, ast.IfExp) and self._known(count.body) == 1 and self._known(count.orelse) == 0:
                turn = ast.For(node.target, ast.Call(node.iter.func, [count.body], []), node.body, [])
                return self.visit_If(ast.If(count.test, [turn], []))
        return ast.For(self.visit(node.target), self.visit(node.iter), self._statements(node.body), [], None, lineno=0)

    def _statements(self, body: list[ast.stmt], empty: bool = True) -> list[ast.stmt]:
        found: list[ast.stmt] = []
        for statement in body:
            lowered = self.visit(statement)
            found += lowered if isinstance(lowered, list) else [lowered]
        return found if found or not empty else [ast.Pass()]

    # --- expressions -----------------------------------------------------------------------------------------------

    def visit_IfExp(self, node: ast.IfExp) -> ast.expr:
        """Keep only what the variant leaves."""
        known = self._known(node.test)
        if known is not _UNKNOWN:
            return self.visit(node.body if known else node.orelse)
        return self.generic_visit(node)  # type: ignore[return-value]

    def visit_BoolOp(self, node: ast.BoolOp) -> ast.expr:
        """Drop the operands that the variant settles."""
        settled = isinstance(node.op, ast.Or)  # the value that decides alone
        kept = []
        for operand in node.values:
            known = self._known(operand)
            if known is _UNKNOWN:
                kept.append(operand)
            elif bool(known) == settled:
                return ast.Constant(settled) if not kept else self.generic_visit(node)  # type: ignore[return-value]
        if len(kept) < 2:
            return self.visit(kept[0]) if kept else ast.Constant(not settled)
        return ast.BoolOp(node.op, [self.visit(operand) for operand in kept])

    def visit_Attribute(self, node: ast.Attribute) -> ast.expr:
        """Replace a named place, or an attribute of the variant, by a constant."""
        value = self._attribute(node)
        if value is _UNKNOWN:
            return self.generic_visit(node)  # type: ignore[return-value]
        assert isinstance(node.value, ast.Name)
        return self._constant(f"{node.value.id}_{node.attr}".upper(), value)

    def visit_Subscript(self, node: ast.Subscript) -> ast.expr:
        """Make one index of the last two, of arrays with a row of lanes at the end."""
        shape = node.value
        if isinstance(shape, ast.Attribute) and shape.attr == "shape" and self._leading(shape.value) == 0:
            return self._index(self.generic_visit(node), ast.FloorDiv(), self._lanes())  # type: ignore[arg-type]
        leading = self._leading(node.value)
        indices = list(node.slice.elts) if isinstance(node.slice, ast.Tuple) else [node.slice]
        indices = [self.visit(index) for index in indices]
        if leading is not None and len(indices) > leading:
            indices[leading:] = [self._flat(indices[leading:])]
        place = indices[0] if len(indices) == 1 else ast.Tuple(indices, ast.Load())
        return ast.Subscript(self.visit(node.value), place, node.ctx)

    def visit_Name(self, node: ast.Name) -> ast.expr:
        """Collect a constant, or a function, of the driver's module."""
        if node.id in self._zeros:
            return ast.Constant(0)
        if node.id in self._locals or node.id not in self._globals:
            return node
        value = self._globals[node.id]
        if isinstance(value, int | float | tuple):
            return self._constant(node.id, value)
        if isinstance(value, ModuleType | type):
            return node
        called = COMPILED.get(value, value)
        if isinstance(called, Chosen):
            called = present_variant().program.parts[called.__name__]
        if not isinstance(called, FunctionType | BuiltinFunctionType | np.ufunc | Recorded | Intrinsic):
            raise TypeError(f"{self._name}: {node.id} is a {type(value).__name__}, which is not known to the assembler")
        self.calls[called.__name__] = called
        return ast.Name(called.__name__, node.ctx)

    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        """Work out what the variant settles of whole numbers."""
        return self._calculated(self.visit(node.left), node.op, self.visit(node.right))

    # --- inside ----------------------------------------------------------------------------------------------------

    def _attribute(self, node: ast.expr) -> Any:
        """Return the value of a named place or of what the variant says, or `_UNKNOWN`."""
        if not isinstance(node, ast.Attribute) or not isinstance(node.value, ast.Name):
            return _UNKNOWN
        names = self._globals.get(node.value.id) if node.value.id not in self._locals else None
        if not isinstance(names, Names | PresentVariant):
            return _UNKNOWN
        try:
            return getattr(names, node.attr)
        except LookupError as error:
            raise LookupError(f"{self._name}: {error.args[0]}") from None

    def _known(self, node: ast.expr) -> Any:
        """Return the value of an expression where the variant settles it, or `_UNKNOWN`."""
        if isinstance(node, ast.Constant):
            return node.value
        if isinstance(node, ast.Attribute):
            return self._attribute(node)
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
            value = self._known(node.operand)
            return _UNKNOWN if value is _UNKNOWN else not value
        if isinstance(node, ast.BoolOp):
            values = [self._known(operand) for operand in node.values]
            decisive = isinstance(node.op, ast.Or)
            if values[0] is not _UNKNOWN and bool(values[0]) == decisive:
                return decisive
            return _UNKNOWN if _UNKNOWN in values else any(values) if decisive else all(values)
        if isinstance(node, ast.Compare) and len(node.ops) == 1:
            left, right = self._known(node.left), self._known(node.comparators[0])
            if left is not _UNKNOWN and right is not _UNKNOWN:
                return _COMPARISONS[type(node.ops[0])](left, right)
        return _UNKNOWN

    def _constant(self, name: str, value: Any) -> ast.Name:
        self.constants[name] = value
        return ast.Name(name, ast.Load())

    def _lanes(self) -> ast.Name:
        return self._constant(LANES, present_variant().lanes)

    def _leading(self, node: ast.expr) -> int | None:
        """Return the axes before a row of lanes and its number, of an array that has them."""
        return self._laned.get(node.id) if isinstance(node, ast.Name) else None

    def _flat(self, indices: list[ast.expr]) -> ast.expr:
        """Make one index of a row and a lane; a row alone, rows, and rows from a lane on become a slice."""
        rows, lane = indices[0], indices[1] if len(indices) > 1 else None
        if isinstance(rows, ast.Slice):
            if isinstance(lane, ast.Slice):  # all rows from a lane on
                assert rows.lower is None and rows.upper is None, self._name
                return lane
            assert lane is None and rows.upper is not None, self._name
            return ast.Slice(self._times(rows.lower or ast.Constant(0)), self._times(rows.upper))
        if lane is None:
            return ast.Slice(self._times(rows), self._times(self._index(rows, ast.Add(), ast.Constant(1))))
        return self._index(lane, ast.Add(), self._times(rows))

    def _times(self, rows: ast.expr) -> ast.expr:
        return self._index(rows, ast.Mult(), self._lanes())

    def _only_turn(self, loop: ast.For) -> list[ast.stmt]:
        """Lower what a loop of a single turn repeats."""
        assert isinstance(loop.target, ast.Name)
        self._zeros.add(loop.target.id)
        body = self._statements(loop.body, empty=False)
        self._zeros.remove(loop.target.id)
        return body

    def _index(self, left: ast.expr, operation: ast.operator, right: ast.expr) -> ast.expr:
        """Work out an operation on indices."""
        a, b = self._whole(left), self._whole(right)
        if b == (1 if isinstance(operation, ast.Mult | ast.FloorDiv) else 0):
            return left
        if a == 0 and isinstance(operation, ast.Add):
            return right
        return self._calculated(left, operation, right)

    def _calculated(self, left: ast.expr, operation: ast.operator, right: ast.expr) -> ast.expr:
        """Work out an operation on whole numbers where the variant settles both."""
        a, b = self._whole(left), self._whole(right)
        calculate = _ARITHMETIC.get(type(operation))
        if a is not None and b is not None and calculate is not None:
            return ast.Constant(calculate(a, b))
        return ast.BinOp(left, operation, right)

    def _whole(self, node: ast.expr) -> int | None:
        """Return a whole number that the variant settles."""
        value = self.constants.get(node.id) if isinstance(node, ast.Name) else getattr(node, "value", None)
        return value if type(value) is int and isinstance(node, ast.Name | ast.Constant) else None


def _plain_loop(loop: ast.For) -> bool:
    """Whether all turns of a loop are complete."""
    left = any(isinstance(inner, ast.Break | ast.Continue) for inner in ast.walk(loop))
    return isinstance(loop.target, ast.Name) and not left


def _flat_shape(argument: ast.expr) -> ast.expr:
    """Merge the last two lengths of a shape."""
    if isinstance(argument, ast.Tuple) and len(argument.elts) == 2:
        return ast.Tuple([ast.BinOp(argument.elts[0], ast.Mult(), argument.elts[1])], ast.Load())
    return argument


class _Plain(ast.NodeTransformer):
    """Leaves out annotations and documentation."""

    def visit_ClassDef(self, node: ast.ClassDef) -> ast.AST:
        """Strip a class."""
        node.body = _undocumented(node)
        return self.generic_visit(node)

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        """Strip a method."""
        node.body, node.returns = _undocumented(node), None
        return self.generic_visit(node)

    def visit_arg(self, node: ast.arg) -> ast.arg:
        """Strip an argument."""
        return ast.arg(node.arg)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> ast.Assign | None:
        """Strip an assignment."""
        return ast.Assign([node.target], self.visit(node.value), lineno=0) if node.value else None


def class_text(kind: type) -> str:
    """Text of a class that the code of intrinsics uses, as it stands."""
    return ast.unparse(_Plain().visit(ast.parse(inspect.getsource(kind)))) + "\n"


def _undocumented(node: ast.FunctionDef | ast.ClassDef) -> list[ast.stmt]:
    return node.body[1:] if ast.get_docstring(node, clean=False) is not None else node.body


def _local_names(code: CodeType) -> set[str]:
    """Collect the local names of a function and those within it."""
    inner = [constant for constant in code.co_consts if isinstance(constant, CodeType)]
    return set(code.co_varnames).union(*map(_local_names, inner))


@cache
def _text(module: ModuleType) -> str:
    return inspect.getsource(module)


def _definition(function: FunctionType) -> ast.FunctionDef:
    """Return the syntax tree of a function of a module, without its decorators.

    Parsing the function alone is much faster than finding it in the module's tree. The function ends before the
    next line that is neither indented nor the end of its signature.
    """
    module = inspect.getmodule(function)
    assert module is not None
    text = re.search(rf"^def {function.__name__}\(.*\n(?:(?:[ \t)].*)?\n)*", _text(module), re.MULTILINE)
    assert text is not None
    (definition,) = ast.parse(text[0]).body
    assert isinstance(definition, ast.FunctionDef)
    return definition
