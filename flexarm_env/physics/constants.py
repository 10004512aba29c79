"""The constants of an arm in the equations: modal integrals and lumped masses, combined (see `dynamics`)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from flexarm_env.codegen.tangents import Dual
from flexarm_env.parameters import ArmParameters
from flexarm_env.physics import linear_algebra
from flexarm_env.physics.bent_link import Link, PointShape
from flexarm_env.physics.damping import link_damping
from flexarm_env.physics.linear_algebra import Vector
from flexarm_env.physics.link_modes import LinkModes, foreshortening_moments, link_modes

# What may differ between arms of one kind, with its unit: mass at the tip, factor on the links' stiffness, and damping
# ratio (`damping`) at that stiffness.
ARM_QUANTITIES = {"payload_mass": "kg", "stiffness": "1", "damping": "1"}
_ELASTIC = ("stiffness_1", "stiffness_2")
_DAMPED = ("damping_1", "damping_2")
_WITHOUT_PAYLOAD = (
    *("elbow_distance", "friction_1", "friction_2", "elbow_values", "elbow_slopes", "elbow_foreshortening"),
    *(*_ELASTIC, *_DAMPED, "dry_friction"),
)


class Constants(NamedTuple):
    """The constants of an arm in the equations; each field is a number or a tuple over modes.

    Link i with what is fixed to it: ``inertia`` about its root [kg m^2]; ``coupling``, moment of inertia between
    root rotation and mode; ``mass``, modal mass matrix (lower triangle, row by row); ``static_moment`` [kg m];
    ``momentum``, integral of the mode over mass. Link 1 carries the elbow's mass and housing, all of link 2 and the
    payload at its tip; link 2 carries the elbow hub's inertia and the payload. ``centrifugal`` as in `bent_link.Link`;
    link 1's is ``mass_1`` with linear kinematics.

    The nine fields from ``elbow_foreshortening`` on are empty with linear kinematics: S at the elbow [m], link 2's
    integral of S over mass [kg m], and the moments that `bent_link.Link` declares [kg m^2]. ``dry_friction`` is empty
    without it (`dynamics.dry_friction`); else it has Coulomb's level and what breakaway adds to it, of the shoulder and
    then of the elbow [N m], one over ``stribeck_velocity`` and one over ``friction_smoothing`` [s/rad].
    """

    elbow_distance: Any
    inertia_1: Any
    inertia_2: Any
    static_moment_2: Any
    friction_1: Any
    friction_2: Any
    elbow_values: Vector
    elbow_slopes: Vector
    coupling_1: Vector
    coupling_2: Vector
    momentum_2: Vector
    stiffness_1: Vector
    stiffness_2: Vector
    damping_1: Vector
    damping_2: Vector
    mass_1: Vector
    mass_2: Vector
    centrifugal_2: Vector
    elbow_foreshortening: Vector = ()
    mean_foreshortening_2: Vector = ()
    centrifugal_1: Vector = ()
    cubic_1: Vector = ()
    cubic_2: Vector = ()
    crossed_1: Vector = ()
    crossed_2: Vector = ()
    quartic_1: Vector = ()
    quartic_2: Vector = ()
    dry_friction: Vector = ()

    @staticmethod
    def sizes(modes: int, foreshortened: bool = False, dry: bool = False) -> list[int | None]:
        """Return the length of each field for a number of modes; None for a number."""
        pairs = modes * (modes + 1) // 2
        crossed = modes * modes * (modes - 1) // 2
        further = [pairs] * 3 + [modes * pairs] * 2 + [crossed] * 2 + [pairs * (pairs + 1) // 2] * 2
        return [None] * 6 + [modes] * 9 + [pairs] * 3 + [count * foreshortened for count in further] + [6 * dry]

    @property
    def foreshortened(self) -> bool:
        """Whether the kinematics are foreshortened."""
        return bool(self.elbow_foreshortening)

    @property
    def dry(self) -> bool:
        """Whether joints have dry friction."""
        return bool(self.dry_friction)

    @property
    def at_rest(self) -> Constants:
        """The constants to first order about rest, where dry friction is viscous."""
        if not self.dry:
            return self
        slopes = [(self.dry_friction[n] + self.dry_friction[n + 1]) * self.dry_friction[5] for n in (0, 2)]
        return self._replace(
            friction_1=self.friction_1 + slopes[0], friction_2=self.friction_2 + slopes[1], dry_friction=()
        )

    @property
    def elbow(self) -> PointShape:
        """Link 1's tip."""
        return PointShape(self.elbow_distance, self.elbow_values, self.elbow_foreshortening)

    @property
    def moment_2(self) -> PointShape:
        """First moment of link 2's mass and the payload's."""
        return PointShape(self.static_moment_2, self.momentum_2, self.mean_foreshortening_2)

    @property
    def links(self) -> tuple[Link, Link]:
        """Inertia of both links; with linear kinematics link 1 has no inertia at its tip that turns with it."""
        one = (self.centrifugal_1 or self.mass_1, self.cubic_1, self.crossed_1, self.quartic_1)
        two = (self.centrifugal_2, self.cubic_2, self.crossed_2, self.quartic_2)
        return (
            Link(self.inertia_1, self.coupling_1, self.mass_1, *one),
            Link(self.inertia_2, self.coupling_2, self.mass_2, *two),
        )

    def flat(self) -> list[Any]:
        """Return all numbers in order, as a kernel reads them."""
        return linear_algebra.flat(self)

    @classmethod
    def unflat(cls, numbers: Sequence[Any], modes: int, foreshortened: bool = False, dry: bool = False) -> Constants:
        """Return the inverse of `flat`."""
        return cls(*linear_algebra.unflat(numbers, cls.sizes(modes, foreshortened, dry)))


