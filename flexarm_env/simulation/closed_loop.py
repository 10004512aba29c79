"""`ClosedLoop`: a batch of arms under the inner law, each with its own sensor and command delays.

The gain lambda is held over a control period; the law itself acts in continuous time inside the integrator
(`jacobian_transpose`). One environment or many, the same compiled functions run.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexarm_env.kernels.entries import Setting, clock_row, in_order, word
from flexarm_env.kernels.layout import arm_rows, place_rows
from flexarm_env.kernels.loop import LOOP
from flexarm_env.kernels.status import failures
from flexarm_env.kernels.variants import Variant
from flexarm_env.physics.paths import ReferencePath
from flexarm_env.simulation.arm import FlexibleArm
from flexarm_env.simulation.cases import LoopCase, case_rows, checked_cases, delays, sensor_variant
from flexarm_env.simulation.lanes import ALL_READINGS, LaneBatch, Lanes
from flexarm_env.simulation.stability import count_readings, count_substeps
from flexarm_env.validation import finite_array, number, shown

Array = NDArray[np.float64]

BLOCK = 8  # lanes; one environment alone has a block of one


class Results(NamedTuple):
    """What a batch of N arms gives out at an instant.

    Attributes:
        observation: what a controller may use (`observation_blocks`). Shape (N, 10 + 2 m).
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


class ClosedLoop(LaneBatch):
    """N arms of equal parameters following one path.

    Attributes:
        arm: the arm.
        path: the reference.
        control_period: the gain is held so long [s].
        substeps: integration steps in a control period.
    """

    WHAT = "the closed loop"

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
        self.control_period = number("control_period", control_period, "s", above=0.0)
        wanted = None if physics_step is None else number("physics_step", physics_step, "s", above=0.0)
        self.substeps = count_substeps(self.control_period, wanted, "implicit", arm.fastest_rate(), "arm")
        limits = np.full(2 * arm.size, np.inf) if state_limits is None else np.array(state_limits, dtype=float)
        if limits.shape != (2 * arm.size,) or not np.all(limits > 0.0):
            raise ValueError(f"state_limits = {shown(state_limits)}: must be {2 * arm.size} numbers > 0 (inf for none)")
        self._limits = limits
        super().__init__(self._lanes())
        fixed = {
            **arm_rows(arm.constants),
            **place_rows("TIP", arm.place(2, arm.parameters.link_lengths[1])),
            "LIMITS": limits,
        }
        self._put_rows([{**fixed, **case_rows(case, arm)} for case in self._cases], np.arange(len(self)))
        self._known = np.zeros((len(self), self._results.stop - self._results.start))
        self._observed = self._observed_places()

    def _lanes(self) -> Lanes:
        """Describe the arms' lanes."""
        p = self.arm.parameters
        width = 1 if len(self._cases) == 1 else BLOCK
        sensor = sensor_variant(self._cases)
        complete, foreshortened = p.velocity_forces == "complete", self.arm.constants.foreshortened
        variant = Variant(LOOP, p.modes_per_link, complete, width, *sensor, foreshortened=foreshortened)
        latest = max(max(delays(case, self.arm)) for case in self._cases)
        readings = count_readings(latest / self.physics_step, self.physics_step, f"delay = {latest} s")
        header = np.zeros(word.PLACES, dtype=np.int64)
        header[[word.SUBSTEPS, word.READINGS, word.DRIVING]] = self.substeps, ALL_READINGS, 1
        settings = in_order(Setting.layout(variant.shape), {"STEP": [self.physics_step], "LENGTHS": p.link_lengths})
        return Lanes(variant, len(self._cases), 3 + readings, header, settings, self.path.rows[None])

    def _link(self) -> None:
        """Make views for the hot path: the gains' rows, and block and lane of each arm in them."""
        super()._link()
        self._gain_rows = self._lane_rows("GAIN")[:, 0]
        self._places = np.divmod(np.arange(self.count), self._gain_rows.shape[1])

    def _arguments(self) -> tuple[Any, ...]:
        return self.arm, self._cases, self.path, self.control_period, self.physics_step, self._limits

    def _kept(self) -> dict[str, Any]:
        return {"_known": self._known}

    def _observed_places(self) -> NDArray[np.int64]:
        """Where the numbers of `Results.observation` lie among the packed results."""
        places = {name: np.arange(part.start, part.stop) for name, part in self.parts.items()}
        q, rates = np.split(places["STATE"], 2)
        return np.concatenate([q[:2], rates[:2], places["LINK_SENSOR"], q[2:], places["REFERENCE"]])

    @property
    def physics_step(self) -> float:
        """Integration step [s]."""
        return self.control_period / self.substeps

    @property
    def noise(self) -> Array:
        """Standard deviation of each sensor's noise [m], for the caller who draws it. Shape (N,)."""
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
        self._put("STATE", finite_array("states", states, (len(self), 2 * self.arm.size)))
        self._put_noise(noise)
        self._starts[:] = True
        self._known = self._run_starts()

    def advance(self, gain: ArrayLike, noise: ArrayLike | None = None) -> None:
        """Advance by one control period.

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
        self._known = self._run()

    def results(self) -> Results:
        """Return all that is known at the present instant; new arrays on every call."""
        return self.unpack(self.packed_results())

    def packed_results(self) -> Array:
        """Return `results` in one new array, for records. Shape (N, k)."""
        return self._known.copy()

    def unpack(self, pack: Array) -> Results:
        """Return the parts of packed results: views, and a new array of observations. Shape (..., k)."""
        parts = {name: pack[..., self.parts[name.upper()]] for name in Results._fields[1:]}
        return Results(self.observations(pack), **{**parts, "status": parts["status"][..., 0]})

    def observations(self, pack: Array) -> Array:
        """Return `Results.observation` of packed results, in a new array. Shape (..., 10 + 2 m)."""
        return pack[..., self._observed]

    def failure(self, status: float) -> str | None:
        """Return what a `Results.status` means: None, "diverged", "angle", "deflection" or "rate"."""
        return failures(self.arm.size)[float(status)]

    # --- inside ----------------------------------------------------------------------------------------------------

    def _put_noise(self, noise: ArrayLike | None) -> None:
        values = np.zeros((len(self), 2)) if noise is None else finite_array("noise", noise, (len(self), 2))
        self._put("NOISE", values)


def observation_blocks(modes: int) -> dict[str, slice]:
    """Return where each named block lies in `Results.observation`: that of `FlexArm/Paper-v0`."""
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
