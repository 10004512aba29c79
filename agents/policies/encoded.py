"""`EncodedPolicy`: a network behind a memory or an observer, run by numpy alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from flexarm_agents.policies.encoders import resumed
from flexarm_agents.policies.history import Array
from flexarm_agents.policies.lstm import ARRAYS, Lstm
from flexarm_agents.policies.network import NetworkPolicy
from flexarm_agents.policies.observer import ARRAY, Observer
from flexarm_baselines.policy import checked_observation
from flexarm_env.simulation import archive

FORMAT = 1
# by an array that only the files of each have
ENCODERS: dict[str, type[Lstm] | type[Observer]] = {ARRAYS[0]: Lstm, ARRAY: Observer}


@dataclass(frozen=True, eq=False, repr=False)
class EncodedPolicy(NetworkPolicy):
    """A `NetworkPolicy` behind an encoder of the observations; the state of `predict` is the encoder's memory.

    Attributes:
        encoder: the memory or the observer.
        batched: one call may choose the actions of several arms.
    """

    encoder: Lstm | Observer | None = None
    batched: ClassVar[bool] = True

    def __post_init__(self) -> None:
        """Check that encoder and network fit together.

        Raises:
            TypeError, ValueError: if they do not.
        """
        super().__post_init__()
        if not isinstance(self.encoder, Lstm | Observer):
            raise TypeError(f"encoder = {self.encoder!r}: must be an Lstm or an Observer")
        inputs = int(self.weights[0].shape[1])
        if self.history.size or self.encoder.inputs != inputs:
            raise ValueError(f"encoder: gives {self.encoder.inputs} numbers, and the network takes {inputs}")
        network = NetworkPolicy(self.weights, self.biases, self.log_std, self.activation)
        object.__setattr__(self, "_network", network)

    def _seen(self) -> str:
        return f"{self.observation_size} -> {self.encoder} -> "

    @property
    def knows(self) -> tuple[str, ...]:
        """What it was told of the arm beside the observation: an observer has the nominal one."""
        return ("plant parameters",) if isinstance(self.encoder, Observer) else ()

    @property
    def observation_size(self) -> int:
        """Length of an observation."""
        assert self.encoder is not None
        return self.encoder.size

    def seed(self, seed: int) -> None:
        """Seed the policy's own randomness."""
        self.__dict__["_network"].seed(seed)

    def predict(
        self,
        observation: Any,
        state: tuple[NDArray[Any], ...] | None = None,
        episode_start: NDArray[Any] | None = None,
        deterministic: bool = True,
    ) -> tuple[Array, tuple[NDArray[Any], ...] | None]:
        """Choose actions; see `NetworkPolicy.predict`.

        Raises:
            TypeError: the observation is a dict.
            ValueError: it has another shape, or the state is of another number of arms.
        """
        assert self.encoder is not None
        one = checked_observation(observation, self.observation_size)
        rows = np.atleast_2d(one).astype(np.float32, copy=False)
        if state is not None and any(len(part) != len(rows) for part in state):
            raise ValueError(f"state: must be what predict returned for as many observations, {len(rows)}")
        starting = np.zeros(len(rows), dtype=bool) if episode_start is None else np.asarray(episode_start, dtype=bool)
        if state is None:
            inputs, memory = self.encoder.begin(rows)
        else:
            inputs, memory = resumed(self.encoder, rows, state, starting)
        action, _ = self.__dict__["_network"].predict(inputs, deterministic=deterministic)
        return action.reshape(*one.shape[:-1], -1), memory

    def save(self, path: str | Path) -> None:
        """Write one npz file: arrays, and the rest as JSON text."""
        assert self.encoder is not None
        head = {"activation": self.activation, "layers": len(self.weights), "notes": self.notes, **self.encoder.head()}
        arrays = {f"weight_{n}": weight for n, weight in enumerate(self.weights)}
        arrays |= {f"bias_{n}": bias for n, bias in enumerate(self.biases)} | self.encoder.arrays()
        archive.write(path, FORMAT, head, {"log_std": self.log_std, **arrays})

    @classmethod
    def _check_file(cls, head: dict[str, Any], entries: Mapping[str, archive.Entry]) -> None:
        kind = _encoder_of(entries)
        own = ARRAYS if kind is Lstm else (ARRAY,)
        for name in own:
            if entries[name].dtype != np.float32:
                raise ValueError(f"{name}: must hold float32, got {entries[name].dtype}")
        kind.check_file(head, entries)
        super()._check_file(head, {name: entry for name, entry in entries.items() if name not in own})

    @classmethod
    def _from_file(cls, head: dict[str, Any], arrays: dict[str, Array]) -> EncodedPolicy:
        plain = NetworkPolicy._from_file(head, arrays)
        encoder = _encoder_of(arrays).from_file(head, arrays)
        return cls(plain.weights, plain.biases, plain.log_std, plain.activation, plain.notes, encoder=encoder)


def _encoder_of(arrays: Mapping[str, Any]) -> type[Lstm] | type[Observer]:
    """Return the kind of encoder whose arrays these are.

    Raises:
        ValueError: if there is none.
    """
    for name, kind in ENCODERS.items():
        if name in arrays:
            return kind
    raise ValueError("there is neither a memory nor an observer")
