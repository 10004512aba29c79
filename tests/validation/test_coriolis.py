"""What the paper's dropped Coriolis and centrifugal terms cost: energy and trajectory, by amplitude.

The paper's arm (`velocity_forces="rigid"`) keeps the rigid arm's velocity forces C_r (7) alone. Both arms start at
rest and get the same doublet of torque at the shoulder. Errors are taken until the doublet ends; what follows is drawn.
"""

from dataclasses import replace
from functools import cache
from typing import Any, NamedTuple

import matplotlib.pyplot as plt
import numpy as np
import pytest

from flexarm_env import ArmParameters, DivergenceError, FlexibleArm, Trajectory
from flexarm_env.parameters import VelocityForces
from scripts.common.plotting import COLOURS, INK, ORANGE, SOFT, WIDTH
from tests.validation.conftest import Check, Page, checked
from tests.validation.motion import Array, bent_state
from tests.validation.small_motion import rate
from tests.validation.test_drift import loss_bound

pytestmark = pytest.mark.validation

PULSE, TIME = 0.2, 1.0  # each half of the doublet, the whole run [s]
STEP, SUBSTEPS = 1e-3, 4
ENDED = round(2.0 * PULSE / STEP) + 1  # instants until the torque ends
AMPLITUDES = (0.045, 0.14, 0.45, 1.4, 4.5, 14.0, 45.0)  # [N m]
SMALL = AMPLITUDES[:3]  # where second order is to be seen


class Pair(NamedTuple):
    """The same doublet on both arms."""

    complete: Trajectory  # with all velocity forces
    rigid: Trajectory  # the paper's arm; shorter, if it was lost

    @property
    def energy(self) -> float:
        """The largest energy [J]."""
        return float((self.complete.kinetic_energy + self.complete.strain_energy).max())

    @property
    def away(self) -> Array:
        """How far the tips are apart [m]. Shape (n,)."""
        return np.linalg.norm(self.rigid.tip - self.complete.tip[: len(self.rigid)], axis=1)

    @property
    def energy_error(self) -> float:
        """The largest error of the paper's energy balance until the torque ends [J]."""
        return float(np.abs(balance(self.rigid)[:ENDED]).max())

    @property
    def tip_error(self) -> float:
        """The largest distance of the tips until the torque ends [m]."""
        return float(self.away[:ENDED].max())

    @property
    def moved(self) -> float:
        """How far the tip goes from its start [m]."""
        return float(np.linalg.norm(self.complete.tip - self.complete.tip[0], axis=1).max())


@cache
def pairs() -> dict[float, Pair]:
    return {a: Pair(doublet("complete", a), doublet("rigid", a)) for a in AMPLITUDES}


def doublet(forces: VelocityForces, amplitude: float) -> Trajectory:
    """Run a torque of +amplitude, then -amplitude, on the shoulder of the paper's arm at rest, while it is sensible."""
    arm = FlexibleArm(ArmParameters.paper(velocity_forces=forces))
    torque = np.zeros((round(TIME / STEP), 2))
    half = round(PULSE / STEP)
    torque[:half, 0], torque[half : 2 * half, 0] = amplitude, -amplitude
    try:
        run = arm.simulate(bent_state(arm), torque, TIME, STEP, SUBSTEPS)
    except DivergenceError as error:
        run = error.trajectory
    # cut where a link's tip is off its root tangent by more than both links are long
    wild = np.append(np.abs(run.tip_deflection).max(axis=1) > run.parameters.reach, True)
    shorter: dict[str, Any] = {name: array[: int(np.argmax(wild))] for name, array in run.arrays().items()}
    return replace(run, **shorter)


def balance(run: Trajectory) -> Array:
    """Energy minus the work of the torques [J]: 0 for equations that are those of a mechanical system."""
    turned = np.diff(run.state[:, :2], axis=0)
    work = np.concatenate([[0.0], np.cumsum((run.torque[:-1] * turned).sum(axis=1))])
    return run.kinetic_energy + run.strain_energy - work


