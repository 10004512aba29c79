"""`NetworkPolicy`: a trained network as numbers in one file, run by numpy alone."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexarm_agents.policies.history import History, memory_of
from flexarm_env.simulation import archive
from flexarm_env.validation import choice, integer, listed, mapping, real_array, shown

Array = NDArray[np.float32]
_FORMAT = 1
MOST_LAYERS = 100
MOST_NUMBERS = 20_000_000  # of all weights and biases
LARGEST_LOG_STD = 20.0


def _elu(x: Array) -> Array:
    return np.where(x > 0.0, x, np.expm1(np.minimum(x, 0.0)))


def _relu(x: Array) -> Array:
    return np.maximum(x, np.float32(0.0))


ACTIVATIONS: dict[str, Callable[[Array], Array]] = {"elu": _elu, "tanh": np.tanh, "relu": _relu}


@dataclass(frozen=True, eq=False, repr=False)
class NetworkPolicy:
    """A Gaussian policy whose mean is a fully connected network; has stable-baselines3's ``predict``.

    Attributes:
        weights: weights of each layer. Shape (outputs, inputs) each.
        biases: biases of each layer. Shape (outputs,) each.
        log_std: logarithm of the standard deviation of each action. Shape (actions,).
        activation: between the layers: "elu", "tanh" or "relu".
        notes: anything plain (JSON) worth keeping with it: environment, options, how it was made.
        history: of past observations, which the network sees beside the present one.
    """

    weights: Sequence[Array]
    biases: Sequence[Array]
    log_std: Array
    activation: str = "elu"
    notes: dict[str, Any] = field(default_factory=dict)
    history: History = field(default_factory=History)

    def __post_init__(self) -> None:
        """Check that the layers fit together.

        Raises:
            ValueError: naming the layer that does not, or a bad activation.
        """
        choice("activation", self.activation, ACTIVATIONS)
        mapping("notes", self.notes)
        for name in ("weights", "biases"):
            listed(name, getattr(self, name))
        if not isinstance(self.history, History):
            raise TypeError(f"history = {shown(self.history)}: must be a History")
        arrays = {f"weights[{n}]": weight for n, weight in enumerate(self.weights)}
        arrays |= {f"biases[{n}]": bias for n, bias in enumerate(self.biases)} | {"log_std": self.log_std}
        for name, array in arrays.items():
            if not np.isfinite(real_array(name, array)).all():
                raise ValueError(f"{name}: must be finite")
        weights, biases = ([np.shape(array) for array in part] for part in (self.weights, self.biases))
        _check_shapes(weights, biases, np.shape(self.log_std))
        if np.abs(self.log_std).max() > LARGEST_LOG_STD:
            raise ValueError(f"log_std = {shown(self.log_std)}: must be at most {LARGEST_LOG_STD:g} in magnitude")
        _check_history(self.history, weights[0][1])
        object.__setattr__(self, "_generator", np.random.default_rng())

    def __repr__(self) -> str:
        """Describe the policy in a line: what it observes, its layers, its action."""
        sizes = " -> ".join(str(size) for size in (self.weights[0].shape[1], *map(len, self.biases)))
        return f"{type(self).__name__}({self._seen()}{sizes}, {self.activation})"

    def _seen(self) -> str:
        return f"{self.observation_size} -> {len(self.history.lags)} lags -> " if self.history.size else ""

    @property
    def observation_size(self) -> int:
        """Length of an observation."""
        return int(self.weights[0].shape[1]) - self.history.size

    def seed(self, seed: int) -> None:
        """Seed the policy's own randomness."""
        object.__setattr__(self, "_generator", np.random.default_rng(seed))

    def predict(
        self,
        observation: Any,
        state: tuple[NDArray[Any], ...] | None = None,
        episode_start: NDArray[Any] | None = None,
        deterministic: bool = True,
    ) -> tuple[Array, tuple[NDArray[Any], ...] | None]:
        """Choose actions.

        Args:
            observation: one or a batch. Shape (k,) or (n, k).
            state: what the call before returned; None: every arm's episode begins. Without a history it is not read.
            episode_start: arms whose episode begins, where there is a history. Shape (n,).
            deterministic: the mean, without noise. It is the default here; stable-baselines3's own models have False.

        Returns:
            Actions in [-1, 1], Shape (actions,) or (n, actions), and the state: the memory of the history, or as it
            was given.

        Raises:
            TypeError: the observation is a dict.
            ValueError: it has another shape, or the state is another policy's.
        """
        if isinstance(observation, dict):
            raise TypeError(f"observation must be an array, got a dict with keys {sorted(observation)}")
        x = np.asarray(observation, dtype=np.float32)
        if x.ndim not in (1, 2) or x.shape[-1] != self.observation_size:
            size = self.observation_size
            raise ValueError(f"observation must have shape ({size},) or (n, {size}), got {x.shape}")
        if self.history.size:
            rows = np.atleast_2d(x)
            memory = memory_of(self.history, rows, state, episode_start)
            x = self.history.inputs(rows, memory).reshape(*x.shape[:-1], -1)
            state = (self.history.advance(rows, memory),)
        x = self._mean(x)
        if not deterministic:
            noise = self.__dict__["_generator"].standard_normal(x.shape, dtype=np.float32)
            x = x + np.exp(self.log_std) * noise
        return np.clip(x, np.float32(-1.0), np.float32(1.0)), state

    def _mean(self, x: Array) -> Array:
        """Run the network."""
        function, last = ACTIVATIONS[self.activation], len(self.weights) - 1
        for n, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            x = x @ weight.T + bias
            x = x if n == last else function(x)
        return x

    def save(self, path: str | Path) -> None:
        """Write one npz file: arrays, and the rest as JSON text."""
        head = {"activation": self.activation, "layers": len(self.weights), "notes": self.notes}
        if self.history.size:  # what earlier versions wrote has none
            head["history"] = asdict(self.history)
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
        return archive.read(path, _FORMAT, "policy", cls._check_file, cls._from_file)

    @classmethod
    def _check_file(cls, head: dict[str, Any], entries: Mapping[str, archive.Entry]) -> None:
        layers = range(integer("layers", head["layers"], 1, MOST_LAYERS))
        names = [[f"{part}_{n}" for n in layers] for part in ("weight", "bias")]
        for name, entry in entries.items():
            if name not in (*names[0], *names[1], "log_std"):
                raise ValueError(f"{shown(name)}: no such array in a policy of {len(layers)} layers")
            if entry.dtype != np.float32:
                raise ValueError(f"{name}: must hold float32, got {entry.dtype}")
        weights, biases = ([entries[name].shape for name in part] for part in names)
        _check_shapes(weights, biases, entries["log_std"].shape)
        _check_history(_history_of(head), weights[0][1])

    @classmethod
    def _from_file(cls, head: dict[str, Any], arrays: dict[str, Array]) -> NetworkPolicy:
        layers = range(head["layers"])
        weights, biases = ([arrays[f"{name}_{n}"] for n in layers] for name in ("weight", "bias"))
        return cls(weights, biases, arrays["log_std"], head["activation"], head["notes"], _history_of(head))


