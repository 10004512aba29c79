"""The environments' ids: one class, and for each id the options in which it differs from `FlexArm/Square-v0`.

The texts are documentation: the ids' pages are made from them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import gymnasium
from gymnasium.envs.registration import EnvSpec

from flexarm_env.allowed import Integer, Number, check_fields, declared
from flexarm_env.envs.choices import DEFAULT_OBSERVATION

NAMESPACE = "FlexArm"
# Control periods of an episode: a lap of 16 s at 100 Hz, at the paper's 1 kHz, or at 500 Hz; of 24 s at 100 Hz; a
# minute. A test checks them.
_LAP, _PAPER_LAP, _LAB_LAP, _CARRY_LAP, _RACE = 1600, 16_000, 8000, 2400, 6000


@dataclass(frozen=True, kw_only=True)
class ChainOptions:
    """Options of the chain in MuJoCo that `FlexArm/SquareChain-v0` has for an arm, beside those of `Settings`."""

    segments: int = declared(20, Integer(3, 100), text="rigid segments a link")
    chain_step: float = declared(
        5e-4,
        Number(1e-6, 1e-2, "s"),
        text="longest integration step of MuJoCo; it is shortened to divide `physics_step`, after which sensors are "
        "read, and where the chain would be unstable",
    )

    def __post_init__(self) -> None:
        """Validate."""
        check_fields(self)


class Id(NamedTuple):
    """Declaration of an environment's id.

    Attributes:
        steps: number of control periods after which an episode is truncated.
        options: options that differ from the defaults of `Settings`.
        summary: description in one line.
        text: what it is for, in a paragraph.
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
    "feedback_source": "sensor",
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

# Unknown arms: what a controller does not know of the arm, its sensors and its motors. `SquareUnknown-v0`
# and every comparison on unknown arms draw it from here.
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

# The laboratory arm (docs/how_to/published_arms.md): its name, and what its maker gives of it.
LAB_ARM = "quanser_measured"
_LAB: dict[str, Any] = {
    "arm": LAB_ARM,
    "control_period": 0.002,
    "torque_limit": (8.39, 0.818),  # a current of 0.94 A times 8.925 and 0.87 N m/A
    "encoder_resolution": (1.534e-5, 3.068e-5),  # of 4096 counts a turn of the motor, through 100:1 and 50:1
    "observation": tuple(name for name in DEFAULT_OBSERVATION if not name.startswith("sensor_error")),
    "reference": "waypoints",
    "waypoints": ((0.29, -0.045), (0.29, 0.045), (0.38, 0.045), (0.38, -0.045)),
    "reward_weights": {"tracking_fine": 0.85, "action_change": 0.15},
    "deflection_limit": 0.0176,  # 5 degrees of link 1: the maker's watchdog
    "error_limit": 0.1,
}

