"""`NetworkPolicy`: a trained network as numbers in one file, run by numpy alone."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexarm_env.simulation import archive
from flexarm_env.validation import choice

Array = NDArray[np.float32]
_FORMAT = 1


def _elu(x: Array) -> Array:
    return np.where(x > 0.0, x, np.expm1(np.minimum(x, 0.0)))


def _relu(x: Array) -> Array:
    return np.maximum(x, np.float32(0.0))


ACTIVATIONS: dict[str, Callable[[Array], Array]] = {"elu": _elu, "tanh": np.tanh, "relu": _relu}


@dataclass(frozen=True, eq=False)
class NetworkPolicy:
    """A Gaussian policy whose mean is a fully connected network; has stable-baselines3's ``predict``.

    Attributes:
        weights: of each layer. Shape (outputs, inputs) each.
        biases: of each layer. Shape (outputs,) each.
        log_std: logarithm of the standard deviation of each action. Shape (actions,).
        activation: between the layers: "elu", "tanh" or "relu".
        notes: anything plain (JSON) worth keeping with it: environment, options, how it was made.
    """

    weights: Sequence[Array]
    biases: Sequence[Array]
    log_std: Array
    activation: str = "elu"
    notes: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check that the layers fit together.

        Raises:
            ValueError: naming the layer that does not, or a bad activation.
        """
        choice("activation", self.activation, ACTIVATIONS)
        if not self.weights or len(self.weights) != len(self.biases):
            raise ValueError(f"weights, biases: must be as many, and some; got {len(self.weights)}, {len(self.biases)}")
        inputs = self.weights[0].shape[-1]
        for n, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            if weight.shape != (len(bias), inputs):
                raise ValueError(f"weights[{n}]: must have shape ({len(bias)}, {inputs}), got {weight.shape}")
            inputs = len(bias)
        if self.log_std.shape != (inputs,):
            raise ValueError(f"log_std: must have shape ({inputs},), got {self.log_std.shape}")
        object.__setattr__(self, "_generator", np.random.default_rng())

    @property
    def observation_size(self) -> int:
        """Length of an observation."""
        return int(self.weights[0].shape[1])

    def seed(self, seed: int) -> None:
        """Seed the policy's own randomness."""
        object.__setattr__(self, "_generator", np.random.default_rng(seed))

    def predict(
        self,
        observation: Any,
        state: tuple[NDArray[Any], ...] | None = None,
        episode_start: NDArray[Any] | None = None,
        deterministic: bool = False,
    ) -> tuple[Array, tuple[NDArray[Any], ...] | None]:
        """Choose actions.

        Args:
            observation: one or a batch. Shape (k,) or (n, k).
            state: comes back as it is.
            episode_start: not read.
            deterministic: the mean, without noise.

        Returns:
            Actions in [-1, 1], Shape (actions,) or (n, actions), and the state.

        Raises:
            TypeError: the observation is a dict.
            ValueError: it has another shape.
        """
        if isinstance(observation, dict):
            raise TypeError(f"observation must be an array, got a dict with keys {sorted(observation)}")
        x = np.asarray(observation, dtype=np.float32)
        if x.ndim not in (1, 2) or x.shape[-1] != self.observation_size:
            size = self.observation_size
            raise ValueError(f"observation must have shape ({size},) or (n, {size}), got {x.shape}")
        function, last = ACTIVATIONS[self.activation], len(self.weights) - 1
        for n, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            x = x @ weight.T + bias
            x = x if n == last else function(x)
        if not deterministic:
            noise = self.__dict__["_generator"].standard_normal(x.shape, dtype=np.float32)
            x = x + np.exp(self.log_std) * noise
        return np.clip(x, np.float32(-1.0), np.float32(1.0)), state

    def save(self, path: str | Path) -> None:
        """Write one npz file: arrays, and the rest as JSON text."""
        head = {"activation": self.activation, "layers": len(self.weights), "notes": self.notes}
        arrays = {f"weight_{n}": weight for n, weight in enumerate(self.weights)}
        arrays |= {f"bias_{n}": bias for n, bias in enumerate(self.biases)}
        archive.write(path, _FORMAT, head, {"log_std": self.log_std, **arrays})

    @classmethod
    def load(cls, path: str | Path) -> NetworkPolicy:
        """Read a file written by `save`; nothing in it is executed.

        Raises:
            FileNotFoundError: if there is none.
            ValueError: if the file is not such a file, naming it and what is wrong.
        """
        return archive.read(path, _FORMAT, "policy", cls._from_file)

    @classmethod
    def _from_file(cls, head: dict[str, Any], arrays: dict[str, Array]) -> NetworkPolicy:
        layers = range(head["layers"])
        weights, biases = ([arrays[f"{name}_{n}"] for n in layers] for name in ("weight", "bias"))
        return cls(weights, biases, arrays["log_std"], head["activation"], head["notes"])
