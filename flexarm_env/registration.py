"""The environments' ids: one class, and for each id the options in which it differs from `FlexArm/Square-v0`."""

from __future__ import annotations

from typing import Any

import gymnasium

NAMESPACE = "FlexArm"
# Control periods of an episode: a lap of 16 s at 100 Hz, or at the paper's 1 kHz; a move there and back of 8 s. A test
# ties them to lap time and control period.
_LAP, _PAPER_LAP, _MOVES = 1600, 16_000, 800

_PAPER: dict[str, Any] = {
    "arm": "paper",
    "action_mode": "gain",
    "control_period": 1e-3,
    "law_sensor": "sensor",
    "sensor": "rigid",
    "observation": (
        "joint_angles",
        "joint_rates",
        "sensed_position",
        "modal_coordinates",
        "reference_position",
        "reference_velocity",
    ),
    "frame": "world",
    "scaled": False,
    "start": "corner",
    "reward_weights": {"tracking_wide": 0.5, "tracking_middle": 0.5},
    "deflection_limit": None,
    "error_limit": None,
}
_ENCODERS = (
    "elbow_direction",
    "joint_rates",
    "joint_error",
    "joint_error_rate",
    "encoder_error",
    "reference_position",
    "reference_velocity",
    "previews",
    "last_actions",
)

IDS: dict[str, tuple[int, dict[str, Any]]] = {
    "Square-v0": (_LAP, {}),
    "SquareResidual-v0": (_LAP, {"action_mode": "residual"}),
    "SquareGain-v0": (
        _LAP,
        {"action_mode": "gain", "physics_step": 1e-3, "deflection_limit": 4.5, "error_limit": 9.0},
    ),
    "SquareEncoders-v0": (_LAP, {"observation": _ENCODERS, "last_actions": 8}),
    "Reach-v0": (_MOVES, {"reference": "moves", "lap_time": 8.0, "start": "corner"}),
    "Track-v0": (_LAP, {"reference": "circle"}),
    "Paper-v0": (_PAPER_LAP, _PAPER),
}


def register_environments() -> None:
    """Register all ids with Gymnasium; doing it again changes nothing."""
    for name, (steps, options) in IDS.items():
        if f"{NAMESPACE}/{name}" not in gymnasium.registry:
            gymnasium.register(
                id=f"{NAMESPACE}/{name}",
                entry_point="flexarm_env.env:FlexArmEnv",
                vector_entry_point="flexarm_env.vector_env:FlexArmVectorEnv",
                max_episode_steps=steps,
                kwargs=options,
            )
