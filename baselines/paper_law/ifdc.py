"""Inverse flexible dynamics control, IFDC: the control law with a constant gain.

The law (13)-(14) itself runs in the environment; a policy commands only its gain lambda. IFDC is lambda = 1,
and any other constant is the control experiment that the fuzzy gain has to beat.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from flexarm_baselines.arrays import Floats
from flexarm_baselines.policy import GainPolicy, env_gain_limit
from flexarm_env.validation import number


@dataclass(frozen=True)
class IFDC(GainPolicy):
    """The paper's law at a constant gain.

    Attributes:
        gain: lambda, dimensionless, in [0, gain_limit].
        gain_limit: gain that the action 1 stands for in the environment, dimensionless.
    """

    gain: float = 1.0
    gain_limit: float = 1.0

    def __post_init__(self) -> None:
        number("gain_limit", self.gain_limit, above=0.0)
        number("gain", self.gain, least=0.0, most=self.gain_limit)

    @classmethod
    def options(cls) -> dict[str, Any]:
        """Return the options with which an environment's action is the gain; of its observation nothing is used."""
        return super().options() | {"observation": ("inner_gain",), "last_actions": 1}

    @classmethod
    def for_env(cls, env: Any, gain: float = 1.0) -> IFDC:
        """Make the constant gain for an environment, single or vector, with its gain limit.

        Args:
            env: a FlexArm environment whose action is the gain.
            gain: lambda, dimensionless, up to the environment's gain limit.

        Raises:
            ValueError: its action is not one gain, or the gain is out of range.
        """
        return cls(gain=gain, gain_limit=env_gain_limit(env))

    def gains(self, observations: Floats) -> Floats:
        """Return the constant, once per observation; see `GainPolicy.gains`."""
        return np.full(len(observations), self.gain, dtype=np.float64)
