"""`Encoder`: turns observations into a network's inputs, with a memory from step to step; `PastReadings` is one."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexarm_env.validation import integer, listed, real_array

Array = NDArray[np.float32]
Memory = tuple[NDArray[Any], ...]  # each with a leading axis of n arms
# Blocks of an observation that follow from the time alone, or are constant: past values of these add no information.
CLOCKED = ("reference_position", "reference_velocity", "previews", "lap_phase", "time", "episode_parameters")
LONGEST_LAG = 1000  # [steps]
MOST_NUMBERS = 1_000_000  # of an observation


class Encoder(ABC):
    """Turns the observations of n arms into a network's inputs."""

    ARRAYS: ClassVar[tuple[str, ...]] = ()  # names of the arrays that it keeps in a policy's file, each an attribute
    knows: ClassVar[tuple[str, ...]] = ()  # model data that it uses beside the observation, in the leaderboard's words
    size: int  # length of an observation

    @property
    @abstractmethod
    def inputs(self) -> int:
        """Number of the network's inputs."""

    @abstractmethod
    def reset(self, observations: Array) -> tuple[Array, Memory]:
        """Return inputs (n, inputs), and memory, of arms whose episode begins with these observations (n, size)."""

    @abstractmethod
    def advance(self, observations: Array, memory: Memory) -> tuple[Array, Memory]:
        """Return inputs (n, inputs), and memory, after the next observations (n, size), in new arrays."""

    def header(self) -> dict[str, Any]:
        """Return the plain values that a policy's file keeps."""
        return {}

    def arrays(self) -> dict[str, Array]:
        """Return the arrays that a policy's file keeps."""
        return {name: getattr(self, name) for name in self.ARRAYS}

    @classmethod
    def is_in(cls, header: Mapping[str, Any], names: Collection[str]) -> bool:
        """Return whether a policy's file with this header and arrays of these names has such an encoder."""
        return cls.ARRAYS[0] in names

    @classmethod
    def from_file(cls, header: Mapping[str, Any], arrays: Mapping[str, Array]) -> Self:
        """Make the encoder from a policy's file."""
        return cls(**{name: arrays[name] for name in cls.ARRAYS})


@dataclass(frozen=True, repr=False)
class PastReadings(Encoder):
    """The present observation, followed by some of its numbers at earlier steps; an `Encoder`.

    Before an episode's first observation, all readings are taken to be equal to the first.
    """

    size: int  # length of an observation
    lags: tuple[int, ...]  # ages of the past readings [steps], increasing
    remembered: tuple[int, ...]  # indices of the numbers in an observation, increasing

    def __post_init__(self) -> None:
        """Check the entries, their range and their order."""
        integer("size", self.size, 1, MOST_NUMBERS)
        for name, least, most in (("lags", 1, LONGEST_LAG), ("remembered", 0, MOST_NUMBERS)):
            values = checked_increasing(name, getattr(self, name), least, most)
            if not values:
                raise ValueError(f"{name} = (): must have an entry")
            object.__setattr__(self, name, values)
        if self.remembered[-1] >= self.size:
            raise ValueError(f"remembered = {self.remembered}: must be indices in an observation of {self.size}")

    def __repr__(self) -> str:
        return f"{type(self).__name__}({len(self.lags)} lags)"

    @property
    def inputs(self) -> int:
        """Number of the network's inputs."""
        return self.size + len(self.lags) * len(self.remembered)

    def reset(self, observations: Array) -> tuple[Array, Memory]:
        """See `Encoder`."""
        now = observations[:, list(self.remembered)]
        return self.advance(observations, (np.repeat(now[:, None], self.lags[-1], axis=1),))

    def advance(self, observations: Array, memory: Memory) -> tuple[Array, Memory]:
        """See `Encoder`; the memory is the last readings, the newest first. Shape (n, longest lag, numbers)."""
        readings = memory[0].astype(np.float32, copy=False)
        past = readings[:, np.array(self.lags) - 1].reshape(len(observations), -1)
        now = observations[:, None, list(self.remembered)]
        inputs = np.concatenate([observations, past], axis=1)
        return inputs, (np.concatenate([now, readings[:, :-1]], axis=1),)

    def header(self) -> dict[str, Any]:
        """See `Encoder`."""
        return {"history": {"lags": self.lags, "remembered": self.remembered}}

    @classmethod
    def is_in(cls, header: Mapping[str, Any], names: Collection[str]) -> bool:
        """See `Encoder`."""
        return "history" in header

    @classmethod
    def from_file(cls, header: Mapping[str, Any], arrays: Mapping[str, Array]) -> Self:
        """See `Encoder`; the size follows from the inputs of the first layer."""
        lags, remembered = (listed(name, header["history"][name]) for name in ("lags", "remembered"))
        return cls(arrays["weight_0"].shape[1] - len(lags) * len(remembered), tuple(lags), tuple(remembered))


def past_readings(lags: Sequence[int], blocks: Mapping[str, slice]) -> PastReadings | None:
    """Return an encoder of all blocks but `CLOCKED` at some ages [control periods]; without ages there is none."""
    if not lags:
        return None
    read = [n for name, part in blocks.items() if name not in CLOCKED for n in range(part.start, part.stop)]
    return PastReadings(max(part.stop for part in blocks.values()), tuple(lags), tuple(sorted(read)))


def encoded(encoder: Encoder, observations: Array, memory: Memory, starting: NDArray[np.bool_]) -> tuple[Array, Memory]:
    """Return inputs and memory where the episodes of some arms begin and those of the others continue.

    Args:
        encoder: of the observations.
        observations: Shape (n, size).
        memory: of the same arms; that of arms whose episode begins is not used.
        starting: arms whose episode begins. Shape (n,).
    """
    if starting.all():
        return encoder.reset(observations)
    inputs, after = encoder.advance(observations, memory)
    if starting.any():
        first_inputs, first_memory = encoder.reset(observations[starting])
        inputs[starting] = first_inputs
        for part, new in zip(after, first_memory, strict=True):
            part[starting] = new
    return inputs, after


def float32_array(name: str, value: ArrayLike) -> Array:
    """Check an array of numbers that are finite as float32, and return it as such: itself, where it is of this type."""
    real_array(name, value)
    with np.errstate(over="ignore"):  # it is infinite then, and refused
        array = np.asarray(value, dtype=np.float32)
    if not np.isfinite(array).all():
        raise ValueError(f"{name}: must be finite")
    return array


def checked_increasing(name: str, values: object, least: int, most: int) -> tuple[int, ...]:
    """Check integers that increase."""
    checked = tuple(integer(f"{name}[{n}]", value, least, most) for n, value in enumerate(listed(name, values)))
    if list(checked) != sorted(set(checked)):
        raise ValueError(f"{name} = {checked}: must increase")
    return checked
