"""Where the arm is linearised: a state and a torque, said in physical terms.

Source: the arm's coordinates of `flexarm_env.simulation.arm`; inverse kinematics of Green & Sasiadek (2008), (8), (9).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexarm_env.lazy import cached_property
from flexarm_env.physics.linearisation import Linearisation
from flexarm_env.physics.paths import inverse_kinematics
from flexarm_env.simulation.arm import FlexibleArm
from flexarm_env.validation import finite_array, instance

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class OperatingPoint:
    """An arm in a configuration; make one with `at_angles` or `at_point`.

    Attributes:
        arm: the arm.
        state: public coordinates and their rates, see `flexarm_env.simulation.arm`. Shape (4 + 4 m,).
        torque: torque of shoulder and elbow [N m]. Shape (2,).
    """

    arm: FlexibleArm
    state: Array
    torque: Array

    @classmethod
    def at_angles(
        cls,
        arm: FlexibleArm,
        angles: ArrayLike,
        modal: ArrayLike | None = None,
        rates: ArrayLike | None = None,
        torque: ArrayLike = (0.0, 0.0),
    ) -> OperatingPoint:
        """Place the arm at given joint angles, by default straight and at rest.

        Args:
            arm: the arm.
            angles: theta1, theta2 [rad]. Shape (2,).
            modal: modal coordinates of link 1, then of link 2; None: straight links. Shape (2 m,).
            rates: rates of all coordinates (a spinning arm); None: at rest. Shape (2 + 2 m,).
            torque: [N m]. Shape (2,).
        """
        instance("arm", arm, FlexibleArm)
        state = np.zeros(2 * arm.size)
        state[:2] = finite_array("angles", angles, (2,))
        if modal is not None:
            state[2 : arm.size] = finite_array("modal", modal, (arm.size - 2,))
        if rates is not None:
            state[arm.size :] = finite_array("rates", rates, (arm.size,))
        return cls(arm, state, finite_array("torque", torque, (2,)))

    @classmethod
    def at_point(cls, arm: FlexibleArm, point: ArrayLike, elbow_branch: str = "positive") -> OperatingPoint:
        """Place the resting arm with straight links so that its tip is at a point.

        Args:
            arm: the arm.
            point: x, y [m]. Shape (2,).
            elbow_branch: "positive" or "negative" theta2.

        Raises:
            ValueError: if the tip cannot reach the point, with the point and the distance by which it misses.
        """
        instance("arm", arm, FlexibleArm)
        return cls.at_angles(arm, inverse_kinematics(arm.parameters, point, elbow_branch))

    @property
    def q(self) -> Array:
        """Coordinates. Shape (2 + 2 m,)."""
        return self.state[: self.arm.size]

    @property
    def rates(self) -> Array:
        """Their rates. Shape (2 + 2 m,)."""
        return self.state[self.arm.size :]

    @property
    def at_rest(self) -> bool:
        """Nothing moves; the forces need not be balanced, see `is_equilibrium`."""
        return not np.any(self.rates)

    @cached_property
    def linearisation(self) -> Linearisation:
        """State matrices, exact to rounding error (`FlexibleArm.linearise`)."""
        return self.arm.linearise(self.state, self.torque)

    def is_equilibrium(self) -> bool:
        """Return whether the arm would stay: without gravity, at rest with straight links and no torque."""
        return not np.any(self.linearisation.rate)

    def __str__(self) -> str:
        theta = ", ".join(f"{angle:.6g}" for angle in self.q[:2])
        text = f"theta = ({theta}) rad"
        if np.any(self.q[2:]):
            text += f", modal coordinates {np.array2string(self.q[2:], precision=4)}"
        if not self.at_rest:
            text += f", rates {np.array2string(self.rates, precision=4)}"
        return text
