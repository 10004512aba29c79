"""`MotionOptions`: the options of the arm, its actions, its motors, and the laws under an action."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from flexarm_env.actions import IDEAL_MOTORS, MODES
from flexarm_env.allowed import Allowed, Custom, Integer, Number, OneOf, Optional, Pair, ZeroOr, allowed_of, declared
from flexarm_env.envs.consistency import checked_arm, checked_changes
from flexarm_env.parameters import (
    MAX_DELAY,
    PRESETS,
    Compensation,
    Delayed,
    LawParameters,
    RateJacobian,
    SensorParameters,
)


def option(default: Any, text: str, allowed: Allowed, own: bool = False) -> Any:
    """Declare an option."""
    return declared(default, allowed, text=text, own=own)


def own(default: Any, text: str, allowed: Allowed) -> Any:
    """Declare an option that environments of a batch may have for themselves, and whose numbers episodes may draw."""
    return option(default, text, allowed, own=True)


@dataclass(frozen=True, kw_only=True)
class MotionOptions:
    """Options that say how an action moves which arm; see `options.Options`."""

    arm: str | Mapping[str, Any] = own(
        "default",
        "the arm: a name, or a mapping of `ArmParameters` fields in which `preset` names the arm that sets the others",
        Custom(checked_arm, text=", ".join(f'"{name}"' for name in PRESETS) + ", or a mapping"),
    )
    payload_changes: Any = option(
        None,
        "changes of the payload in each lap: the share of the lap, and what the tip carries from then on; None for "
        "that: the episode's `payload_mass`. No impulse acts: the mass arrives with the tip's velocity",
        Optional(Custom(checked_changes, "1, kg")),
    )
    action_mode: str = option("torque", "what an action is", OneOf(tuple(MODES)))
    control_period: float = option(0.01, "duration of an action", Number(1e-5, 1.0, "s"))
    physics_step: float | None = option(
        None,
        "longest integration step; None: 0.25 ms for the gain or less, else as the arm demands: the tip's expected "
        "error after a second of full random torques is at most 0.1 mm",
        Optional(Number(1e-9, 1.0, "s")),
    )
    torque_limit: tuple[float, float] | None = own(
        None,
        "largest torques of shoulder and elbow; None: 150 and 50, for the gain no limit (limited, the law loses the "
        "path)",
        allowed_of(LawParameters, "torque_limit"),
    )
    torque_rate_limit: tuple[float, float] = option(
        # A reversal excites the free arm's second pair of modes (29 Hz and more) at most a ninth as much as a step.
        (3000.0, 1000.0),
        "change of the torque per second at action 1; the default reverses the default torques in 0.1 s",
        Pair(1e-6, 1e12, "N m/s"),
    )
    motor_time_constant: tuple[float, float] = own(
        IDEAL_MOTORS["motor_time_constant"],
        "time constants of the current loops of shoulder and elbow, through which a torque follows its command",
        Pair(0.0, MAX_DELAY, "s"),
    )
    torque_speed_limit: tuple[float, float] | None = own(
        IDEAL_MOTORS["torque_speed_limit"],
        "no-load speeds: the torque that a motor has in the direction of motion falls linearly from `torque_limit` at "
        "rest to 0 there; None: it does not fall",
        Optional(Pair(1e-3, 1e6, "rad/s")),
    )
    torque_resolution: tuple[float, float] = own(
        IDEAL_MOTORS["torque_resolution"],
        "torques that commands are rounded to multiples of; 0: they are not",
        Pair(0.0, 1e9, "N m"),
    )
    pulse_force: tuple[float, float] = own(
        (0.0, 0.0), "force of pulses that act at the tip, in the world's x and y", Pair(-1e6, 1e6, "N")
    )
    pulse_time: float = own(0.0, "when the first pulse begins, since the episode began", Number(0.0, 1e6, "s"))
    pulse_duration: float = own(0.1, "how long a pulse lasts", Number(1e-6, 1e6, "s"))
    pulse_period: float = own(
        0.0, "from the beginning of one pulse to that of the next; 0: there is one", ZeroOr(1e-6, 1e6, "s")
    )
    race_laps: int = option(3, "laps of a race", Integer(1, 1000))
    reference_speed: float = option(
        25.0, "speed of the reference along the path at action 1, in a race", Number(1e-3, 1e3, "m/s")
    )
    reference_acceleration: float = option(
        100.0,
        "largest change of that speed per second; the default reaches the default speed in a quarter of a second",
        Number(1e-3, 1e6, "m/s^2"),
    )
    gain_limit: float = own(1.0, "gain lambda at action 1", Number(1e-6, 1e6, "1"))
    shift_limit: tuple[float, float] = option(
        (0.3, 0.3), "shift of the joints' target at action 1", Pair(1e-6, np.pi, "rad")
    )
    inner_stiffness: tuple[float, float] = own(
        (1000.0, 130.0), "stiffness of the inner law in shoulder and elbow", Pair(0.0, 1e9, "N m/rad")
    )
    inner_damping: tuple[float, float] = own(
        (40.0, 30.0), "damping of the inner law in shoulder and elbow", Pair(0.0, 1e9, "N m s/rad")
    )
    proportional_gain: float = own(150.79, "Kp of the paper's law (11)", allowed_of(LawParameters, "proportional_gain"))
    derivative_gain: float = own(17.364, "Kd of the paper's law (12)", allowed_of(LawParameters, "derivative_gain"))
    compensation: Compensation = own(
        "none",
        'delay of the law\'s target: "none", "shared" (the shoulder\'s delay for both joints) or "per_joint"',
        allowed_of(LawParameters, "compensation"),
    )
    feedback_source: Literal["joints", "sensor"] = option(
        "joints",
        'what the paper\'s law acts on: "joints" (collocated, not late) or the late "sensor"',
        OneOf(("joints", "sensor")),
    )
    rate_jacobian: RateJacobian = option(
        "delayed",
        'angles in the Jacobian of the "rigid" sensor\'s velocity error',
        allowed_of(SensorParameters, "rate_jacobian"),
    )
    delayed: Delayed = own(
        "position",
        'what is late of the "rigid" sensor: positions alone (the paper), or rates, too',
        allowed_of(SensorParameters, "delayed"),
    )
