"""`Chain`: a chain of rigid segments (`model`) in motion, and where its points are."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from flexarm_env.chain import model as chain
from flexarm_env.parameters import ArmParameters

Array = NDArray[np.float64]
STATE = mujoco.mjtState.mjSTATE_INTEGRATION


class Chain:
    """A chain in motion.

    Attributes:
        parameters: parameters of the arm.
        model: MuJoCo's.
        data: MuJoCo's.
        segments: number of segments of a link.
        shoulder_and_elbow: places of theta1 and theta2 among the angles.
        lengths: lengths of the segments [m]. Shape (2, segments).
    """

    def __init__(self, model: mujoco.MjModel, parameters: ArmParameters) -> None:
        """Take a chain, at rest and straight.

        Args:
            model: a model made by `flexarm_env.chain.model`.
            parameters: parameters of the arm that it was built for.
        """
        self.parameters, self.model, self.data = parameters, model, mujoco.MjData(model)
        self.segments = model.nv // 2
        self.shoulder_and_elbow = np.array([0, self.segments])
        elements = self.segments - 1
        self._ends = np.concatenate([[0.0], (0.5 + np.arange(elements)) / elements, [1.0]])  # of segments, L = 1
        self.lengths = np.outer(parameters.link_lengths, np.diff(self._ends))
        self._tip = model.site(chain.TIP).id

    # --- motion ------------------------------------------------------------------------------------------------------

    def step(self, torque: Array, steps: int) -> None:
        """Hold the torques of shoulder and elbow [N m], Shape (2,), for some integration steps."""
        self.data.ctrl[:] = torque
        mujoco.mj_step(self.model, self.data, steps)

    def pose(self, angles: Array, rates: Array) -> None:
        """Begin anew.

        Args:
            angles: theta1, link 1's bend angles, theta2, link 2's [rad]. Shape (2 segments,).
            rates: their rates [rad/s]. Shape (2 segments,).
        """
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:], self.data.qvel[:] = angles, rates

    def get_state(self) -> Array:
        """Return all that decides how it moves on. Shape (k,)."""
        state = np.zeros(mujoco.mj_stateSize(self.model, STATE))
        mujoco.mj_getState(self.model, self.data, state, STATE)
        return state

    def set_state(self, state: Array) -> None:
        """Go on from a state of the same chain."""
        mujoco.mj_setState(self.model, self.data, state, STATE)

    # --- what it is --------------------------------------------------------------------------------------------------

    def joints(self) -> tuple[float, float]:
        """Return theta1 and theta2 now [rad]."""
        return float(self.data.qpos[0]), float(self.data.qpos[self.segments])

    def tip(self) -> Array:
        """Return where the end of link 2 is now, as MuJoCo has it [m]. Shape (2,)."""
        mujoco.mj_kinematics(self.model, self.data)
        return self.data.site_xpos[self._tip, :2].copy()

    def point_weights(self, link: int, s: float) -> Array:
        """Return how much of each segment lies before a point; with their directions, this is where the point is.

        Args:
            link: 1 or 2.
            s: distance of the point from the link's root [m].

        Returns:
            Lengths [m]. Shape (2 segments,).
        """
        weights = self.lengths.copy()
        begins = self._ends[:-1] * self.parameters.link_lengths[link - 1]
        weights[link - 1] = np.clip(s - begins, 0.0, weights[link - 1])
        weights[link:] = 0.0
        return weights.ravel()

    def point(self, weights: Array) -> Array:
        """Return the position and velocity of a point.

        Args:
            weights: `point_weights`. Shape (2 segments,).

        Returns:
            x, y [m] and their rates [m/s]. Shape (4,).
        """
        angles, rates = np.cumsum(self.data.qpos), np.cumsum(self.data.qvel)
        along, across = weights * np.cos(angles), weights * np.sin(angles)
        return np.array([along.sum(), across.sum(), -across @ rates, along @ rates])

    def inertial(self, weights: Array) -> Array:
        """Return what an inertial measurement unit at a point reads (`physics.sensing.inertial`).

        Args:
            weights: `point_weights`. Shape (2 segments,).

        Returns:
            Specific force along and across the point's segment [m/s^2], and the segment's rate [rad/s]. Shape (3,).
        """
        mujoco.mj_forward(self.model, self.data)
        angles, rates, turns = (np.cumsum(each) for each in (self.data.qpos, self.data.qvel, self.data.qacc))
        own = np.flatnonzero(weights)[-1]
        sin, cos = np.sin(angles - angles[own]), np.cos(angles - angles[own])
        along, across = -sin * turns - cos * rates**2, cos * turns - sin * rates**2
        return np.array([weights @ along, weights @ across, rates[own]])

    def centre_lines(self) -> tuple[Array, Array]:
        """Return the joints' places along each link, its root and tip included [m]. Shape (segments + 1, 2) each."""
        angles = np.cumsum(self.data.qpos).reshape(2, -1)
        steps = self.lengths[..., None] * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        points = np.vstack([np.zeros((1, 2)), np.cumsum(steps.reshape(-1, 2), axis=0)])
        return points[: self.segments + 1], points[self.segments :]
