"""What the user can set, with units, defaults, their source, and validation.

All classes are frozen: a changed set is a new one (`dataclasses.replace`). The range of each number stands beside its
field, wide enough for arms from millimetres to kilometres, and such that all that is computed from it stays finite;
combinations are checked where they matter (`conditioning`, `stability.count_substeps`). "(n)" is equation n of Green &
Sasiadek, *Control of a flexible robot using fuzzy logic and a noncollocated sensor*, IFAC 2008.

The default arm with a payload of half a kilogram; a value that is not allowed is refused at once:

    >>> from dataclasses import replace
    >>> arm = replace(ArmParameters.named("default"), payload_mass=0.5)
    >>> arm.link_lengths, arm.payload_mass
    ((4.5, 4.5), 0.5)
    >>> replace(arm, payload_mass=-1.0)
    Traceback (most recent call last):
    ValueError: payload_mass
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np

from flexarm_env.allowed import Custom, Integer, Number, OneOf, Optional, Pair, check_fields, declared
from flexarm_env.published_arms import PUBLISHED, Preset
from flexarm_env.sensor_models import SENSOR_MODELS as SENSOR_MODELS
from flexarm_env.sensor_models import SensorModel as SensorModel
from flexarm_env.sensor_models import SensorTraits as SensorTraits
from flexarm_env.validation import choice, number, pair, shown

VelocityForces = Literal["complete", "rigid"]
Kinematics = Literal["linear", "foreshortened"]
ModeShapes = Literal["cantilever", "polynomial"]
DampingModel = Literal["modal", "material"]
Delayed = Literal["position", "position+rate"]
RateJacobian = Literal["delayed", "current"]
Compensation = Literal["none", "shared", "per_joint"]
Corner = Literal["lower left", "upper left", "upper right", "lower right"]
Direction = Literal["clockwise", "counterclockwise"]
ElbowBranch = Literal["positive", "negative"]
DIRECTIONS: tuple[Direction, ...] = get_args(Direction)
EITHER = "either"  # of two: an environment draws one for each episode

MAX_MODES = 4
MAX_DELAY = 10.0  # [s]; the delay line holds a reading for every integration step
WAVE_SPEED = 288.33  # c [m/s] (15)
HEAVIEST_PAYLOAD = 1e3  # [kg]
LARGEST_NOISE = 1e3  # [m], [rad], [rad/s]
# Ratio of the free arm's first elastic mode where each clamped mode of equal links is damped by 1 %.
CLAMPED_ONE_PERCENT = 0.018684769131347163


@dataclass(frozen=True)
class ArmParameters:
    """A planar arm of two flexible links, no gravity.

    Attributes:
        link_lengths: L1, L2 [m]. Paper: 4.5, 4.5.
        flexural_rigidities: EI of each link [N m^2]. Paper: 1676.
        masses_per_length: rho of each link [kg/m]. Paper: 0.335.
        modes_per_link: shapes of each link, 1 to 4; 3 by default. The paper has 1, whose elastic frequencies are much
            too high (docs/validation.md has the figures).
        shoulder_hub_inertia: turns at the rate of theta1 [kg m^2].
        elbow_hub_inertia: turns with the root of link 2, at its absolute rate [kg m^2].
        elbow_mass: point mass at the tip of link 1 [kg].
        payload_mass: point mass at the tip of link 2 [kg].
        payload_inertia: turns with the tip tangent of link 2 [kg m^2].
        damping_ratio: zeta, the ratio of the first elastic mode of the free arm without payload, whatever the model
            (`physics.damping` has the exact definition). The paper has none.
        damping_model: how the modes above follow: "modal", one ratio for all clamped modes of the bare links; or
            "material" (Kelvin-Voigt), a damping matrix in proportion to the stiffness, so that the ratio grows with the
            frequency. Only with the latter do scores under feedback converge with the number of modes (docs/plant.md).
        joint_friction: viscous friction of shoulder and elbow [N m s/rad].
        coulomb_friction: dry friction of shoulder and elbow [N m].
        breakaway_excess: what breakaway takes beyond it [N m].
        stribeck_velocity: rate at which half of that is left [rad/s].
        friction_smoothing: rate below which dry friction is viscous: a joint creeps where it would stick [rad/s].
        velocity_forces: "complete", or "rigid": the paper's C_r (7), the rigid arm's Coriolis and centrifugal
            forces in the joint rows only, while the mass matrix still depends on the deflections.
        mode_scale: A, the arbitrary constant of the shapes (4). It scales the modal coordinates only.
        kinematics: "linear", the paper's: a point of a link moves across the root tangent only; or "foreshortened":
            a bent link also draws its points in, by half the integral of w'^2, in kinetic energy, kinematics and
            forces (geometric stiffening follows). The linear arm's tip is right to 10 mm only while links bend by less
            than 5 % *and* turn at less than 1.2 rad/s (hardly bent: 3.3 rad/s); its straight spin is unstable from 4.6
            rad/s. The square leaves both limits (docs/validation.md).
        mode_shapes: "cantilever", the paper's clamped-free modes (4); or "polynomial": as many polynomials from x^2
            up, orthogonal in mass and stiffness, which let the elbow's moment bend link 1's tip.
        elbow_housing_inertia: turns with the tip tangent of link 1, as the elbow motor's housing does [kg m^2];
            foreshortened kinematics only.
    """

    link_lengths: tuple[float, float] = declared((4.5, 4.5), Pair(1e-3, 1e3, "m"))
    flexural_rigidities: tuple[float, float] = declared((1676.0, 1676.0), Pair(1e-9, 1e12, "N m^2"))
    masses_per_length: tuple[float, float] = declared((0.335, 0.335), Pair(1e-9, 1e6, "kg/m"))
    modes_per_link: int = declared(3, Integer(1, MAX_MODES))
    shoulder_hub_inertia: float = declared(0.0, Number(0.0, 1e9, "kg m^2"))
    elbow_hub_inertia: float = declared(0.0, Number(0.0, 1e9, "kg m^2"))
    elbow_mass: float = declared(0.0, Number(0.0, 1e9, "kg"))
    payload_mass: float = declared(0.0, Number(0.0, HEAVIEST_PAYLOAD, "kg"))
    payload_inertia: float = declared(0.0, Number(0.0, 1e9, "kg m^2"))
    damping_ratio: float = declared(0.01, Number(0.0, 1.0))
    damping_model: DampingModel = declared("material", OneOf(get_args(DampingModel)))
    joint_friction: tuple[float, float] = declared((0.0, 0.0), Pair(0.0, 1e9, "N m s/rad"))
    coulomb_friction: tuple[float, float] = declared((0.0, 0.0), Pair(0.0, 1e9, "N m"))
    breakaway_excess: tuple[float, float] = declared((0.0, 0.0), Pair(0.0, 1e9, "N m"))
    stribeck_velocity: float = declared(0.5, Number(1e-6, 1e3, "rad/s"))
    friction_smoothing: float = declared(0.1, Number(1e-6, 1e3, "rad/s"))
    velocity_forces: VelocityForces = declared("complete", OneOf(get_args(VelocityForces)))
    mode_scale: float = declared(0.1, Number(1e-3, 1e3, "m"))
    kinematics: Kinematics = declared("foreshortened", OneOf(get_args(Kinematics)))
    mode_shapes: ModeShapes = declared("polynomial", OneOf(get_args(ModeShapes)))
    elbow_housing_inertia: float = declared(0.0, Number(0.0, 1e9, "kg m^2"))

    def __post_init__(self) -> None:
        """Validate and bring to canonical types.

        Raises:
            TypeError, ValueError: naming the field, its value and what is allowed.
        """
        check_fields(self)
        if self.kinematics == "foreshortened" and self.velocity_forces == "rigid":
            raise ValueError(
                "kinematics = 'foreshortened': the paper's C_r (velocity_forces = 'rigid') has no foreshortening; "
                "velocity_forces must be 'complete'"
            )
        if self.kinematics == "linear" and self.elbow_housing_inertia:
            raise ValueError(
                f"elbow_housing_inertia = {self.elbow_housing_inertia!r}: must be 0 with kinematics = 'linear'"
            )

    @classmethod
    def named(cls, preset: str, **changes: object) -> ArmParameters:
        """Return an arm of `PRESETS` by its name; `changes`: fields to set otherwise."""
        fields = PRESETS[choice("preset", preset, tuple(PRESETS))].fields
        return cls(**(dict(fields) | changes))  # type: ignore[arg-type]

    @classmethod
    def linear(cls, **changes: object) -> ArmParameters:
        """Return the arm "linear" of `PRESETS`; `changes` as in `named`."""
        return cls.named("linear", **changes)

    @classmethod
    def paper(cls, **changes: object) -> ArmParameters:
        """Return the paper's arm, "paper" of `PRESETS`; `changes` as in `named`."""
        return cls.named("paper", **changes)

    @property
    def breakaway(self) -> tuple[float, float]:
        """Dry friction of shoulder and elbow near rest [N m]."""
        shoulder, elbow = self.breakaway_excess
        return self.coulomb_friction[0] + shoulder, self.coulomb_friction[1] + elbow

    @property
    def steepest_friction(self) -> float:
        """Slope of dry friction at rest, the larger one of shoulder and elbow [N m s/rad]."""
        return max(self.breakaway) / self.friction_smoothing

    @property
    def reach(self) -> float:
        """Distance from the shoulder to the tip of the straight arm [m]."""
        return self.link_lengths[0] + self.link_lengths[1]

    @property
    def inner_reach(self) -> float:
        """Distance from the shoulder to the tip of the folded arm [m]."""
        return abs(self.link_lengths[0] - self.link_lengths[1])


