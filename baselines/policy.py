"""What a policy is, and the base of the policies that command one gain.

`Policy` is stable-baselines3's ``predict``, so a trained agent and a baseline are run by the same code.
Symbols: ``lambda`` the gain on the control law's torque (14), dimensionless; ``k`` the length of an
    observation.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, ClassVar, Protocol

import numpy as np

from flexarm_baselines.arrays import Array, Float32s, Floats
from flexarm_env.actions import action_from_gain
from flexarm_env.validation import shown

Observation = Array | dict[str, Array]
State = tuple[Array, ...] | None


class Policy(Protocol):
    """Anything that maps observations to actions the way a stable-baselines3 model does."""

    def predict(
        self,
        observation: Observation,
        state: State = None,
        episode_start: Array | None = None,
        deterministic: bool = True,
    ) -> tuple[Array, State]:
        """Choose actions.

        Args:
            observation: one observation, shape ``(k,)``, or a batch, shape ``(n, k)``.
            state: memory from the previous call, for policies that have one.
            episode_start: flags of the observations that begin an episode, shape ``(n,)``.
            deterministic: whether to leave out the policy's own randomness.

        Returns:
            The actions in [-1, 1], one row per observation if a batch was given, and the next state.
        """


def checked_observation(observation: Observation, size: int | None = None) -> Array:
    """Return an observation or a batch of them as an array.

    Args:
        observation: shape ``(k,)`` or ``(n, k)``.
        size: k; None: any.

    Raises:
        TypeError: if it is a dict.
        ValueError: if it has another shape.
    """
    if isinstance(observation, dict):
        raise TypeError(f"observation must be an array, got a dict with keys {sorted(observation)}")
    rows = np.asarray(observation)
    if rows.ndim not in (1, 2) or size not in (None, rows.shape[-1]):
        k = "k" if size is None else size
        raise ValueError(f"observation must have shape ({k},) or (n, {k}), got {rows.shape}")
    return rows


class GainPolicy(ABC):
    """A policy without memory or randomness whose action is one gain.

    Attributes:
        gain_limit: gain that the action 1 stands for, dimensionless.
        knows: see `controller.TorqueController`.
    """

    gain_limit: float
    knows: ClassVar[tuple[str, ...]] = ()

    @classmethod
    def options(cls) -> dict[str, Any]:
        """Return the options with which an environment's action is the gain, those of `FlexArm/SquareGain-v0`.

        The law overshoots corners, so that the limits that end an episode are wide.
        """
        return {"action_mode": "gain", "physics_step": 1e-3, "deflection_limit": 4.5, "error_limit": 9.0}

    @abstractmethod
    def gains(self, observations: Floats) -> Floats:
        """Return the gains lambda for a batch of observations.

        Args:
            observations: shape ``(n, k)``.

        Returns:
            Gains in [0, gain_limit], dimensionless, shape ``(n,)``.
        """

    def predict(
        self,
        observation: Observation,
        state: State = None,
        episode_start: Array | None = None,
        deterministic: bool = True,
    ) -> tuple[Float32s, State]:
        """Choose actions; see `Policy.predict`. The state comes back as it was given.

        Returns:
            Actions in [-1, 1], shape ``(1,)`` for one observation, ``(n, 1)`` for a batch, and ``state``.
        """
        rows = checked_observation(observation).astype(np.float64)
        gains = self.gains(np.atleast_2d(rows))
        actions = action_from_gain(gains, self.gain_limit).astype(np.float32)
        return actions.reshape(*rows.shape[:-1], 1), state


def env_attribute(env: Any, name: str) -> Any:
    """Return an attribute of the environment below all wrappers, or raise `TypeError` if it has none."""
    base = env.unwrapped
    if not hasattr(base, name):
        raise TypeError(f"env must be a FlexArm environment, but {shown(base)} has no attribute {name!r}")
    return getattr(base, name)


def env_gain_limit(env: Any) -> float:
    """Return the gain limit of an environment, or raise `ValueError` if its action is not the gain."""
    limit = float(env_attribute(env, "gain_limit"))
    space = getattr(env.unwrapped, "single_action_space", None) or env.unwrapped.action_space
    if space.shape != (1,):
        raise ValueError(f"env must take one gain as action, a space of shape (1,), got shape {space.shape}")
    return limit
