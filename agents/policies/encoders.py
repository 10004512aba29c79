"""`Encoder`: what stands between observations and a network, and remembers from step to step; past readings as one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from flexarm_agents.policies.history import Array, History

Memory = tuple[NDArray[Any], ...]  # each with a leading axis of n arms
# Blocks that the task's clock alone decides: there is nothing to remember of them.
CLOCKED = ("reference_position", "reference_velocity", "previews", "lap_phase")


class Encoder(Protocol):
    """Turns the observations of n arms into a network's inputs."""

    @property
    def size(self) -> int:
        """Length of an observation."""

    @property
    def inputs(self) -> int:
        """How many numbers the network sees."""

    def begin(self, observations: Array) -> tuple[Array, Memory]:
        """Return inputs and memory of arms whose episode begins. Shape (n, size)."""

    def go_on(self, observations: Array, memory: Memory) -> tuple[Array, Memory]:
        """Return inputs and memory after the next observations. Shape (n, size)."""


@dataclass(frozen=True)
class Stacked:
    """Present and past readings.

    Attributes:
        history: which past ones.
        size: length of an observation.
    """

    history: History
    size: int

    @property
    def inputs(self) -> int:
        """How many numbers the network sees."""
        return self.size + self.history.size

    def begin(self, observations: Array) -> tuple[Array, Memory]:
        """See `Encoder`; before the first observation it was always that one."""
        return self.go_on(observations, (self.history.begin(observations),))

    def go_on(self, observations: Array, memory: Memory) -> tuple[Array, Memory]:
        """See `Encoder`."""
        past = memory[0].astype(np.float32, copy=False)
        return self.history.inputs(observations, past), (self.history.advance(observations, past),)


def readings_history(lags: tuple[int, ...], blocks: Mapping[str, slice]) -> History:
    """Return a history of all that the task's clock does not decide.

    Args:
        lags: ages [control periods]; none: nothing is remembered.
        blocks: where each block lies in an observation.
    """
    if not lags:
        return History()
    read = [n for name, part in blocks.items() if name not in CLOCKED for n in range(part.start, part.stop)]
    return History(lags, tuple(sorted(read)))


def resumed(encoder: Encoder, observations: Array, memory: Memory, starting: NDArray[np.bool_]) -> tuple[Array, Memory]:
    """Return inputs and memory where the episodes of some arms begin and those of the others go on.

    Args:
        encoder: what reads.
        observations: Shape (n, size).
        memory: of the same arms; that of starting ones counts for nothing.
        starting: which ones begin. Shape (n,).
    """
    if starting.all():
        return encoder.begin(observations)
    inputs, after = encoder.go_on(observations, memory)
    if starting.any():
        begun, fresh = encoder.begin(observations[starting])
        inputs[starting] = begun
        for part, new in zip(after, fresh, strict=True):
            part[starting] = new
    return inputs, after