PRESETS: dict[str, Preset] = {
    "default": Preset(
        "three polynomials a link, foreshortened kinematics, material damping with 1 % of the first elastic mode", {}
    ),
    "linear": Preset(
        "two clamped-free modes a link, linear kinematics, complete velocity forces, each clamped mode damped by 1 %",
        {
            "modes_per_link": 2,
            "kinematics": "linear",
            "mode_shapes": "cantilever",
            "damping_ratio": CLAMPED_ONE_PERCENT,
            "damping_model": "modal",
        },
    ),
    "paper": Preset(
        "the paper's: one clamped-free mode a link, linear kinematics, velocity forces C_r (7), no damping",
        {
            "modes_per_link": 1,
            "kinematics": "linear",
            "mode_shapes": "cantilever",
            "velocity_forces": "rigid",
            "damping_ratio": 0.0,
            "damping_model": "modal",
        },
    ),
    **PUBLISHED,
}


def _one_or_two_delays(name: str, value: Any) -> float | tuple[float, float]:
    if isinstance(value, tuple | list) or (isinstance(value, np.ndarray) and value.ndim):
        return pair(name, value, "s", least=0.0, most=MAX_DELAY)
    return number(name, value, "s", least=0.0, most=MAX_DELAY)


_DELAY = Custom(_one_or_two_delays, "s", f'0 to {MAX_DELAY:g}, two (shoulder, elbow) for a "rigid" sensor')


