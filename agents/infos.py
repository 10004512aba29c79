"""One environment's info out of Gymnasium's form for a batch: arrays, and for each a mask of who has it."""

from __future__ import annotations

from typing import Any

_OF_BATCHES = ("final_obs", "final_info")


def info_of(infos: dict[str, Any], index: int) -> dict[str, Any]:
    """The info of one environment, as the single environment would give it.

    Args:
        infos: of a batch.
        index: of the environment.

    Returns:
        A new mapping; its arrays are copies.
    """
    own: dict[str, Any] = {}
    for name, values in infos.items():
        if name.startswith("_") or name in _OF_BATCHES or not infos[f"_{name}"][index]:
            continue
        own[name] = values[index].copy()
    return own
