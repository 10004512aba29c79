"""The bar of a command that runs long."""

from __future__ import annotations

import sys
from typing import Any

from tqdm import tqdm

PATIENCE = 1.0  # before a bar is shown [s]
LOG = 30.0  # the same without a terminal, and between two lines there [s]


def progress_bar(total: int, unit: str) -> tqdm[Any]:
    """Return a bar on stderr; it is shown once it takes long, and taken away in the end.

    Args:
        total: how much there is to do.
        unit: what it is, e.g. "pictures".
    """
    terminal = sys.stderr.isatty()
    pauses = {"delay": PATIENCE} if terminal else {"delay": LOG, "mininterval": LOG}
    return tqdm(total=total, unit=f" {unit}", leave=False, dynamic_ncols=terminal, **pauses)
