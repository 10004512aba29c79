"""States of environments: all that decides how an episode goes on, as one row of words for each environment.

An environment that is set to the state of another one with the same options goes on like it, to the last bit, whatever
the sizes of their batches: arm, delay line, clock, last actions, random numbers to come. Options stay where they are:
limits, gains, noise and the ranges of what is drawn are those of the environment that is set.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import fields
from hashlib import sha256
from typing import Any
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from flexarm_env.envs.kernel_inputs import fixed_rows
from flexarm_env.envs.quantities import SHARED_BY_ARMS
from flexarm_env.envs.settings import Settings
from flexarm_env.kernels.entries import Setting, clock_row, word
from flexarm_env.kernels.variants import Variant
from flexarm_env.validation import shown

Words = NDArray[np.uint64]
Indices = NDArray[np.int64]
# Words of the header on which the meaning of a state's words depends.
_MEANING = ("SUBSTEPS", "CHANNELS", "KEPT_ACTIONS", "PREVIEWS", "COMMANDS", "SHIFTING", "PATH_NAMES")
# Rows of the arena that say what is read, where no episode changes them.
_READ = (
    *("LAP", "LINK_FRAME", "RATE_LATE", "SENSOR_POINT_DISTANCE", "SENSOR_DISTANCE", "NOMINAL_DELAY"),
    *("FURTHER_LINK", "FURTHER_DISTANCE", "FURTHER_DELAY", "NOMINAL_FURTHER_DELAY"),
)
_CHECK, _STAMP, _READINGS = 0, 1, 2  # places of a state's first words
GENERATOR = slice(3, 8)  # the generator of the keys of later episodes (`seeding.generator_words`)
_FIRST = 8


class States:
    """Reads and writes the states of a batch's environments."""

    def __init__(
        self,
        view: Callable[[str], NDArray[Any]],
        drawn: slice,
        variant: Variant,
        fixed: frozenset[str],
        beside: int,
        each: Sequence[Settings],
    ) -> None:
        """Find the places of everything.

        Args:
            view: returns an array of the batch's memory, by its name (`entries.MEMORY`).
            drawn: columns of the reset requests for options and parameters of the arm that episodes draw (`draws`).
            variant: of its kernels.
            fixed: names of the rows that no episode changes, which stay where they are.
            beside: words that another engine's plant adds.
            each: settings of each environment.
        """
        own = each[0].has_own_path  # each lane has memory for its path
        self._header, self._observations = view("HEADER"), view("OBSERVATIONS")
        self._clocks, self._histories = view("CLOCKS"), view("HISTORIES")
        arenas, paths, requests = view("ARENAS"), view("PATHS"), view("RESET_REQUESTS")[:, drawn]
        blocks, _, lanes = arenas.shape
        self._lanes = lanes
        counts = [clock_row.STEPS, clock_row.SINCE, clock_row.BEGAN, *([] if own else [clock_row.PATH])]
        parts: list[NDArray[Any]] = [view("KEYS").reshape(blocks, 1, lanes)]
        parts += [self._clocks[:, one : one + 1] for one in counts]
        parts += [arenas[:, low:high] for low, high in _runs(variant, fixed, arenas.shape[1])]
        parts.append(np.moveaxis(requests.reshape(blocks, lanes, requests.shape[1]), 1, 2))
        if own:  # one for each lane
            parts.append(np.moveaxis(paths.reshape(blocks, lanes, -1), 1, 2))
        self._parts, end = [], _FIRST
        for part in parts:
            # the lane before the number, so that both indices of a lane stand together
            self._parts.append((slice(end, end + part.shape[1]), np.moveaxis(part.view(np.uint64), 2, 1)))
            end += part.shape[1]
        self._history = slice(end, end + self._histories[0, :, :, 0].size)
        self._observed = slice(self._history.stop, self._history.stop + (self._observations.shape[1] + 1) // 2)
        self._beside = slice(self._observed.stop, self._observed.stop + beside)
        self.size = self._beside.stop
        meaning = (
            *(_compiled(variant), variant.rows),
            *(sorted(fixed), self.size),  # a set has another order in another process
            *((name, int(self._header[getattr(word, name)])) for name in _MEANING),
            *(self._header[word.PLACES :].tobytes(), paths.shape[1:], None if own else paths.tobytes()),
            self._histories.shape[1:3],
            *(float(view("SETTINGS")[Setting.layout(variant)[name][0]]) for name in ("STEP", "PERIOD")),
        )
        kinds = {id(one): one for one in each}
        stamps = {name: _stamp((meaning, _own_meaning(one, fixed))) for name, one in kinds.items()}
        self._stamps = np.array([stamps[id(one)] for one in each], np.uint64)

    def read(self, rows: Indices, generators: Words, beside: NDArray[np.float64]) -> Words:
        """Return the states of some environments.

        Args:
            rows: their indices. Shape (n,).
            generators: see `GENERATOR`. Shape (n, 5).
            beside: of another engine's plant. Shape (`beside`,).
        """
        block, lane = np.divmod(rows, self._lanes)
        states = np.empty((len(rows), self.size), dtype=np.uint64)
        states[:, _STAMP] = self._stamps[rows]
        states[:, _READINGS] = self._header[word.KEPT_READINGS : word.KEPT_READINGS + 1].view(np.uint64)
        states[:, GENERATOR] = generators
        for place, part in self._parts:
            states[:, place] = part[block, lane]
        history = self._histories[block[:, None], self._slots(block), :, lane[:, None]]
        states[:, self._history] = history.reshape(len(rows), -1).view(np.uint64)
        observed = np.zeros((len(rows), 2 * (self._observed.stop - self._observed.start)), dtype=np.float32)
        observed[:, : self._observations.shape[1]] = self._observations[rows]
        states[:, self._observed] = observed.view(np.uint64)
        states[:, self._beside] = beside.view(np.uint64)
        states[:, _CHECK] = [_sum(state) for state in states]
        return states

    def write(self, states: Words, rows: Indices) -> NDArray[np.float64]:
        """Set some environments to states that `checked` has accepted.

        Args:
            states: one for all of them, or one for each. Shape (1 or n, `size`).
            rows: their indices, each once. Shape (n,).

        Returns:
            What another engine's plant has added to the first of the states. Shape (`beside`,).
        """
        self._header[word.KEPT_READINGS] |= np.bitwise_or.reduce(states[:, _READINGS]).view(np.int64)
        history = states[:, self._history].view(np.float64).reshape(len(states), *self._histories.shape[1:3])
        observed = states[:, self._observed].copy().view(np.float32)
        self._observations[rows] = observed[:, : self._observations.shape[1]]
        for block, lanes, chosen in self._shares(rows):
            some = slice(None) if len(states) == 1 else chosen
            for place, part in self._parts:
                part[block][lanes] = states[some, place]
            ring = np.empty_like(history[some])
            ring[:, self._slots(np.array([block]))[0]] = history[some]
            np.moveaxis(self._histories[block], 2, 0)[lanes] = ring
        return states[0, self._beside].view(np.float64)

    def _shares(self, rows: Indices) -> Iterator[tuple[int, Any, Any]]:
        """Yield for each block its lanes among the rows, and the places of these rows; slices where that is faster."""
        block, lane = np.divmod(rows, self._lanes)
        if len(rows) == rows[-1] - rows[0] + 1 and np.all(np.diff(rows) == 1):
            for one in range(block[0], block[-1] + 1):
                low, high = np.searchsorted(block, [one, one + 1]).tolist()
                yield one, slice(lane[low], lane[high - 1] + 1), slice(low, high)
            return
        for one in np.unique(block).tolist():
            chosen = np.flatnonzero(block == one)
            yield one, lane[chosen], chosen

    def _slots(self, block: Indices) -> Indices:
        """Return the slots of the delay lines of some blocks, the newest first. Shape (n, slots)."""
        count = self._histories.shape[1]
        return (self._clocks[block, clock_row.HEAD, 0][:, None] - np.arange(count)) % count

    def checked(self, given: Any, rows: Indices) -> Words:
        """Return states as `write` takes them.

        Args:
            given: one state, or one for each of the environments that are set.
            rows: indices of these environments. Shape (n,).

        Raises:
            TypeError, ValueError: for anything else, for states of environments with other options, or damaged ones.
        """
        if not isinstance(given, np.ndarray) or given.dtype != np.uint64:
            raise TypeError(f"state = {shown(given)}: must be an array of uint64 that get_state() has returned")
        count = len(rows)
        states = np.ascontiguousarray(given[None] if given.ndim == 1 else given)
        if states.ndim != 2 or len(states) not in (1, count):
            allowed = "(k,)" if count == 1 else f"(k,) or ({count}, k)"
            raise ValueError(f"state: must have shape {allowed}, got {given.shape}")
        for n, state in enumerate(states):
            wanted = self._stamps[rows if len(states) == 1 else rows[n : n + 1]]
            if len(state) != self.size or np.any(wanted != state[_STAMP]):
                raise ValueError(
                    f"state[{n}]: is of an environment with other options; those that decide what is simulated, "
                    "observed and kept (arm's shapes and kinematics, action_mode, feedback_source, sensors, delays, "
                    "observation, reference, control_period, physics_step, names in randomisation) must be the same"
                )
            if state[_CHECK] != _sum(state):
                raise ValueError(f"state[{n}]: its check sum is wrong; must be as get_state() has returned it")
        return states


def _runs(variant: Variant, fixed: frozenset[str], end: int) -> Iterator[tuple[int, int]]:
    """Yield the first row of each run of an arena's rows that belong to states, and the row after its last."""
    begin = 0
    for name, (first, count) in variant.rows.items():
        if name in fixed and count:
            if first > begin:
                yield begin, first
            begin = first + count
    if end > begin:
        yield begin, end


def _compiled(variant: Variant) -> list[tuple[str, Any]]:
    """Return what kernels are compiled for, other than lanes and disturbances, with the program by its name."""
    values = {one.name: getattr(variant, one.name) for one in fields(variant)} | {"program": variant.kind}
    return [(name, value) for name, value in values.items() if name not in ("lanes", "disturbed")]


def _own_meaning(settings: Settings, fixed: frozenset[str]) -> tuple[Any, ...]:
    """Return what else the numbers of an environment's state mean: shapes of its arm, readings, observations."""
    arm, rows = settings.flexible_arm.parameters, fixed_rows(settings)
    read = [(name, list(map(float, rows[name]))) for name in _READ if name in fixed]
    previews = settings.previews if "previews" in settings.observation else ()
    return ([getattr(arm, name) for name in SHARED_BY_ARMS], read, settings.scaled, previews)


def _stamp(meaning: tuple[Any, ...]) -> int:
    return int.from_bytes(sha256(repr(meaning).encode()).digest()[:8], "little")


def _sum(state: Words) -> int:
    return crc32(state[_STAMP:].data)
