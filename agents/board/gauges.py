"""What a row observes of an arm with other shapes than the nominal one: strain gauges keep their calibration.

The nominal arm's modal coordinates are read off the true deflection by the best fit in the mean square over mass. It
is linear, so that an observation is a matrix times the environment's own.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from flexarm_env.envs.single import FlexArmEnvBase
from flexarm_env.physics.link_modes import LinkModes
from flexarm_env.simulation.arm import FlexibleArm

Array = NDArray[np.float64]
_MODAL = ("modal_coordinates", "modal_rates")
_SHAPES = ("link_lengths", "mode_shapes", "modes_per_link", "mode_scale")
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(24)


def observation_map(env: FlexArmEnvBase, nominal: FlexArmEnvBase) -> Array | None:
    """Return the matrix from an environment's observations to those of the nominal environment; None: they are alike.

    Args:
        env: the environment, single or vector.
        nominal: the environment that a policy was made for; its options select the same observation.

    Raises:
        ValueError: if observations differ in more than the modal coordinates.
    """
    if all(getattr(env.arm.parameters, name) == getattr(nominal.arm.parameters, name) for name in _SHAPES):
        return None
    own, other = env.observation_blocks, nominal.observation_blocks
    fit = _fit(env.arm, nominal.arm)
    found = np.zeros((len(nominal.observation_scale), len(env.observation_scale)))
    for name, place in other.items():
        theirs = own[name]
        if name in _MODAL:
            block = fit
        elif name == "state":
            block = block_diag(np.eye(2), fit, np.eye(2), fit)
        elif place.stop - place.start == theirs.stop - theirs.start:
            block = np.eye(place.stop - place.start)
        else:
            raise ValueError(f"observation block {name!r}: depends on the shapes of the links")
        found[place, theirs] = block
    return np.asarray(found * env.observation_scale / nominal.observation_scale[:, None])


def _fit(arm: FlexibleArm, nominal: FlexibleArm) -> Array:
    """Return the map between the modal coordinates of both links. Shape (2 m nominal, 2 m)."""
    links = [_link_fit(own, other) for own, other in zip(arm.modes, nominal.modes, strict=True)]
    return np.asarray(block_diag(*links))


def _link_fit(own: LinkModes, nominal: LinkModes) -> Array:
    """Fit the nominal shapes of a link to its own ones. Shape (m nominal, m)."""
    places = 0.5 * nominal.length * (1.0 + _NODES)
    shapes = nominal.shape(places)
    weighted = shapes * _WEIGHTS[:, None]
    return np.asarray(np.linalg.solve(weighted.T @ shapes, weighted.T @ own.shape(places)), dtype=np.float64)
