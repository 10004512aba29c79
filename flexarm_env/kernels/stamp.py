"""The stamp of the kernels' memory: saved memory is read only by a version that lays it out in the same way."""

from __future__ import annotations

from collections.abc import Mapping
from hashlib import sha256
from typing import Any

from numpy.typing import NDArray

from flexarm_env.codegen.declarations import Names
from flexarm_env.codegen.memory import ArraySpec
from flexarm_env.kernels.entries import (
    ClockRow,
    Column,
    Constant,
    Drawn,
    Header,
    LaneSetting,
    ReadingRow,
    Segment,
    Setting,
)
from flexarm_env.kernels.layout import Row
from flexarm_env.kernels.variants import Variant

TABLES: tuple[type[Names], ...] = (
    *(Row, Setting, LaneSetting, Constant, Header, ClockRow, ReadingRow, Column, Drawn),
    Segment,
)


class LayoutError(ValueError):
    """Saved memory has another layout than the kernels of this version."""


def layout_stamp(variant: Variant, arrays: Mapping[str, NDArray[Any] | ArraySpec]) -> str:
    """Hash all that says where a number lies: the declared parts of each table, and the shapes of the arrays.

    Args:
        variant: variant of the kernels.
        arrays: that the kernels work on, by name.
    """
    tables = [(table.__name__, list(table.layout(variant).items())) for table in TABLES]
    shapes = [(name, array.shape, array.dtype.str) for name, array in arrays.items()]
    return sha256(repr((variant.kind, tables, shapes)).encode()).hexdigest()[:16]


def check_stamp(what: str, found: str | None, present: str) -> None:
    """Refuse saved memory of another layout.

    Args:
        what: name of what was saved, for the message.
        found: stamp that was saved with it; None: it has none.
        present: stamp of this version.

    Raises:
        LayoutError: if the stamps differ.
    """
    if found != present:
        layout = "no layout stamp" if found is None else f"the layout {found}"
        raise LayoutError(
            f"{what} was saved with {layout}, and this version of flexarm_env reads the layout {present} only: "
            "make it anew, or load it with the version that saved it"
        )