@dataclass(frozen=True)
class SensorParameters:
    """Where the end-effector sensor sits, what it sees, and how late.

    Attributes:
        model: "collocated", "rigid" or "true"; `SENSOR_MODELS` says what each is.
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

    model: SensorModel = declared("rigid", OneOf(get_args(SensorModel)), name="sensor")
    position: float = declared(4.5, Number(1e-6, 1e3, "m"), name="sensor_position")
    delay: float | tuple[float, float] | None = declared(None, Optional(_DELAY))
    delayed: Delayed = declared("position", OneOf(get_args(Delayed)))
    rate_jacobian: RateJacobian = declared("delayed", OneOf(get_args(RateJacobian)))
    noise: float = declared(0.0, Number(0.0, LARGEST_NOISE, "m"))
    wave_speed: float = declared(WAVE_SPEED, Number(1e-3, 1e9, "m/s"))

    def __post_init__(self) -> None:
        """Validate; see `ArmParameters.__post_init__` for the errors."""
        check_fields(self)
        if not self.traits.late and self.delay is not None:
            raise ValueError(f"delay = {self.delay!r}: a {self.model} sensor has none; it must be None")
        if self.traits.delays == "one" and isinstance(self.delay, tuple):
            raise ValueError(
                f"delay = {self.delay!r}: a {self.model!r} sensor's reading has one delay; it must be one number [s]. "
                f"An environment draws it for each episode by randomisation={{'delay': {self.delay!r}}}"
            )

    @property
    def traits(self) -> SensorTraits:
        """What its model is."""
        return SENSOR_MODELS[self.model]

    def joint_delays(self, shoulder_to_elbow: float) -> tuple[float, float]:
        """Return the delay of the shoulder's and of the elbow's measurement [s] (16), (18).

        Args:
            shoulder_to_elbow: L1 [m].

        Raises:
            ValueError: if the wave speed makes one longer than `MAX_DELAY`.
        """
        root = number("shoulder_to_elbow", shoulder_to_elbow, "m", least=0.0)
        if not self.traits.late:
            return 0.0, 0.0
        if isinstance(self.delay, tuple):
            return self.delay
        if self.delay is not None:
            return self.delay, self.delay
        shoulder = (root + self.position) / self.wave_speed
        if shoulder > MAX_DELAY:
            raise ValueError(
                f"wave_speed = {self.wave_speed} m/s: the sensor would be late by {shoulder:.4g} s; "
                f"at most {MAX_DELAY} s is allowed"
            )
        return shoulder, shoulder if self.traits.delays == "one" else self.position / self.wave_speed


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

    proportional_gain: float = declared(150.79, Number(0.0, 1e9, "N/m"))
    derivative_gain: float = declared(17.364, Number(0.0, 1e9, "N s/m"))
    compensation: Compensation = declared("none", OneOf(get_args(Compensation)))
    torque_limit: tuple[float, float] | None = declared(None, Optional(Pair(1e-9, 1e9, "N m")))

    def __post_init__(self) -> None:
        """Validate; see `ArmParameters.__post_init__` for the errors."""
        check_fields(self)


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

    side: float = declared(12.6, Number(1e-3, 1e3, "m"))
    lap_time: float = declared(16.0, Number(1e-3, 1e5, "s"))
    start_corner: Corner = declared("lower left", OneOf(get_args(Corner)))
    direction: Direction = declared("clockwise", OneOf(get_args(Direction)))
    elbow_branch: ElbowBranch = declared("positive", OneOf(get_args(ElbowBranch)))

    def __post_init__(self) -> None:
        """Validate; see `ArmParameters.__post_init__` for the errors."""
        check_fields(self)


def arm_parameters(arm: str | Mapping[str, Any] | ArmParameters) -> ArmParameters:
    """Return the arm that an environment's `arm` argument stands for.

    Raises:
        TypeError, ValueError: for anything else than a preset's name, a mapping of fields or parameters.
    """
    if isinstance(arm, ArmParameters):
        return arm
    if isinstance(arm, str):
        arm = {"preset": arm}
    if not isinstance(arm, Mapping):
        known_presets = ", ".join(map(repr, PRESETS))
        raise TypeError(f"arm = {shown(arm)}: must be one of {known_presets} or a mapping of ArmParameters fields")
    given = dict(arm)
    preset = choice("arm", given.pop("preset", "default"), tuple(PRESETS))
    known = ArmParameters.__dataclass_fields__
    unknown = [name for name in given if name not in known]
    if unknown:
        raise ValueError(
            f"arm: unknown field(s) {shown(unknown)}; ArmParameters has {list(known)}, and there is 'preset'"
        )
    return ArmParameters.named(preset, **given)
