"""What the user can set, with units, defaults, their source, and validation.

All classes are frozen: a changed set is a new one (`dataclasses.replace`). "(n)" is equation n of Green & Sasiadek,
*Control of a flexible robot using fuzzy logic and a noncollocated sensor*, IFAC 2008.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from flexarm_env.validation import choice, integer, number, pair

VelocityForces = Literal["complete", "rigid"]
Kinematics = Literal["linear", "foreshortened"]
ModeShapes = Literal["cantilever", "polynomial"]
SensorModel = Literal["collocated", "rigid", "true"]
Delayed = Literal["position", "position+rate"]
RateJacobian = Literal["delayed", "current"]
Compensation = Literal["none", "shared", "per_joint"]
Corner = Literal["lower left", "upper left", "upper right", "lower right"]
Direction = Literal["clockwise", "counterclockwise"]
ElbowBranch = Literal["positive", "negative"]

MAX_MODES = 4
MAX_DELAY = 10.0  # [s]; the delay line holds a reading for every integration step
WAVE_SPEED = 288.33  # c [m/s] (15)


@dataclass(frozen=True)
class ArmParameters:
    """A planar arm of two flexible links, no gravity.

    Attributes:
        link_lengths: L1, L2 [m]. Paper: 4.5, 4.5.
        flexural_rigidities: EI of each link [N m^2]. Paper: 1676.
        masses_per_length: rho of each link [kg/m]. Paper: 0.335.
        modes_per_link: clamped-free modes of each link, 1 to 4. The paper has 1, which puts the first elastic
            frequencies of the free arm 33 to 46 % too high (with payload or hubs up to 55 %); with 2 they are
            within 1 % (with payload or hubs 3 %).
        shoulder_hub_inertia: turns at the rate of theta1 [kg m^2].
        elbow_hub_inertia: turns with the root of link 2, at its absolute rate [kg m^2].
        elbow_mass: point mass at the tip of link 1 [kg].
        payload_mass: point mass at the tip of link 2 [kg].
        payload_inertia: turns with the tip tangent of link 2 [kg m^2].
        modal_damping_ratio: zeta; each clamped mode is damped by 2 zeta omega_i m_i. The paper has none.
        joint_friction: viscous friction of shoulder and elbow [N m s/rad].
        velocity_forces: "complete", or "rigid": the paper's C_r (7), the rigid arm's Coriolis and centrifugal
            forces in the joint rows only, while the mass matrix still depends on the deflections.
        mode_scale: A, the arbitrary constant of the shapes (4). It scales the modal coordinates only.
        kinematics: "linear", the paper's: a point of a link moves across the root tangent only; or "foreshortened":
            a bent link also draws its points in, by half the integral of w'^2, in kinetic energy, kinematics and
            forces (geometric stiffening follows). The linear arm's tip is right to 10 mm only while links bend by
            less than 5 % *and* turn at less than 1.2 rad/s (hardly bent: 3.3 rad/s); its straight spin is unstable
            from 4.6 rad/s. The square leaves both limits (docs/validation.md).
        mode_shapes: "cantilever", the paper's clamped-free modes (4); or "polynomial": as many polynomials from x^2
            up, orthogonal in mass and stiffness, which let the elbow's moment bend link 1's tip.
    """

    link_lengths: tuple[float, float] = (4.5, 4.5)
    flexural_rigidities: tuple[float, float] = (1676.0, 1676.0)
    masses_per_length: tuple[float, float] = (0.335, 0.335)
    modes_per_link: int = 2
    shoulder_hub_inertia: float = 0.0
    elbow_hub_inertia: float = 0.0
    elbow_mass: float = 0.0
    payload_mass: float = 0.0
    payload_inertia: float = 0.0
    modal_damping_ratio: float = 0.01
    joint_friction: tuple[float, float] = (0.0, 0.0)
    velocity_forces: VelocityForces = "complete"
    mode_scale: float = 0.1
    kinematics: Kinematics = "linear"
    mode_shapes: ModeShapes = "cantilever"

    def __post_init__(self) -> None:
        """Validate and bring to canonical types.

        Raises:
            TypeError: for a value of the wrong kind.
            ValueError: for a value out of range.
        """
        checked = {
            "link_lengths": pair("link_lengths", self.link_lengths, "m", above=0.0),
            "flexural_rigidities": pair("flexural_rigidities", self.flexural_rigidities, "N m^2", above=0.0),
            "masses_per_length": pair("masses_per_length", self.masses_per_length, "kg/m", above=0.0),
            "modes_per_link": integer("modes_per_link", self.modes_per_link, 1, MAX_MODES),
            "shoulder_hub_inertia": number("shoulder_hub_inertia", self.shoulder_hub_inertia, "kg m^2", least=0.0),
            "elbow_hub_inertia": number("elbow_hub_inertia", self.elbow_hub_inertia, "kg m^2", least=0.0),
            "elbow_mass": number("elbow_mass", self.elbow_mass, "kg", least=0.0),
            "payload_mass": number("payload_mass", self.payload_mass, "kg", least=0.0),
            "payload_inertia": number("payload_inertia", self.payload_inertia, "kg m^2", least=0.0),
            "modal_damping_ratio": number("modal_damping_ratio", self.modal_damping_ratio, least=0.0, most=1.0),
            "joint_friction": pair("joint_friction", self.joint_friction, "N m s/rad", least=0.0),
            "velocity_forces": choice("velocity_forces", self.velocity_forces, ("complete", "rigid")),
            "mode_scale": number("mode_scale", self.mode_scale, above=0.0),
            "kinematics": choice("kinematics", self.kinematics, ("linear", "foreshortened")),
            "mode_shapes": choice("mode_shapes", self.mode_shapes, ("cantilever", "polynomial")),
        }
        if self.kinematics == "foreshortened" and self.velocity_forces == "rigid":
            raise ValueError(
                "kinematics = 'foreshortened': the paper's C_r (velocity_forces = 'rigid') knows no foreshortening; "
                "velocity_forces must be 'complete'"
            )
        for name, value in checked.items():
            object.__setattr__(self, name, value)

    @classmethod
    def paper(cls, **changes: object) -> ArmParameters:
        """The paper's arm: one mode a link, rigid velocity forces C_r (7), A = 0.1 (4), no damping.

        Args:
            **changes: fields to set otherwise.
        """
        values: dict[str, object] = {
            "modes_per_link": 1,
            "modal_damping_ratio": 0.0,
            "velocity_forces": "rigid",
            "mode_scale": 0.1,
        }
        return cls(**(values | changes))  # type: ignore[arg-type]

    @property
    def reach(self) -> float:
        """Distance from the shoulder to the tip of the straight arm [m]."""
        return self.link_lengths[0] + self.link_lengths[1]


@dataclass(frozen=True)
class SensorParameters:
    """Where the end-effector sensor sits, what it sees, and how late.

    Attributes:
        model: "collocated": joint angles and rates, no delay. "rigid": noncollocated as in the paper, rigid
            kinematics (8), (9) of the delayed joint angles, each by its own delay. "true": the physical point
            with its deflection, the whole reading late by one delay.
        position: distance of the sensor from the elbow along link 2 [m]; it replaces L2 in (8), (9) and (13) of
            all three models. Paper: 4.5 (end effector) and 0.5.
        delay: None: distance from each joint to the sensor over the wave speed (16), (18). Else [s], one number
            for both or a pair (shoulder, elbow), at most 10 s. "true" readings use the shoulder's only, so a pair is
            refused.
        delayed: "position" (the paper: rates are current) or "position+rate".
        rate_jacobian: Jacobian in the velocity error of the "rigid" model, of the "delayed" angles or of the
            "current" ones (a sensitivity; docs/reproduction.md).
        noise: standard deviation of the white noise on each coordinate of the reading [m], drawn once a control
            period.
        wave_speed: c [m/s] (15).
    """

    model: SensorModel = "rigid"
    position: float = 4.5
    delay: float | tuple[float, float] | None = None
    delayed: Delayed = "position"
    rate_jacobian: RateJacobian = "delayed"
    noise: float = 0.0
    wave_speed: float = WAVE_SPEED

    def __post_init__(self) -> None:
        """Validate; see `ArmParameters.__post_init__` for the errors."""
        choice("sensor", self.model, ("collocated", "rigid", "true"))
        object.__setattr__(self, "position", number("sensor_position", self.position, "m", above=0.0))
        choice("delayed", self.delayed, ("position", "position+rate"))
        choice("rate_jacobian", self.rate_jacobian, ("delayed", "current"))
        object.__setattr__(self, "noise", number("noise", self.noise, "m", least=0.0))
        object.__setattr__(self, "wave_speed", number("wave_speed", self.wave_speed, "m/s", above=0.0))
        if self.delay is not None:
            if self.model == "collocated":
                raise ValueError(f"delay = {self.delay!r}: a collocated sensor has none; it must be None")
            if not isinstance(self.delay, tuple | list | np.ndarray):
                object.__setattr__(self, "delay", number("delay", self.delay, "s", least=0.0, most=MAX_DELAY))
            elif self.model == "true":
                raise ValueError(
                    f"delay = {self.delay!r}: a 'true' sensor's reading has one delay; it must be one number [s]"
                )
            else:
                object.__setattr__(self, "delay", pair("delay", self.delay, "s", least=0.0, most=MAX_DELAY))

    def joint_delays(self, shoulder_to_elbow: float) -> tuple[float, float]:
        """Delay of the shoulder's and of the elbow's measurement [s] (16), (18).

        Args:
            shoulder_to_elbow: L1 [m].

        Raises:
            ValueError: if the wave speed makes one longer than `MAX_DELAY`.
        """
        if self.model == "collocated":
            return 0.0, 0.0
        if isinstance(self.delay, tuple):
            return self.delay
        if self.delay is not None:
            return self.delay, self.delay
        shoulder = (shoulder_to_elbow + self.position) / self.wave_speed
        if shoulder > MAX_DELAY:
            raise ValueError(
                f"wave_speed = {self.wave_speed} m/s: the sensor would be late by {shoulder:.4g} s; "
                f"at most {MAX_DELAY} s is allowed"
            )
        return shoulder, shoulder if self.model == "true" else self.position / self.wave_speed


@dataclass(frozen=True)
class LawParameters:
    """The Jacobian-transpose law (10), scaled by the gain lambda (14).

    Attributes:
        proportional_gain: Kp [N/m]. Paper: 150.79 (11).
        derivative_gain: Kd [N s/m]. Paper: 17.364 (12).
        compensation: delay of the command (reference position and velocity): "none"; "shared", the shoulder's
            sensor delay for both joints (the paper's NMP correction); "per_joint", each joint's own sensor delay.
        torque_limit: largest torque of shoulder and elbow [N m]; None for no limit (the paper).
    """

    proportional_gain: float = 150.79
    derivative_gain: float = 17.364
    compensation: Compensation = "none"
    torque_limit: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        """Validate; see `ArmParameters.__post_init__` for the errors."""
        for name, unit in (("proportional_gain", "N/m"), ("derivative_gain", "N s/m")):
            object.__setattr__(self, name, number(name, getattr(self, name), unit, least=0.0))
        choice("compensation", self.compensation, ("none", "shared", "per_joint"))
        if self.torque_limit is not None:
            object.__setattr__(self, "torque_limit", pair("torque_limit", self.torque_limit, "N m", above=0.0))


@dataclass(frozen=True)
class SquareParameters:
    """The square task.

    Attributes:
        side: length of a side [m], centred on the shoulder. Paper: 12.6.
        lap_time: time of one lap [s]. The paper's 16000 steps of 0.001 s are 16 s.
        start_corner: where a lap starts. Paper: lower left.
        direction: Paper: clockwise.
        elbow_branch: sign of theta2 at the start. The paper does not say; "positive" is the project's reading.
    """

    side: float = 12.6
    lap_time: float = 16.0
    start_corner: Corner = "lower left"
    direction: Direction = "clockwise"
    elbow_branch: ElbowBranch = "positive"

    def __post_init__(self) -> None:
        """Validate; see `ArmParameters.__post_init__` for the errors."""
        object.__setattr__(self, "side", number("side", self.side, "m", above=0.0))
        object.__setattr__(self, "lap_time", number("lap_time", self.lap_time, "s", above=0.0))
        choice("start_corner", self.start_corner, ("lower left", "upper left", "upper right", "lower right"))
        choice("direction", self.direction, ("clockwise", "counterclockwise"))
        choice("elbow_branch", self.elbow_branch, ("positive", "negative"))


def arm_parameters(arm: str | Mapping[str, Any] | ArmParameters) -> ArmParameters:
    """The arm that an environment's `arm` argument stands for.

    Raises:
        TypeError: for anything but a name or a mapping.
        ValueError: for another name, or a field that `ArmParameters` does not have.
    """
    if isinstance(arm, ArmParameters):
        return arm
    if isinstance(arm, str):
        arm = {"preset": arm}
    if not isinstance(arm, Mapping):
        raise TypeError(f"arm = {arm!r}: must be 'paper', 'default' or a mapping of ArmParameters fields")
    given = dict(arm)
    preset = choice("arm", given.pop("preset", "default"), ("paper", "default"))
    known = ArmParameters.__dataclass_fields__
    unknown = [name for name in given if name not in known]
    if unknown:
        raise ValueError(f"arm: unknown field(s) {unknown}; ArmParameters has {list(known)}, and there is 'preset'")
    return ArmParameters.paper(**given) if preset == "paper" else ArmParameters(**given)
