"""`ClosedLoop`: a batch of arms under the inner law, each with its own sensor and command delays.

The gain lambda is held over a control period; the law itself acts in continuous time inside the integrator
(`closed_loop`). One environment or many, the same compiled functions run.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexarm_env.codegen import assembly, cache
from flexarm_env.kernels.entries import CLOCK_ROWS, clock_row, extent
from flexarm_env.kernels.imex import LOOP, failures
from flexarm_env.kernels.layout import arm_rows
from flexarm_env.kernels.variants import Variant
from flexarm_env.physics.paths import ReferencePath
from flexarm_env.simulation.arm import FlexibleArm
from flexarm_env.simulation.cases import LoopCase, case_rows, checked_cases, delays, sensor_variant
from flexarm_env.simulation.stability import STEP_LIMIT, count_readings, count_steps, default_step
from flexarm_env.validation import finite_array, number, shown

Array = NDArray[np.float64]

BLOCK = 8  # lanes; one environment alone has a block of one


class Results(NamedTuple):
    """What a batch of N arms gives out at an instant.

    Attributes:
        observation: what a controller may know (`closed_loop.Outputs`). Shape (N, 10 + 2 m).
        state: public states. Shape (N, 4 + 4 m).
        torque: the law's at the start of the period that ends now, with its gain [N m]; at the reset that of gain 0,
            none. Shape (N, 2).
        true_tip: with deflection [m]. Shape (N, 2).
        rigid_tip: by rigid kinematics (8), (9) [m]. Shape (N, 2).
        status: 0 for a valid state, -1 for one that is not finite, n where entry n - 1 of the state passed its
            limit. Shape (N,).
    """

    observation: Array
    state: Array
    torque: Array
    true_tip: Array
    rigid_tip: Array
    status: Array


class ClosedLoop:
    """N arms of equal parameters following one path.

    Attributes:
        arm: the arm.
        path: the reference.
        control_period: the gain is held so long [s].
        substeps: integration steps in a control period.
    """

    def __init__(
        self,
        arm: FlexibleArm,
        cases: Sequence[LoopCase],
        path: ReferencePath,
        control_period: float = 1e-3,
        physics_step: float | None = None,
        state_limits: ArrayLike | None = None,
    ) -> None:
        """Lay out the batch; the kernel is compiled (or found in the cache) at the first reset.

        Args:
            arm: the arm.
            cases: one for each member of the batch.
            path: the reference.
            control_period: [s].
            physics_step: longest integration step [s]; None: as the arm's fastest mode demands.
            state_limits: magnitudes beyond which a state's `Results.status` says so. Shape (4 + 4 m,).

        Raises:
            ValueError: for bad input: no cases, a sensor off the link, a compensation without delay, a step too
                long for the fastest mode.
        """
        if not isinstance(arm, FlexibleArm):
            raise TypeError(f"arm = {shown(arm)}: must be a FlexibleArm")
        if not isinstance(path, ReferencePath):
            raise TypeError(f"path = {shown(path)}: must be a ReferencePath")
        self.arm, self.path, self._cases = arm, path, checked_cases(cases, arm)
        self._path_rows = path.rows[None]
        self._ready = False  # until the first reset
        self.control_period = number("control_period", control_period, "s", above=0.0)
        self.substeps = self._count_substeps(physics_step)
        p = arm.parameters
        lanes = 1 if len(self._cases) == 1 else BLOCK
        sensor = sensor_variant(self._cases)
        complete, foreshortened = p.velocity_forces == "complete", arm.constants.foreshortened
        self._variant = Variant(LOOP, p.modes_per_link, complete, lanes, *sensor, foreshortened=foreshortened)
        self._allocate()
        limits = np.full(2 * arm.size, np.inf) if state_limits is None else np.array(state_limits, dtype=float)
        if limits.shape != (2 * arm.size,) or not np.all(limits > 0.0):
            raise ValueError(f"state_limits = {shown(state_limits)}: must be {2 * arm.size} numbers > 0 (inf for none)")
        for name, values in {**arm_rows(arm.constants), "LIMITS": limits}.items():
            self._put(name, np.tile(np.asarray(values, dtype=float), (len(self), 1)))
        for name, rows in case_rows(self._cases, arm).items():
            self._put(name, rows)
        self._link()

    def _allocate(self) -> None:
        """Blocks of arenas, delay lines and clocks, and where the results lie in an arena."""
        lanes = self._variant.lanes
        self._rows = self._variant.rows
        self._results = slice(self._rows["OBSERVATION"][0], extent(self._rows))
        blocks = -(-len(self) // lanes)
        self._arenas = np.zeros((blocks, extent(self._rows), lanes))
        latest = max(max(delays(case, self.arm)) for case in self._cases)
        readings = count_readings(latest / self.physics_step, self.physics_step, f"delay = {latest} s")
        self._histories = np.zeros((blocks, 3 + readings, 4, lanes))
        self._clocks = np.zeros((blocks, CLOCK_ROWS, lanes), dtype=np.int64)

    def _link(self) -> None:
        """Views for the hot path: whole blocks as the kernels take them, the gains' rows, the parts of results."""
        self._flat_arenas = self._arenas.reshape(len(self._arenas), -1)
        self._flat_histories = self._histories.reshape(len(self._histories), -1)
        self._gain_rows = self._arenas[:, self._rows["GAIN"][0]]
        self._places = np.divmod(np.arange(len(self._cases)), self._arenas.shape[2])  # block and lane of each arm
        places = [self._rows[name.upper()] for name in Results._fields]
        self._parts = [slice(first - self._results.start, first - self._results.start + n) for first, n in places]

    def __getstate__(self) -> dict[str, Any]:
        """Without the views, which would come back as copies."""
        views = ("_flat_arenas", "_flat_histories", "_gain_rows")
        return {name: value for name, value in self.__dict__.items() if name not in views}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Link the views again."""
        self.__dict__.update(state)
        self._link()

    def __len__(self) -> int:
        """Number of arms."""
        return len(self._cases)

    @property
    def physics_step(self) -> float:
        """Integration step [s]."""
        return self.control_period / self.substeps

    @property
    def noise(self) -> Array:
        """Standard deviation of each sensor's noise [m], for whoever draws it. Shape (N,)."""
        return np.array([case.sensor.noise for case in self._cases])

    @property
    def time(self) -> float:
        """Since the reset [s]."""
        return float(self._clocks[0, clock_row.STEPS, 0] * self.physics_step)

    # --- running ---------------------------------------------------------------------------------------------------

    def reset(self, states: ArrayLike, noise: ArrayLike | None = None) -> None:
        """Put all arms at time 0, their delay lines filled with the first measurement.

        Args:
            states: public states. Shape (N, 4 + 4 m).
            noise: see `advance`.
        """
        start = finite_array("states", states, (len(self), 2 * self.arm.size))
        internal = self.arm.internal_state(start)
        self._clocks[:] = 0
        self._put("Y", internal[:, : self.arm.size])
        self._put("V", internal[:, self.arm.size :])
        self._gain_rows[:] = 0.0  # until the first period
        self._put_noise(noise)
        module = assembly.load(self._variant)
        for arena, history in zip(self._flat_arenas, self._flat_histories, strict=True):
            cache.call(module.store_reading, arena, history, 0)
        self._histories[:, 1:] = self._histories[:, :1]
        self._histories[:, 1:, 2:] = 0.0  # before the start nothing moves
        self._run(0, initialise=True)
        self._ready = True

    def advance(self, gain: ArrayLike, noise: ArrayLike | None = None) -> None:
        """One control period.

        Args:
            gain: lambda of each arm. Shape (N,).
            noise: added to each arm's reading [m]. Shape (N, 2); None leaves it as it was.

        Raises:
            RuntimeError: before the first reset.
            ValueError: for a gain that is negative or not finite, or another shape.
        """
        if not self._ready:
            raise RuntimeError("advance() before reset(): there is no state to advance")
        values = np.asarray(gain, dtype=np.float64)
        if values.shape != (len(self),) or not ((values >= 0.0) & (values < np.inf)).all():
            values = finite_array("gain", gain, (len(self),))
            raise ValueError(f"gain = {float(values.min())!r}: must be >= 0")
        self._gain_rows[self._places] = values
        if noise is not None:
            self._put_noise(noise)
        self._run(self.substeps, initialise=False)

    def results(self) -> Results:
        """All that is known at the present instant; new arrays on every call."""
        return self.unpack(self.packed_results())

    def packed_results(self) -> Array:
        """`results` in one new array, for records. Shape (N, k)."""
        rows = self._arenas[:, self._results].transpose(0, 2, 1).copy()
        return rows.reshape(-1, rows.shape[2])[: len(self._cases)]

    def unpack(self, pack: Array) -> Results:
        """Views of packed results. Shape (..., k)."""
        *parts, status = (pack[..., part] for part in self._parts)
        return Results._make([*parts, status[..., 0]])

    def failure(self, status: float) -> str | None:
        """What a `Results.status` means: None, "diverged", "angle", "deflection" or "rate"."""
        return failures(self.arm.size)[float(status)]

    # --- inside ----------------------------------------------------------------------------------------------------

    def _count_substeps(self, physics_step: float | None) -> int:
        fastest = self.arm.fastest_rate()
        if physics_step is None:
            wanted = default_step(fastest)
            cause = f"arm: its fastest mode, {fastest:.4g} rad/s, asks for steps of {wanted:.4g} s"
        else:
            wanted = number("physics_step", physics_step, "s", above=0.0)
            cause = f"physics_step = {wanted} s"
            if wanted > STEP_LIMIT / fastest:
                raise ValueError(
                    f"physics_step = {wanted} s: too long for the arm's fastest mode, {fastest:.4g} rad/s; "
                    f"at most {STEP_LIMIT / fastest:.4g} s is allowed"
                )
        return count_steps(self.control_period, wanted, cause)

    def _put(self, name: str, values: Array) -> None:
        """Write rows of all arms; lanes beyond the last arm repeat the first."""
        first, count = self._rows[name]
        blocks, _, lanes = self._arenas.shape
        padded = np.concatenate([values, np.repeat(values[:1], blocks * lanes - len(values), axis=0)])
        self._arenas[:, first : first + count] = padded.reshape(blocks, lanes, count).transpose(0, 2, 1)

    def _put_noise(self, noise: ArrayLike | None) -> None:
        values = np.zeros((len(self), 2)) if noise is None else finite_array("noise", noise, (len(self), 2))
        self._put("NOISE", values)

    def _run(self, steps: int, initialise: bool) -> None:
        cache.call(
            assembly.load(self._variant).run_loop,
            self._flat_arenas,
            self._flat_histories,
            self._clocks,
            self._path_rows,
            self.physics_step,
            steps,
            initialise,
        )


def observation_blocks(modes: int) -> dict[str, slice]:
    """Where each named block lies in `Results.observation`: that of `FlexArm/Paper-v0`."""
    sizes = {
        "joint_angles": 2,
        "joint_rates": 2,
        "sensed_position": 2,
        "modal_coordinates": 2 * modes,
        "reference_position": 2,
        "reference_velocity": 2,
    }
    ends = np.cumsum(list(sizes.values())).tolist()
    return {name: slice(end - size, end) for (name, size), end in zip(sizes.items(), ends, strict=True)}
