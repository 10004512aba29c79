"""`LoopCase`: what may differ between the arms of a closed loop, its checks, and its rows of the arena."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexarm_env.kernels.layout import place_rows
from flexarm_env.kernels.variants import shared_model
from flexarm_env.parameters import LawParameters, SensorModel, SensorParameters
from flexarm_env.simulation.arm import FlexibleArm
from flexarm_env.validation import shown

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LoopCase:
    """What may differ between the arms of a batch.

    Attributes:
        sensor: models may differ where they share a kernel: "collocated" and "rigid" do.
        law: gains, command delay, torque limit.
    """

    sensor: SensorParameters
    law: LawParameters


def checked_cases(cases: Sequence[LoopCase], arm: FlexibleArm) -> list[LoopCase]:
    """Check the cases of a batch, each of which must fit the arm.

    Raises:
        TypeError: for something else than a case.
        ValueError: for no cases, a sensor off the link, a compensation without delay.
    """
    listed = list(cases)
    if not listed:
        raise ValueError("cases: must hold at least one LoopCase")
    length2 = arm.parameters.link_lengths[1]
    for case in listed:
        if not isinstance(case, LoopCase):
            raise TypeError(f"cases hold {shown(case)}: must be LoopCase objects")
        if case.sensor.position > length2:
            raise ValueError(f"sensor_position = {case.sensor.position} m: must be on link 2, > 0 and <= {length2} m")
        if case.law.compensation != "none" and not case.sensor.traits.late:
            raise ValueError(
                f"compensation = {case.law.compensation!r}: a {case.sensor.model} sensor has no delay to compensate; "
                "it must be 'none'"
            )
    return listed


def sensor_variant(cases: Sequence[LoopCase]) -> tuple[SensorModel, str]:
    """Model and Jacobian of the sensors, for which a kernel is compiled (`variants.Variant`).

    Raises:
        ValueError: if they differ.
    """
    kinds = {(shared_model(case.sensor.model), case.sensor.rate_jacobian) for case in cases}
    if len(kinds) > 1:
        raise ValueError(f"cases: sensors of one batch must share model and rate_jacobian, got {sorted(kinds)}")
    return kinds.pop()


def delays(case: LoopCase, arm: FlexibleArm) -> tuple[float, float]:
    """Delay of the shoulder's and of the elbow's reading [s]."""
    return case.sensor.joint_delays(arm.parameters.link_lengths[0])


def command_delays(case: LoopCase, arm: FlexibleArm) -> tuple[float, float]:
    """Delay of the command in the shoulder's and in the elbow's torque [s]."""
    shoulder, elbow = delays(case, arm)
    return {"none": (0.0, 0.0), "shared": (shoulder, shoulder), "per_joint": (shoulder, elbow)}[case.law.compensation]


def case_rows(cases: Sequence[LoopCase], arm: FlexibleArm) -> dict[str, Array]:
    """Rows of the arena that the cases set and no step changes, by name (`layout`). Shape (N, k) each."""
    each = [_rows_of(case, arm) for case in cases]
    return {name: np.array([list(values[name]) for values in each]) for name in each[0]}


def _rows_of(case: LoopCase, arm: FlexibleArm) -> dict[str, Sequence[float]]:
    sensor, law = case.sensor, case.law
    return {
        **place_rows("SENSOR", arm.place(2, sensor.position)),
        **place_rows("TIP", arm.place(2, arm.parameters.link_lengths[1])),
        "PROPORTIONAL_GAIN": [law.proportional_gain],
        "DERIVATIVE_GAIN": [law.derivative_gain],
        "TORQUE_LIMIT": law.torque_limit or (np.inf, np.inf),
        "DELAY": delays(case, arm),
        "COMMAND_DELAY": command_delays(case, arm),
        "RATE_LATE": [float(sensor.delayed == "position+rate")],
    }
