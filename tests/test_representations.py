"""What Python shows of public objects: a line that says what they are."""

from typing import Any

import gymnasium
import numpy as np
import pytest

from flexarm_agents import load_policy, shipped_policies
from flexarm_agents.policies.constant import ConstantPolicy
from flexarm_agents.policies.lstm import Lstm
from flexarm_agents.policies.network import NetworkPolicy
from flexarm_baselines.optimal.plan import load_plan
from flexarm_baselines.registry import make_controller
from flexarm_env import ArmParameters, FlexibleArm
from flexarm_env.envs.single import FlexArmEnv
from flexarm_env.envs.vector import FlexArmVectorEnv

SQUARE = "flexarm_env:FlexArm/Square-v0"
LONGEST = 240
LAYERS = ([np.zeros((2, 3), np.float32)], [np.zeros(2, np.float32)], np.zeros(2, np.float32))


def controller(name: str) -> Any:
    from flexarm_baselines.registry import controller

    return make_controller(name, FlexArmEnv(**controller(name).options))


def run() -> Any:
    return FlexibleArm(ArmParameters(modes_per_link=1)).record(np.zeros(1), np.zeros((1, 8)), np.zeros((1, 2)))


@pytest.mark.parametrize(
    ("made", "words"),
    [
        (lambda: FlexArmEnv(noise=0.1), ("FlexArmEnv", "torque", "'default'", "10 ms", "46 ")),
        (lambda: gymnasium.make(SQUARE), ("TimeLimit<", "<FlexArmEnv FlexArm/Square-v0: torque", "10 ms", "46 ")),
        (lambda: FlexArmVectorEnv(3, arm="linear"), ("num_envs=3", "'linear'")),
        (lambda: FlexArmVectorEnv(2, per_env={"noise": [0.0, 0.1]}), ("num_envs=2", "per_env")),
        (lambda: NetworkPolicy(*LAYERS), ("NetworkPolicy(3 -> 2, elu)",)),
        (lambda: ConstantPolicy(2, 0.5), ("ConstantPolicy", "0.5")),
        (lambda: Lstm(np.zeros((8, 3), np.float32), np.zeros((8, 2), np.float32), np.zeros(8, np.float32)), ("Lstm",)),
        (lambda: controller("joint_pd"), ("JointTracking", "joint_rates")),
        (lambda: controller("joint_pd").task, ("Task", "period=0.01", "16 s")),
        (lambda: controller("flsac"), ("FLSAC", "K_n=5.0")),
        (lambda: FlexibleArm(), ("FlexibleArm", "4.5", "foreshortened")),
        (lambda: load_plan("default_swing"), ("Plan", "1600")),
        (run, ("Trajectory", "1 instants")),
        *((lambda name=name: load_policy(name), (name, "-> ", "FlexArm/")) for name in shipped_policies()),
    ],
)
def test_a_line_says_what_it_is(made: Any, words: tuple[str, ...]) -> None:
    it = made()
    for text in (repr(it), str(it)):
        assert len(text) <= LONGEST
        assert "\n" not in text
        assert " object at " not in text
        for word in words:
            assert word in text
