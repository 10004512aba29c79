"""Values of the environments' options: starts, frames, and the longer defaults."""

from __future__ import annotations

from typing import Literal

from flexarm_env.episode.reset import SHARE_AT_REST
from flexarm_env.parameters import ArmParameters

Start = Literal["corner", "corners", "moving", "mix"]
Frame = Literal["link", "world"]
STARTS = {
    "corner": "at rest at the start of the lap",
    "corners": "at rest at a quarter of the lap, drawn",
    "moving": "anywhere, drawn to the control period, with the target's velocity and off it by up to `start_spread`",
    "mix": f'"corners" in {100.0 * SHARE_AT_REST:g} % of the episodes, else "moving"',
}
# [m]; scales in m and m/s, and the spread of starts, are for an arm of this reach, and in proportion for others
REACH = 9.0
MOVE_POINTS = 800  # sides of the polyline that approximates a move there and back
DEFAULT_WEIGHTS = {"tracking_wide": 0.6, "tracking_middle": 0.15, "tracking_fine": 0.1, "action_change": 0.15}
DEFAULT_OBSERVATION = (
    "elbow_direction",
    "joint_rates",
    "joint_error",
    "joint_error_rate",
    "encoder_error",
    "reference_position",
    "reference_velocity",
    "sensor_error",
    "sensor_error_rate",
    "modal_coordinates",
    "modal_rates",
    "previews",
    "last_actions",
)


def move_ring(arm: ArmParameters) -> tuple[float, float]:
    """Return the least and the largest distance of the ends of drawn moves from the shoulder [m].

    They are 0.05 of the reachable ring's width away from its edges, and the least is at least 0.35 of the reach.
    """
    outer = 0.05 * arm.inner_reach + 0.95 * arm.reach
    return max(0.35 * arm.reach, arm.inner_reach + arm.reach - outer), outer