test_checks = checked(
    Check(
        "complete forces: energy minus work of the torques, over energy, any amplitude",
        lambda: max(np.abs(balance(pair.complete)).max() / pair.energy for pair in pairs().values()),
        "nothing else gives or takes energy; the method itself loses omega^6 h^5 / 72 a second at the fastest rate",
        most=loss_bound(FlexibleArm(ArmParameters.paper()), STEP / SUBSTEPS, TIME),
    ),
    Check(
        "paper's forces: order of the energy error in the amplitude",
        lambda: -rate(SMALL, [pairs()[a].energy_error for a in SMALL]),
        "the forces dropped are of second order, their power, times a rate, of third",
        least=2.7,
        most=3.3,
    ),
    Check(
        "paper's forces: order of the trajectory error in the amplitude",
        lambda: -rate(SMALL, [pairs()[a].tip_error for a in SMALL]),
        "the forces dropped are of second order: a tenth of the torque, a hundredth of the error",
        least=1.8,
        most=2.2,
    ),
)


def test_table(page: Page) -> None:
    header = ("doublet [N m]", "largest deflection [m]", "tip's way [m]", "tip error [m]", "energy error / energy")
    rows = []
    for amplitude, pair in pairs().items():
        bend = np.abs(pair.complete.tip_deflection).max()
        found = (amplitude, bend, pair.moved, pair.tip_error, pair.energy_error / pair.energy)
        rows.append([f"{value:.3g}" for value in found])
        quoted = {"away": pair.tip_error, "moved": pair.moved, "ended": pair.rigid.time[-1]}
        page.quote({f"{what}, {amplitude:g} N m": value for what, value in quoted.items()})
    page.table("coriolis_amplitudes", header, rows)


def test_picture(page: Page) -> None:
    figure, axes = plt.subplots(2, 2, figsize=(WIDTH, 7.8))
    for (amplitude, pair), colour in zip(reversed(pairs().items()), (*COLOURS, INK), strict=False):
        time, late = pair.rigid.time[1:], pair.complete.time[1:]
        error, floor = (np.abs(balance(run)[1:]) / pair.energy for run in (pair.rigid, pair.complete))
        axes[0, 0].semilogy(time, error, color=colour, label=f"{amplitude:g} N m")
        axes[0, 1].semilogy(time, pair.away[1:], color=colour)
        axes[0, 0].semilogy(late, np.maximum(floor, 1e-16), color=colour, linewidth=0.6, alpha=0.5)
    for axis, what, order, unit in ((axes[1, 0], "energy_error", 3, "J"), (axes[1, 1], "tip_error", 2, "m")):
        found = np.array([getattr(pair, what) for pair in pairs().values()])
        axis.loglog(AMPLITUDES, found, "o-", color=ORANGE)
        slope = 0.4 * found[0] * (np.array(AMPLITUDES) / AMPLITUDES[0]) ** order
        axis.loglog(AMPLITUDES, slope, color=SOFT, linestyle=":", label=f"order {order}")
        axis.axvspan(min(SMALL), max(SMALL), color="0.9", zorder=0)
        axis.set(xlabel="amplitude of the torque [N m]", ylabel=f"largest error [{unit}]")
        axis.legend()
    for axis in axes[0]:
        axis.axvline(2.0 * PULSE, color=SOFT, linestyle=":")
        axis.set_xlabel("time [s]; torque until the dotted line")
    axes[0, 0].set(title="error of the energy balance", ylabel="share of the energy [1]; thin: complete")
    axes[0, 1].set(title="error of the tip", ylabel="distance from the complete model [m]")
    axes[1, 0].set_title("energy, while the torque lasts")
    axes[1, 1].set_title("tip, while the torque lasts")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower left", ncol=4)
    page.picture(figure, "coriolis", "The paper's forces, without some Coriolis terms, by amplitude of the torque")
