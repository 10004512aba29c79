"""`BatchSimulator`: N environments whose episodes are reset and stepped by compiled kernels.

Single and vector environments both use it: a single environment is a batch of one, bitwise identical.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexarm_env.codegen import assembly, cache
from flexarm_env.codegen.declarations import Program
from flexarm_env.codegen.intrinsics import TILE
from flexarm_env.codegen.memory import aligned_zeros
from flexarm_env.envs.bounds import check_moving_start
from flexarm_env.envs.choices import STARTS
from flexarm_env.envs.drawing import Drawing, drawing_of
from flexarm_env.envs.kernel_inputs import (
    ALL_READINGS,
    NAN,
    fixed_rows,
    header_and_settings,
    lane_numbers,
    lay_out,
    path_tables,
    tail_rows,
)
from flexarm_env.envs.observation import common_layout
from flexarm_env.envs.per_env import refuse_unlike
from flexarm_env.envs.settings import Settings
from flexarm_env.episode import draws
from flexarm_env.kernels.entries import CLOCK_ROWS, clock_row, column, drawn, extent, word
from flexarm_env.kernels.layout import beginning_sizes, episode_sizes
from flexarm_env.kernels.stamp import check_stamp, layout_stamp
from flexarm_env.kernels.status import failures
from flexarm_env.kernels.variants import Variant, shared_model
from flexarm_env.parameters import DIRECTIONS

Array = NDArray[np.float64]
# Relative time of a block's step, by its number of lanes; `Square-v0` with two modes (`make bench`, batches).
# Three of the largest hold 1024 lanes; with a power of two, rows would evict each other from the processor's caches.
COSTS = {8: 1.0, 32: 2.9, 128: 10.8, 344: 27.5}
assert all(lanes % TILE == 0 for lanes in COSTS)  # `write_observations` works by tiles
REASONS: dict[float, str | None] = {
    -2.0: "deflection",
    -3.0: "error",
}  # beside those of a state (`observe.termination_status`)
# Attributes that are views of the memory.
VIEWS = (
    *("_header", "_arenas", "_clocks", "_keys", "_starts", "_reset_requests", "_paths"),
    *("actions", "observations", "single_action", "single_observation", "single_result", "single_end"),
)


class BatchSimulator:
    """N environments with the same settings, or with some of their own (`per_env`).

    Attributes:
        settings: settings of environment 0; those of all environments without `per_env`.
        each: settings of each environment.
        layout: of the observations.
        failures: reason for the end of an episode, by its status; status 0 is that of a valid state.
        everyone: mask of all environments; read-only. Shape (N,).
        usual_requests: requests for new episodes by the settings alone; read-only. Shape (N, columns).
        observations: present observations; the kernels write into this array. Shape (lanes, k), float32.
        results: results of the latest `start` or `step` (not `single_step`), a new array each time. Shape (N, k).
        parts: slices of the columns of `results`, by name.
        single_step: advances a batch of one by a control period; returns False if the action is not finite.
        single_action: action of the first environment: a `memoryview`, which takes float32 arrays of its shape only.
        single_observation: observation of the first environment: a view.
        single_result: present results of the first environment: a view.
        single_end: reward and status, a part of `single_result`: a `memoryview`.
    """

    results: Array
    _pool: ThreadPoolExecutor | None
    _step_kernel: Callable[..., Any]
    single_step: Callable[[], bool]

    def __init__(self, settings: Settings | Sequence[Settings], count: int, threads: int = 1) -> None:
        """Lay out the memory; kernels are compiled, or loaded from the cache, at the first start.

        Args:
            settings: settings of all environments, or a sequence with those of each.
            count: number of environments.
            threads: number of threads that step the blocks; more than one pays off for large batches on idle cores.

        Raises:
            ValueError: if settings differ in what all environments of a batch share.
        """
        self.each = [settings] * count if isinstance(settings, Settings) else list(settings)
        self.settings, self.count, self._threads = self.each[0], count, threads
        refuse_unlike(self.each)
        settings, kinds = self.settings, list({id(one): one for one in self.each}.values())
        for one in kinds:
            check_moving_start(one, one.start)
        arm = settings.flexible_arm
        program = self._program_of(settings)
        self.layout = common_layout(kinds, program)
        lanes = block_lanes(count, threads)
        self._variant = _variant(settings, program, lanes, any(one.disturbed for one in kinds))
        self._rows = self._variant.rows
        sizes = episode_sizes(self._rows)
        first = self._rows[next(iter(sizes))][0]
        self._results = slice(first, first + sum(sizes.values()))
        ends = np.cumsum(list(sizes.values())).tolist()
        self.parts = {name: slice(end - size, end) for (name, size), end in zip(sizes.items(), ends, strict=True)}
        channels = len(settings.action_limit)
        blocks = -(-count // lanes)
        header, table = header_and_settings(kinds, program, self.layout)
        rows = extent(self._rows) + tail_rows(kinds, self._variant.hosted)
        places = {id(one): n for n, one in enumerate(kinds)}
        kind_of = np.array([places[id(one)] for one in self.each])[np.minimum(np.arange(blocks * lanes), count - 1)]
        owns = np.array([lane_numbers(one, program) for one in kinds])
        usual = _usual_orders(settings, count, blocks * lanes)
        self._memory, self._parts = lay_out(
            {
                "HEADER": header,
                "ARENAS": np.zeros((blocks, rows, lanes)),
                "HISTORIES": np.zeros(
                    (blocks, max(one.history_slots for one in kinds), self._variant.slot_rows, lanes)
                ),
                "CLOCKS": np.zeros((blocks, CLOCK_ROWS, lanes), dtype=np.int64),
                "KEYS": np.zeros(blocks * lanes, dtype=np.uint64),
                "STARTS": np.zeros(blocks * lanes, dtype=bool),
                "ACTIVE": np.zeros(blocks * lanes, dtype=bool),
                "ACTIONS": np.zeros((blocks * lanes, channels), dtype=np.float32),
                "OBSERVATIONS": np.zeros((blocks * lanes, len(self.layout.rows)), dtype=np.float32),
                "SETTINGS": table,
                "LANE_SETTINGS": owns[kind_of] if len(kinds) > 1 else owns,
                "PATHS": path_tables(settings, blocks * lanes),
                "RESET_REQUESTS": usual,
            }
        )
        self.failures = failures(arm.size) | REASONS
        self.usual_requests = usual[:count]
        self._usual = True
        self._link()
        self._fix_rows([fixed_rows(one) for one in kinds], kind_of)

    def __len__(self) -> int:
        """Return the number of environments."""
        return self.count

    # --- running ---------------------------------------------------------------------------------------------------

    def start(self, keys: NDArray[np.uint64], which: NDArray[np.int64], reset_requests: Array) -> None:
        """Begin episodes.

        Args:
            keys: keys of the episodes that begin. Shape (n,).
            which: indices of the environments that begin one; the others do not change. Shape (n,).
            reset_requests: see `entries.Column`; only the rows `which` are read. Shape (N, columns).
        """
        self.request_resets(keys, which, reset_requests)
        if self._step_kernel is _not_started:
            self._use(self.compile())
            self._starts[self.count :] = True  # lanes without an environment run, too, and need a valid state
            self.actions[self.count :] = self.settings.mode.idle
        self._header[word.DRIVING] = 0
        try:
            self.step()
        finally:
            self._header[word.DRIVING] = 1

    def request_resets(self, keys: NDArray[np.uint64], which: NDArray[np.int64], reset_requests: Array) -> None:
        """Request that the next step begins episodes at its end; see `start`."""
        self._starts[which] = True
        self._keys[which] = keys
        usual = reset_requests is self.usual_requests
        if not (usual and self._usual):  # the memory holds the usual requests until others are written
            self._usual = False
            self._reset_requests[which] = reset_requests[which]
        if not usual and np.isfinite(reset_requests[which, column.DRAWN + drawn.DELAY]).any():
            self._header[word.READINGS] = ALL_READINGS

    def step(self) -> None:
        """Advance all environments by one control period with `actions`, and begin the requested episodes."""
        if self.count == 1:
            if not self.single_step():
                raise ValueError(f"actions = {self.actions!r}: must be finite")
            self.results = self.result(0)[None]
            return
        told = np.empty((self._results.stop - self._results.start, len(self._keys)))
        if self._threads == 1:
            self._step_kernel(self._memory, 0, self._blocks, told)
        else:
            if self._pool is None:
                self._pool = ThreadPoolExecutor(self._threads)
            for _ in self._pool.map(partial(self._step_share, told), self._edges[:-1], self._edges[1:]):
                pass
        self.results = told[:, : self.count].T

    def _step_share(self, told: Array, begin: int, end: int) -> None:
        self._step_kernel(self._memory, begin, end, told)

    def dispatcher(self) -> Any:
        """Return the function, not its machine code, that steps these environments."""
        entry = self._variant.program.entries(self._variant.lanes)[0]
        return getattr(assembly.load(self._variant), entry.__name__)

    def compile(self) -> Callable[..., Any]:
        """Return the machine code that steps these environments; the first call compiles or loads it."""
        return cache.compiled_entry(self.dispatcher(), *self._example())

    def result(self, index: int) -> Array:
        """Return one environment's present results (columns: `parts`) in a new array. Shape (k,)."""
        block, lane = divmod(index, self._arenas.shape[2])
        return self._arenas[block, self._results, lane].copy()

    def close(self) -> None:
        """Shut down the threads."""
        if self._pool is not None:
            self._pool.shutdown()
            self._pool = None

    def beginnings(self) -> Array:
        """Return what describes the present episodes (`layout.beginning_sizes`) in a new array. Shape (N, k)."""
        first = self._rows["EPISODE"][0]
        rows = self._arenas[:, first : first + sum(beginning_sizes(self._rows).values())]
        return np.moveaxis(rows, 1, 2).reshape(-1, rows.shape[1])[: self.count].copy()

    def path_names(self) -> NDArray[np.str_]:
        """Return the names of the paths that the environments follow. Shape (N,)."""
        names = np.array(self.settings.reference)
        return names[self._chosen_paths() % len(names)]

    def directions(self) -> NDArray[np.str_]:
        """Return the directions of the environments' laps. Shape (N,)."""
        if not self.settings.paths:
            return np.array([one.direction for one in self.each])
        return np.array(DIRECTIONS)[self._chosen_paths() // len(self.settings.reference)]

    def _chosen_paths(self) -> NDArray[np.int64]:
        """Return the index of the path that each environment follows. Shape (N,)."""
        return self._clocks[:, clock_row.PATH].reshape(-1)[: self.count]

    def path(self, index: int) -> Array:
        """Return the way-points of the path that an environment follows [m]. Shape (n, 2)."""
        block, lane = divmod(index, self._arenas.shape[2])
        return np.asarray(self._paths[self._clocks[block, clock_row.PATH, lane], :, 1:3])

    def drawing(self, index: int, result: Array) -> Drawing:
        """Where the lines of an environment's arm are, from its `result`."""
        return drawing_of(self.each[index], result[self.parts["STATE"]])

    # --- inside ----------------------------------------------------------------------------------------------------

    def _program_of(self, settings: Settings) -> Program:
        """Program of the kernels."""
        return settings.program

    def _example(self) -> tuple[Any, ...]:
        """Arguments of the types that the kernel takes."""
        return (self._memory,) if self.count == 1 else (self._memory, 0, self._blocks, np.empty((1, 1)))

    def _anew(self) -> BatchSimulator:
        """Return a new batch with these settings."""
        return BatchSimulator(self.each, self.count, self._threads)

    def _fix_rows(self, kinds: Sequence[Mapping[str, Any]], kind_of: NDArray[np.int64]) -> None:
        """Write the rows that no episode changes, by the settings of each lane."""
        for name in kinds[0]:
            if name in self._rows:
                first, count = self._rows[name]
                values = np.array([one[name] for one in kinds], dtype=float)[kind_of]
                blocks = values.reshape(self._blocks, len(kind_of) // self._blocks, count)
                self._arenas[:, first : first + count] = np.moveaxis(blocks, 2, 1)

    def _link(self) -> None:
        """Make the views of the memory, and what else cannot be pickled."""
        views = {name: part.view(self._memory) for name, part in self._parts.items()}
        self._header, self._arenas, self._clocks = views["HEADER"], views["ARENAS"], views["CLOCKS"]
        self._keys, self._starts, self._reset_requests = views["KEYS"], views["STARTS"], views["RESET_REQUESTS"]
        self._paths, self.actions, self.observations = views["PATHS"], views["ACTIONS"], views["OBSERVATIONS"]
        self.single_result = self._arenas[0, self._results, 0]
        end = self.single_result[self.parts["REWARD"].start : self.parts["STATUS"].stop]
        self.single_end = memoryview(end)  # type: ignore[arg-type]
        self.single_action, self.single_observation = memoryview(self.actions[0]), self.observations[0]
        self.everyone = np.ones(self.count, dtype=np.bool_)
        self.everyone.setflags(write=False)
        self._blocks = len(self._arenas)
        self._edges = np.linspace(0, self._blocks, self._threads + 1).astype(int).tolist()  # of the threads' shares
        self._use(_not_started)
        self._pool = None

    def _use(self, kernel: Callable[..., Any]) -> None:
        self._step_kernel, self.single_step = kernel, partial(kernel, self._memory)

    def __getstate__(self) -> dict[str, Any]:
        """Leave out views, which would become copies, and what cannot be pickled."""
        left_out = (*VIEWS, "everyone", "_pool", "_step_kernel", "single_step")
        kept = {name: value for name, value in self.__dict__.items() if name not in left_out}
        return {"layout_stamp": self._stamp(), **kept}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore the memory and link the views again.

        Raises:
            LayoutError: if a new batch with these settings has another layout.
        """
        found, kept = state.get("layout_stamp"), {**state}
        kept.pop("layout_stamp", None)
        self.__dict__.update(kept)
        check_stamp("the batch", found, self._anew()._stamp())
        self._memory = aligned_zeros(len(kept["_memory"]))
        self._memory[:] = kept["_memory"]
        self._link()
        if self._keys.any():  # an episode has begun
            self._use(self.compile())

    def _stamp(self) -> str:
        return layout_stamp(self._variant, self._parts)


def _variant(settings: Settings, program: Program, lanes: int, disturbed: bool) -> Variant:
    """Return the variant of the kernels that these settings need."""
    arm = settings.flexible_arm
    return Variant(
        program,
        arm.parameters.modes_per_link,
        arm.parameters.velocity_forces == "complete",
        lanes,
        sensor=shared_model(settings.sensor),
        rate_jacobian=settings.rate_jacobian,
        law_on_sensor=settings.law_sensor == "sensor",
        own_paths=not settings.paths,
        foreshortened=arm.constants.foreshortened,
        disturbed=disturbed,
        second_sensor=settings.second_sensor_link or 0,
    )


def _usual_orders(settings: Settings, count: int, lanes: int) -> Array:
    """Return requests for episodes by the settings alone; read-only. Shape (lanes, columns)."""
    usual = np.full((lanes, column.STATE + 2 * settings.flexible_arm.size), NAN)
    usual[:, column.START] = START_CODES[settings.start]
    usual[count:, column.START] = START_CODES["corner"]  # lanes without an environment stay at rest
    usual.setflags(write=False)
    return usual


def block_lanes(count: int, threads: int) -> int:
    """Return the number of lanes of a block with which a batch is stepped fastest, by `COSTS`."""
    if count == 1:
        return 1

    def time(lanes: int) -> float:
        blocks = -(-count // lanes)
        return COSTS[lanes] * -(-blocks // threads)

    return min(COSTS, key=time)


def _not_started(*arguments: Any) -> None:
    raise RuntimeError("step() before start(): there are no states to advance")


START_CODES = {name: getattr(draws, name.upper()) for name in STARTS}
