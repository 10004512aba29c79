"""One environment's info, extracted from that of a batch: arrays, each with a mask of the environments that have it."""

from __future__ import annotations

from typing import Any

_OF_BATCHES = ("final_obs", "final_info")


def info_of(infos: dict[str, Any], index: int) -> dict[str, Any]:
    """Extract the info of one environment, as the single environment would give it.

    Args:
        infos: info of a batch.
        index: index of the environment.

    Returns:
        A new mapping; its arrays are copies.
    """
    own: dict[str, Any] = {}
    for name, values in infos.items():
        if name.startswith("_") or name in _OF_BATCHES or not infos[f"_{name}"][index]:
            continue
        own[name] = values[index].copy()
    return own
