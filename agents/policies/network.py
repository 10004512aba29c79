"""`NetworkPolicy`: a trained policy as numbers in one file, run by numpy alone: an encoder, layers and a head."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexarm_agents.policies.encoders import Array, PastReadings, encoded, float32_array
from flexarm_agents.policies.lstm import Lstm
from flexarm_agents.policies.observer import Observer
from flexarm_baselines.policy import checked_observation
from flexarm_env.simulation import archive
from flexarm_env.validation import choice, integer, listed, mapping, shown

ENCODERS: tuple[type[PastReadings | Lstm | Observer], ...] = (PastReadings, Lstm, Observer)
MOST_LAYERS = 100
MOST_NUMBERS = 20_000_000  # of all weights and biases
LARGEST_LOG_STD = 20.0
LOG_STD_LIMITS = (-20.0, 2.0)  # where it depends on the observation; as in stable-baselines3
_FORMAT = 1
_SQUASHED = "spread"  # name of `log_std_weights` in a file


ACTIVATIONS: dict[str, Callable[[Array], Array]] = {
    "elu": lambda x: np.where(x > 0.0, x, np.expm1(np.minimum(x, 0.0))),
    "tanh": np.tanh,
    "relu": lambda x: np.maximum(x, np.float32(0.0)),
}


@dataclass(frozen=True, eq=False, repr=False)
class NetworkPolicy:
    """A Gaussian policy with stable-baselines3's ``predict``.

    An encoder turns observations into the network's inputs, fully connected layers give the mean of the action, and the
    head limits it to [-1, 1]. The head of PPO clips, and its standard deviation is constant. That of SAC and TQC is a
    tanh, and the standard deviation depends on the observation.

    All arrays become float32.

    Attributes:
        weights: weights of each layer. Shape (outputs, inputs) each.
        biases: biases of each layer. Shape (outputs,) each.
        log_std: logarithm of the standard deviation of each action. Shape (actions,).
        activation: between the layers: "elu", "tanh" or "relu".
        notes: plain values (JSON) that the file keeps: environment, options, configuration, scores.
        encoder: of the observations; None: they are the inputs.
        log_std_weights: head of SAC and TQC: weights of the last hidden layer's outputs in the logarithm of the
            standard deviation, whose bias is `log_std`. Shape (actions, last hidden size). None: the head of PPO.
    """

    weights: Sequence[Array]
    biases: Sequence[Array]
    log_std: Array
    activation: str = "elu"
    notes: dict[str, Any] = field(default_factory=dict)
    encoder: PastReadings | Lstm | Observer | None = None
    log_std_weights: Array | None = None

    def __post_init__(self) -> None:
        """Check that encoder, layers and head fit together."""
        choice("activation", self.activation, ACTIVATIONS)
        mapping("notes", self.notes)
        for name in ("weights", "biases"):
            listed(name, getattr(self, name))
        _take_arrays(self)
        _check_layers([np.shape(weight) for weight in self.weights], [np.shape(bias) for bias in self.biases])
        _check_head(self)
        if self.encoder is not None:
            if not isinstance(self.encoder, ENCODERS):
                kinds = ", ".join(kind.__name__ for kind in ENCODERS)
                raise TypeError(f"encoder = {shown(self.encoder)}: must be None or one of {kinds}")
            if self.encoder.inputs != self.weights[0].shape[1]:
                inputs = self.weights[0].shape[1]
                raise ValueError(f"encoder: gives {self.encoder.inputs} numbers, and the network takes {inputs}")
        object.__setattr__(self, "_generator", np.random.default_rng())

    def __repr__(self) -> str:
        sizes = " -> ".join(str(size) for size in (self.weights[0].shape[1], *map(len, self.biases)))
        encoder = "" if self.encoder is None else f"{self.observation_size} -> {self.encoder} -> "
        squashed = "" if self.log_std_weights is None else ", squashed"
        return f"{type(self).__name__}({encoder}{sizes}, {self.activation}{squashed})"

    @property
    def observation_size(self) -> int:
        """Length of an observation."""
        return int(self.weights[0].shape[1]) if self.encoder is None else self.encoder.size

    @property
    def knows(self) -> tuple[str, ...]:
        """Model data that it uses beside the observation, in the leaderboard's words."""
        return () if self.encoder is None else self.encoder.knows

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
            state: what the previous call returned; None: every arm's episode begins. Not used without an encoder.
            episode_start: arms whose episode begins, for the encoder. Shape (n,).
            deterministic: the mean, without noise. It is the default here; stable-baselines3's own models have False.

        Returns:
            Actions in [-1, 1], shape (actions,) or (n, actions), and the state: the encoder's memory, or the given
            state without an encoder.
        """
        x = checked_observation(observation, self.observation_size).astype(np.float32, copy=False)
        if self.encoder is not None:
            inputs, state = self._encoded(np.atleast_2d(x), state, episode_start)
            x = inputs.reshape(*x.shape[:-1], -1)
        for weight, bias in zip(self.weights[:-1], self.biases[:-1], strict=True):
            x = ACTIVATIONS[self.activation](x @ weight.T + bias)
        action = x @ self.weights[-1].T + self.biases[-1]
        if not deterministic:
            noise = self.__dict__["_generator"].standard_normal(action.shape, dtype=np.float32)
            action = action + np.exp(self._log_std(x)) * noise
        limited = np.clip(action, np.float32(-1), np.float32(1)) if self.log_std_weights is None else np.tanh(action)
        return limited, state

    def _encoded(
        self, rows: Array, state: tuple[NDArray[Any], ...] | None, episode_start: NDArray[Any] | None
    ) -> tuple[Array, tuple[NDArray[Any], ...]]:
        """Return the network's inputs and the encoder's memory; arguments as of `predict`, a batch."""
        assert self.encoder is not None
        if state is None:
            return self.encoder.reset(rows)
        shapes = [(len(rows), *shape) for shape in self._memory_shapes]
        if [np.shape(part) for part in state] != shapes:
            raise ValueError(f"state: must be what predict returned for as many observations, of shapes {shapes}")
        starting = np.zeros(len(rows), dtype=bool) if episode_start is None else np.asarray(episode_start, dtype=bool)
        return encoded(self.encoder, rows, state, starting)

    @cached_property
    def _memory_shapes(self) -> list[tuple[int, ...]]:
        """Shapes of the encoder's memory of one arm."""
        assert self.encoder is not None
        return [part.shape[1:] for part in self.encoder.reset(np.zeros((1, self.encoder.size), np.float32))[1]]

    def _log_std(self, hidden: Array) -> Array:
        """Return the logarithm of the standard deviation. Shape (..., actions) or (actions,)."""
        if self.log_std_weights is None:
            return self.log_std
        return np.clip(hidden @ self.log_std_weights.T + self.log_std, *LOG_STD_LIMITS).astype(np.float32)

    def save(self, path: str | Path) -> None:
        """Write one npz file: arrays, and the rest as JSON text."""
        header = {"activation": self.activation, "layers": len(self.weights), "notes": self.notes}
        arrays = {"log_std": self.log_std}
        arrays |= {f"weight_{n}": weight for n, weight in enumerate(self.weights)}
        arrays |= {f"bias_{n}": bias for n, bias in enumerate(self.biases)}
        if self.log_std_weights is not None:
            arrays[_SQUASHED] = self.log_std_weights
        if self.encoder is not None:
            header |= self.encoder.header()
            arrays |= self.encoder.arrays()
        archive.write(path, _FORMAT, header, arrays)

    @classmethod
    def load(cls, path: str | Path) -> NetworkPolicy:
        """Read a file written by `save`; nothing in it is executed.

        Raises:
            FileNotFoundError: if there is none.
            ValueError: if the file is not such a file, naming it and what is wrong.
        """
        return archive.read(path, _FORMAT, "policy", _check_file, cls._from_file)

    @classmethod
    def _from_file(cls, header: dict[str, Any], arrays: dict[str, Array]) -> NetworkPolicy:
        kind = _encoder_in(header, arrays)
        weights, biases = ([arrays[name] for name in names] for names in _layer_names(header))
        return cls(
            weights,
            biases,
            arrays["log_std"],
            header["activation"],
            header["notes"],
            None if kind is None else kind.from_file(header, arrays),
            arrays.get(_SQUASHED),
        )


