"""`PastObservations`: what Gymnasium's wrappers lack for batches, a frame stack, a history or a delay."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv, VectorWrapper
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from flexarm_env.validation import integer, listed, shown

LONGEST = 1000  # steps


class PastObservations(VectorWrapper[Any, Any, Any, Any, Any]):
    """Observations of chosen ages, one after the other; in every autoreset mode, and with `reset_mask`.

    Ages (0, 1, 2, 3) are a frame stack, (0, 5, 10) a history, (2,) a delay by two steps. Before an episode's first
    observation, all are taken to be equal to it. `final_obs` has the past of the episode that ended. `set_state` of the
    batch does not change the past that is kept here.
    """

    def __init__(self, env: VectorEnv[Any, Any, Any], ages: Sequence[int]) -> None:
        """Put it around a batch.

        Args:
            env: the batch, whose observations are vectors.
            ages: of the observations, increasing, from 0 to `LONGEST` [steps].

        Raises:
            TypeError, ValueError: for observations that are no vectors, or other ages.
        """
        super().__init__(env)
        space = env.single_observation_space
        if not isinstance(space, gymnasium.spaces.Box) or len(space.shape) != 1:
            raise TypeError(f"env: must observe vectors, got {space}")
        self.ages = [integer(f"ages[{n}]", age, 0, LONGEST) for n, age in enumerate(listed("ages", ages))]
        if not self.ages or self.ages != sorted(set(self.ages)):
            raise ValueError(f"ages = {shown(ages)}: must increase, and there must be one at least")
        low, high = (np.tile(bound, len(self.ages)) for bound in (space.low, space.high))
        self.single_observation_space = gymnasium.spaces.Box(low, high, dtype=space.dtype.type)
        self.observation_space = batch_space(self.single_observation_space, env.num_envs)
        self._past = np.zeros((env.num_envs, self.ages[-1] + 1, *space.shape), space.dtype)  # the newest first
        self._beginning = np.zeros(env.num_envs, dtype=bool)  # in the next step

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[Any], dict[str, Any]]:
        """Begin episodes; arguments as of the batch."""
        given = (options or {}).get("reset_mask")
        mask = np.ones(self.num_envs, dtype=bool) if given is None else np.asarray(given)
        observations, infos = self.env.reset(seed=seed, options=options)  # type: ignore[arg-type]
        self._past[mask] = observations[mask, None]
        self._beginning[mask] = False
        return self._chosen(self._past), infos

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Step the batch."""
        observations, rewards, terminated, truncated, infos = self.env.step(actions)
        self._past = np.concatenate([observations[:, None], self._past[:, :-1]], axis=1)
        begun, ended = self._beginning, terminated | truncated
        if "final_obs" in infos:
            begun, final = ended, infos["final_obs"].copy()
            for i in np.flatnonzero(ended):
                self._past[i, 0] = final[i]
                final[i] = self._chosen(self._past[i : i + 1])[0]
            infos["final_obs"] = final
        self._past[begun] = observations[begun, None]
        if self.env.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP:
            self._beginning = ended
        return self._chosen(self._past), rewards, terminated, truncated, infos

    def _chosen(self, past: NDArray[Any]) -> NDArray[Any]:
        return past[:, self.ages].reshape(len(past), -1)
