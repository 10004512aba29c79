"""`SquashedPolicy`: the policy of SAC and TQC, a Gaussian whose spread depends on the observation, through tanh."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from flexarm_agents.policies.history import Array
from flexarm_agents.policies.network import ACTIVATIONS, NetworkPolicy
from flexarm_baselines.policy import checked_observation
from flexarm_env.simulation import archive
from flexarm_env.validation import real_array

FORMAT = 1
ARRAY = "spread"
LOG_STD_LIMITS = (-20.0, 2.0)  # as in stable-baselines3


@dataclass(frozen=True, eq=False, repr=False)
class SquashedPolicy(NetworkPolicy):
    """A `NetworkPolicy` whose action is tanh(mean + spread * noise).

    The logarithm of the spread is a layer on the last hidden one, as the mean is; `log_std` is its bias.

    Attributes:
        spread: weights of that layer. Shape (actions, last hidden size).
        batched: one call may choose the actions of several arms.
    """

    spread: Array = field(default_factory=lambda: np.zeros((0, 0), np.float32))
    batched: ClassVar[bool] = True

    def __post_init__(self) -> None:
        """Check that the layers fit together.

        Raises:
            TypeError, ValueError: naming what does not.
        """
        super().__post_init__()
        if not np.isfinite(real_array(ARRAY, self.spread)).all():
            raise ValueError(f"{ARRAY}: must be finite")
        if np.shape(self.spread) != np.shape(self.weights[-1]):
            raise ValueError(f"{ARRAY}: must have shape {np.shape(self.weights[-1])}, got {np.shape(self.spread)}")
        if self.history.size or len(self.weights) < 2:
            raise ValueError("weights: must have a hidden layer, and the policy no history")

    def predict(
        self,
        observation: Any,
        state: tuple[NDArray[Any], ...] | None = None,
        episode_start: NDArray[Any] | None = None,
        deterministic: bool = True,
    ) -> tuple[Array, tuple[NDArray[Any], ...] | None]:
        """Choose actions; see `NetworkPolicy.predict`."""
        x = checked_observation(observation, self.observation_size).astype(np.float32, copy=False)
        hidden = x
        for weight, bias in zip(self.weights[:-1], self.biases[:-1], strict=True):
            hidden = ACTIVATIONS[self.activation](hidden @ weight.T + bias)
        action = hidden @ self.weights[-1].T + self.biases[-1]
        if not deterministic:
            log_std = np.clip(hidden @ self.spread.T + self.log_std, *LOG_STD_LIMITS).astype(np.float32)
            noise = self.__dict__["_generator"].standard_normal(action.shape, dtype=np.float32)
            action = action + np.exp(log_std) * noise
        return np.tanh(action), state

    def save(self, path: str | Path) -> None:
        """Write one npz file: arrays, and the rest as JSON text."""
        head = {"activation": self.activation, "layers": len(self.weights), "notes": self.notes}
        arrays = {f"weight_{n}": weight for n, weight in enumerate(self.weights)}
        arrays |= {f"bias_{n}": bias for n, bias in enumerate(self.biases)}
        archive.write(path, FORMAT, head, {"log_std": self.log_std, ARRAY: self.spread, **arrays})

    @classmethod
    def _check_file(cls, head: dict[str, Any], entries: Mapping[str, archive.Entry]) -> None:
        if entries[ARRAY].dtype != np.float32 or entries[ARRAY].shape != entries[f"weight_{head['layers'] - 1}"].shape:
            raise ValueError(f"{ARRAY}: must hold float32 in the shape of the last weights")
        super()._check_file(head, {name: entry for name, entry in entries.items() if name != ARRAY})

    @classmethod
    def _from_file(cls, head: dict[str, Any], arrays: dict[str, Array]) -> SquashedPolicy:
        plain = NetworkPolicy._from_file(head, arrays)
        return cls(
            plain.weights, plain.biases, plain.log_std, plain.activation, plain.notes, plain.history, arrays[ARRAY]
        )
