"""Texts of the environments' documentation that hold for all ids, in Markdown; `documentation` puts them together."""

from __future__ import annotations

from flexarm_env.envs.sensors import FURTHER
from flexarm_env.laps import LAPS
from flexarm_env.physics.inverse_kinematics import STRAIGHT

ACTION = """\
An action is an array of float32 in [-1, 1]. It is held for one control period and takes effect `actuation_delay`
seconds after it is given; an inner control law acts without that delay. `flexarm_env.actions.physical_from_action`
converts actions to physical values, `action_from_physical` converts back. Values outside [-1, 1] are clipped; values
that are not finite raise an error."""
OBSERVATION = """\
An observation is an array of float32: the blocks named by the option `observation`, in that order. With `scaled`, each
block is divided by its scale. `env.unwrapped.observation_blocks` has the slice of each block, `observation_scale` the
divisor of each number. Each number stays within its bound until the episode ends. In the table of blocks the column
`reads` names the sensor behind a block. A policy that observes `state` is privileged. The strain gauges of `Square-v0`
have no noise: with the encoders they give the same state. `SquareEncoders-v0`, `SquareUnknown-v0` and the ids
`SquareDelay...` have none."""
FRAMES = """\
All units are SI. theta1 is the angle from the world's x axis to the root of link 1, theta2 the angle from the tangent
at link 1's tip to the root of link 2. Blocks in m and m/s are x and y with the shoulder as origin. With
`frame="link"` the x axis lies along the root of link 1: coordinates are turned by minus the measured theta1. With
`frame="world"` they are not turned. There is no gravity, so in the link's frame the four sides of the square look
alike. Infos always use the world's frame."""
BRANCHES = f"""\
The rigid arm reaches a point with its elbow on either side: theta2 > 0 or theta2 < 0. `elbow_branch` chooses the side
of an episode. `joint_error`, the joint-space law, drawn moves and starts use that side throughout. The elbow may swing
through the straight arm to the other side, and good plans do so at corners; `joint_error` still refers to the chosen
side. `present_joint_error` and `present_joint_error_rate` refer to the side that the encoders measure. That is the sign
of sin(theta2) when the elbow was last more than {STRAIGHT:g} rad away from the straight and from the folded arm. Before
that it is `elbow_branch`. `info["elbow_side"]` is the same sign for the true angle, and 0 before."""
PARAGRAPHS = "\n\n".join(sensor.text for sensor in FURTHER)
LATENESS = f"""\
Encoders and strain gauges are not late, and the gauges have no noise. The position sensor on link 2 is late: at the
end of each control period, its reading of `delay` seconds ago arrives, not rounded to integration steps. If `delay` is
None, it is the distance from the shoulder to the sensor over the wave speed: 31.2 ms for a sensor at the tip. The
"rigid" sensor computes the position from joint angles, each with a delay of its own.

- `jitter` adds to the delay of each reading an amount drawn uniformly from 0 to that value.
- `sensor_period` is the period of a slower clock: readings are taken at its ticks only.
- `dropout` is the probability that a reading is lost; the one before then stays.
- `outage_duration` is how long no reading is taken, from `outage_time` on.

A reading is ignored unless it is newer than the one before by half a control period. `sensor_error` compares a reading,
when it arrives, with the target of `delay` seconds ago; with a clock, with the target at the newest tick of then. Where
nothing about the delay is drawn, that is when the reading was taken: for a "true" sensor at the tip, the default, it is
the exact error of a moment ago. A drawn delay, jitter and lost readings are not in it, nor in `sensor_error_rate`: a
controller has to find them, or to observe `reading_age`, the readings' time stamps. For a sensor elsewhere on link 2
`sensor_error` is the vector from that point to where the *tip* should be; for the "rigid" sensor it mixes two moments.

{PARAGRAPHS}"""
RACE = """\
A race (`action_mode="race"`) has no clock. The target rests at first, and the third number of the action is the speed
at which it moves along the path. That speed changes by `reference_acceleration` times the control period at most.
Previews are by distance, with horizons in m. Errors of late readings are from the present target. The path may be any
closed one; its length counts, not its times. `info["lap_times"]` has the times of the first lap, of the fastest, and of
all, to the instant at which the target ends them. A lost race has no time."""
DISTURBANCES = """\
`pulse_force` pushes the tip, once or every `pulse_period` seconds. Its generalised force is the tip's Jacobian
transposed times it, so that it does the work of the force; an accelerometer feels it. `gauge_drift` moves what strain
gauges read of the links' first modes away from the state. `payload_changes` gives the tip a mass, or takes it: the
rates stay and the momenta change, since the mass arrives with the tip's velocity. `randomisation` draws the numbers of
all of them but the last, whose mass may be the episode's `payload_mass`."""
MIRROR = """\
The mirror image of a motion is a motion, since there is no gravity. Reflect an episode about the world's x axis: the
start corner, the direction of the lap, `elbow_branch`, and the signs of the state's angles and modal coordinates.
Without noise, the mirrored actions then give the mirrored observations and the same rewards, bit for bit. In the tables
of actions and blocks the column `mirrored` has the sign of each number, repeated over its block.
`env.unwrapped.mirror_observation` and `mirror_action` apply the signs to one sample or to a batch; `observation_mirror`
and `action_mirror` hold them, for tensors of other libraries. A learner can double its samples by mirroring them, and a
policy between the two maps can drive the mirrored laps."""
REWARD = """\
The reward uses the true tip, whatever the sensors read; e is its distance from the target after the step. The reward
is a sum of terms in [0, 1], each times its weight (`reward_weights`). No term is negative, so with the
default weights ending an episode early never pays; with weights below 0 it can. The function `reward` replaces the sum,
and `termination` ends further episodes. Each is called once a step with the quantities of the infos of the whole batch
(of a single environment as a batch of one); `info` keeps the weighted terms."""
LAP_LIST = "\n".join(f"- The *{name} lap*: {lap.text}." for name, lap in LAPS.items())
SCORE = f"""\
The reward trains; the score compares. A lap from rest is decided mostly by its start: the target leaves at full
speed, and how well the arm can follow depends on the side of its elbow. The standard score therefore has two laps
(`flexarm_env.laps.LAPS`):

{LAP_LIST}

Report whether the lap was completed and three distances of the true tip from the target: r.m.s. over the lap, r.m.s.
after the first 2 s, and the maximum. `flexarm_agents.evaluate(env, policy)` computes them.
`flexarm_env.rollout.run_policy(env, policy, lap="swing")` runs one lap, and
`env.reset(options=LAPS["swing"].reset_options())` begins one. A lost lap has no score;
`run.notes["ended"]` has the reason."""
ENDING = """\
`max_episode_steps` truncates an episode. An episode terminates for one of the reasons below. `error_limit` and
`deflection_limit` belong to the task: a learner that has lost the path does not spend the rest of the lap far from it,
and links bent further are outside linear elasticity. A race that is `finished` is done, and `own` is the user's. The
other reasons mean that the state is no longer valid; the reward of that step is 0, and its observation is the last
valid one.

`info["end_code"]` is the reason's code in the step that terminates the episode, else 0; `flexarm_env.end_reason`
returns its name. A time limit has no code, since Gymnasium's `TimeLimit` ends a single environment from outside: at the
end of an episode, 0 means that the time limit truncated it."""
INFO = """\
An info has the same keys after a reset and after every step. Each value is a float64 or an array of float64; in a batch
each key has an array with a row for each arm."""
EPISODE = """\
`env.unwrapped.episode` describes the present episode: what was drawn or chosen at its reset. In a batch it has arrays
of shape (N,), and from the step that begins the next episode it describes that one."""
SEEDS = """\
`reset(seed=s)` seeds `np_random`, and every reset, seeded or not, draws one key from it. All that is random in an
episode (start, drawn quantities, noise, jitter, lost readings) is a hash of that key and a counter. Key and actions
alone therefore determine the episode, on any thread and in a batch of any size. Environment i of a batch seeded with s
is the single environment seeded with s + i, bit for bit."""
