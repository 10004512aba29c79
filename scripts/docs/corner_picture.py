"""The picture of the README: the first corner under IFDC, under FLSAC and under a shipped agent, on the same arm."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import tyro
from matplotlib import pyplot as plt
from numpy.typing import NDArray

from flexarm_agents import load_policy
from flexarm_baselines import FLSAC, IFDC
from scripts.common.markdown import DOCS

PICTURE = DOCS / "figures" / "three_controllers.png"
TIME = 5.0  # [s]; a second after the reference has turned
GAIN = "FlexArm/SquareGain-v0"
AGENT = "square"


def frame(env: gymnasium.Env[Any, Any], policy: Any) -> NDArray[np.uint8]:
    """The arm at `TIME`, from rest on the first corner."""
    observation, info = env.reset(seed=0, options={"start": "corner"})
    state, start = None, np.ones(1, dtype=bool)
    while info["time"] < TIME - 1e-9:
        action, state = policy.predict(observation, state, start, True)
        start = np.zeros(1, dtype=bool)
        observation, _, terminated, _, info = env.step(action)
        assert not terminated, f"{type(policy).__name__}: {info['termination_reason']} after {info['time']} s"
    picture = env.render()
    env.close()
    assert isinstance(picture, np.ndarray)
    return picture


def main(output: Path = PICTURE) -> None:
    """Draw it.

    Args:
        output: the file; an existing one is replaced.
    """
    gain = [gymnasium.make(GAIN, render_mode="rgb_array") for _ in range(2)]
    agent = load_policy(AGENT)
    frames = {
        "IFDC: the paper's law at gain 1": frame(gain[0], IFDC.for_env(gain[0])),
        "FLSAC: the law with a fuzzy gain": frame(gain[1], FLSAC.for_env(gain[1])),
        "PPO: torques at 100 Hz, 150 / 50 N m": frame(agent.make_env(render_mode="rgb_array"), agent.policy),
    }
    figure, axes = plt.subplots(1, 3, figsize=(15.0, 5.3), layout="constrained")
    for axis, (title, picture) in zip(axes, frames.items(), strict=True):
        axis.imshow(picture)
        axis.set_title(title, fontsize=13)
        axis.set_axis_off()
    output.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(output, dpi=110)
    print(f"{output}: drawn")


if __name__ == "__main__":
    tyro.cli(main)