def arm_modes(parameters: ArmParameters) -> tuple[LinkModes, LinkModes]:
    """Return the modes of the two bare links."""
    p = parameters
    first, second = (
        link_modes(length, rigidity, density, p.modes_per_link, p.mode_scale, p.mode_shapes)
        for length, rigidity, density in zip(p.link_lengths, p.flexural_rigidities, p.masses_per_length, strict=True)
    )
    return first, second


def arm_constants(parameters: ArmParameters, modes: tuple[LinkModes, LinkModes]) -> Constants:
    """Fold modal integrals and lumped masses into the equations' constants; floats only."""
    p = parameters
    one, two = modes
    (length_1, length_2), (rho_1, rho_2) = p.link_lengths, p.masses_per_length
    at_elbow = p.elbow_mass + rho_2 * length_2 + p.payload_mass  # what link 1 carries at its tip
    slope_2 = two.tip_slopes
    translation_2 = two.mass + p.payload_mass * np.outer(two.tip_values, two.tip_values)
    mass_2 = translation_2 + p.payload_inertia * np.outer(slope_2, slope_2)
    hub_and_payload = p.elbow_hub_inertia + p.payload_mass * length_2**2 + p.payload_inertia
    housing, slope_1 = p.elbow_housing_inertia, one.tip_slopes
    coupling_2 = two.second_moment + p.payload_mass * length_2 * two.tip_values + p.payload_inertia * slope_2
    mass_1 = one.mass + at_elbow * np.outer(one.tip_values, one.tip_values)
    k = Constants(
        elbow_distance=length_1,
        inertia_1=rho_1 * length_1**3 / 3.0 + p.shoulder_hub_inertia + at_elbow * length_1**2 + housing,
        inertia_2=rho_2 * length_2**3 / 3.0 + hub_and_payload,
        static_moment_2=rho_2 * length_2**2 / 2.0 + p.payload_mass * length_2,
        friction_1=p.joint_friction[0],
        friction_2=p.joint_friction[1],
        elbow_values=_floats(one.tip_values),
        elbow_slopes=_floats(one.tip_slopes),
        coupling_1=_floats(one.second_moment + at_elbow * length_1 * one.tip_values + housing * slope_1),
        coupling_2=_floats(coupling_2),
        momentum_2=_floats(two.first_moment + p.payload_mass * two.tip_values),
        stiffness_1=_floats(one.stiffness),
        stiffness_2=_floats(two.stiffness),
        damping_1=_floats(link_damping(p, one)),
        damping_2=_floats(link_damping(p, two)),
        mass_1=_lower(mass_1),
        mass_2=_lower(mass_2),
        centrifugal_2=_lower(translation_2),
        dry_friction=_dry_friction(p) if any(p.breakaway) else (),
    )
    if p.kinematics == "linear":
        return k
    k = _foreshortened(k, modes, (at_elbow, p.payload_mass))
    return k._replace(mass_1=_lower(mass_1 + housing * np.outer(slope_1, slope_1)))  # turns: no centrifugal force


