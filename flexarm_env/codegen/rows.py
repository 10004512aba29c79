"""Rows of lanes as kernels see them: a numba type whose number of lanes is a part of the type.

In plain Python these are arrays of shape (rows, lanes). A constant distance of the rows, and indices that are not
checked for being negative, let the compiler work on several lanes at once.
"""

from __future__ import annotations

import operator
from typing import Any

from numba.core import types
from numba.core.typing.templates import AbstractTemplate, AttributeTemplate, infer_getattr, infer_global, signature
from numba.extending import lower_builtin, lower_getattr, models, register_model
from numba.np.arrayobj import populate_array

from flexarm_env.codegen.arrays import LaneRows, Memory
from flexarm_env.codegen.declarations import intrinsic
from flexarm_env.codegen.memory import WORD

_ROW: Any = types.Array(types.float64, 1, "C")
_PAIR: Any = types.UniTuple(types.intp, 2)


class Rows(types.Type):
    """Rows of so many lanes."""

    def __init__(self, lanes: int) -> None:
        """Name the type."""
        self.lanes = lanes
        super().__init__(f"Rows({lanes})")


@register_model(Rows)
class _Model(models.StructModel):
    def __init__(self, manager: Any, kind: Rows) -> None:
        super().__init__(manager, kind, [("data", types.CPointer(types.float64)), ("rows", types.intp)])


# --- types ------------------------------------------------------------------------------------------------------------


@infer_global(operator.getitem)
class _Reading(AbstractTemplate):
    def generic(self, arguments: Any, named: Any) -> Any:
        """Type a number, a row, some rows, or all rows from a lane on."""
        kind, place = arguments
        if not isinstance(kind, Rows):
            return None
        if isinstance(place, types.Integer):
            return signature(_ROW, kind, types.intp)
        if isinstance(place, types.SliceType) or isinstance(next(iter(place)), types.SliceType):
            return signature(kind, kind, place)
        return signature(types.float64, kind, _PAIR)


@infer_global(operator.setitem)
class _Writing(AbstractTemplate):
    def generic(self, arguments: Any, named: Any) -> Any:
        """Type a number that is written."""
        return signature(types.none, arguments[0], _PAIR, types.float64) if isinstance(arguments[0], Rows) else None


@infer_getattr
class _Attributes(AttributeTemplate):
    key = Rows

    def resolve_shape(self, kind: Rows) -> Any:
        """Type the shape."""
        return _PAIR


# --- code -------------------------------------------------------------------------------------------------------------


def _place(builder: Any, kind: Rows, rows: Any, row: Any, lane: Any) -> Any:
    return builder.gep(rows.data, [builder.add(builder.mul(row, row.type(kind.lanes)), lane)])


def _number(context: Any, builder: Any, kind: Rows, arguments: Any) -> Any:
    rows = context.make_helper(builder, kind, arguments[0])
    return _place(builder, kind, rows, *(builder.extract_value(arguments[1], n) for n in (0, 1)))


@lower_builtin(operator.getitem, Rows, types.UniTuple)
def _read(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    kind, place = signature.args
    if not isinstance(place.dtype, types.SliceType):
        return builder.load(_number(context, builder, kind, arguments))
    rows = context.make_helper(builder, kind, arguments[0])
    lanes = context.make_helper(builder, place.dtype, builder.extract_value(arguments[1], 1))
    rows.data = builder.gep(rows.data, [lanes.start])
    return rows._getvalue()


@lower_builtin(operator.setitem, Rows, types.UniTuple, types.Float)
def _write(context: Any, builder: Any, signature: Any, arguments: Any) -> None:
    builder.store(arguments[2], _number(context, builder, signature.args[0], arguments))


@lower_builtin(operator.getitem, Rows, types.Integer)
def _row(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    kind, row = signature.args[0], arguments[1]
    array, word = context.make_array(_ROW)(context, builder), row.type(WORD)
    data = _place(builder, kind, context.make_helper(builder, kind, arguments[0]), row, row.type(0))
    populate_array(array, data, [row.type(kind.lanes)], [word], word, None)
    return array._getvalue()


@lower_builtin(operator.getitem, Rows, types.SliceType)
def _some_rows(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    kind, place = signature.args
    rows, asked = context.make_helper(builder, kind, arguments[0]), context.make_helper(builder, place, arguments[1])
    rows.data = _place(builder, kind, rows, asked.start, asked.start.type(0))
    rows.rows = builder.sub(asked.stop, asked.start)
    return rows._getvalue()


@lower_getattr(Rows, "shape")
def _shape(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    rows = context.make_helper(builder, kind, value).rows
    return context.make_tuple(builder, _PAIR, [rows, rows.type(kind.lanes)])


def _lane_rows(typing_context: Any, memory: Any, lanes: Any) -> Any:
    kind = Rows(lanes.literal_value)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array = context.make_array(memory)(context, builder, arguments[0])
        rows = context.make_helper(builder, kind)
        rows.data, rows.rows = array.data, builder.sdiv(array.nitems, array.nitems.type(kind.lanes))
        return rows._getvalue()

    return kind(memory, lanes), generate


@intrinsic(_lane_rows)
def lane_rows(memory: Memory, lanes: int) -> LaneRows:
    """Return the rows of a block that lie one after the other in an array; `lanes` must be the variant's."""
    return memory.reshape(-1, lanes)
