"""Every number that the paper prints, beside ours."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from flexarm_baselines import paper_system
from flexarm_env import ArmParameters, FlexibleArm, LawParameters, SensorParameters, SquareParameters, square
from scripts.paper.cases import CONTROL_PERIOD, Study

PAPER_CLOCK = {"ifdc": 77.0, "flsac": 100.0}  # [s]; clock time a run, end of section 4
CLOCK_STEP = 0.0252  # [s]; the paper's clock time a step, in which it counts delays


@dataclass(frozen=True)
class Number:
    """One row of numbers.json."""

    name: str
    unit: str  # of both values
    source: str  # equation or place in the paper
    paper: float  # as printed
    ours: float  # as computed or used
    note: str = ""  # where they differ, why

    def as_json(self) -> dict[str, Any]:
        """Return plain data, with the relative difference."""
        return asdict(self) | {"relative_difference": self.ours / self.paper - 1.0 if self.paper else 0.0}


def numbers() -> list[Number]:
    """Return all rows; every value of ours comes from the package's own objects."""
    arm = FlexibleArm(ArmParameters.paper())
    return [*_arm_and_gains(arm), *_delays(arm), *_lap(), *_fuzzy_system()]


def clock_numbers(clock: float) -> list[Number]:
    """Return the clock time of a run [s] beside the paper's."""
    note = "a run's share of the batch of both controllers' runs, measured beside another worker process"
    return [
        Number(f"clock time of a run, {name.upper()}", "s", "end of sec. 4", paper, clock, note)
        for name, paper in PAPER_CLOCK.items()
    ]


def _arm_and_gains(arm: FlexibleArm) -> list[Number]:
    p, link, law = arm.parameters, arm.modes[0], LawParameters()
    omega = float(link.frequencies[0])
    return [
        Number("L1", "m", "sec. 2", 4.5, p.link_lengths[0]),
        Number("L2", "m", "sec. 2", 4.5, p.link_lengths[1]),
        Number("EI", "N m^2", "sec. 2", 1676.0, p.flexural_rigidities[0]),
        Number("rho", "kg/m", "sec. 2", 0.335, p.masses_per_length[0]),
        Number("mode constant A", "1", "(4)", 0.1, p.mode_scale),
        Number("tip value of the mode, 2 A", "m", "(4)", 0.2, float(link.tip_values[0])),
        Number(
            "first root lambda_c1 L",
            "rad",
            "below (4)",
            0.5 * np.pi,
            float(link.wavenumbers[0]) * p.link_lengths[0],
            "printed (i - 0.5) pi is the asymptote for large i; the printed frequency comes from the exact root",
        ),
        Number("first cantilever frequency", "rad/s", "(5), below (12)", 12.28, omega, "printed in Hz; it is rad/s"),
        Number("damping ratio zeta", "1", "below (12)", 0.707, law.derivative_gain / (2.0 * omega)),
        Number("Kp = omega^2", "N/m", "(11)", 150.79, omega**2, "12.28^2 = 150.80; the printed value is used"),
        Number("Kd = 2 zeta omega", "N s/m", "(12)", 17.364, 2.0 * 0.707 * omega, "the printed value is used"),
    ]


def _delays(arm: FlexibleArm) -> list[Number]:
    p = arm.parameters
    tip, elbow = SensorParameters(position=4.5), SensorParameters(position=0.5)
    tip_delay, elbow_delay = tip.joint_delays(p.link_lengths[0]), elbow.joint_delays(p.link_lengths[0])
    wave = float(np.sqrt(1745833.0 / 21.0))
    steps = "the paper counts delays in steps of 0.0252 s of clock time, which has no physical meaning"
    return [
        Number("wave speed c", "m/s", "(15)", 288.33, wave, "no flexural wave's speed; kept as the paper's figure"),
        Number("distance shoulder to end effector", "m", "(16)", 9.0, p.link_lengths[0] + tip.position),
        Number("delay shoulder to end effector", "s", "(16)", 0.0312, tip_delay[0]),
        Number("delay elbow to end effector", "s", "(18)", 0.0156, tip_delay[1]),
        Number("delay shoulder to 0.5 m past the elbow", "s", "after (19)", 0.01734, elbow_delay[0]),
        Number("delay elbow to 0.5 m past it", "s", "after (19)", 0.001734, elbow_delay[1]),
        Number("the same in steps: 9 m", "steps", "(17)", 1.238, tip_delay[0] / CLOCK_STEP, steps),
        Number("the same in steps: 4.5 m", "steps", "(19)", 0.619, tip_delay[1] / CLOCK_STEP, steps),
        Number("the same in steps: 5.0 m", "steps", "after (19)", 0.688, elbow_delay[0] / CLOCK_STEP, steps),
        Number("the same in steps: 0.5 m", "steps", "after (19)", 0.0688, elbow_delay[1] / CLOCK_STEP, steps),
    ]


def _lap() -> list[Number]:
    side = SquareParameters()
    path = square(side)
    return [
        Number("side of the square", "m", "sec. 1", 12.6, float(np.ptp(path.table[:, 1]))),
        Number("simulation steps", "1", "above (17)", 16000.0, side.lap_time / CONTROL_PERIOD),
        Number("step size", "s", "above (17)", 0.001, CONTROL_PERIOD),
        Number(
            "lap time",
            "s",
            "above (17)",
            402.0,
            side.lap_time,
            "16000 steps of 0.001 s are 16 s; 402 s is clock time and contradicts the 77 s and 100 s given later",
        ),
    ]


def _fuzzy_system() -> list[Number]:
    system = paper_system()
    lowest, highest = (float(system.evaluate(np.array([[x, x]]))[0]) for x in (0.0, 5.0))
    return [
        Number("universe of delta", "1", "sec. 3", 5.0, float(system.inputs[0].universe[1])),
        Number("normalising gain K_n", "1", "below Table 1", 5.0, Study().K_n, "taken as a factor"),
        Number("fuzzy rules", "1", "Table 1", 9.0, float(np.asarray(system.rules).size)),
        Number(
            "smallest lambda",
            "1",
            "sec. 3",
            0.0,
            lowest,
            "'zero' cannot occur: the centroid of a clipped triangle at the universe's end is 1/6",
        ),
        Number(
            "largest lambda",
            "1",
            "sec. 3",
            1.0,
            highest,
            "'lambda = 1' cannot occur: the centroid at the other end is 5/6",
        ),
    ]
