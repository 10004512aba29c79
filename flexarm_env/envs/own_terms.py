"""Reward and termination by functions of the user's, which take the quantities of a whole batch at once."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexarm_env.envs.batch import OWN_END, BatchSimulator
from flexarm_env.envs.info import InfoMaker
from flexarm_env.validation import shown


def judge(simulator: BatchSimulator, infos: InfoMaker, results: NDArray[np.float64], begun: NDArray[np.int64]) -> None:
    """Write the rewards and terminations by the user's functions into the results of a step.

    Args:
        simulator: the environments.
        infos: makes their infos.
        results: of the step; changed. Shape (N, k).
        begun: environments that began an episode in this step; they have no reward and do not end. Shape (n,).

    Raises:
        TypeError, ValueError: for what a function returns of another shape or type, or a reward that is not finite.
    """
    settings, seen = simulator.settings, results.view()
    seen.flags.writeable = False  # infos show the same memory
    known = infos.quantities(seen)
    rewards, status = (results[:, simulator.parts[name].start] for name in ("REWARD", "STATUS"))
    if settings.reward is not None:
        found = _checked("reward", settings.reward(known), len(results), "fiu", "real numbers")
        rewards[:] = np.where((status == 0.0) | (status < -1.5), found, 0.0)  # an invalid state has no reward
        rewards[begun] = 0.0
        if not np.isfinite(rewards).all():
            raise ValueError(f"reward(infos)[{int(np.argmin(np.isfinite(rewards)))}]: must be finite")
    if settings.termination is not None:
        ends = _checked("termination", settings.termination(known), len(results), "b", "bool") & (status == 0.0)
        ends[begun] = False
        status[ends] = OWN_END
        simulator.end(ends.nonzero()[0])


def _checked(name: str, found: Any, count: int, kinds: str, what: str) -> NDArray[Any]:
    array = np.asarray(found)
    if array.shape != (count,) or array.dtype.kind not in kinds:
        raise TypeError(f"{name}(infos) = {shown(found)}: must be an array of {what}, of shape ({count},)")
    return array
