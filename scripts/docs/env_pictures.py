"""The moving pictures of docs/environments: each id up to a telling moment, under a simple policy."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium
import numpy as np
from numpy.typing import NDArray
from PIL import Image  # matplotlib, of the extra `plot`, brings it

from flexarm_baselines.registry import controller
from flexarm_env.envs.registration import NAMESPACE
from flexarm_env.envs.single import FlexArmEnv
from flexarm_env.envs.termination import end_reason
from flexarm_env.predictor import predictor
from scripts.common.plotting import write_moving

FRAMES = 60  # of a picture, at most
INTERVAL, REST = 0.08, 1.2  # between frames, and on the last one [s]
SIZE = 400  # [px]
Driver = Callable[[FlexArmEnv, Any], Any]  # makes an action of an environment and its observation


class Picture(NamedTuple):
    """How a picture comes about."""

    caption: str  # what it shows
    policy: Driver | str  # who drives, or the name of a controller
    reset: dict[str, Any]  # options of the reset
    steps: int  # control periods before the last of its frames
    seed: int = 0  # seed of the reset


def constant(value: float) -> Driver:
    """Make a policy that always returns the same action."""
    return lambda env, observation: np.full(env.action_space.shape or (), value, np.float32)


def joint_law(stiffness: tuple[float, float], resistance: tuple[float, float]) -> Driver:
    """Make a policy of springs and dampers between the joints and the rigid arm on the reference."""

    def policy(env: FlexArmEnv, observation: Any) -> Any:
        """Return the law's torques as an action."""
        values, blocks = observation * env.observation_scale, env.observation_blocks
        torque = stiffness * values[blocks["joint_error"]] + resistance * values[blocks["joint_error_rate"]]
        return np.clip(torque / env.settings.action_limit, -1.0, 1.0).astype(np.float32)

    return policy


STIFF = joint_law((480.0, 160.0), (28.0, 8.5))
SOFT = joint_law((60.0, 20.0), (2.0, 0.5))

CORNER = "A corner under a stiff spring and damper in each joint"


def moving(caption: str, time: float, steps: int, policy: Any = STIFF, **parameters: float) -> Picture:
    """Declare a picture of an arm that moves along the lap at the start; parameters are those of the episode."""
    reset: dict[str, Any] = {"start": "moving", "time": time}
    return Picture(caption, policy, reset | ({"parameters": parameters} if parameters else {}), steps)


def late(when: str, **parameters: float) -> Picture:
    """Declare a picture of what the late sensor shows."""
    return moving(f"After a corner: the sensor at the tip shows where the tip was {when} ago.", 2.0, 230, **parameters)


PICTURES = {
    "Square-v0": moving(f"{CORNER}: the links bend, and the tip swings past.", 2.0, 260),
    "SmoothSquare-v0": Picture(
        "Round the first corner along the best known plan, under its regulator.",
        "plan_lqr",
        {"start": "corner", "elbow_branch": "negative"},
        470,
    ),
    "SquareResidual-v0": moving("Action 0: the inner law alone swings wide at every corner.", 1.0, 900, constant(0.0)),
    "SquareGain-v0": Picture(
        "Gain 1 from rest at the lower left: the tip overshoots each corner.", constant(1.0), {"start": "corner"}, 1250
    ),
    "SquareChain-v0": moving(f"{CORNER}; every link is a chain of 20 rigid segments.", 2.0, 260),
    "SquareEncoders-v0": moving(f"{CORNER}, which use the encoders only.", 6.0, 240),
    "SquareUnknown-v0": moving(
        "A corner with 0.9 kg of payload, under a soft spring in each joint.", 2.0, 260, SOFT, payload_mass=0.9
    ),
    "SquareDelayEasy-v0": late("31 ms"),
    "SquareDelayMedium-v0": late("60 ms", delay=0.06),
    "SquareDelayHard-v0": late("120 to 140 ms", delay=0.12),
    "Reach-v0": Picture(
        "Halfway through the first move, under a stiff spring and damper in each joint: the tip lags behind.",
        STIFF,
        {},
        220,
        8,
    ),
    "Track-v0": moving("Half a lap under a stiff spring and damper in each joint.", 0.0, 900),
    "Lab-v0": Picture(
        "Under a soft spring in each joint: dry friction holds the tip off the path.",
        joint_law((40.0, 8.0), (0.0, 0.0)),
        {"start": "corner", "elbow_branch": "negative"},
        5000,
    ),
    "Carry-v0": Picture(
        "The tip takes up 1.2 kg (the square), driven by `lqg`, and arrives at the next corner.",
        "lqg",
        {"start": "corner", "elbow_branch": "negative", "parameters": {"payload_mass": 1.2}},
        965,
    ),
    "Race-v0": Picture(
        "Two laps in 9.3 s: the second one along the best known plan, in 4.6 s.",
        "race_lqg",
        {"start": "corner"},
        934,
    ),
    "Paper-v0": Picture(
        "Gain 1 at the first corner of the lap; the sensor reads where the rigid arm was.", constant(1.0), {}, 4250
    ),
}


def frames(name: str, most: int = FRAMES) -> list[NDArray[np.uint8]]:
    """Draw the last frames of an id's picture, `INTERVAL` apart. Shape (size, size, 3) each."""
    wanted = PICTURES[name]
    policy: Any = wanted.policy
    listed = controller(policy) if isinstance(policy, str) else None
    own = listed.options if listed else {}
    # without a limit, since the policies are poor
    made = gymnasium.make(f"{NAMESPACE}/{name}", render_mode="rgb_array", error_limit=None, **own)
    env = made.unwrapped
    assert isinstance(env, FlexArmEnv)
    stride = max(1, round(INTERVAL / env.settings.control_period))
    observation, _ = made.reset(seed=wanted.seed, options=wanted.reset)
    predict = predictor(listed.make(made) if listed else partial(policy, env), deterministic=True)
    found, memory = [], None
    for step in range(1, wanted.steps + 1):
        action, memory = predict(observation, memory, np.array([step == 1]))
        observation, _, terminated, _, info = made.step(action)
        assert not terminated, f"{name}: {end_reason(info['end_code'])} after {info['time']} s"
        left, odd = divmod(wanted.steps - step, stride)
        if left < most and not odd:
            picture = env.render()
            assert picture is not None
            found.append(picture)
    made.close()
    return found


def write(path: Path, pictures: Sequence[NDArray[np.uint8]]) -> None:
    """Write frames as a moving picture. Shape (size, size, 3) each."""
    small = (Image.fromarray(one).resize((SIZE, SIZE), Image.Resampling.LANCZOS) for one in pictures)
    write_moving(path, small, INTERVAL, REST, minimize_size=True)
