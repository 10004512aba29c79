"""What a model of the end-effector sensor reads, and how late; (n) is equation n of Green & Sasiadek (2008)."""

from __future__ import annotations

from typing import Literal, NamedTuple, get_args

SensorModel = Literal["collocated", "rigid", "true"]


class SensorTraits(NamedTuple):
    """What a model of the end-effector sensor is.

    Attributes:
        text: description.
        reading: what a reading holds: the joint "angles", from which rigid kinematics give the point and the law's
            Jacobian, or the Cartesian "point" of the bent link (`physics.sensing.READINGS`,
            `control.jacobian_transpose.MEASUREMENTS`).
        delays: of a reading: "none"; for "each joint" its own; or "one" for the whole reading.
    """

    text: str
    reading: Literal["angles", "point"]
    delays: Literal["none", "each joint", "one"]

    @property
    def late(self) -> bool:
        """Whether readings are late."""
        return self.delays != "none"

    @property
    def bends(self) -> bool:
        """Whether the sensor sees the deflection."""
        return self.reading == "point"


SENSOR_MODELS: dict[SensorModel, SensorTraits] = {
    "collocated": SensorTraits("joint angles and rates, no delay", "angles", "none"),
    "rigid": SensorTraits(
        "noncollocated as in the paper, rigid kinematics (8), (9) of the delayed joint angles, each by its own delay",
        "angles",
        "each joint",
    ),
    "true": SensorTraits("the physical point with its deflection, the whole reading late by one delay", "point", "one"),
}
assert tuple(SENSOR_MODELS) == get_args(SensorModel)
