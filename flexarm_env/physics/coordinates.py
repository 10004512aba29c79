"""Where the arm's material points are, and the change between public and internal coordinates, on arrays.

Public order: (theta1, theta2, q1, q2), internal order: y = (a1, q1, a2, q2); symbols as in `physics.dynamics`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexarm_env.physics.constants import Constants
from flexarm_env.physics.dynamics import internal_coordinates, joint_angles, public_coordinates
from flexarm_env.physics.link_modes import LinkModes
from flexarm_env.physics.sensing import rigid_point

Array = NDArray[np.float64]


def check_leading(**axes: tuple[int, ...]) -> None:
    """Refuse arguments, by name, whose leading axes do not broadcast."""
    try:
        np.broadcast_shapes(*axes.values())
    except ValueError:
        listed = ", ".join(f"{name} {shape}" for name, shape in axes.items())
        raise ValueError(f"leading axes must broadcast, got {listed}") from None


def stack(values: Sequence[Any]) -> Array:
    """Stack numbers, or arrays that broadcast, along a new last axis."""
    return np.stack(np.broadcast_arrays(*values), axis=-1)


def stack_matrix(rows: Sequence[Sequence[Any]]) -> Array:
    """Stack a square matrix of numbers, or of arrays that broadcast, along two new last axes."""
    size = len(rows)
    flat = stack([value for row in rows for value in row])
    return flat.reshape(*flat.shape[:-1], size, size)


def to_internal(k: Constants) -> Array:
    """Return dy/dq, constant. Shape (2 + 2 m, 2 + 2 m)."""
    size = 2 * len(k.elbow_slopes) + 2
    return np.array(internal_coordinates(k, list(np.eye(size))), dtype=np.float64)


def to_public(k: Constants) -> Array:
    """Return dq/dy, constant. Shape (2 + 2 m, 2 + 2 m)."""
    size = 2 * len(k.elbow_slopes) + 2
    return np.array(public_coordinates(k, list(np.eye(size))), dtype=np.float64)


def internal_state(k: Constants, state: Array) -> Array:
    """Return (y, v) of public states. Shape (..., 4 + 4 m)."""
    halves = np.split(state, 2, axis=-1)
    return np.concatenate([stack(internal_coordinates(k, list(np.moveaxis(half, -1, 0)))) for half in halves], axis=-1)


def public_state(k: Constants, internal: Array) -> Array:
    """Invert `internal_state`; sums have a fixed order, so that one state and many are bitwise identical."""
    halves = []
    m = len(k.elbow_slopes)
    for half in np.split(internal, 2, axis=-1):
        theta1, theta2 = joint_angles(k, list(np.moveaxis(half, -1, 0)))
        halves += [theta1[..., None], theta2[..., None], half[..., 1 : m + 1], half[..., m + 2 :]]
    return np.concatenate(halves, axis=-1)


def material_point(
    modes: tuple[LinkModes, LinkModes], foreshortened: bool, y: Array, link: int, s: Array
) -> tuple[Array, Array]:
    """Return the position of a material point and its Jacobian with respect to the internal coordinates.

    Args:
        modes: modes of both links.
        foreshortened: kinematics.
        y: internal coordinates. Shape (..., 2 + 2 m).
        link: 1 or 2.
        s: distance from the link's root along its undeformed axis [m]; broadcasts with y's leading axes.

    Returns:
        x, y [m], Shape (..., 2), and its derivatives, Shape (..., 2, 2 + 2 m).
    """
    size = y.shape[-1]
    half = size // 2
    first_s = s if link == 1 else np.asarray(modes[0].length)
    at, jacobian = _link_point(modes[0], foreshortened, y[..., :half], first_s)
    full = np.zeros((*jacobian.shape[:-1], size))
    full[..., :half] = jacobian
    if link == 2:
        relative, jacobian = _link_point(modes[1], foreshortened, y[..., half:], s)
        at = at + relative
        full = np.broadcast_to(full, (*relative.shape, size)).copy()
        full[..., half:] = jacobian
    return at, full


def rigid_tip(lengths: tuple[float, float], q: Array) -> Array:
    """Return the tip by rigid kinematics of the joint angles (8), (9) [m]. Shape (..., 2)."""
    one, both = ((np.sin(angle), np.cos(angle)) for angle in (q[..., 0], q[..., 0] + q[..., 1]))
    return stack(rigid_point(*lengths, one, both))


def _link_point(link: LinkModes, foreshortened: bool, y: Array, s: Array) -> tuple[Array, Array]:
    """Return the point X e + Y n of one link relative to its root, and its Jacobian in (a, q)."""
    angle, coordinates = y[..., 0], y[..., 1:]
    shape = link.shape(s)
    w = np.sum(shape * coordinates, axis=-1)
    along = s
    normal = np.stack([-np.sin(angle), np.cos(angle)], axis=-1)
    bend = normal[..., :, None] * np.broadcast_to(shape, (*w.shape, shape.shape[-1]))[..., None, :]
    if foreshortened:
        foreshortening_gradient = np.sum(link.foreshortening(s) * coordinates[..., None, :], axis=-1)
        along = s - 0.5 * np.sum(foreshortening_gradient * coordinates, axis=-1)
        tangent = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        bend = bend - tangent[..., :, None] * foreshortening_gradient[..., None, :]
    cos, sin = np.cos(angle), np.sin(angle)
    at = np.stack([along * cos - w * sin, along * sin + w * cos], axis=-1)
    turn = np.stack([-at[..., 1], at[..., 0]], axis=-1)
    return at, np.concatenate([turn[..., None], bend], axis=-1)