IDS: dict[str, Id] = {
    "Square-v0": Id(
        _LAP,
        {},
        "Follow the square with the motors' torques",
        "The main task: the paper's square, with the torques in the agent's hands and nothing stabilised. The "
        "joints have encoders, the links strain gauges, the tip a sensor that is late. The gauges have no noise: with "
        "the encoders they give the whole state. `SquareEncoders-v0`, `SquareUnknown-v0` and the ids `SquareDelay...` "
        "have none. Each episode draws the side of the elbow, so an agent meets both laps of the score.",
    ),
    "SmoothSquare-v0": Id(
        _LAP,
        {"corner_time": 0.4},
        "Follow the square with corners blended over 0.4 s",
        "The square that the arm can follow. At a sharp corner the best known lap is 14 cm off, whatever its "
        "controller: the shoulder's torque limits it. Blended over 0.4 s a corner asks for 11 m/s², and the best known "
        "lap errs by less than 0.05 mm after 2 s. What a controller errs by is then its own.",
    ),
    "SquareResidual-v0": Id(
        _LAP,
        {"action_mode": "residual"},
        "Follow the square with torques added to springs and dampers in the joints",
        "A quick start for learning, and the task of improving a classical loop: a spring and a damper in each "
        "joint pull the arm along the path, and the agent adds torques to theirs. Action 0 keeps the tip "
        "within 2 m; the law knows neither the links' bending nor the next corner. Its dampers make the fastest "
        "pole some ten times as fast, so that a step takes more integration steps and more time; a smaller "
        "`inner_damping` needs fewer.",
    ),
    "SquareGain-v0": Id(
        _LAP,
        {"action_mode": "gain", "physics_step": 1e-3, "deflection_limit": 4.5, "error_limit": 9.0},
        "Follow the square by setting the gain of the paper's law",
        "What the paper's fuzzy system does, for a learner: the action is the gain of a Jacobian-transpose law, "
        "100 times a second. The law acts on joint angles without delay, on the default arm. It overshoots "
        "corners, so the limits that end an episode are wide.",
    ),
    "SquareChain-v0": Id(
        _LAP,
        {"arm": {"damping_model": "material"}},
        "Follow the square on another arm, a chain of rigid segments in MuJoCo",
        "The stand-in for hardware, an arm that no controller's model contains: 20 rigid segments a link with "
        "springs and dampers between them. Train and tune on another id and see here what remains. Spaces, "
        "reward, resets and infos are those of `FlexArm/Square-v0`; sensors read the chain, and modal coordinates "
        "are the least-squares fit to its deflection. `action_mode` can be a torque, its rate, or the gain.",
        entry="flexarm_env.chain.env:ChainEnv",
        batch_entry=None,
        extra="chain",
        options_of=ChainOptions,
    ),
    "SquareEncoders-v0": Id(
        _LAP,
        {"observation": _ENCODERS, "last_actions": 8},
        "Follow the square with joint encoders as the only sensors",
        "How far does a policy get without any sensor on the links? It has to infer their bending from the motion "
        "of the joints and from its last eight actions. The reward still uses the true tip.",
    ),
    "SquareUnknown-v0": Id(
        _LAP,
        {"observation": _LATE_TIP, "last_actions": 8, **UNKNOWN_PLANT},
        "Follow the square with an arm and sensors that are drawn for each episode",
        "The task for robust and adaptive control: payload, stiffness, damping and the delays of sensor and motors "
        "differ from episode to episode, and readings are noisy. One policy has to serve all; the draw is in "
        "`env.unwrapped.episode` only.",
    ),
    "SquareDelayEasy-v0": Id(
        _LAP,
        {"observation": _LATE_TIP, "last_actions": 4, "delay": 0.031},
        "Follow the square with a tip sensor that is 31 ms late",
        "The first of three tasks about delay, all without strain gauges. The delay is known and constant. The "
        "last four actions, whose effect the latest reading cannot show yet, are in the observation.",
    ),
    "SquareDelayMedium-v0": Id(
        _LAP,
        {"observation": _LATE_TIP, "last_actions": 8, "randomisation": {"delay": (0.0, 0.06)}},
        "Follow the square with a tip sensor that is 0 to 60 ms late",
        "The second task about delay: each episode draws the delay, and a controller has to find it or to do without.",
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
        "Follow the square with a tip sensor up to 120 ms late, with jitter and lost readings",
        "The third task about delay: the drawn delay is up to twice as long, each reading is up to 20 ms later "
        "still, and one reading in ten is lost, so that the one before stays.",
    ),
    "Reach-v0": Id(
        _LAP,
        {"reference": "moves", "start": "corner", "elbow_branch": "positive"},
        "Move the tip to a drawn point and back, and bring it to rest there",
        "The task is to arrive without vibration. Each episode draws two points. The target moves from one to "
        "the other in a quarter of the lap time (both joints along a minimum-jerk polynomial), rests as long, "
        "moves back, and rests. The points lie all round the shoulder, so moves with the elbow on the other side "
        "are mirror images, and `elbow_branch` is fixed.",
    ),
    "Track-v0": Id(
        _LAP,
        {"reference": "circle"},
        "Follow a circle, or a path of your own, with the motors' torques",
        "A path without corners: the circle inside the square. With `reference` the path can be a line, a figure "
        "eight or your own way-points; of several paths, each episode draws one.",
    ),
    "Lab-v0": Id(
        _LAB_LAP,
        _LAB,
        "Follow a small square with a laboratory arm at 500 Hz",
        "A laboratory arm of 0.4 m reach, with its maker's limits of current and bend, its encoders and strain gauges, "
        "and no sensor of the tip. The square of 9 cm lies before the shoulder, so that both joints stay within a "
        "quarter turn. Dry friction holds the shoulder against 44 % of its largest torque.",
    ),
    "Carry-v0": Id(
        _CARRY_LAP,
        {
            "arm": {"payload_mass": 0.85},
            "payload_changes": ((5 / 24, None), (17 / 24, 0.0)),
            "randomisation": {"payload_mass": (0.2, 1.5)},
            "reference": "stops",
            "lap_time": 24.0,
            "observation": (*DEFAULT_OBSERVATION, "lap_phase"),
        },
        "Take up a payload of unknown mass at one corner and put it down at another",
        "The task of handling: the tip moves from corner to corner of the square, and rests for 2 s at each. In the "
        "middle of the first rest it takes up a payload that each episode draws, in the middle of the third it puts it "
        "down. The mass arrives with the tip's velocity, so that no impulse acts, but the arm that moves on is another "
        "one. What counts is how soon the tip rests, how far it vibrates then, and how much the links are stressed.",
    ),
    "Race-v0": Id(
        _RACE,
        {
            "action_mode": "race",
            "start": "corner",
            "previews": (0.5, 1.0, 2.0, 3.0, 4.5, 6.0, 10.0),
            "reward_weights": {"progress": 1.0},
            "elbow_branch": "negative",
            "error_limit": 0.25,
        },
        "Go round the square three times, as fast as you can, within 25 cm of the target",
        "The race: there is no clock. A third number of the action is the speed at which the reference moves along the "
        "square (contouring control with progress as an action), and a tip that is 0.25 m off it is out. "
        "The reward is progress, as a share of the fastest; previews are by distance along the path. What counts is "
        "the time of the first lap, from rest, of the fastest, and of all three. The path may be any closed one.",
    ),
    "Paper-v0": Id(
        _PAPER_LAP,
        _PAPER,
        "Set the gain of the paper's law at 1 kHz, in the paper's own set-up",
        "What `make reproduce` runs: the paper's arm, its late, noncollocated sensor in the loop, no torque "
        "limit. Only an invalid state ends an episode. theta2 > 0 at the start is our reading of the paper.",
    ),
}


def warn_of_short_limit(spec: EnvSpec | None, steps: int | None, lap_steps: int) -> None:
    """Warn if the time limit with which an id is registered is shorter than a lap.

    Both are numbers of control periods, and other options can make a lap longer. A limit that differs from the
    registered one is the user's choice and gives no warning.
    """
    one = IDS.get(spec.id.removeprefix(f"{NAMESPACE}/")) if spec is not None else None
    if spec is not None and one is not None and steps == one.steps < lap_steps:
        gymnasium.logger.warn(
            f"{spec.id}: the registered limit of {steps} control periods is shorter than a lap of {lap_steps} with "
            f"these options; give make max_episode_steps={lap_steps} for a whole lap"
        )


def register_environments() -> None:
    """Register all ids with Gymnasium; repeated calls change nothing."""
    for name, one in IDS.items():
        if f"{NAMESPACE}/{name}" not in gymnasium.registry:
            gymnasium.register(
                id=f"{NAMESPACE}/{name}",
                entry_point=one.entry,
                vector_entry_point=one.batch_entry,
                max_episode_steps=one.steps,
                kwargs=one.options,
            )
