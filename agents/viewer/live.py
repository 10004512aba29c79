"""`LiveArm`: the paper's law on a late sensor, whose delay, place and gain can be moved while the arm runs."""

from collections import deque
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexarm_env.actions import action_from_gain
from flexarm_env.envs.single import FlexArmEnv
from flexarm_env.envs.termination import end_reason
from flexarm_env.parameters import PRESETS, arm_parameters
from flexarm_env.published_arms import PUBLISHED
from flexarm_env.validation import choice, number

MOST_DELAY, MOST_GAIN = 0.2, 2.0  # [s], [1]
ARMS = tuple(name for name in PRESETS if name not in PUBLISHED)  # which reach the paper's square
LEAST_PLACE = 0.5  # of the sensor from the elbow [m]
MEMORY = 8.0  # [s] of errors that are kept
OPTIONS: dict[str, Any] = {
    "action_mode": "gain",
    "gain_limit": MOST_GAIN,
    "control_period": 0.01,
    "feedback_source": "sensor",
    "sensor": "rigid",
    "start": "corner",
    "elbow_branch": "positive",
    "deflection_limit": 4.5,
    "error_limit": 9.0,
    "randomisation": {"delay": (0.0, MOST_DELAY)},
}


class Knobs(NamedTuple):
    """What can be moved."""

    delay: float = 0.03  # of the sensor [s]
    place: float = 4.5  # of the sensor, from the elbow along link 2 [m]
    gain: float = 1.0  # lambda of the law


class LiveArm:
    """An environment in which knobs are turned.

    All knobs act at once. The gain is the action. With another delay or place of the sensor, the arm keeps its state
    and its moment in the lap; the sensor's memory begins anew, as after a reset.

    Attributes:
        errors: distances of the true tip from the reference, of the last `MEMORY` seconds, one a control period [m].
        ended: why the arm stopped; None: it runs.
    """

    def __init__(self, arm: str = "paper", knobs: Knobs | None = None) -> None:
        self._arm = choice("arm", arm, ARMS)
        self.knobs = self._checked(knobs or Knobs())
        self.ended: str | None = None
        self._env = self._make()
        self.errors: deque[float] = deque(maxlen=round(MEMORY / self._env.control_period))
        self.restart()

    @property
    def period(self) -> float:
        """Control period [s]."""
        return self._env.control_period

    @property
    def phase(self) -> float:
        """Time since the lap began [s]."""
        return float(self._time % self._env.settings.lap_time)

    @property
    def longest(self) -> float:
        """Largest distance of the sensor from the elbow, the length of link 2 [m]."""
        return arm_parameters(self._arm).link_lengths[1]

    def restart(self) -> None:
        """Begin a lap on the first corner."""
        self._time, self.ended = 0.0, None
        self.errors.clear()
        self._begin({})

    def turn(self, **changes: float) -> None:
        """Turn knobs, which act at once."""
        before, self.knobs = self.knobs, self._checked(self.knobs._replace(**changes))
        if self.ended is not None or self.knobs._replace(gain=before.gain) == before:
            return
        self._begin({"state": self._info["state"], "time": self.phase})

    def advance(self, periods: int) -> None:
        """Run for some control periods, or until the arm is lost."""
        action = action_from_gain(np.array([self.knobs.gain]), MOST_GAIN).astype(np.float32)
        for _ in range(periods):
            if self.ended is not None:
                return
            *_, terminated, _, self._info = self._env.step(action)
            self._time += self.period
            self._note()
            if terminated:
                self.ended = end_reason(self._info["end_code"])

    def picture(self) -> NDArray[np.uint8]:
        """Draw the arm. Shape (600, 600, 3)."""
        drawn = self._env.render()
        assert drawn is not None
        return drawn

    def close(self) -> None:
        """Close the environment."""
        self._env.close()

    def _make(self) -> FlexArmEnv:
        whole = {**OPTIONS, "arm": self._arm, "sensor_position": self.knobs.place}
        return FlexArmEnv(render_mode="rgb_array", **whole)

    def _begin(self, options: dict[str, Any]) -> None:
        if self._env.settings.sensor_position != self.knobs.place:
            self._env.close()
            self._env = self._make()
        parameters = {"parameters": {"delay": self.knobs.delay}}
        _, self._info = self._env.reset(seed=0, options=options | parameters)
        self._note()

    def _note(self) -> None:
        self.errors.append(float(np.hypot(*(self._info["true_tip"] - self._info["reference"][:2]))))

    def _checked(self, knobs: Knobs) -> Knobs:
        return Knobs(
            number("delay", knobs.delay, "s", least=0.0, most=MOST_DELAY),
            number("place", knobs.place, "m", least=LEAST_PLACE, most=self.longest),
            number("gain", knobs.gain, least=0.0, most=MOST_GAIN),
        )