Shape = tuple[int, ...]


def _history_of(head: Mapping[str, Any]) -> History:
    return History(**{name: tuple(values) for name, values in head.get("history", {}).items()})


def _check_history(history: History, inputs: int) -> None:
    """Refuse a history that leaves no observation, or remembers what is not in one."""
    size = inputs - history.size
    if size < 1 or any(index >= size for index in history.remembered):
        raise ValueError(f"history: remembers numbers {history.remembered} of an observation of {size}")


def _check_shapes(weights: Sequence[Shape], biases: Sequence[Shape], log_std: Shape) -> None:
    """Refuse layers that do not fit together, or are too large to be a policy's."""
    if not 0 < len(weights) == len(biases) <= MOST_LAYERS:
        raise ValueError(f"weights, biases: must be as many, 1 to {MOST_LAYERS}; got {len(weights)}, {len(biases)}")
    for n, (weight, bias) in enumerate(zip(weights, biases, strict=True)):
        if len(weight) != 2 or len(bias) != 1 or 0 in (*weight, *bias):
            raise ValueError(f"weights[{n}], biases[{n}]: must have shapes (n, k) and (n,), got {weight} and {bias}")
    inputs = weights[0][1]
    for n, (weight, bias) in enumerate(zip(weights, biases, strict=True)):
        if weight != (bias[0], inputs):
            raise ValueError(f"weights[{n}]: must have shape ({bias[0]}, {inputs}), got {weight}")
        inputs = bias[0]
    if log_std != (inputs,):
        raise ValueError(f"log_std: must have shape ({inputs},), got {log_std}")
    numbers = sum(math.prod(shape) for shape in (*weights, *biases))
    if numbers > MOST_NUMBERS:
        raise ValueError(f"weights: {numbers} numbers; at most {MOST_NUMBERS} are allowed")
