"""The run of one arm under torques that are a function of its state, on compiled kernels; how long runs may be.

The classical Runge-Kutta method of fourth order; states come in and go out in public coordinates.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexarm_env.codegen import cache, compiler
from flexarm_env.codegen.compiler import Entries
from flexarm_env.kernels.entries import extent
from flexarm_env.kernels.layout import arm_rows
from flexarm_env.kernels.rk4 import OPEN
from flexarm_env.kernels.tableau import RK4_NODES, RK4_WEIGHTS
from flexarm_env.kernels.variants import Variant
from flexarm_env.physics.constants import Constants
from flexarm_env.physics.coordinates import internal_state, public_state
from flexarm_env.physics.dynamics import generalised_torque
from flexarm_env.validation import finite_array, integer, shown

Array = NDArray[np.float64]
TorqueFunction = Callable[[float, Array], ArrayLike]
# Magnitude of any coordinate, rate or torque at which the equations are evaluated: far beyond what an arm survives, and
# no power of it that they form overflows.
LARGEST = 1e12
MOST_INSTANTS = 10_000_000  # of a run: a trajectory of one arm with two modes then takes 2 GB
MOST_STEPS = 100_000_000  # integration steps of a run: they take minutes


class OpenLoop:
    """One arm between its start and its present state."""

    def __init__(self, constants: Constants, complete: bool, start: Array) -> None:
        """Load the kernel (compiled when first run) and put the arm at its start.

        Args:
            constants: constants of the arm, in the equations.
            complete: complete velocity forces, or the paper's C_r.
            start: public state. Shape (4 + 4 m,).
        """
        modes = len(constants.elbow_slopes)
        size = 2 * modes + 2
        self._start, self._constants = start, constants
        variant = Variant(OPEN, modes, complete, lanes=1, foreshortened=constants.foreshortened, dry=constants.dry)
        self._module: Entries = compiler.load(variant)
        self._rows = variant.rows
        self._arena = np.zeros(extent(self._rows))
        for name, values in arm_rows(constants).items():
            self._arena[self._part(name)] = values
        # rates follow positions
        self._state = slice(self._rows["Y"][0], self._rows["Y"][0] + 2 * size)
        self._arena[self._state] = internal_state(constants, start)

    def run(self, torque: TorqueFunction, steps: int, step: float, substeps: int) -> tuple[Array, Array]:
        """Evaluate the torque at every stage.

        Args:
            torque: see `FlexibleArm.simulate`.
            steps: how many.
            step: [s].
            substeps: integration steps in each `step`.

        Returns:
            States, Shape (n, 4 + 4 m), and torques, Shape (n, 2), until the state stops being finite: n = steps + 1
            if it does not.
        """
        h = step / substeps
        states, torques = [self._start], [_evaluate(torque, 0.0, self._start)]
        cache.call(self._module.find_momenta, self._arena)
        for k in range(steps * substeps):
            if not self._step(torque, k, h):
                break
            if (k + 1) % substeps == 0:
                with np.errstate(over="ignore", invalid="ignore"):
                    state = public_state(self._constants, self._arena[self._state])
                if not np.all(np.isfinite(state)):
                    break
                states.append(state)
                torques.append(_evaluate(torque, (k + 1) * h, state))
        return np.array(states), np.array(torques)

    def _step(self, torque: TorqueFunction, k: int, h: float) -> bool:
        """Do integration step k; return False if a stage is not finite."""
        y, p, v, force = (self._part(name) for name in ("Y", "P", "V", "FORCE"))
        start = self._arena[y].copy(), self._arena[p].copy()
        total = np.zeros((2, len(start[0])))
        for node, next_node, weight in zip(RK4_NODES, (*RK4_NODES[1:], None), RK4_WEIGHTS, strict=True):
            with np.errstate(over="ignore", invalid="ignore"):  # a diverging state
                stage = public_state(self._constants, self._arena[self._state])
            if not np.all(np.isfinite(stage)):
                return False
            tau = _evaluate(torque, (k + node) * h, stage)
            slope = np.array([self._arena[v], self._arena[force] + generalised_torque(self._constants, list(tau))])
            total = total + weight * slope
            ahead = (h / 6.0, total) if next_node is None else (h * next_node, slope)
            self._arena[y], self._arena[p] = start + ahead[0] * ahead[1]
            cache.call(self._module.find_slopes, self._arena)
        return True

    def _part(self, name: str) -> slice:
        first, count = self._rows[name]
        return slice(first, first + count)


def count_instants(duration: float, step: float, substeps: int, name: str = "duration") -> int:
    """Count the steps of a run.

    Args:
        duration: length of the run [s].
        step: between two instants of the trajectory [s].
        substeps: integration steps in each.
        name: of the duration, for messages.

    Raises:
        ValueError: if the duration is not a whole number of steps, or too long.
    """
    wanted = duration / step
    if not (wanted <= MOST_INSTANTS and wanted * substeps <= MOST_STEPS):
        raise ValueError(
            f"{name} = {duration!r}: {wanted:.4g} steps of {step} s in {substeps} substep(s); at most "
            f"{MOST_INSTANTS} steps and {MOST_STEPS} substeps are allowed"
        )
    steps = round(wanted)
    if steps < 1 or abs(steps * step - duration) > 1e-9 * duration:
        raise ValueError(f"{name} = {duration!r}: must be a whole number of steps of {step} s")
    return steps


def substeps_of(step: float, substeps: int | Literal["auto"], longest: float, fastest: float) -> int:
    """Count the integration steps in a step.

    Args:
        step: between two instants of the trajectory [s].
        substeps: as the user gives it.
        longest: integration step that the arm's fastest mode allows [s].
        fastest: that mode's rate [rad/s].

    Raises:
        TypeError, ValueError: for a bad number, or one that makes an integration step too long.
    """
    enough = np.ceil(step / longest)
    if isinstance(substeps, str):
        if substeps != "auto":
            raise ValueError(f"substeps = {shown(substeps)}: must be an integer >= 1 or 'auto'")
        if enough > MOST_STEPS:
            raise ValueError(f"step = {step} s: takes {enough:.4g} substeps; at most {MOST_STEPS} are allowed")
        return int(enough)
    count = integer("substeps", substeps, 1, MOST_STEPS)
    if step / count > longest:
        raise ValueError(
            f"step = {step} s in {count} substep(s): too long for the arm's fastest mode, "
            f"{fastest:.4g} rad/s; at most {longest:.4g} s is allowed (or substeps='auto', here {enough:.0f})"
        )
    return count


def _evaluate(torque: TorqueFunction, time: float, state: Array) -> Array:
    """Check the user's torque; the function gets a copy, which it may change."""
    return finite_array(f"torque(time={time:.6g}, state)", torque(time, state.copy()), (2,))
