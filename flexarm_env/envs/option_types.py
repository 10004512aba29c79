"""`EnvOptions`: the options as keyword arguments, for editors and type checkers.

Written by `python -m scripts.docs.environments --no-pictures`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, TypedDict

from flexarm_env.envs.choices import Frame, Start
from flexarm_env.parameters import Compensation, Corner, Delayed, RateJacobian, SensorModel


class EnvOptions(TypedDict, total=False):
    """Options of an environment, all of them optional; see `flexarm_env.envs.options.Options`."""

    arm: str | Mapping[str, Any]
    payload_changes: Any
    action_mode: str
    control_period: float
    physics_step: float | None
    torque_limit: Sequence[float] | None
    torque_rate_limit: Sequence[float]
    motor_time_constant: Sequence[float]
    torque_speed_limit: Sequence[float] | None
    torque_resolution: Sequence[float]
    pulse_force: Sequence[float]
    pulse_time: float
    pulse_duration: float
    pulse_period: float
    race_laps: int
    reference_speed: float
    reference_acceleration: float
    gain_limit: float
    shift_limit: Sequence[float]
    inner_stiffness: Sequence[float]
    inner_damping: Sequence[float]
    proportional_gain: float
    derivative_gain: float
    compensation: Compensation
    feedback_source: Literal["joints", "sensor"]
    rate_jacobian: RateJacobian
    delayed: Delayed
    sensor: SensorModel
    sensor_position: float
    delay: float | Sequence[float] | None
    wave_speed: float
    noise: float
    jitter: float
    sensor_period: float
    dropout: float
    outage_time: float
    outage_duration: float
    gauge_drift: Sequence[float]
    encoder_noise: Sequence[float]
    encoder_resolution: Sequence[float]
    second_sensor_link: int | None
    second_sensor_position: float | None
    second_sensor_delay: float
    second_sensor_noise: float
    imu_link: int | None
    imu_position: float | None
    imu_delay: float
    imu_noise: Sequence[float]
    imu_bias: Sequence[float]
    imu_range: Sequence[float]
    actuation_delay: float
    observation: Sequence[str]
    frame: Frame
    previews: Sequence[float]
    last_actions: int
    scaled: bool
    reference: Any
    waypoints: Any
    side: float
    lap_time: float
    corner_time: float
    start_corner: Corner
    direction: str
    elbow_branch: str
    start: Start
    start_spread: Sequence[float]
    randomisation: Mapping[str, Sequence[Any]]
    reward_weights: Mapping[str, float]
    reward: Callable[[dict[str, Any]], Any] | None
    termination: Callable[[dict[str, Any]], Any] | None
    deflection_limit: float | None
    error_limit: float | None
