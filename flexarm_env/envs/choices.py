"""What the environments' options may be: action modes, starts, and the defaults that take more than a word."""

from __future__ import annotations

from typing import Literal, NamedTuple

from flexarm_env.episode.reset import SHARE_AT_REST

Mode = Literal["torque", "residual", "reference", "gain"]
Start = Literal["corner", "corners", "moving", "mix"]
Frame = Literal["link", "world"]


class ActionMode(NamedTuple):
    """What an entry a of an action, in [-1, 1], stands for.

    Attributes:
        text: description.
        quantity: name of the physical quantity in the formulas.
        unit: of it.
        formula: the quantity from a, as Python writes it; other names are options.
        inverse: a from the quantity.
        channels: what each entry belongs to.
        least: the quantity at a = -1, as a share of that at 1.
    """

    text: str
    quantity: str
    unit: str
    formula: str
    inverse: str
    channels: tuple[str, ...] = ("shoulder", "elbow")
    least: float = -1.0


MODES: dict[str, ActionMode] = {
    "torque": ActionMode(
        "torque of the motors, held over the control period",
        "torque",
        "N m",
        "torque_limit * a",
        "torque / torque_limit",
    ),
    "residual": ActionMode(
        "torque added to an inner joint-space tracking law (a spring and a damper between each joint and the rigid "
        "arm's way along the reference), which acts in continuous time; `torque_limit` limits the sum too",
        "residual",
        "N m",
        "torque_limit * a",
        "residual / torque_limit",
    ),
    "reference": ActionMode(
        "shift of that law's joint reference, reached linearly within the control period",
        "shift",
        "rad",
        "shift_limit * a",
        "shift / shift_limit",
    ),
    "gain": ActionMode(
        "the gain lambda of the paper's law (10), (14), which acts in continuous time",
        "gain",
        "1",
        "gain_limit * (a + 1) / 2",
        "2 * gain / gain_limit - 1",
        ("law",),
        0.0,
    ),
}
TORQUE_LIMIT = (150.0, 50.0)  # [N m]
PHYSICS_STEP = 1e-3  # [s], of the explicit integrator
STARTS = {
    "corner": "at rest at the start of the lap",
    "corners": "at rest at a quarter of the lap, drawn",
    "moving": "anywhere, drawn to the control period, with the reference's velocity and off it by up to `start_spread`",
    "mix": f'"corners" in {100.0 * SHARE_AT_REST:g} % of the episodes, else "moving"',
}
MOVE_POINTS = 800  # sides of the polyline that stands for a move there and back
MOVE_RING = (0.35, 0.95)  # of the reach: where the ends of drawn moves lie
SECOND_SENSOR_BLOCKS = ("second_sensed_position", "second_sensor_error")
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
