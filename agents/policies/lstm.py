"""`Lstm`: the memory of a recurrent policy, run by numpy alone.

Source: Hochreiter and Schmidhuber, *Long short-term memory*, Neural Computation 9, 1997, with a forget gate; the gates
lie in torch's order (input, forget, cell, output).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from flexarm_agents.policies.encoders import Array, Encoder, Memory, float32_array


@dataclass(frozen=True, eq=False, repr=False)
class Lstm(Encoder):
    """A layer of long short-term memory; an `Encoder`, whose outputs are the network's inputs."""

    lstm_input: Array  # weights of the observation. Shape (4 h, k)
    lstm_memory: Array  # weights of the previous outputs. Shape (4 h, h)
    lstm_bias: Array  # Shape (4 h,)
    ARRAYS: ClassVar[tuple[str, ...]] = ("lstm_input", "lstm_memory", "lstm_bias")

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.inputs})"

    def __post_init__(self) -> None:
        """Check that the arrays are finite and fit together; they become float32."""
        for name in self.ARRAYS:
            object.__setattr__(self, name, float32_array(name, getattr(self, name)))
        _check_shapes(*(np.shape(getattr(self, name)) for name in self.ARRAYS))

    @property
    def size(self) -> int:  # type: ignore[override]
        """Length of an observation."""
        return int(self.lstm_input.shape[1])

    @property
    def inputs(self) -> int:
        """Number of the network's inputs."""
        return int(self.lstm_memory.shape[1])

    def reset(self, observations: Array) -> tuple[Array, Memory]:
        """See `Encoder`; the memory of an arm whose episode begins is 0."""
        nothing = np.zeros((len(observations), self.inputs), dtype=np.float32)
        return self.advance(observations, (nothing, nothing))

    def advance(self, observations: Array, memory: Memory) -> tuple[Array, Memory]:
        """See `Encoder`; the memory holds the previous outputs and the cells."""
        before, cells = (part.astype(np.float32, copy=False) for part in memory)
        sums = observations @ self.lstm_input.T + before @ self.lstm_memory.T + self.lstm_bias
        let_in, keep, new, let_out = np.split(sums, 4, axis=1)
        cells = _sigmoid(keep) * cells + _sigmoid(let_in) * np.tanh(new)
        out = _sigmoid(let_out) * np.tanh(cells)
        return out.copy(), (out, cells)


def _sigmoid(x: Array) -> Array:
    return np.float32(0.5) + np.float32(0.5) * np.tanh(np.float32(0.5) * x)


def _check_shapes(given: tuple[int, ...], memory: tuple[int, ...], bias: tuple[int, ...]) -> None:
    if len(given) != 2 or len(memory) != 2 or 0 in (*given, *memory):
        raise ValueError(f"lstm_input, lstm_memory: must have shapes (4 h, k) and (4 h, h), got {given} and {memory}")
    rows = 4 * memory[1]
    if (given[0], memory[0], bias) != (rows, rows, (rows,)):
        raise ValueError(
            f"lstm_input, lstm_memory, lstm_bias: must have shapes (4 h, k), (4 h, h) and (4 h,), got {given}, "
            f"{memory} and {bias}"
        )
