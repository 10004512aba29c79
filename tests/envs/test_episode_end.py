"""Success, and the reasons and codes with which episodes end."""

import numpy as np
import pytest

from flexarm_env import end_reason
from flexarm_env.envs.info import info_keys
from flexarm_env.envs.registration import IDS
from flexarm_env.envs.single import FlexArmEnv
from flexarm_env.envs.termination import END_CODES, ENDS
from tests.support.envs import REACH, make, vector
from tests.support.refusals import refuses


def test_success_is_a_lap_with_a_quiet_final_rest() -> None:
    """`Reach`: 1 at the end of the lap only, if the tip was within 2 cm from 12 s to 16 s; `Carry` has another one."""
    settings = {name: make(f"FlexArm/{name}").unwrapped.settings for name in IDS}
    assert [name for name, own in settings.items() if "is_success" in info_keys(own)] == ["Reach-v0", "Carry-v0"]
    env = make(REACH, error_limit=None, deflection_limit=None)
    inner = env.unwrapped
    assert isinstance(inner, FlexArmEnv)
    still = np.zeros(2, np.float32)
    for late, wanted in ((12.0, 1.0), (12.01, 0.0)):
        # at rest on the resting reference no torque keeps the tip where it is
        env.reset(seed=0, options={"time": late, "start": "corner"})
        seen = []
        truncated = False
        for _ in range(round((16.0 - late) / 0.01)):
            *_, truncated, info = env.step(still)
            seen.append(info["is_success"])
            assert info["tip_error"] < 1e-9
        assert not any(seen[:-1])
        assert seen[-1] == wanted
        assert not truncated
    state = env.reset(seed=0, options={"time": 12.0})[1]["state"]
    env.reset(seed=0, options={"time": 12.0, "state": state + np.eye(len(state))[0] * 0.01})  # 2 cm or more off
    for _ in range(400):
        *_, info = env.step(still)
    assert info["tip_error"] > 0.02
    assert info["is_success"] == 0.0


@pytest.mark.usefixtures("uncompiled")
def test_success_of_a_batch_survives_the_end_of_the_lap() -> None:
    env = vector(REACH, 2, error_limit=None, max_episode_steps=120, lap_time=4.0)
    env.reset(seed=0, options={"time": [3.0, 3.25], "start": "corner"})
    still = np.zeros((2, 2), np.float32)
    for k in range(1, 111):
        infos = env.step(still)[4]
        expected = [1.0, 0.0] if k >= 100 else [0.0, 0.0]
        if k < 101 or infos["is_success"][1] == 0.0:
            np.testing.assert_array_equal(infos["is_success"], expected, f"step {k}")


def test_codes_and_reasons() -> None:
    assert [end_reason(code) for code in END_CODES.values()] == list(END_CODES)
    assert [
        END_CODES[name] for name in ("none", "error", "deflection", "angle", "rate", "diverged", "own", "finished")
    ] == [*range(8)]
    assert set(END_CODES) == {"none", *ENDS}
    assert end_reason(np.float64(2.0)) == "deflection"
    for bad in (8, -1, 1.5, float("nan")):
        with refuses((TypeError, ValueError), "code = "):
            end_reason(bad)


def test_stable_baselines3s_monitor_keeps_the_code() -> None:
    monitor = pytest.importorskip("stable_baselines3.common.monitor")
    for limits, code in (({"max_episode_steps": 5}, 0.0), ({"error_limit": 1e-6}, END_CODES["error"])):
        env = monitor.Monitor(make(**limits), info_keywords=("end_code",))
        env.reset(seed=0)
        done = False
        while not done:
            *_, terminated, truncated, info = env.step(np.ones(2, np.float32))
            done = terminated or truncated
        assert info["episode"]["end_code"] == code
