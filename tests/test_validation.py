"""A refusal shows the value that it refuses, however long it is, and whether or not it can be shown at all."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from flexarm_agents import config_of, load_policy
from flexarm_agents.environments import check_id, check_options
from flexarm_agents.evaluation.candidates import imported
from flexarm_env import ArmParameters, Trajectory, end_reason, run_policy, warm_up
from flexarm_env.envs.single import FlexArmEnv
from flexarm_env.envs.vector import FlexArmVectorEnv
from flexarm_env.metrics import overshoot, tracking_error
from flexarm_env.predictor import predictor
from flexarm_env.simulation.arm import FlexibleArm

LONGEST = 1500  # characters of a message: what is allowed takes some, too
STILL = FlexibleArm(ArmParameters.linear()).simulate(np.zeros(12), None, duration=0.01)


class Unshowable:
    def __repr__(self) -> str:
        raise RuntimeError("no repr")


REFUSALS: dict[str, Callable[[Any], Any]] = {
    "an option": lambda value: FlexArmEnv(frame=value),
    "reset's options": lambda value: FlexArmEnv(arm="linear").reset(options=value),
    "an option of reset": lambda value: FlexArmEnv(arm="linear").reset(options={"start": value}),
    "parameters of an episode": lambda value: FlexArmEnv(arm="linear").reset(options={"parameters": value}),
    "a batch's reset": lambda value: FlexArmVectorEnv(2, arm="linear").reset(options=value),
    "a mask": lambda value: FlexArmVectorEnv(2, arm="linear").reset(options={"reset_mask": value}),
    "autoreset_mode": lambda value: FlexArmVectorEnv(2, autoreset_mode=value),
    "warm_up": lambda value: warm_up(["FlexArm/Square-v0"], value),
    "end_reason": end_reason,
    "an environment to run": lambda value: run_policy(value, None),
    "a policy": lambda value: predictor(value, True),
    "a tip": lambda value: tracking_error(STILL, tip=value),
    "an id": check_id,
    "options in a file": lambda value: check_options("FlexArm/Square-v0", value),
    "plain options": lambda value: check_options("FlexArm/Square-v0", {"frame": value}),
    "hidden layers": lambda value: config_of(hidden=value),
}


@pytest.mark.parametrize("value", ["x" * 100_000, Unshowable()], ids=["long", "unshowable"])
@pytest.mark.parametrize("refuse", REFUSALS.values(), ids=REFUSALS)
def test_any_value_is_shown_in_a_line(refuse: Callable[[Any], Any], value: Any) -> None:
    with pytest.raises((TypeError, ValueError)) as caught:
        refuse(value)
    assert len(str(caught.value)) < LONGEST


@pytest.mark.parametrize("refuse", [load_policy, imported, Trajectory.load])
def test_a_long_name_is_cut(refuse: Callable[[str], Any]) -> None:
    with pytest.raises((OSError, ValueError)) as caught:
        refuse("x" * 100_000)
    assert len(str(caught.value)) < LONGEST


def test_a_direction_that_is_none() -> None:
    with pytest.raises(ValueError, match=r"incoming = array\(\[0\., 0\.\]\): must be a direction"):
        overshoot(STILL.tip, STILL.time, np.zeros(2), np.zeros(2), (0.0, 1.0))
