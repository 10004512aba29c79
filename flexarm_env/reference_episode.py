"""An episode of `FlexArm/Square-v0` in plain Python, to be read first: from the action to reward and observation.

The compiled environments compute the same from the same formulas, for many arms at once and a thousand times as fast;
a test holds the two equal to rounding. Here everything has its default and episodes begin at rest on the first corner.
Nothing is drawn; the caller chooses the side of the elbow.

    >>> episode = ReferenceEpisode(elbow_branch="negative")
    >>> observation = episode.reset()
    >>> observation, reward, terminated, truncated = episode.step([0.5, -0.2])
    >>> len(observation), round(reward, 4), terminated
    (46, 0.8654, False)
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexarm_env import formulas
from flexarm_env.codegen.elementary import sincos
from flexarm_env.episode import reward
from flexarm_env.episode.features import Measurements, features, in_frame, joint_aim
from flexarm_env.kernels.delay_line import hermite
from flexarm_env.parameters import WAVE_SPEED, ArmParameters, SquareParameters
from flexarm_env.physics import dynamics as dyn
from flexarm_env.physics.paths import square
from flexarm_env.physics.polyline import reference_at
from flexarm_env.physics.sensing import point_reading, truth
from flexarm_env.simulation.arm import FlexibleArm
from flexarm_env.simulation.limits import rest_state, state_limits

PERIOD, SUBSTEPS, STEPS = 0.01, 5, 1600  # control period [s], integration steps in it, periods of an episode
TORQUE_LIMIT = (150.0, 50.0)  # [N m]; the action 1
HORIZONS = (0.05, 0.1, 0.2, 0.3, 0.45, 0.6, 1.0)  # [s]; previews of the reference
WEIGHTS = {"tracking_wide": 0.6, "tracking_middle": 0.15, "tracking_fine": 0.1, "action_change": 0.15}
LARGEST_DEFLECTION, LARGEST_ERROR = 1.5, 2.5  # [m]; beyond them the episode terminates
LONG_AGO = -1e18  # [s]
SIN, COS = (lambda angle: sincos(angle)[0]), (lambda angle: sincos(angle)[1])

Floats = list[float]


class ReferenceEpisode:
    """One arm on its way along the square.

    Attributes:
        state: joint angles and modal coordinates, and their rates (`flexarm_env.simulation.arm`).
        history: what the sensor at the tip has read at each integration step: position [m] and velocity [m/s].
    """

    def __init__(self, elbow_branch: str = "positive") -> None:
        """Choose the side of the elbow at the start: "positive" (the swing lap) or "negative" (the plain lap)."""
        self.arm = FlexibleArm(ArmParameters())
        self.k, self.lengths = self.arm.constants, self.arm.parameters.link_lengths
        self.tip = self.arm.place(2, self.lengths[1])
        self.path = square(SquareParameters())
        self.rows, self.branch = self.path.rows[None], elbow_branch
        self.h = PERIOD / SUBSTEPS
        self.delay = sum(self.lengths) / WAVE_SPEED  # of the sensor at the tip

    def reset(self) -> Floats:
        """Put the arm at rest on the first corner; return the observation."""
        self.state: Floats = rest_state(self.arm, self.path.table[0, 1:], self.branch).tolist()
        self.steps = 0  # integration steps since the start
        before = int((self.delay + PERIOD) / self.h) + 2  # until the start the arm rested, and so did the reference
        self.history = [point_reading(self.k, self.tip, *self._internal())] * before
        self.action: Floats = [0.0, 0.0]
        self.joint_aim = [self.state[0], 0.0, 0.0, 0.0]
        self.sensor_error, self.taken = [0.0, 0.0], -self.delay - PERIOD
        return self._observe()

    def step(self, action: Sequence[float]) -> tuple[Floats, float, bool, bool]:
        """Hold an action for a control period; return observation, reward, terminated and truncated."""
        before, self.action = self.action, np.clip(np.array(action, dtype=np.float32), -1.0, 1.0).tolist()
        change = sum((new - old) ** 2 for new, old in zip(self.action, before, strict=True))
        torque = [limit * share for limit, share in zip(TORQUE_LIMIT, self.action, strict=True)]
        for _ in range(SUBSTEPS):
            self.state = formulas.step(self.arm, self.state, torque, self.h, SIN, COS)
            self.steps += 1
            self.history.append(point_reading(self.k, self.tip, *self._internal()))
        observation = self._observe()
        now = truth(self.k, self.tip, *self._internal())
        square_error = reward.squared_distance(now.true_tip, self._reference(0.0))
        terms = reward.tracking_terms(square_error)
        terms += reward.regularising_terms(change, torque, now.deflection_rate)
        names = [name for name in reward.TERMS if name not in reward.OF_RACES]
        total = sum(WEIGHTS.get(name, 0.0) * term for name, term in zip(names, terms, strict=True))
        invalid = np.any(np.abs(self.state) > state_limits(self.arm))  # it has no reward
        outside = max(map(abs, now.deflection)) > LARGEST_DEFLECTION or square_error > LARGEST_ERROR**2
        ended = bool(invalid or outside), self.steps >= STEPS * SUBSTEPS
        return observation, 0.0 if invalid else float(total), *ended

    def _internal(self) -> tuple[Floats, Floats]:
        """Return y and v, the coordinates and rates that the formulas take (`flexarm_env.physics.dynamics`)."""
        q, rates = self.state[: self.arm.size], self.state[self.arm.size :]
        return dyn.internal_coordinates(self.k, q), dyn.internal_coordinates(self.k, rates)

    def _reference(self, ahead: float, since: float = 0.0) -> tuple[float, ...]:
        """Return position [m] and velocity [m/s] of the reference, some time ahead; before `since` it rests."""
        time = self.steps * self.h + ahead
        return reference_at(self.rows, 0, time, time + 1e-9 * self.h, since)  # on a corner, of the side that begins

    def _late_reading(self) -> Floats:
        """Return where the tip was when the reading that arrives now was taken, between two integration steps."""
        back = self.delay / self.h
        newer = len(self.history) - 1 - int(back)
        a, b = self.history[newer - 1], self.history[newer]
        return [hermite(a[r], b[r], a[2 + r], b[2 + r], self.h, 1.0 - (back - int(back)))[0] for r in (0, 1)]

    def _observe(self) -> Floats:
        """Measure the present instant, and write the observation: each number over its scale."""
        state, n = self.state, self.arm.size
        theta, modal, theta_rate, modal_rate = state[:2], state[2:n], state[n : n + 2], state[n + 2 :]
        reference, sensed = self._reference(0.0), self._late_reading()
        sign = 1.0 if self.branch == "positive" else -1.0
        self.joint_aim = joint_aim(self.lengths, sign, reference, self.joint_aim[0])
        before, last = self.sensor_error, self.taken
        self.taken = self.steps * self.h - self.delay
        self.sensor_error = [a - b for a, b in zip(self._reference(-self.delay)[:2], sensed, strict=True)]
        known = Measurements(
            encoders=[*theta, *theta_rate],
            reference=reference,
            reference_joints=self.joint_aim,
            link_sensor=sensed,
            sensor_error=self.sensor_error,
            sensor_error_rate=[(a - b) / (self.taken - last) for a, b in zip(self.sensor_error, before, strict=True)],
            lengths=self.lengths,
            phase=0.0,
            frame=1.0,  # x along link 1
        )
        seen = features(known)
        previews: Floats = []
        for horizon in HORIZONS:
            there = self._reference(horizon, LONG_AGO)
            previews += in_frame(seen.frame_axis, [there[r] - reference[r] for r in (0, 1)])
        parts: list[tuple[Sequence[float], Sequence[float]]] = [  # numbers, and scales repeated over them
            (seen.directions[:2], [1.0]),
            (theta_rate, [3.0]),
            (seen.joint_error, [0.3]),
            (seen.joint_error_rate, [3.0]),
            (seen.encoder_error, [0.5]),
            (seen.reference, [6.3]),
            (seen.reference_velocity, [3.15]),
            (seen.sensor_error, [0.5]),
            (seen.sensor_error_rate, [3.0]),
            (modal, [2.5, 0.25, 0.25]),
            (modal_rate, [10.0, 5.0, 5.0]),
            (previews, [2.0]),
            (self.action, [1.0]),
        ]
        return [x / scales[n % len(scales)] for numbers, scales in parts for n, x in enumerate(numbers)]
