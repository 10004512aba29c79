"""The arrays that drivers work on, as types.

Rows of lanes are arrays of shape (rows, lanes) in plain Python, and have a type of their own in kernels (`rows`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Arena = NDArray[np.float64]  # all that is known of a block's environments (`layout.Row`). Shape (rows, lanes)
LaneRows = NDArray[np.float64]  # some rows of lanes. Shape (n, lanes)
History = NDArray[np.float64]  # readings at past steps (`delay_line`). Shape (slots * slot_rows, lanes)

LaneRow = NDArray[np.float64]  # one number of each lane. Shape (lanes,)
Clock = NDArray[np.int64]  # what a lane counts and points to (`entries.ClockRow`). Shape (5, lanes)
Keys = NDArray[np.uint64]  # of the lanes' episodes (`elementary.uniform`). Shape (lanes,)
Mask = NDArray[np.bool_]  # some of the lanes. Shape (lanes,)
Paths = NDArray[np.float64]  # see `polyline.reference_at`. Shape (paths, n, 5)
Path = NDArray[np.float64]  # one of them. Shape (n, 5)
Words = NDArray[np.int64]  # whole numbers (`entries.Header`). Shape (n,)
Table = NDArray[np.float64]  # settings (`entries.Setting`). Shape (n,)
ResetRequest = NDArray[np.float64]  # for a new episode (`entries.Column`). Shape (columns,)
Actions = NDArray[np.float32]  # Shape (lanes, channels)
Observations = NDArray[np.float32]  # Shape (lanes, k)
Memory = NDArray[np.float64]  # of a batch (`memory`). Shape (words,)
Four = tuple[float, float, float, float]
