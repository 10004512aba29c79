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
from flexarm_env.metrics import elbow_changes, ended_early
from flexarm_env.rollout import run_policy
from scripts.common.markdown import DOCS

PICTURE = DOCS / "figures" / "three_controllers.png"
TIME = 5.0  # [s]; a second after the reference has turned
GAIN = "FlexArm/SquareGain-v0"
AGENT, LAP = "square", "swing"


def frame(env: gymnasium.Env[Any, Any], policy: Any) -> tuple[NDArray[np.uint8], str]:
    """Simulate the arm to `TIME`, from rest on the first corner; describe what its elbow has done until then."""
    periods = round(TIME / env.get_wrapper_attr("control_period"))
    run = run_policy(env, policy, seed=0, max_steps=periods, lap=LAP)
    assert not ended_early(run), f"{type(policy).__name__}: {run.notes['ended']} after {run.time[-1]} s"
    picture = env.render()
    env.close()
    assert isinstance(picture, np.ndarray)
    changes = elbow_changes(run)
    times = ", ".join(f"{time:.2f} s" for time in changes)
    return picture, f"elbow changed sides at {times}" if len(changes) else "elbow on the side of the start"


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
    figure, axes = plt.subplots(1, 3, figsize=(15.0, 5.75), layout="constrained")
    for axis, (title, (picture, elbow)) in zip(axes, frames.items(), strict=True):
        axis.imshow(picture)
        axis.set_title(f"{title}\n{elbow}", fontsize=13)
        axis.set_axis_off()
    output.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(output, dpi=110, bbox_inches="tight", pad_inches=0.1)
    print(f"{output}: drawn")


if __name__ == "__main__":
    tyro.cli(main, prog="python -m scripts.docs.corner_picture")
