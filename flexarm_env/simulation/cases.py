"""`LoopCase`: what may differ between the arms of a closed loop, its checks, and its rows of the arena."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flexarm_env.kernels.layout import place_rows
from flexarm_env.kernels.variants import shared_model
from flexarm_env.parameters import (
    SENSOR_MODELS,
    ArmParameters,
    Compensation,
    LawParameters,
    SensorModel,
    SensorParameters,
)
from flexarm_env.simulation.arm import FlexibleArm
from flexarm_env.validation import shown

COMPENSATIONS: tuple[Compensation, ...] = ("none", "shared", "per_joint")  # by their numbers in the arena


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
    for case in listed:
        if not isinstance(case, LoopCase):
            raise TypeError(f"cases hold {shown(case)}: must be LoopCase objects")
        refuse_off_link("sensor_position", case.sensor.position, 2, arm.parameters)
        refuse_compensation_without_delay(case.law.compensation, case.sensor.model)
    return listed


def refuse_off_link(name: str, position: float, link: int, arm: ArmParameters) -> None:
    """Refuse a sensor's position beyond the end of its link.

    Raises:
        ValueError: naming the option.
    """
    length = arm.link_lengths[link - 1]
    if position > length:
        raise ValueError(
            f"{name} = {position} m: must be on link {link}, > 0 and <= {length} m (link_lengths of the arm)"
        )


def refuse_compensation_without_delay(compensation: Compensation, model: SensorModel) -> None:
    """Refuse delayed commands where the sensor has no delay.

    Raises:
        ValueError: naming the compensation and the sensor.
    """
    if compensation != "none" and not SENSOR_MODELS[model].late:
        raise ValueError(
            f"compensation = {compensation!r}: a {model} sensor has no delay to compensate; it must be 'none'"
        )


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


def sensor_rows(sensor: SensorParameters, arm: FlexibleArm) -> dict[str, Sequence[float]]:
    """Rows of the arena that a sensor sets and no step changes, by name (`layout`); its delays may be drawn."""
    return {
        **place_rows("SENSOR_POINT", arm.place(2, sensor.position)),
        "RATE_LATE": [float(sensor.delayed == "position+rate")],
    }


def law_rows(law: LawParameters, arm: FlexibleArm, distance: float) -> dict[str, Sequence[float]]:
    """Rows of the arena that the paper's law sets and no step changes, by name (`layout`).

    Args:
        law: the law.
        arm: the arm.
        distance: of the point that the law acts on from the elbow [m].
    """
    return {
        **place_rows("SENSOR", arm.place(2, distance)),
        "PROPORTIONAL_GAIN": [law.proportional_gain],
        "DERIVATIVE_GAIN": [law.derivative_gain],
        "TORQUE_LIMIT": law.torque_limit or (np.inf, np.inf),
        "COMPENSATION": [COMPENSATIONS.index(law.compensation)],
    }


def case_rows(case: LoopCase, arm: FlexibleArm) -> dict[str, Sequence[float]]:
    """Rows of the arena that a case sets, by name (`layout`)."""
    return {
        **sensor_rows(case.sensor, arm),
        **law_rows(case.law, arm, case.sensor.position),
        "SENSOR_DELAY": delays(case, arm),
    }