class ConstantChanges(NamedTuple):
    """How an arm's constants change with `ARM_QUANTITIES`; flat as `Constants.flat`.

    They are linear in the payload. Damping is linear in its ratio and grows with the root of the stiffness (`damping`).

    Attributes:
        base: constants of the arm itself.
        own: its payload [kg], 1, its damping ratio.
        payload_mass: change per payload [1/kg].
        damping: change per damping ratio.
        elastic: 1 for the links' stiffness, else 0.
    """

    base: np.ndarray
    own: np.ndarray
    payload_mass: np.ndarray
    damping: np.ndarray
    elastic: np.ndarray

    def constants(self, quantities: np.ndarray) -> np.ndarray:
        """Return the constants of arms with these quantities.

        Args:
            quantities: in the order of `ARM_QUANTITIES`. Shape (n, 3).

        Returns:
            Shape (n, numbers).
        """
        payload, factor, ratio = np.moveaxis(quantities, -1, 0)[..., None]
        damping = ratio * np.sqrt(factor) - self.own[2]
        moved = self.base + (payload - self.own[0]) * self.payload_mass + damping * self.damping
        return np.where(self.elastic, moved * factor, moved)

    def derivatives(self, quantities: np.ndarray) -> np.ndarray:
        """Return the derivatives of `constants` by each quantity. Shape (n, 3, numbers)."""
        _, factor, ratio = np.moveaxis(quantities, -1, 0)[..., None]
        by_payload = np.broadcast_to(self.payload_mass, (len(quantities), len(self.base)))
        by_damping = np.sqrt(factor) * self.damping
        by_stiffness = self.elastic * self.base + 0.5 * ratio / np.sqrt(factor) * self.damping
        return np.stack([by_payload, by_stiffness, by_damping], axis=1)


def constant_changes(parameters: ArmParameters, modes: tuple[LinkModes, LinkModes]) -> ConstantChanges:
    """Return how the constants of an arm change with what may differ between arms of its kind."""
    k, ones = arm_constants(parameters, modes), (1.0,) * parameters.modes_per_link
    light, heavy = (arm_constants(replace(parameters, payload_mass=mass), modes) for mass in (0.0, 1.0))
    return ConstantChanges(
        base=np.array(k.flat()),
        own=np.array([parameters.payload_mass, 1.0, parameters.damping_ratio]),
        payload_mass=np.array(heavy.flat()) - np.array(light.flat()),
        damping=_by_damping(k, parameters, modes),
        elastic=_alone(k, stiffness_1=ones, stiffness_2=ones),
    )


def _by_damping(k: Constants, parameters: ArmParameters, modes: tuple[LinkModes, LinkModes]) -> np.ndarray:
    """Return how the constants k of an arm change with its damping ratio; flat as `Constants.flat`."""
    unit = replace(parameters, damping_ratio=1.0)
    one, two = (_floats(link_damping(unit, link)) for link in modes)
    return _alone(k, damping_1=one, damping_2=two)


def _alone(k: Constants, **fields: Vector) -> np.ndarray:
    """Return some fields among zeros in the place of all others; flat as `k.flat`."""
    zeros: list[Any] = [(0.0,) * len(each) if isinstance(each, tuple) else 0.0 for each in k]
    return np.array(Constants(*zeros)._replace(**fields).flat())


