"""`ObservedTracking`: computed torque with a disturbance observer, which takes the links' bending for a disturbance.

The observer compares the momentum of the arm with straight links to what the commanded torques should have made of it,
so that no acceleration is measured. Sources: Chen, Ballance, Gawthrop and O'Reilly, *A nonlinear disturbance observer
for robotic manipulators*, IEEE Trans. Industrial Electronics 47, 2000; De Luca and Mattone, *Actuator failure detection
and isolation using generalized momenta*, ICRA 2003 (the form with momenta).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from flexarm_baselines.arrays import Floats, product
from flexarm_baselines.controller import Memory, Seen
from flexarm_baselines.joint_space.tracking import DECOUPLED, JointFeedback, JointTracking
from flexarm_baselines.task import Task
from flexarm_env.validation import number

RATE = 0.3  # [1/s]; the loop at rest settles fastest at the slowest of four elbow angles, as a test searches


class ObservedTracking(JointTracking):
    """Track in joint space as `computed_torque` does, less the torque that a disturbance observer finds.

    Attributes:
        rate: of the observer: both of its poles, that of the estimate and that of the low-pass filter which the
            estimate passes before it acts [1/s].
    """

    def __init__(
        self,
        task: Task,
        rate: float = RATE,
        feedback: JointFeedback = DECOUPLED,
        **design: Any,
    ) -> None:
        """Design the motion and the observer.

        Args:
            task: see `Task`.
            rate: see the attribute; 0: no observer.
            feedback: see `JointTracking`.
            **design: see `JointTracking`; the feed-forward is that of the rigid arm.
        """
        super().__init__(task, feedforward="rigid", feedback=feedback, **design)
        self.rate = number("rate", rate, "1/s", least=0.0)
        q = np.zeros((2, self.arm.size))
        q[1, 1] = 0.5 * np.pi
        straight, bent = self.arm.mass_matrix(q)[:, :2, :2]
        self._masses, self._coupling = bent, 0.5 * (straight - bent)[0, 0]

    def start(self, seen: Seen) -> Memory:
        """Begin with the present momentum, and without a disturbance."""
        return (*super().start(seen), self.momentum(seen), np.zeros((len(seen), 2)))

    def torque(self, seen: Seen, memory: Memory) -> tuple[Floats, Memory]:
        """Return the torques of computed torque less the disturbance; see `TorqueController.torque`."""
        *inner, expected, acting = memory
        found = self.rate * (self.momentum(seen) - expected)
        keep, limit = np.exp(-self.task.period * self.rate), np.asarray(self.task.torque_limit)
        acting = keep * acting + (1.0 - keep) * found
        torque, after = super().torque(seen, tuple(inner))
        torque = np.clip(torque - acting, -limit, limit)
        expected = expected + self.task.period * (torque + self.by_angles(seen) + found)
        return torque, (*after, expected, acting)

    def momentum(self, seen: Seen) -> Floats:
        """Return the momenta of the arm with straight links [N m s]. Shape (n, 2)."""
        cosine = np.cos(seen["joint_angles"][:, 1])[:, None, None]
        mass = self._masses + self._coupling * cosine * np.array([[2.0, 1.0], [1.0, 0.0]])
        return product(mass, seen["joint_rates"])

    def by_angles(self, seen: Seen) -> Floats:
        """Return the derivatives of the kinetic energy by the angles [N m]. Shape (n, 2)."""
        first, second = seen["joint_rates"].T
        own = -self._coupling * np.sin(seen["joint_angles"][:, 1]) * first * (first + second)
        return np.stack([np.zeros_like(own), own], axis=1)
