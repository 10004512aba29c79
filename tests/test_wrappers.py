"""Past observations of batches: against lists of what each arm observed in its episode."""

from typing import Any

import numpy as np
import pytest

from flexarm_env.wrappers import PastObservations
from tests.support.envs import vector
from tests.support.refusals import refuses


@pytest.mark.parametrize("ages", [(0, 1, 2, 3), (0, 5), (2,)], ids=str)
@pytest.mark.parametrize("mode", ["SameStep", "NextStep", "Disabled"])
def test_each_arm_has_the_past_of_its_own_episode(mode: str, ages: tuple[int, ...]) -> None:
    """Two batches with the same seed, in which episodes end at different steps."""
    bare, envs = (vector(autoreset_mode=mode, max_episode_steps=6) for _ in range(2))
    wrapped = PastObservations(envs, ages)
    seen: list[list[Any]] = [[one] for one in bare.reset(seed=1)[0]]
    shown, _ = wrapped.reset(seed=1)

    def reset(mask: Any) -> Any:
        observations, _ = bare.reset(options={"reset_mask": np.array(mask)})
        for i in np.flatnonzero(mask):
            seen[i] = [observations[i]]
        return wrapped.reset(options={"reset_mask": np.array(mask)})[0]

    def expected(i: int) -> Any:
        return np.concatenate([seen[i][max(len(seen[i]) - 1 - age, 0)] for age in ages])

    over, finals = np.zeros(3, bool), 0
    for step in range(16):
        if step == 4 or (mode == "Disabled" and over.any()):
            shown = reset(over if over.any() else [False, True, False])
            over = np.zeros(3, bool)
        action = wrapped.action_space.sample()
        observations, _, terminated, truncated, infos = bare.step(action)
        shown, *_, found = wrapped.step(action)
        for i in range(3):
            if mode == "SameStep" and (terminated | truncated)[i]:
                seen[i].append(infos["final_obs"][i])
                np.testing.assert_array_equal(found["final_obs"][i], expected(i))
                finals += 1
            begins = over[i] if mode == "NextStep" else mode == "SameStep" and (terminated | truncated)[i]
            seen[i] = [observations[i]] if begins else [*seen[i], observations[i]]
            np.testing.assert_array_equal(shown[i], expected(i))
        assert shown in wrapped.observation_space
        over = terminated | truncated
    assert finals > 3 or mode != "SameStep"


def test_no_mask_is_a_reset_of_all() -> None:
    envs = PastObservations(vector(), (0, 2))
    envs.reset(seed=0)
    seen, _ = envs.reset(options={"reset_mask": None})
    np.testing.assert_array_equal(*np.split(seen, 2, axis=1))


def test_bad_ages_are_refused() -> None:
    for ages in ([], [1, 0], [0, 0]):
        with refuses(ValueError, f"ages = {ages}: must increase"):
            PastObservations(vector(), ages)
    with refuses(TypeError, "ages = 4: must be a list or a tuple"):
        PastObservations(vector(), 4)  # type: ignore[arg-type]