def changes_of_like(parameters: ArmParameters, like: ConstantChanges) -> ConstantChanges:
    """Return `constant_changes` of an arm with the lengths and mode shapes of another, `like`.

    The change with the payload is taken from `like`; it is the same to rounding error.
    """
    modes = arm_modes(parameters)
    k = arm_constants(parameters, modes)
    own = np.array([parameters.payload_mass, 1.0, parameters.damping_ratio])
    return like._replace(base=np.array(k.flat()), own=own, damping=_by_damping(k, parameters, modes))


def varied_constants(k: Constants, derivatives: Sequence[Constants], directions: Sequence[Any]) -> Constants:
    """Return constants as dual numbers that vary with each quantity.

    Args:
        k: constants.
        derivatives: their derivatives by each of `ARM_QUANTITIES`.
        directions: names of the directions along which these quantities vary (`tangents.Dual`).
    """
    fields: dict[str, Any] = {}
    for name, own in k._asdict().items():
        parts = {
            way: getattr(change, name)
            for way, change, quantity in zip(directions, derivatives, ARM_QUANTITIES, strict=True)
            if _varies(name, quantity)
        }
        if isinstance(own, tuple):
            fields[name] = tuple(_dual(x, {way: part[n] for way, part in parts.items()}) for n, x in enumerate(own))
        else:
            fields[name] = _dual(own, parts)
    return Constants(**fields)


def _dual(number: Any, tangents: Mapping[Any, Any]) -> Any:
    return Dual(number, tangents) if tangents else number


def _varies(field: str, quantity: str) -> bool:
    """Whether a field of `Constants` depends on a quantity."""
    if quantity == "payload_mass":
        return field not in _WITHOUT_PAYLOAD
    return field in _DAMPED or (quantity == "stiffness" and field in _ELASTIC)


def link_place(modes: LinkModes, foreshortened: bool, s: float) -> PointShape:
    """Return a point of a link at the distance s [m] from its root; floats only."""
    sums = _lower(modes.foreshortening(s)) if foreshortened else ()
    return PointShape(float(s), _floats(modes.shape(s)), sums)


def _foreshortened(k: Constants, modes: tuple[LinkModes, LinkModes], carried: tuple[float, float]) -> Constants:
    """Return the constants with foreshortened kinematics; `carried`: masses at the links' tips [kg]."""
    one, two = (foreshortening_moments(link, mass) for link, mass in zip(modes, carried, strict=True))
    return k._replace(
        elbow_foreshortening=_lower(modes[0].foreshortening(modes[0].length)),
        mean_foreshortening_2=_lower(two.mean),
        centrifugal_1=_floats(np.array(k.mass_1) - _lower(one.shortened)),
        centrifugal_2=_floats(np.array(k.centrifugal_2) - _lower(two.shortened)),
        cubic_1=tuple(x for matrix in one.cubic for x in _lower(matrix)),
        cubic_2=tuple(x for matrix in two.cubic for x in _lower(matrix)),
        crossed_1=_crossed(one.cubic),
        crossed_2=_crossed(two.cubic),
        quartic_1=_lower(one.quartic),
        quartic_2=_lower(two.quartic),
    )


def _dry_friction(p: ArmParameters) -> tuple[float, ...]:
    levels = zip(p.coulomb_friction, p.breakaway_excess, strict=True)
    return (*(level for joint in levels for level in joint), 1.0 / p.stribeck_velocity, 1.0 / p.friction_smoothing)


def _crossed(cubic: np.ndarray) -> tuple[float, ...]:
    """Return T_k,ji - T_j,ki for each two modes k > j and each i; T of shape (m, m, m)."""
    return tuple(float(x) for k in range(len(cubic)) for j in range(k) for x in cubic[k, j] - cubic[j, k])


def _floats(values: np.ndarray) -> tuple[float, ...]:
    return tuple(float(value) for value in values)


_tril_indices = lru_cache(np.tril_indices)


def _lower(matrix: np.ndarray) -> tuple[float, ...]:
    return _floats(matrix[_tril_indices(len(matrix))])
