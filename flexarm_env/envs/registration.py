"""The environments' ids: one class, and for each id the options in which it differs from `FlexArm/Square-v0`.

The texts are documentation: the ids' pages are made from them.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import gymnasium
from gymnasium.envs.registration import EnvSpec

from flexarm_env.envs.chain_options import ChainOptions
from flexarm_env.envs.choices import DEFAULT_OBSERVATION

NAMESPACE = "FlexArm"
# Control periods of an episode: a lap of 16 s at 100 Hz, or at the paper's 1 kHz. A test checks them.
_LAP, _PAPER_LAP = 1600, 16_000


class Id(NamedTuple):
    """Declaration of an environment's id.

    Attributes:
        steps: number of control periods after which an episode is truncated.
        options: options that differ from the defaults of `Settings`.
        summary: description in one line.
        text: description in a paragraph.
        history: versions, the newest first.
        entry: class of the environment.
        batch_entry: class of the batch; None: Gymnasium's own vector environments make one.
        extra: what is to be installed for it; "": nothing.
        options_of: class of the options that it has beside those of `Settings`.
    """

    steps: int
    options: dict[str, Any]
    summary: str
    text: str
    history: tuple[str, ...] = ("v0: first version",)
    entry: str = "flexarm_env.envs.single:FlexArmEnv"
    batch_entry: str | None = "flexarm_env.envs.vector:FlexArmVectorEnv"
    extra: str = ""
    options_of: type[ChainOptions] | None = None


_PAPER: dict[str, Any] = {
    "arm": "paper",
    "action_mode": "gain",
    "control_period": 1e-3,
    "law_sensor": "sensor",
    "sensor": "rigid",
    "observation": (
        "joint_angles",
        "joint_rates",
        "sensed_position",
        "modal_coordinates",
        "reference_position",
        "reference_velocity",
    ),
    "frame": "world",
    "scaled": False,
    "start": "corner",
    "elbow_branch": "positive",
    "reward_weights": {"tracking_wide": 0.5, "tracking_middle": 0.5},
    "deflection_limit": None,
    "error_limit": None,
}
# Blocks that need the sensor on link 2 or the strain gauges.
_OF_THE_LINKS = ("sensor_error", "sensor_error_rate", "modal_coordinates", "modal_rates")
_ENCODERS = tuple(name for name in DEFAULT_OBSERVATION if name not in _OF_THE_LINKS)
_GAUGES = ("modal_coordinates", "modal_rates")
_LATE_TIP = tuple(name for name in DEFAULT_OBSERVATION if name not in _GAUGES)

# The unknown plant: what a controller does not know of the arm, its sensors and its motors. `SquareUnknown-v0` and
# every comparison on an unknown plant draw it from here.
UNKNOWN_PLANT: dict[str, Any] = {
    "randomisation": {
        "payload_mass": (0.0, 1.0),
        "stiffness": (0.8, 1.25),
        "damping": (0.003, 0.02),
        "delay": (0.0, 0.06),
        "actuation_delay": (0.0, 0.01),
    },
    "noise": 0.003,
    "encoder_noise": (1e-4, 1e-3),
}

IDS: dict[str, Id] = {
    "Square-v0": Id(
        _LAP,
        {},
        "Track the square by the motors' torques",
        "The paper's task with the torques in the agent's hands: nothing is stabilised. It observes the "
        "joints by encoders, the links' bending by strain gauges, and the tip by a sensor that is late. In the "
        "link's frame the sides of the square are one task; what differs is how the arm is bent when the "
        "reference turns. Each episode draws the side of the elbow, so that an agent meets both laps of the standard "
        "score; they are different tasks.",
    ),
    "SquareResidual-v0": Id(
        _LAP,
        {"action_mode": "residual"},
        "Track the square by torques added to an inner joint-space law",
        "As `FlexArm/Square-v0`, but a spring and a damper in each joint already pull the arm along the reference. "
        "Alone (action 0) they keep the tip within 2 m of it: their torques depend neither on the links' bending nor "
        "on the next corner. The agent adds torques; the sum is limited. The dampers act on joints that weigh little "
        "beside the links' bending, which makes the fastest pole some ten times as fast as the arm's own: with the "
        "default arm more integration steps are needed than in `FlexArm/Square-v0`, and a step takes longer in "
        'proportion; weaker dampers (`inner_resistance`) or `arm="linear"` need fewer.',
    ),
    "SquareGain-v0": Id(
        _LAP,
        {"action_mode": "gain", "physics_step": 1e-3, "deflection_limit": 4.5, "error_limit": 9.0},
        "Track the square by the gain of the paper's law",
        "The action is what the paper's fuzzy system sets, the gain of a Jacobian-transpose law; here 100 times a "
        "second, on joints without delay, with the default arm. The law overshoots corners, so the limits that "
        "end an episode are wide. For the paper's own conditions see `FlexArm/Paper-v0`.",
    ),
    "SquareChain-v0": Id(
        _LAP,
        {"arm": {"damping_model": "material"}},
        "Track the square with a chain of rigid segments in MuJoCo for an arm",
        "As `FlexArm/Square-v0`, but what the motors move is no sum of a few modes: 20 rigid segments a link, "
        "joined by springs and dampers of the material. It is the hardware of this benchmark, an arm that no "
        "controller's model contains: train and tune elsewhere, then see here what remains. Action, observation, "
        "reward, resets and infos are the same, by the same code; an action is a torque, its rate, or the gain of "
        "the paper's law. Encoders, sensors and the true tip are the chain's own. The modal coordinates are those "
        "whose deflection fits the chain's best in the mean square, as strain gauges would be calibrated; a start "
        "on the move, or in a given `state`, bends the chain so that the gauges read it.",
        entry="flexarm_env.chain.env:ChainEnv",
        batch_entry=None,
        extra="chain",
        options_of=ChainOptions,
    ),
    "SquareEncoders-v0": Id(
        _LAP,
        {"observation": _ENCODERS, "last_actions": 8},
        "Track the square by torques, knowing the joints only",
        "As `FlexArm/Square-v0`, without strain gauges and without the sensor on link 2: how far the links bend "
        "must be guessed from what the joints do and from the last eight actions. The reward still judges the "
        "true tip.",
    ),
    "SquareUnknown-v0": Id(
        _LAP,
        {"observation": _LATE_TIP, "last_actions": 8, **UNKNOWN_PLANT},
        "Track the square with an arm and sensors that each episode draws anew",
        "As `FlexArm/Square-v0` without strain gauges, on an unknown plant: payload, stiffness, damping, the delay of "
        "the sensor on link 2 and that of the motors differ from episode to episode, and all readings are noisy. The "
        "observation has the last eight actions, which go back further than any reading is late. One policy or "
        "controller is for the whole box of `randomisation`; what an episode drew is in `env.unwrapped.episode`, never "
        "in an observation.",
    ),
    "SquareDelayEasy-v0": Id(
        _LAP,
        {"observation": _LATE_TIP, "last_actions": 4, "delay": 0.031},
        "Track the square with a sensor on link 2 that is always 31 ms late",
        "As `FlexArm/Square-v0`, without strain gauges: how the links bend is known late or not at all. The first of "
        "three tasks to find out what helps against delay. Here it is known and constant, and the last four actions, "
        "which the latest reading cannot show yet, are in the observation.",
    ),
    "SquareDelayMedium-v0": Id(
        _LAP,
        {"observation": _LATE_TIP, "last_actions": 8, "randomisation": {"delay": (0.0, 0.06)}},
        "Track the square with a sensor on link 2 that is 0 to 60 ms late",
        "As `FlexArm/SquareDelayEasy-v0`, but each episode draws the delay, and a controller has to find it out or to "
        "do without.",
    ),
    "SquareDelayHard-v0": Id(
        _LAP,
        {
            "observation": _LATE_TIP,
            "last_actions": 16,
            "randomisation": {"delay": (0.0, 0.12)},
            "jitter": 0.02,
            "dropout": 0.1,
        },
        "Track the square with a sensor up to 140 ms late that loses readings",
        "As `FlexArm/SquareDelayMedium-v0`, but the delay is up to twice as long, each reading is up to 20 ms later "
        "still, and one reading of ten is lost, so that the one before stays.",
    ),
    "Reach-v0": Id(
        _LAP,
        {"reference": "moves", "start": "corner", "elbow_branch": "positive"},
        "Move the tip to a drawn point and back, and bring it to rest there",
        "Each episode draws two points. The reference moves from the first to the second in a quarter of the lap "
        "time, both joints together along a minimum-jerk polynomial, rests as long, moves back, and rests. To be "
        "learned is to arrive without vibration. The points lie all round the shoulder, so a move with the elbow "
        "on the other side is the mirror image of one that is drawn as often; `elbow_branch` stays on one side.",
    ),
    "Track-v0": Id(
        _LAP,
        {"reference": "circle"},
        "Track a circle, or any path that you give, by the motors' torques",
        "As `FlexArm/Square-v0` on the circle inside the square: no corners. `reference` takes other paths, and "
        "way-points of your own; of several names one is drawn for each episode.",
    ),
    "Paper-v0": Id(
        _PAPER_LAP,
        _PAPER,
        "The paper's set-up: the gain of the law at 1 kHz, with the late sensor in the loop",
        "What `make reproduce` runs: one mode a link, the rigid arm's velocity forces, no damping; the law acts "
        "on the late, noncollocated sensor, and the action is its gain. Observations are plain numbers in the "
        "world's frame, as IFDC and FLSAC of `flexarm_baselines` read them. There is no torque limit, and only an "
        "invalid state ends an episode. The elbow starts with theta2 > 0, the project's reading of "
        "the paper. [The paper, reproduced](../reproduction.md) tells what comes out.",
    ),
}


def warn_of_short_limit(spec: EnvSpec | None, steps: int | None, lap_steps: int) -> None:
    """Warn if the time limit with which an id is registered is shorter than a lap.

    The limit is a number of control periods, and other options can make a lap longer. A limit that differs from the
    registered one is the user's choice and gives no warning.

    Args:
        spec: spec of the environment.
        steps: its time limit [control periods].
        lap_steps: number of control periods in a lap.
    """
    declared = IDS.get(spec.id.removeprefix(f"{NAMESPACE}/")) if spec is not None else None
    if spec is not None and declared is not None and steps == declared.steps < lap_steps:
        gymnasium.logger.warn(
            f"{spec.id}: the registered limit of {steps} control periods is shorter than a lap of {lap_steps} with "
            f"these options; give make max_episode_steps={lap_steps} for a whole lap"
        )


def register_environments() -> None:
    """Register all ids with Gymnasium; repeated calls change nothing."""
    for name, declared in IDS.items():
        if f"{NAMESPACE}/{name}" not in gymnasium.registry:
            gymnasium.register(
                id=f"{NAMESPACE}/{name}",
                entry_point=declared.entry,
                vector_entry_point=declared.batch_entry,
                max_episode_steps=declared.steps,
                kwargs=declared.options,
            )