Shape = tuple[int, ...]


def _layer_names(header: Mapping[str, Any]) -> list[list[str]]:
    layers = range(integer("layers", header["layers"], 1, MOST_LAYERS))
    return [[f"{part}_{n}" for n in layers] for part in ("weight", "bias")]


def _encoder_in(header: Mapping[str, Any], arrays: Mapping[str, Any]) -> type[PastReadings | Lstm | Observer] | None:
    found = [kind for kind in ENCODERS if kind.is_in(header, arrays)]
    if len(found) > 1:
        raise ValueError(f"{' and '.join(kind.__name__ for kind in found)}: at most one encoder is allowed")
    return found[0] if found else None


def _check_file(header: dict[str, Any], entries: Mapping[str, archive.Entry]) -> None:
    """Refuse arrays of other names or types; their shapes are checked when the policy is made."""
    kind = _encoder_in(header, entries)
    weights, biases = _layer_names(header)
    known = {*weights, *biases, "log_std", _SQUASHED, *(() if kind is None else kind.ARRAYS)}
    for name, entry in entries.items():
        if name not in known:
            raise ValueError(f"{shown(name)}: no such array in a policy of {len(weights)} layers")
        if entry.dtype != np.float32:
            raise ValueError(f"{name}: must hold float32, got {entry.dtype}")
    _check_layers([entries[name].shape for name in weights], [entries[name].shape for name in biases])


def _take_arrays(policy: NetworkPolicy) -> None:
    """Give all arrays the type that files have; refuse what is no array of finite numbers."""
    found: dict[str, Any] = {
        name: [float32_array(f"{name}[{n}]", array) for n, array in enumerate(getattr(policy, name))]
        for name in ("weights", "biases")
    }
    for name in ("log_std", "log_std_weights"):
        if getattr(policy, name) is not None:
            found[name] = float32_array(name, getattr(policy, name))
    for name, value in found.items():
        object.__setattr__(policy, name, value)


def _check_layers(weights: Sequence[Shape], biases: Sequence[Shape]) -> None:
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
    numbers = sum(math.prod(shape) for shape in (*weights, *biases))
    if numbers > MOST_NUMBERS:
        raise ValueError(f"weights: {numbers} numbers; at most {MOST_NUMBERS} are allowed")


def _check_head(policy: NetworkPolicy) -> None:
    """Refuse a standard deviation that does not fit the last layer."""
    actions, hidden = np.shape(policy.weights[-1])
    if np.shape(policy.log_std) != (actions,):
        raise ValueError(f"log_std: must have shape ({actions},), got {np.shape(policy.log_std)}")
    if np.abs(policy.log_std).max() > LARGEST_LOG_STD:
        raise ValueError(f"log_std = {shown(policy.log_std)}: must be at most {LARGEST_LOG_STD:g} in magnitude")
    if policy.log_std_weights is not None and np.shape(policy.log_std_weights) != (actions, hidden):
        got = np.shape(policy.log_std_weights)
        raise ValueError(f"log_std_weights: must have shape ({actions}, {hidden}), got {got}")
