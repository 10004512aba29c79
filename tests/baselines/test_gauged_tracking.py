"""Command shaping with feedback of the state that encoders and gauges read."""

import gymnasium
import numpy as np

from flexarm_baselines.gauged_tracking import GaugedTracking
from flexarm_baselines.joint_space.tracking import JointTracking
from flexarm_env.laps import LAPS
from flexarm_env.rollout import run_policy

ID = "flexarm_env:FlexArm/Square-v0"


def test_gauges_damp_what_joint_feedback_leaves() -> None:
    """A heavier tip vibrates after the start; feedback of the bending leaves less than a third of the error."""
    left = []
    for kind in (JointTracking, GaugedTracking):
        nominal = gymnasium.make(ID, **kind.options())
        nominal.reset(seed=0, options=LAPS["plain"].reset_options())
        env = gymnasium.make(ID, arm={"payload_mass": 0.5}, **kind.options())
        run = run_policy(env, kind.for_env(nominal), lap="plain", max_steps=400)
        left.append(np.sqrt(np.mean(np.sum((run.tip - run.reference)[200:] ** 2, axis=1))))
    assert left[1] < left[0] / 3.0
