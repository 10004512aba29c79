"""The pictures of docs/environments: each id at a telling moment, under a simple policy."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import gymnasium
import numpy as np
from numpy.typing import NDArray

from flexarm_env.envs.registration import NAMESPACE
from flexarm_env.envs.single import FlexArmEnv
from flexarm_env.envs.termination import end_reason


class Picture(NamedTuple):
    """How a picture comes about.

    Attributes:
        caption: what it shows.
        policy: makes an action of an environment and its observation.
        reset: options of the reset.
        steps: control periods before it is taken.
        seed: seed of the reset.
    """

    caption: str
    policy: Callable[[FlexArmEnv, Any], Any]
    reset: dict[str, Any]
    steps: int
    seed: int = 0


def constant(value: float) -> Callable[[FlexArmEnv, Any], Any]:
    """Make a policy that always returns the same action."""
    return lambda env, observation: np.full(env.action_space.shape or (), value, np.float32)


def joint_law(stiffness: tuple[float, float], resistance: tuple[float, float]) -> Callable[[FlexArmEnv, Any], Any]:
    """Make a policy of springs and dampers between the joints and the rigid arm on the reference."""

    def policy(env: FlexArmEnv, observation: Any) -> Any:
        """Return the law's torques as an action."""
        values, blocks = observation * env.observation_scale, env.observation_blocks
        torque = stiffness * values[blocks["joint_error"]] + resistance * values[blocks["joint_error_rate"]]
        return np.clip(torque / env.settings.action_limit, -1.0, 1.0).astype(np.float32)

    return policy


STIFF = joint_law((480.0, 160.0), (28.0, 8.5))
SOFT = joint_law((60.0, 20.0), (2.0, 0.5))

PICTURES = {
    "Square-v0": Picture(
        "A corner under a stiff spring and damper in each joint: the links bend, and the tip swings past.",
        STIFF,
        {"start": "moving", "time": 2.0},
        260,
    ),
    "SquareResidual-v0": Picture(
        "Action 0: the inner law alone swings wide at every corner.",
        constant(0.0),
        {"start": "moving", "time": 1.0},
        900,
    ),
    "SquareGain-v0": Picture(
        "IFDC (gain 1) from rest at the lower left: each corner is overshot.", constant(1.0), {"start": "corner"}, 1250
    ),
    "SquareChain-v0": Picture(
        "The same corner on the chain: hinges with springs, 19 a link, bend as far as they bend.",
        STIFF,
        {"start": "moving", "time": 2.0},
        260,
    ),
    "SquareEncoders-v0": Picture(
        "A corner under a stiff spring and damper in each joint, which know the joints only, as an agent here does.",
        STIFF,
        {"start": "moving", "time": 6.0},
        240,
    ),
    "SquareUnknown-v0": Picture(
        "A corner with 0.9 kg of payload, under a soft spring in each joint: stiff ones with dampers set the "
        "links swinging, since the motors are late.",
        SOFT,
        {"start": "moving", "time": 2.0, "parameters": {"payload_mass": 0.9}},
        260,
    ),
    "SquareDelayEasy-v0": Picture(
        "After a corner: the sensor at the tip shows where the tip was 31 ms ago.",
        STIFF,
        {"start": "moving", "time": 2.0},
        230,
    ),
    "SquareDelayMedium-v0": Picture(
        "The same with a reading of 60 ms ago.",
        STIFF,
        {"start": "moving", "time": 2.0, "parameters": {"delay": 0.06}},
        230,
    ),
    "SquareDelayHard-v0": Picture(
        "The same with a reading of 120 ms ago, and up to 20 ms more.",
        STIFF,
        {"start": "moving", "time": 2.0, "parameters": {"delay": 0.12}},
        230,
    ),
    "Reach-v0": Picture(
        "Half way through the first move, under a stiff spring and damper in each joint: the tip lags behind.",
        STIFF,
        {},
        220,
        8,
    ),
    "Track-v0": Picture(
        "Half a lap under a stiff spring and damper in each joint.", STIFF, {"start": "moving", "time": 0.0}, 900
    ),
    "Paper-v0": Picture(
        "IFDC (gain 1) at the first corner of the lap; the sensor's reading is where the rigid arm was.",
        constant(1.0),
        {},
        4250,
    ),
}


def drawn(name: str) -> NDArray[np.uint8]:
    """Draw the picture of an id. Shape (size, size, 3)."""
    wanted = PICTURES[name]
    made = gymnasium.make(f"{NAMESPACE}/{name}", render_mode="rgb_array", error_limit=None)  # the policies are poor
    env = made.unwrapped
    assert isinstance(env, FlexArmEnv)
    observation, _ = made.reset(seed=wanted.seed, options=wanted.reset)
    for _ in range(wanted.steps):
        observation, _, terminated, _, info = made.step(wanted.policy(env, observation))
        assert not terminated, f"{name}: {end_reason(info['end_code'])} after {info['time']} s"
    picture = env.render()
    assert picture is not None
    made.close()
    return picture
