"""Results of the board's cells, for studies that measure agents: computed once, and kept."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from flexarm_agents.board.cells import Cell, Store, compute, jobs_of


def results(cells: Sequence[Cell], store: Store) -> list[Any]:
    """Return what a store has of cells, in their order; what is missing is computed and put there.

    Args:
        cells: rows at points.
        store: keeps results.
    """
    by_key = {cell.key: cell for cell in cells}
    for job in jobs_of(store.missing(cells)):
        for key, result in zip(job.keys, compute(job), strict=True):
            store.write(by_key[key], result)
    return [store.read(cell) for cell in cells]
