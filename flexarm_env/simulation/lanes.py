"""`LaneBatch`: N arms in blocks of lanes, in one piece of memory, stepped by compiled kernels.

It has the places of arrays, the call into the kernels, their results, threads and copies. The program says what a
period does (`episode.step`), rows of the arena hold the parameters of a lane (`envs.batch`).
"""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexarm_env.codegen import cache, compiler
from flexarm_env.codegen.memory import ArraySpec, pack
from flexarm_env.kernels.entries import CLOCK_ROWS, MEMORY, extent, word
from flexarm_env.kernels.layout import result_sizes
from flexarm_env.kernels.stamp import check_stamp, layout_stamp
from flexarm_env.kernels.variants import Variant

Array = NDArray[np.float64]
ALL_READINGS = -1  # as bits of `Header.KEPT_READINGS`


class LaneBatch(ABC):
    """N arms in blocks of lanes.

    Attributes:
        count: N.
        parts: places of the parts of results, by name (`layout.result_sizes`).
    """

    _kernel: Callable[..., Any]
    _pool: ThreadPoolExecutor | None
    _process: int  # whose threads are in the pool

    def __init__(
        self, variant: Variant, count: int, arrays: Mapping[str, NDArray[Any]], slots: int, tail: int, threads: int = 1
    ) -> None:
        """Lay out the memory; kernels are compiled, or found in the cache, when `_prepare` is first called.

        Args:
            variant: of the kernels.
            count: N; lanes beyond the last arm repeat it.
            arrays: HEADER (`entries.Header`), SETTINGS (`entries.Setting`), each with what follows it, PATHS, and
                those of `entries.MEMORY` that the program has beside a batch's own.
            slots: of the delay line.
            tail: further rows of an arena.
            threads: that step the blocks; more than one pays for large batches on idle cores only.

        Raises:
            ValueError: if numba compiles nothing.
        """
        cache.check_compiler()
        self.count, self._threads = count, threads
        self._variant, self._rows = variant, variant.rows
        sizes = result_sizes(self._rows)
        first = self._rows[next(iter(sizes))][0]
        self._results = slice(first, first + sum(sizes.values()))
        self.parts = {
            name: slice(self._rows[name][0] - first, self._rows[name][0] - first + size) for name, size in sizes.items()
        }
        self._blocks = -(-count // variant.lanes)
        self._memory, self._parts = _lay_out(variant, self._blocks, arrays, slots, tail)
        self._link()
        self._edges = np.linspace(0, self._blocks, threads + 1).astype(int).tolist()  # of the threads' shares
        self._pool = None
        self._ready = False  # until the first start
        self._use(_not_started)

    def __len__(self) -> int:
        """Return the number of arms."""
        return self.count

    def _link(self) -> None:
        self._header, self._arenas, self._histories = (self._view(n) for n in ("HEADER", "ARENAS", "HISTORIES"))
        self._clocks, self._starts, self._paths = (self._view(n) for n in ("CLOCKS", "STARTS", "PATHS"))

    def _view(self, name: str) -> NDArray[Any]:
        return self._parts[name].view(self._memory)

    # --- rows ------------------------------------------------------------------------------------------------------

    def _lane_rows(self, name: str) -> Array:
        """Return a view of a part of the arenas. Shape (blocks, count, lanes)."""
        first, count = self._rows[name]
        return self._arenas[:, first : first + count]

    def _put_rows(self, kinds: Sequence[Mapping[str, Any]], kind_of: NDArray[np.int64]) -> None:
        """Write what no period changes, as far as the program has it.

        Args:
            kinds: parts of the arenas by name, of each kind of lane.
            kind_of: kind of each arm. Shape (N,).
        """
        for name in kinds[0].keys() & self._rows.keys():
            rows = self._lane_rows(name)
            blocks, count, lanes = rows.shape
            own = kind_of[np.minimum(np.arange(blocks * lanes), self.count - 1)]
            values = np.array([one[name] for one in kinds], dtype=float)[own]
            rows[:] = np.moveaxis(values.reshape(blocks, lanes, count), 2, 1)

    def _get(self, name: str, count: int) -> Array:
        """Return rows of the arenas, from a part on, in a new array. Shape (N, count)."""
        first, _ = self._rows[name]
        rows = np.moveaxis(self._arenas[:, first : first + count], 1, 2)
        return rows.reshape(-1, count)[: self.count].copy()

    # --- running ---------------------------------------------------------------------------------------------------

    def dispatcher(self) -> Any:
        """Return the function, not its machine code, that steps these arms."""
        entry = self._variant.program.entries(self._variant.lanes)[0]
        return getattr(compiler.load(self._variant), entry.__name__)

    def _example(self) -> tuple[Any, ...]:
        return self._memory, 0, self._blocks, np.empty((1, 1))

    def compile(self) -> Callable[..., Any]:
        """Return the machine code that steps these arms; the first call compiles or loads it."""
        return cache.compiled_entry(self.dispatcher(), *self._example())

    def _prepare(self) -> None:
        if not self._ready:
            self._use(self.compile())
            self._ready = True

    def _use(self, kernel: Callable[..., Any]) -> None:
        self._kernel = kernel

    def _run_starts(self) -> Array:
        """Start the lanes that are marked, while no time passes; see `_run`."""
        self._prepare()
        self._header[word.DRIVING] = 0
        try:
            return self._run()
        finally:
            self._header[word.DRIVING] = 1

    def _run(self) -> Array:
        """Run one control period, and the starts that are marked; return the results, a new array. Shape (N, k)."""
        results = np.empty((self._results.stop - self._results.start, self._blocks * self._variant.lanes))
        if self._threads == 1:
            self._kernel(self._memory, 0, self._blocks, results)
        else:
            if self._pool is None or self._process != os.getpid():  # a forked child does not have its parent's threads
                self._pool, self._process = ThreadPoolExecutor(self._threads), os.getpid()

            def step(low: int, high: int) -> None:
                self._kernel(self._memory, low, high, results)

            for _ in self._pool.map(step, self._edges[:-1], self._edges[1:]):
                pass
        return results[:, : self.count].T

    def close(self) -> None:
        """End the threads."""
        if self._pool is not None:
            self._pool.shutdown()
            self._pool = None

    # --- copies ----------------------------------------------------------------------------------------------------

    @abstractmethod
    def _arguments(self) -> tuple[Any, ...]:
        """Return the arguments from which a copy is made."""

    @abstractmethod
    def _kept(self) -> dict[str, Any]:
        """Return the attributes that a copy takes over, beside the memory."""

    def __getstate__(self) -> dict[str, Any]:
        """Return what a copy is made from: arguments, memory, and the layout's stamp."""
        return {
            "layout_stamp": layout_stamp(self._variant, self._parts),
            "arguments": self._arguments(),
            "memory": self._memory.copy(),
            "ready": self._ready,
            "kept": self._kept(),
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Make it anew, with the memory of the one that was saved.

        Raises:
            LayoutError: if the memory has another layout than a new one.
        """
        anew = type(self)(*state["arguments"])
        check_stamp("the batch", state.get("layout_stamp"), layout_stamp(anew._variant, anew._parts))
        self.__dict__.update(anew.__dict__)
        self.__dict__.update(state["kept"])
        self._memory[:] = state["memory"]
        if state["ready"]:
            self._prepare()


def _not_started(*arguments: Any) -> None:
    raise RuntimeError("step() before start(): there are no states to advance")


def _lay_out(
    variant: Variant, blocks: int, arrays: Mapping[str, NDArray[Any]], slots: int, tail: int
) -> tuple[Array, dict[str, ArraySpec]]:
    """Return memory with the header and the arrays, and where each lies; kernels read these places in the header."""
    width = variant.lanes
    own = {
        "HEADER": arrays["HEADER"],  # kernels find it at the beginning
        "ARENAS": np.zeros((blocks, extent(variant.rows) + tail, width)),
        "HISTORIES": np.zeros((blocks, slots, variant.slot_rows, width)),
        "CLOCKS": np.zeros((blocks, CLOCK_ROWS, width), dtype=np.int64),
        "STARTS": np.zeros(blocks * width, dtype=bool),
    }
    memory, parts = pack({**own, **arrays})
    header = parts["HEADER"].view(memory)
    sizes = {
        "HEADER_WORDS": len(header),
        "SETTING_NUMBERS": len(arrays["SETTINGS"]),
        "ARENA_ROWS": own["ARENAS"].shape[1],
        "HISTORY_ROWS": slots * variant.slot_rows,
        "PATH_COUNT": arrays["PATHS"].shape[0],
        "PATH_POINTS": arrays["PATHS"].shape[1],
    }
    places = {name: parts[name].first for name in MEMORY if name in parts}
    for name, value in {**sizes, **places}.items():
        header[getattr(word, name)] = value
    return memory, parts
