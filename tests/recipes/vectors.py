"""Ways in which Gymnasium steps several environments: a row of docs/recipes/wrappers.md for each."""

from __future__ import annotations

from typing import Any, NamedTuple


class Vector(NamedTuple):
    """A way to step several environments.

    Attributes:
        name: how it is asked for.
        arguments: of `gymnasium.make_vec`.
        slow: starts processes.
    """

    name: str
    arguments: dict[str, Any]
    slow: bool = False


VECTORS = (
    Vector("`make_vec(id, n)`: the batch", {}),
    Vector('`vectorization_mode="sync"`', {"vectorization_mode": "sync"}),
    Vector(
        '`vectorization_mode="async"`, processes forked',
        {"vectorization_mode": "async", "vector_kwargs": {"context": "fork"}},
        True,
    ),
    Vector(
        '`vectorization_mode="async"`, processes spawned',
        {"vectorization_mode": "async", "vector_kwargs": {"context": "spawn"}},
        True,
    ),
)
