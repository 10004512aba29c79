"""Standard deviations that an observer assumes: of its model, and of each of its sensors."""

from __future__ import annotations

from dataclasses import dataclass, fields

from flexarm_env.validation import number, pair


@dataclass(frozen=True)
class NoiseModel:
    """Standard deviations of what the observer does not know; each sample is independent of the others.

    Attributes:
        joint_angle: standard deviation of an encoder's angle [rad].
        joint_rate: standard deviation of an encoder's rate [rad/s].
        tip: standard deviation of each coordinate of the late sensor [m].
        gauge: standard deviation of a modal coordinate from strain gauges, as a deflection of the link's tip [m].
        gauge_rate: standard deviation of its rate [m/s].
        torque: disturbance of each motor's torque, held over a control period [N m].
        modal_force: disturbance of each mode's rate over a control period, as a rate of the link's tip [m/s].
        start_joint: standard deviation of the joint angles at the start [rad].
        start_mode: standard deviation of each modal coordinate at the start, as a deflection of the link's tip [m].
        start_rate: standard deviation of joint rates [rad/s] and of modal rates, as a rate of the link's tip [m/s],
            at the start.
    """

    joint_angle: float = 1e-4
    joint_rate: float = 1e-3
    tip: float = 3e-3
    gauge: float = 2e-3
    gauge_rate: float = 2e-2
    torque: tuple[float, float] = (1.0, 0.5)
    modal_force: float = 1e-3
    start_joint: float = 0.02
    start_mode: float = 0.02
    start_rate: float = 0.02

    def __post_init__(self) -> None:
        """Refuse deviations that are no numbers, or 0 where a sensor's covariance would be singular."""
        for field in fields(self):
            value = getattr(self, field.name)
            if field.name == "torque":
                object.__setattr__(self, "torque", pair("torque", value, "N m", least=0.0))
            elif field.name.startswith("start_") or field.name == "modal_force":
                number(field.name, value, least=0.0)
            else:
                number(field.name, value, above=0.0)
