"""`Fleet`: N environments side by side, their episodes begun and stepped by compiled kernels.

Single and vector environments both stand on it: one arm is a fleet of one, with the same bits.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexarm_env import kernels, starts
from flexarm_env.choices import STARTS
from flexarm_env.observation import observation_layout, refuse_fast_starts
from flexarm_env.recorded import Variant
from flexarm_env.rows import ORDER, PLAN, blank_arenas, episode_sizes, extent
from flexarm_env.settings import Settings
from flexarm_env.stepping import BEGAN, CLOCK, PATH
from flexarm_env.tables import (
    ALL_READINGS,
    NAN,
    fixed_rows,
    history_slots,
    path_tables,
    plan_and_table,
)
from flexarm_env.task import ANGLE_LIMITS, RATE_LIMIT

Array = NDArray[np.float64]
# Lanes of a block, by the number of environments from which on they pay.
LANES = {1: 1, 2: 8, 24: 32, 512: 64}
DRIVING = PLAN.index("DRIVING")
KINDS = {"torque": "torque", "residual": "tracking", "reference": "tracking", "gain": "gain"}
REASONS = {-1: "diverged", -2: "deflection", -3: "error"}
# Why an episode may terminate.
ENDS = {
    "error": "the true tip is farther from the reference than `error_limit`",
    "deflection": "a link's tip deflection is beyond `deflection_limit`, or that of one of its modes beyond its length",
    "angle": "theta1 is beyond {:g} turns, or theta2 beyond {:g}".format(*(x / (2.0 * np.pi) for x in ANGLE_LIMITS)),
    "rate": f"a joint is faster than {RATE_LIMIT:g} rad/s",
    "diverged": "a number of the state is not finite",
}


class Fleet:
    """N environments with the same settings.

    Attributes:
        settings: the settings.
        layout: of the observations.
        observations: present ones; the kernels write into it. Shape (lanes, k), float32.
        only_action: of the first environment: a view.
        only_observation: the same.
    """

    _pool: ThreadPoolExecutor | None
    _step_kernel: Callable[..., Any]

    def __init__(self, settings: Settings, count: int, threads: int = 1) -> None:
        """Lay out the fleet; kernels are compiled, or found in the cache, at the first start.

        Args:
            settings: of all environments.
            count: how many.
            threads: that step the blocks; more than one pays for large fleets on idle cores only.
        """
        self.settings, self.count, self._threads = settings, count, threads
        refuse_fast_starts(settings, settings.start)
        arm = settings.flexible_arm
        modes = arm.parameters.modes_per_link
        self._kind = KINDS[settings.action_mode]
        self.layout = observation_layout(settings, self._kind)
        lanes = max(lanes for least, lanes in LANES.items() if count >= least)
        late = settings.law_sensor == "sensor"
        self._variant = Variant(
            self._kind,
            modes,
            arm.parameters.velocity_forces == "complete",
            lanes,
            "true" if settings.sensor == "true" else "rigid",
            settings.rate_jacobian,
            late,
            not settings.paths,
            arm.constants.foreshortened,
        )
        self._rows = self._variant.rows
        sizes = episode_sizes(modes)
        first = self._rows["STATE"][0]
        self._results = slice(first, first + sum(sizes.values()))
        ends = np.cumsum(list(sizes.values())).tolist()
        self.parts = {name: slice(end - size, end) for (name, size), end in zip(sizes.items(), ends, strict=True)}
        channels = len(settings.action_limit)
        longest = settings.randomisation.get("actuation_delay", (0.0, settings.actuation_delay))[1]
        self._kept = max(2, settings.last_actions, int(np.ceil(longest / settings.control_period)) + 1)
        blocks = -(-count // lanes)
        rows = extent(self._rows) + 2 * len(settings.previews) + self._kept * channels
        self._arenas = blank_arenas(blocks, rows, lanes)
        self._histories = np.zeros((blocks, history_slots(settings), 4, lanes))
        self._clocks = np.zeros((blocks, CLOCK, lanes), dtype=np.int64)
        self._keys = np.zeros((blocks, lanes), dtype=np.uint64)
        self._paths = path_tables(settings, blocks * lanes)
        self._names = np.array(settings.reference, dtype=object)
        self._plan, self._table = plan_and_table(settings, self._kind, self.layout, self._kept)
        self._orders = np.full((blocks * lanes, len(ORDER) + 2 * arm.size), NAN)
        self._starts = np.zeros((blocks, lanes), dtype=bool)
        self.actions = np.zeros((blocks * lanes, channels))
        self.observations = np.zeros((blocks * lanes, len(self.layout.rows)), dtype=np.float32)
        for name, value in fixed_rows(settings).items():
            if name in self._rows:
                first, rows_of = self._rows[name]
                self._arenas[:, first : first + rows_of] = np.asarray(value, dtype=float)[None, :, None]
        self._link()

    def __len__(self) -> int:
        """Number of environments."""
        return self.count

    # --- running ---------------------------------------------------------------------------------------------------

    def start(self, keys: NDArray[np.uint64], which: NDArray[np.int64], orders: Array) -> None:
        """Begin episodes.

        Args:
            keys: of the episodes that begin. Shape (n,).
            which: environments that begin one; the others stay as they are. Shape (n,).
            orders: see `rows.ORDER`; rows of the others are not read. Shape (N, columns).
        """
        self.order_starts(keys, which, orders)
        kernel = self._module.step_episodes
        self._plan[DRIVING] = 0
        kernel(*self._step_arguments)
        self._plan[DRIVING] = 1
        self._step_kernel = kernel

    def order_starts(self, keys: NDArray[np.uint64], which: NDArray[np.int64], orders: Array) -> None:
        """Have the next step begin episodes at its end; see `start`."""
        self._starts.reshape(-1)[which] = True
        self._keys.reshape(-1)[which] = keys
        ordered = orders[which]
        self._orders[which] = ordered
        if np.isfinite(ordered[:, ORDER.index("delay")]).any():
            self._plan[PLAN.index("READINGS")] = ALL_READINGS

    def step(self) -> None:
        """One control period with `actions`."""
        if self._threads == 1:
            self._step_kernel(*self._step_arguments)
            return
        if self._pool is None:
            self._pool = ThreadPoolExecutor(self._threads)
        for _ in self._pool.map(self._step_blocks, self._edges[:-1], self._edges[1:]):
            pass

    def _step_blocks(self, begin: int, end: int) -> None:
        self._step_kernel(*self._step_arguments[:-2], begin, end)

    def results(self) -> Array:
        """All that is known at the present instant, in a new array; `parts` says what lies where. Shape (N, k)."""
        rows = self._arenas[:, self._results].transpose(1, 0, 2).copy()
        return rows.reshape(len(rows), -1)[:, : self.count].T  # each quantity contiguous, as in the arenas

    def result(self) -> Array:
        """`results` of the only environment. Shape (k,)."""
        return self._only.copy()

    def close(self) -> None:
        """Let go of the threads."""
        if self._pool is not None:
            self._pool.shutdown()
            self._pool = None

    def failure(self, status: float) -> str | None:
        """What a status means: None for a valid state, else why the episode ended."""
        if status <= 0.0:
            return None if status == 0.0 else REASONS[int(status)]
        entry, size = int(status) - 1, self.settings.flexible_arm.size
        if entry >= size:
            return "rate"
        return "angle" if entry < 2 else "deflection"

    def order(self) -> Array:
        """An order for a new episode, as the settings say. Shape (columns,)."""
        order = np.full(self._orders.shape[1], NAN)
        order[ORDER.index("start")] = START_CODES[self.settings.start]
        return order

    def starts_of(self, chosen: NDArray[np.int64]) -> tuple[NDArray[np.object_], Array]:
        """Names of the paths that some environments' episodes follow, and the moments at which they began [s]."""
        block, lane = np.divmod(chosen, self._arenas.shape[2])
        path = self._clocks[block, PATH, lane] if self.settings.paths else np.zeros_like(chosen)
        step = self.settings.control_period / self.settings.substeps
        return self._names[path], self._clocks[block, BEGAN, lane] * step

    def path(self, index: int) -> Array:
        """Way-points of the path that an environment follows [m]. Shape (n, 2)."""
        block, lane = divmod(index, self._arenas.shape[2])
        return np.asarray(self._paths[self._clocks[block, PATH, lane], :, 1:3])

    # --- inside ----------------------------------------------------------------------------------------------------

    def _link(self) -> None:
        """Views and functions of the hot path."""
        self._flat_arenas = self._arenas.reshape(len(self._arenas), -1)
        self._flat_histories = self._histories.reshape(len(self._histories), -1)
        self._only = self._arenas[0, self._results, 0]
        self.only_action, self.only_observation = self.actions[0], self.observations[0]
        tables = (self._clocks, self._keys, self._paths, self._plan, self._table, self._orders, self._starts)
        data = (self._flat_arenas, self._flat_histories, *tables, self.actions, self.observations)
        self._step_arguments = (*data, 0, len(self._arenas))
        self._edges = (
            np.linspace(0, len(self._arenas), self._threads + 1).astype(int).tolist()
        )  # of the threads' shares
        self._step_kernel = _not_started
        self._pool = None

    @property
    def _module(self) -> ModuleType:
        return kernels.load(self._variant)

    def __getstate__(self) -> dict[str, Any]:
        """Without views, which would come back as copies, and without what cannot be pickled."""
        left_out = (
            "_flat_arenas",
            "_flat_histories",
            "_only",
            "_pool",
            "only_action",
            "only_observation",
            "_step_arguments",
            "_step_kernel",
        )
        return {name: value for name, value in self.__dict__.items() if name not in left_out}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Link the views again."""
        self.__dict__.update(state)
        self._arenas = blank_arenas(*state["_arenas"].shape)
        self._arenas[:] = state["_arenas"]
        self._link()
        if self._keys.any():  # an episode has begun
            self._step_kernel = self._module.step_episodes


def _not_started(*arguments: Any) -> None:
    raise RuntimeError("step() before start(): there are no states to advance")


START_CODES = {name: getattr(starts, name.upper()) for name in STARTS}
