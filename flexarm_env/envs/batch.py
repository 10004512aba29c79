"""`BatchSimulator`: N environments whose episodes are reset and stepped by compiled kernels.

Single and vector environments both use it: a single environment is a batch of one, bitwise identical.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexarm_env.codegen.declarations import Program
from flexarm_env.codegen.intrinsics import TILE
from flexarm_env.codegen.memory import WORD, machine_memory
from flexarm_env.envs.bounds import check_moving_start
from flexarm_env.envs.drawing import Drawing, drawing_of
from flexarm_env.envs.draws import Draws
from flexarm_env.envs.kernel_inputs import (
    fixed_rows,
    header_and_settings,
    lane_numbers,
    path_tables,
    tail_rows,
    usual_requests,
)
from flexarm_env.envs.observation import common_layout, variant_of
from flexarm_env.envs.own_paths import moved, shown_rows
from flexarm_env.envs.per_env import refuse_unlike
from flexarm_env.envs.settings import Settings
from flexarm_env.envs.states import States, Words
from flexarm_env.episode.observe import failures
from flexarm_env.kernels.entries import CLOCK_ROWS, clock_row, column, drawn, extent, segment, word
from flexarm_env.kernels.layout import sizes_between
from flexarm_env.kernels.variants import Variant
from flexarm_env.lazy import cached_property
from flexarm_env.parameters import DIRECTIONS
from flexarm_env.simulation.lanes import ALL_READINGS, LaneBatch
from flexarm_env.validation import shown

Array = NDArray[np.float64]
# Relative time of a block's step, by its number of lanes, in a batch of 1024 of `Square-v0` with the linear arm. Each
# size is compiled when it is first used, so there are two. Three of the larger hold 1024 lanes; with a power of two,
# rows would evict each other from the processor's caches.
COSTS = {8: 1.0, 344: 36.0}
assert all(lanes % TILE == 0 for lanes in COSTS)  # `write_observations` works by tiles
BESIDE = 4000  # bytes that an environment takes beside the kernels' memory: generator, observation, bounds, results
OWN_END = -4.0  # the status that the option `termination` sets


class BatchSimulator(LaneBatch):
    """N environments with the same settings, or with some of their own (`per_env`).

    Attributes:
        settings: settings of environment 0; those of all environments without `per_env`.
        each: settings of each environment.
        layout: of the observations.
        draws: what episodes draw.
        failures: reason for the end of an episode, by its status; status 0 is that of a valid state.
        everyone: mask of all environments; read-only. Shape (N,).
        usual_requests: requests for new episodes by the settings alone; read-only. Shape (N, columns).
        observations: present observations; the kernels write into this array. Shape (lanes, k), float32.
        results: results of the latest `start` or `step` (not `single_step`), a new array each time. Shape (N, k).
        single_step: advances a batch of one by a control period; returns False if the action is not finite.
        single_action: action of the first environment: a `memoryview`, which takes float32 arrays of its shape only.
        single_observation: observation of the first environment: a view.
        single_result: present results of the first environment: a view.
        single_end: reward and status, a part of `single_result`: a `memoryview`.
    """

    results: Array
    single_step: Callable[[], bool]
    single_action: Any  # before Python 3.12, types do not know that an array goes into a memoryview

    def __init__(self, settings: Settings | Sequence[Settings], count: int, threads: int = 1) -> None:
        """Lay out the memory for so many environments, which have the same settings or each its own.

        Kernels are compiled, or loaded from the cache, at the first start.

        Raises:
            ValueError: if settings differ in what all environments of a batch share, or there are more environments
                than the machine has memory for.
        """
        each = [settings] if isinstance(settings, Settings) else list(settings)
        self.settings = settings = each[0]
        refuse_unlike(each)
        kinds = list({id(one): one for one in each}.values())
        for one in kinds:
            check_moving_start(one, one.start)
        program = self._program_of(settings)
        self.layout = common_layout(kinds, program)
        lanes = block_lanes(count, threads)
        variant = variant_of(settings, program, lanes, any(one.disturbed for one in kinds))
        _check_room(count, variant, kinds)
        self.each = each if len(each) == count else each * count
        places = {id(one): n for n, one in enumerate(kinds)}
        kind_of = np.array([places[id(one)] for one in self.each])
        self.draws = Draws(kinds, kind_of, column.STATE + 2 * settings.flexible_arm.size)
        slots, tail = max(one.history_slots for one in kinds), tail_rows(kinds, variant.hosted)
        super().__init__(variant, count, self._arrays(variant, kinds, kind_of), slots, tail, threads)
        rows = [fixed_rows(one) for one in kinds]
        self._put_rows(rows, kind_of)
        self._fixed = frozenset(rows[0]) - self.draws.rows
        self.failures = failures(settings.flexible_arm.size) | {OWN_END: "own"}
        self.usual_requests = self._reset_requests[:count].copy()
        self.usual_requests.setflags(write=False)
        self._usual = True
        self.everyone = np.ones(count, dtype=np.bool_)
        self.everyone.setflags(write=False)

    def _arrays(
        self, variant: Variant, kinds: Sequence[Settings], kind_of: NDArray[np.int64]
    ) -> dict[str, NDArray[Any]]:
        """Return the arrays that decide what the environments' lanes do, and what they are given and give."""
        settings, count = self.settings, len(kind_of)
        width = -(-count // variant.lanes) * variant.lanes
        paths, names, first = path_tables(kinds, width)
        self._path_names, self.first_paths = np.array(names), np.array(first)[kind_of]
        owns = np.array([lane_numbers(one, variant) for one in kinds])
        if len(kinds) > 1 or self.draws.further:
            owns = owns[kind_of[np.minimum(np.arange(width), count - 1)]]
        requests = usual_requests(settings, self.first_paths, (width, self.draws.columns))
        header, table = header_and_settings(kinds, variant, self.layout)
        header[word.PATH_NAMES] = len(names)
        header[[word.LANE_SETTING_ROWS, word.LANE_SETTING_COLUMNS]] = owns.shape
        header[word.REQUEST_COLUMNS] = requests.shape[1]
        return {
            "HEADER": header,
            "SETTINGS": table,
            "PATHS": paths,
            "KEYS": np.zeros(width, dtype=np.uint64),
            "ACTIVE": np.zeros(width, dtype=bool),
            "ACTIONS": np.zeros((width, len(settings.action_limit)), dtype=np.float32),
            "OBSERVATIONS": np.zeros((width, len(self.layout.rows)), dtype=np.float32),
            "LANE_SETTINGS": owns,
            "RESET_REQUESTS": requests,
        }

    def _link(self) -> None:
        super()._link()
        self._keys, self._reset_requests = self._view("KEYS"), self._view("RESET_REQUESTS")
        self._own_settings = self._view("LANE_SETTINGS")
        self.actions, self.observations = self._view("ACTIONS"), self._view("OBSERVATIONS")
        self.single_result = self._arenas[0, self._results, 0]
        end = self.single_result[self.parts["REWARD"].start : self.parts["STATUS"].stop]
        self.single_end = end.data
        self.single_action, self.single_observation = self.actions[0].data, self.observations[0]

    def _use(self, kernel: Callable[..., Any]) -> None:
        super()._use(kernel)
        self.single_step = partial(kernel, self._memory)

    # --- running ---------------------------------------------------------------------------------------------------

    def start(self, keys: NDArray[np.uint64], which: NDArray[np.int64], reset_requests: Array) -> None:
        """Begin episodes.

        Args:
            keys: keys of the episodes that begin. Shape (n,).
            which: indices of the environments that begin one; the others do not change. Shape (n,).
            reset_requests: see `entries.Column`; only the rows `which` are read. Shape (N, columns).
        """
        self.request_resets(keys, which, reset_requests)
        if not self._ready:
            self._starts[self.count :] = True  # lanes without an environment run, too, and need a valid state
            self.actions[self.count :] = self.settings.mode.idle
        self.results = self._run_starts()

    def request_resets(self, keys: NDArray[np.uint64], which: NDArray[np.int64], reset_requests: Array) -> None:
        """Request that the next step begins episodes at its end; see `start`.

        What a path's function raises is raised before anything changes.
        """
        usual, drawing = reset_requests is self.usual_requests, not self.draws.nothing
        # the memory holds the usual requests until others are written
        new = drawing or not (usual and self._usual)
        rows = self.draws.completed(reset_requests[which], keys, which) if new else self._reset_requests[which]
        if self.settings.path_rows:
            each, width = zip(rows, which.tolist(), keys.tolist(), strict=True), self._paths.shape[1]
            self._paths[which] = [self.draws.path(row, i, key, width) for row, i, key in each]
        self._starts[which], self._keys[which] = True, keys
        if new:
            self._usual, self._reset_requests[which] = False, rows
            if self.draws.further:
                self._put_constants(which)
        if not usual and np.isfinite(reset_requests[which, column.DRAWN + drawn.DELAY]).any():
            self._header[word.KEPT_READINGS] = ALL_READINGS

    def _put_constants(self, which: NDArray[np.int64]) -> None:
        """Give environments that begin an episode the constants that follow from what it draws."""
        for i in which.tolist():
            rows, self._own_settings[i] = self.draws.constants(self._reset_requests[i], i, self._variant)
            block, lane = divmod(i, self._arenas.shape[2])
            for name, values in rows.items():
                self._lane_rows(name)[block, :, lane] = values

    def step(self) -> None:
        """Advance all environments by one control period with `actions`, and begin the requested episodes."""
        self.results = self._run()

    def _run(self) -> Array:
        if self.count > 1:
            return super()._run()
        if not self.single_step():
            raise ValueError(f"actions = {self.actions!r}: must be finite")
        return self.result(0)[None]

    def _example(self) -> tuple[Any, ...]:
        return (self._memory,) if self.count == 1 else super()._example()

    def result(self, index: int) -> Array:
        """Return one environment's present results (columns: `parts`) in a new array. Shape (k,)."""
        block, lane = divmod(index, self._arenas.shape[2])
        return self._arenas[block, self._results, lane].copy()

    def set_target(self, rows: NDArray[np.int64], *given: Any) -> None:
        """Move the targets of some environments; see `FlexArmEnvBase.set_reference` for the arguments and errors."""
        if self.settings.reference != ("target",):
            raise ValueError(f"set_reference: reference = {shown(self.settings.reference)}; must be 'target'")
        block, lane = np.divmod(rows, self._arenas.shape[2])
        steps = self._clocks[block, clock_row.STEPS, lane]
        now = steps * (self.settings.control_period / self.settings.substeps)
        self._paths[rows] = moved(self.settings, self._paths[rows], now, given)
        for name in {"PRESENT_SEGMENT", "COMMAND_SEGMENT"}.intersection(self._rows):
            self._arenas[block, self._rows[name][0] + segment.END, lane] = -np.inf  # as `invalidate_segment` does

    def end(self, rows: NDArray[np.int64]) -> None:
        """Note that the option `termination` has ended some episodes."""
        block, lane = np.divmod(rows, self._arenas.shape[2])
        self._arenas[block, self._rows["STATUS"][0], lane] = OWN_END

    def get_states(self, rows: NDArray[np.int64], generators: Words) -> Words:
        """Return the states of some environments (`states.States.read`). Shape (n, k)."""
        return self._states.read(rows, generators, self._plant_state())

    def set_states(self, given: Any, rows: NDArray[np.int64]) -> Words:
        """Set some environments to states, and return these (`states.States`). Shape (1 or n, k)."""
        states = self._states.checked(given, rows)
        self._set_plant_state(self._states.write(states, rows))
        if self._variant.payloads and self.draws.further:  # what the payload changes follows from them
            self._put_constants(rows)
        first = self._rows["STATE"][0]
        count = self._results.stop - self._results.start
        assert first == self._results.start
        self.results = self._get("STATE", count)
        return states

    @cached_property
    def _states(self) -> States:
        drawn = slice(self.draws.first, None)
        return States(self._view, drawn, self._variant, self._fixed, len(self._plant_state()), self.each)

    def _plant_state(self) -> Array:
        """Return what another engine's plant adds to a state. Shape (k,)."""
        return np.zeros(0)

    def _set_plant_state(self, state: Array) -> None:
        """Set another engine's plant to its part of a state, once the environment's own part is set."""

    def episode_data(self) -> Array:
        """Return the rows that describe the present episodes, EPISODE to BRANCH, in a new array. Shape (N, k)."""
        return self._get("EPISODE", sum(sizes_between(self._rows, "EPISODE", "BRANCH").values()))

    def drawn_values(self) -> dict[str, Array]:
        """Return options and parameters of the arm that the present episodes have drawn. Shape (N,) or (N, 2) each."""
        return self.draws.values(self._reset_requests[: self.count])

    def path_names(self) -> NDArray[np.str_]:
        """Return the names of the paths that the environments follow. Shape (N,)."""
        return self._path_names[self._chosen_paths() % len(self._path_names)]

    def directions(self) -> NDArray[np.str_]:
        """Return the directions of the environments' laps. Shape (N,)."""
        if not self.settings.paths:
            return np.array([one.direction for one in self.each])
        return np.array(DIRECTIONS)[self._chosen_paths() // len(self._path_names)]

    def _chosen_paths(self) -> NDArray[np.int64]:
        """Return the index of the path that each environment follows. Shape (N,)."""
        if self.settings.paths and (column_of := self.draws.chosen_path):
            return self._reset_requests[: self.count, column_of].astype(np.int64)
        return self._clocks[:, clock_row.PATH].reshape(-1)[: self.count]

    def path(self, index: int) -> Array:
        """Return the way-points of the path that an environment follows [m]. Shape (n, 2)."""
        block, lane = divmod(index, self._arenas.shape[2])
        rows = shown_rows(self.settings, self._paths.shape[1])
        return np.asarray(self._paths[self._clocks[block, clock_row.PATH, lane], rows, 1:3])

    def drawing(self, index: int, result: Array) -> Drawing:
        """Return where the lines of an environment's arm are, from its `result`."""
        return drawing_of(self.each[index], result[self.parts["STATE"]])

    # --- inside ----------------------------------------------------------------------------------------------------

    def _program_of(self, settings: Settings) -> Program:
        return settings.program

    def _arguments(self) -> tuple[Any, ...]:
        return self.each, self.count, self._threads

    def _kept(self) -> dict[str, Any]:
        kept: dict[str, Any] = {"_usual": self._usual, "draws": self.draws}
        return kept | {"results": self.results} if self._ready else kept


def _check_room(count: int, variant: Variant, kinds: Sequence[Settings]) -> None:
    """Refuse more environments than this machine has memory for, before any of it is taken."""
    slots = max(one.history_slots for one in kinds)
    rows = extent(variant.rows) + tail_rows(kinds, variant.hosted) + slots * variant.slot_rows + CLOCK_ROWS
    each, room = WORD * rows + BESIDE, machine_memory()
    if count * each > room:
        raise ValueError(
            f"num_envs = {shown(count)}: would take {count * each / 1e9:.0f} GB at least; must be at most "
            f"{room // each:.0f}, for which this machine has memory ({room / 1e9:.0f} GB)"
        )


def block_lanes(count: int, threads: int) -> int:
    """Return the number of lanes of a block with which a batch is stepped fastest, by `COSTS`."""
    if count == 1:
        return 1

    def time(lanes: int) -> float:
        blocks = -(-count // lanes)
        return COSTS[lanes] * -(-blocks // threads)

    return min(COSTS, key=time)
