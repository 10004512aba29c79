"""Infos: flat, the same keys always, of one environment and of a batch."""

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from flexarm_env.envs.info import info_keys
from tests.support.envs import REACH, SQUARE, kinds_of, vector


@pytest.mark.parametrize("mode", AutoresetMode)
@pytest.mark.parametrize("env_id", [SQUARE, REACH])
def test_infos_of_a_batch_never_change_their_structure(env_id: str, mode: AutoresetMode) -> None:
    """Libraries lay out their memory by the first info."""
    env = vector(env_id, 3, autoreset_mode=mode, error_limit=0.3, start="corner", max_episode_steps=15)
    infos = env.reset(seed=0)[1]
    begun = kinds_of(infos)
    keys = info_keys(env.settings)
    assert set(begun) == {*keys, *(f"_{name}" for name in keys)}
    ended = 0
    for action in np.random.default_rng(0).uniform(-1.0, 1.0, (35, 3, 2)).astype(np.float32):
        *_, terminated, truncated, infos = env.step(action)
        done = terminated | truncated
        final = infos.pop("final_info", None)
        present = infos.pop("_final_info", np.zeros(3, bool))
        assert ({"final_obs", "_final_obs"} <= set(infos)) == (final is not None)
        infos = {name: value for name, value in infos.items() if "final_obs" not in name}
        assert kinds_of(infos) == begun
        if mode is AutoresetMode.SAME_STEP:
            assert not infos["end_code"].any()
            np.testing.assert_array_equal(present, done)
            if done.any():
                assert kinds_of(final) == begun
                np.testing.assert_array_equal(final["end_code"] != 0.0, terminated)
                np.testing.assert_array_equal(final["_end_code"], done)
        else:
            np.testing.assert_array_equal(infos["end_code"] != 0.0, terminated)
        ended += done.sum()
        if mode is AutoresetMode.DISABLED and done.any():
            again = env.reset(options={"reset_mask": done})[1]
            assert kinds_of(again) == begun
            np.testing.assert_array_equal(again["_time"], done)
    assert ended > 3
