"""The picture of the README: the first corner under FLSAC, two shipped agents and LQG, on the same arm."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import tyro
from matplotlib import pyplot as plt
from numpy.typing import NDArray

from flexarm_agents import load_policy
from flexarm_agents.board.terms import SQUARE, interface_of
from flexarm_baselines.registry import controller, make_controller
from flexarm_env.metrics import elbow_changes, ended_early
from flexarm_env.rollout import run_policy
from scripts.common.command_line import run
from scripts.common.markdown import DOCS

PICTURE = DOCS / "figures" / "four_controllers.png"
TIME = 5.0  # [s]; a second after the reference has turned
GAIN = "FlexArm/SquareGain-v0"
LAP = "swing"


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


def controlled(name: str, environment: str) -> tuple[NDArray[np.uint8], str]:
    """Return the frame of a controller, by its name."""
    options = controller(name).options if environment == SQUARE else {}
    env = gymnasium.make(environment, render_mode="rgb_array", **options)
    return frame(env, make_controller(name, env))


def learned(name: str) -> tuple[NDArray[np.uint8], str]:
    """Return the frame of a shipped agent, on the nominal arm."""
    agent = load_policy(name)
    own = interface_of(gymnasium.spec(agent.environment).kwargs | agent.options)
    return frame(gymnasium.make(SQUARE, render_mode="rgb_array", **own), agent.policy)


def main(output: Path = PICTURE) -> None:
    """Draw it.

    Args:
        output: the file; an existing one is replaced.
    """
    frames = {
        "FLSAC: the paper's fuzzy gain": controlled("flsac", GAIN),
        "PPO: an agent by reward": learned("square"),
        "a student of the unknown plant": learned("student_unknown"),
        "LQG along the best plan known": controlled("lqg", SQUARE),
    }
    figure, axes = plt.subplots(2, 2, figsize=(10.5, 11.5), layout="constrained")
    for axis, (title, (picture, elbow)) in zip(axes.flat, frames.items(), strict=True):
        axis.imshow(picture)
        axis.set_title(f"{title}\n{elbow}", fontsize=13)
        axis.set_axis_off()
    output.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(output, dpi=100, bbox_inches="tight", pad_inches=0.1)
    print(f"{output}: drawn")


if __name__ == "__main__":
    run(lambda: tyro.cli(main, prog="python -m scripts.docs.corner_picture"))
