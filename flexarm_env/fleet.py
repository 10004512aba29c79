"""`Fleet`: N environments side by side, their episodes begun and stepped by compiled kernels.

Single and vector environments both stand on it: one arm is a fleet of one, with the same bits.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexarm_env import kernels, starts
from flexarm_env.choices import MOVE_POINTS, MOVE_RING, STARTS
from flexarm_env.dynamics import arm_constants
from flexarm_env.observation import observation_layout, refuse_fast_starts
from flexarm_env.recorded import Variant
from flexarm_env.reference import same_length
from flexarm_env.reward import TERMS
from flexarm_env.rows import DRAWN, ORDER, PLAN, arena_rows, episode_sizes, extent, layout, settings_layout
from flexarm_env.settings import Settings
from flexarm_env.stepping import BEGAN, CLOCK, PATH
from flexarm_env.task import ANGLE_LIMITS, RATE_LIMIT, state_limits

Array = NDArray[np.float64]
# Lanes of a block, by the number of environments from which on they pay.
LANES = {1: 1, 2: 8, 96: 32}
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
ALL_READINGS = -1  # as bits
NAN = float("nan")


class Fleet:
    """N environments with the same settings.

    Attributes:
        settings: the settings.
        layout: of the observations.
        observations: present ones; the kernels write into it. Shape (lanes, k), float32.
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
        )
        self._rows = layout(self._kind, modes)
        sizes = episode_sizes(modes)
        first = self._rows["STATE"][0]
        self._results = slice(first, first + sum(sizes.values()))
        ends = np.cumsum(list(sizes.values())).tolist()
        self.parts = {name: slice(end - size, end) for (name, size), end in zip(sizes.items(), ends, strict=True)}
        channels = len(settings.action_limit)
        longest = settings.randomisation.get("actuation_delay", (0.0, settings.actuation_delay))[1]
        self._kept = max(2, settings.last_actions, int(np.ceil(longest / settings.control_period)) + 1)
        blocks = -(-count // lanes)
        rows = arena_rows(self._kind, modes) + 2 * len(settings.previews) + self._kept * channels
        self._arenas = np.zeros((blocks, rows, lanes))
        self._histories = np.zeros((blocks, self._slots(), 4, lanes))
        self._clocks = np.zeros((blocks, CLOCK, lanes), dtype=np.int64)
        self._keys = np.zeros((blocks, lanes), dtype=np.uint64)
        self._paths = self._tables(blocks * lanes)
        self._plan, self._table = self._plan_and_table()
        self._orders = np.full((blocks * lanes, len(ORDER) + 2 * arm.size), NAN)
        self._starts = np.zeros((blocks, lanes), dtype=bool)
        self.actions = np.zeros((blocks * lanes, channels))
        self.observations = np.zeros((blocks * lanes, len(self.layout.rows)), dtype=np.float32)
        self._fill_rows()
        self._link()

    def __len__(self) -> int:
        """Number of environments."""
        return self.count

    # --- running ---------------------------------------------------------------------------------------------------

    def start(self, keys: NDArray[np.uint64], which: NDArray[np.bool_], orders: Array) -> None:
        """Begin episodes.

        Args:
            keys: of the episodes that begin, in order. Shape (sum(which),).
            which: environments that begin one; the others stay as they are. Shape (N,).
            orders: see `rows.ORDER`; rows of the others are not read. Shape (N, columns).
        """
        self._starts.reshape(-1)[: self.count] = which
        self._keys.reshape(-1)[: self.count][which] = keys
        self._orders[: self.count] = orders
        if np.isfinite(orders[which, ORDER.index("delay")]).any():
            self._plan[PLAN.index("READINGS")] = ALL_READINGS
        self._step_kernel = self._module.step_episodes
        self._module.start_episodes(
            self._flat_arenas,
            self._flat_histories,
            self._clocks,
            self._keys,
            self._paths,
            self._plan,
            self._table,
            self._orders,
            self._starts,
            self.observations,
        )

    def step(self) -> None:
        """One control period with `actions`."""
        if self._threads == 1:
            self._step_kernel(*self._step_arguments)
            return
        edges = np.linspace(0, len(self._flat_arenas), self._threads + 1).astype(int).tolist()
        if self._pool is None:
            self._pool = ThreadPoolExecutor(self._threads)
        for _ in self._pool.map(self._step_blocks, edges[:-1], edges[1:]):
            pass

    def _step_blocks(self, begin: int, end: int) -> None:
        self._step_kernel(*self._step_arguments[:-2], begin, end)

    def results(self) -> Array:
        """All that is known at the present instant, in a new array; `parts` says what lies where. Shape (N, k)."""
        rows = self._arenas[:, self._results].transpose(0, 2, 1).copy()
        return rows.reshape(-1, rows.shape[2])[: self.count]

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

    def order(self, start: str | None = None) -> Array:
        """An order for a new episode, as the settings say unless a start is named. Shape (columns,)."""
        order = np.full(self._orders.shape[1], NAN)
        order[ORDER.index("start")] = START_CODES[start or self.settings.start]
        return order

    def start_of(self, index: int) -> tuple[str, float]:
        """Name of the path that an environment's episode follows, and the moment of the lap at which it began [s]."""
        block, lane = divmod(index, self._arenas.shape[2])
        clock = self._clocks[block, :, lane]
        names = self.settings.reference
        name = names[clock[PATH]] if self.settings.paths else names[0]
        return name, float(clock[BEGAN] * (self.settings.control_period / self.settings.substeps))

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
        tables = (self._clocks, self._keys, self._paths, self._plan, self._table)
        data = (self._flat_arenas, self._flat_histories, *tables, self.actions, self.observations)
        self._step_arguments = (*data, 0, len(self._arenas))
        self._step_kernel = _not_started
        self._pool = None

    @property
    def _module(self) -> ModuleType:
        return kernels.load(self._variant)

    def __getstate__(self) -> dict[str, Any]:
        """Without views, which would come back as copies, and without what cannot be pickled."""
        left_out = ("_flat_arenas", "_flat_histories", "_only", "_pool", "_step_arguments", "_step_kernel")
        return {name: value for name, value in self.__dict__.items() if name not in left_out}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Link the views again."""
        self.__dict__.update(state)
        self._link()
        if self._keys.any():  # an episode has begun
            self._step_kernel = self._module.step_episodes

    def _slots(self) -> int:
        """Length of the delay line: the latest reading and the period before the first."""
        s = self.settings
        latest = max(*self.delays(), s.randomisation.get("delay", (0.0, 0.0))[1])
        longest = latest + s.jitter + 4.0 * s.hold + 2.0 * s.control_period
        return 4 + int(np.ceil(longest / s.control_period * s.substeps))

    def delays(self) -> tuple[float, float]:
        """Delay of the shoulder's and of the elbow's reading unless drawn or ordered otherwise [s]."""
        return self.settings.sensor_parameters.joint_delays(self.settings.flexible_arm.parameters.link_lengths[0])

    def _readings(self) -> int:
        """Integration steps of a control period after which a reading is kept, as bits (bit 0: its end).

        Where each sample is equally late, it lies between the same two steps of a period; the others are not needed.
        """
        s = self.settings
        varies = s.jitter > 0.0 or s.hold > 0.0 or "delay" in s.randomisation or self._kind == "gain"
        if varies or s.substeps > 62:
            return ALL_READINGS
        bits = 0
        for delay in self.delays():
            back = delay / (s.control_period / s.substeps)
            # a hair more on both sides: rounding may see a whole number of steps from either
            for steps in range(int(np.floor(back - 1e-6)), int(np.floor(back + 1e-6)) + 2):
                bits |= 1 << (-steps % s.substeps)
        return bits

    def _tables(self, lanes: int) -> Array:
        if self.settings.paths:
            return same_length(self.settings.paths)
        points = min(MOVE_POINTS, round(self.settings.lap_time / self.settings.control_period)) + 1
        return np.zeros((lanes, points, 5))

    def _plan_and_table(self) -> tuple[NDArray[np.int64], Array]:
        """`plan` and `settings` of the kernels (`rows.PLAN`, `rows.SETTINGS`)."""
        s = self.settings
        arm = s.flexible_arm
        whole = {
            "SUBSTEPS": s.substeps,
            "CHANNELS": len(s.action_limit),
            "KEPT_ACTIONS": self._kept,
            "PREVIEWS": len(s.previews) if "previews" in s.observation else 0,
            "OBSERVED": len(self.layout.rows),
            "SHIFTING": int(s.action_mode == "reference"),
            "COMPENSATION": ("none", "shared", "per_joint").index(s.compensation),
            "READINGS": self._readings(),
        }
        assert (*whole, "PLACES") == PLAN
        p = arm.parameters
        base = {
            "delay": NAN if s.delay is None or isinstance(s.delay, tuple) else s.delay,
            "payload_mass": p.payload_mass,
            "stiffness": 1.0,
            "damping": p.modal_damping_ratio,
            "noise": s.noise,
            "actuation_delay": s.actuation_delay,
        }
        limit = (*s.action_limit, 0.0)[:2]
        weights = [s.reward_weights.get(name, 0.0) for name in TERMS]
        values: dict[str, Any] = {
            "STEP": [s.control_period / s.substeps],
            "PERIOD": [s.control_period],
            "ACTION_SCALE": limit,
            "JITTER": [s.jitter],
            "HOLD": [s.hold],
            "DROPOUT": [s.dropout],
            "ENCODER_NOISE": s.encoder_noise,
            "DEFLECTION_LIMIT": [np.inf if s.deflection_limit is None else s.deflection_limit],
            "ERROR_LIMIT": [np.inf if s.error_limit is None else s.error_limit],
            "LENGTHS": p.link_lengths,
            "BRANCH": [1.0 if s.elbow_branch == "positive" else -1.0],
            "START_SPREAD": s.start_spread,
            "MOVES": [MOVE_RING[0] * p.reach, MOVE_RING[1] * p.reach, s.lap_time],
            "WEIGHTS": weights,
            "SENSOR_DELAYS": self.delays(),
            "BASE": [base[name] for name in DRAWN],
            "LOWEST": [s.randomisation.get(name, (NAN, NAN))[0] for name in DRAWN],
            "HIGHEST": [s.randomisation.get(name, (NAN, NAN))[1] for name in DRAWN],
            "ARM": arm.constants.flat(),
            "PER_PAYLOAD": self._per_payload(),
            "PER_DAMPING": self._per_damping(),
        }
        places = settings_layout(p.modes_per_link)
        assert all(len(values[name]) == count for name, (_, count) in places.items())
        table = np.concatenate([np.asarray(values[name], dtype=float) for name in places])
        assert len(table) == extent(places)
        horizons = s.previews if whole["PREVIEWS"] else ()
        plan = np.concatenate([np.array(list(whole.values()), dtype=np.int64), self._observed_rows()])
        return plan, np.concatenate([table, horizons, 1.0 / self.layout.scale])

    def _observed_rows(self) -> NDArray[np.int64]:
        """Rows of the observation; actions move up where there are no previews before them."""
        tail = arena_rows(self._kind, self.settings.flexible_arm.parameters.modes_per_link)
        if "previews" in self.settings.observation:
            return self.layout.rows
        return np.where(self.layout.rows >= tail, self.layout.rows - 2 * len(self.settings.previews), self.layout.rows)

    def _per_payload(self) -> Array:
        """Change of the arm's constants with the payload, in which they are linear [1/kg]."""
        p = self.settings.flexible_arm.parameters
        modes = self.settings.flexible_arm.modes
        heavy, light = (arm_constants(replace(p, payload_mass=mass), modes) for mass in (1.0, 0.0))
        return np.array(heavy.flat()) - np.array(light.flat())

    def _per_damping(self) -> Array:
        """Change of the arm's constants with the modal damping ratio."""
        p = self.settings.flexible_arm.parameters
        modes = self.settings.flexible_arm.modes
        damped, free = (arm_constants(replace(p, modal_damping_ratio=ratio), modes) for ratio in (1.0, 0.0))
        return np.array(damped.flat()) - np.array(free.flat())

    def _fill_rows(self) -> None:
        """Rows that no episode changes."""
        s = self.settings
        arm = s.flexible_arm
        link2 = arm.modes[1]
        law_point = s.sensor_position if s.law_sensor == "sensor" else link2.length
        values: dict[str, Any] = {
            "LIMITS": state_limits(arm),
            "TIP_VALUES": link2.tip_values,
            "TIP_DISTANCE": [link2.length],
            "PLACE_DISTANCE": [s.sensor_position],
            "PLACE_VALUES": link2.shape(s.sensor_position),
            "SENSOR_DISTANCE": [law_point],
            "SENSOR_VALUES": link2.shape(law_point),
            "FRAME": [float(s.frame == "link")],
            "TORQUE_LIMIT": s.motor_limit,
            "STIFFNESS": s.inner_stiffness,
            "RESISTANCE": s.inner_resistance,
            "PROPORTIONAL_GAIN": [s.proportional_gain],
            "DERIVATIVE_GAIN": [s.derivative_gain],
            "RATE_LATE": [float(s.delayed == "position+rate")],
        }
        for name, value in values.items():
            if name in self._rows:
                first, count = self._rows[name]
                self._arenas[:, first : first + count] = np.asarray(value, dtype=float)[None, :, None]


def _not_started(*arguments: Any) -> None:
    raise RuntimeError("step() before start(): there are no states to advance")


START_CODES = {name: getattr(starts, name.upper()) for name in STARTS}
