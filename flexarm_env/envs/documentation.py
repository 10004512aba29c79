"""The environments' documentation in Markdown, made from the declarations that the code itself reads.

All functions are pure. The tables come from `options`, `observation`, `reward`, `reset_options`, `info` and
`registration`. The texts that hold for all environments are here, for `FlexArmEnv`'s docstring and for the pages under
docs/environments (scripts/docs/environments.py).
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields
from typing import Any

import numpy as np

from flexarm_env.actions import MODES, ActionMode, modes_reading
from flexarm_env.envs.blocks import BLOCKS
from flexarm_env.envs.choices import DEFAULT_WEIGHTS, STARTS
from flexarm_env.envs.info import KEYS, Episode, info_keys
from flexarm_env.envs.observation import observation_layout
from flexarm_env.envs.registration import IDS, NAMESPACE
from flexarm_env.envs.reset_options import OPTIONS
from flexarm_env.envs.settings import Settings, default_of
from flexarm_env.envs.termination import END_CODES, ENDS
from flexarm_env.episode.reward import TERMS
from flexarm_env.laps import LAPS
from flexarm_env.parameters import PRESETS, ArmParameters
from flexarm_env.physics.inverse_kinematics import STRAIGHT

# Texts that hold for all environments.
ACTION = """\
An action is an array of float32 in [-1, 1], held for one control period (from `actuation_delay` after it is given; an
inner law itself acts without delay). `flexarm_env.actions.physical_from_action` is the map below, with its inverse.
What is beyond that range is limited, for policies that draw from a Gaussian; what is not finite is refused."""
BRANCHES = f"""\
The rigid arm can be on the reference with its elbow on either side. `joint_error`, the joint-space law, drawn moves
and starts use the side of `elbow_branch`, all the episode long. The elbow may swing through the straight arm to the
other side, and good plans do so at corners; `joint_error` still refers to the first side. `present_joint_error` and
`present_joint_error_rate` are on the side that the encoders measure: the sign of sin(theta2) when it was last
bent by more than {STRAIGHT:g} rad, off the straight and off the folded arm, and `elbow_branch` before.
`info["elbow_side"]` follows the same rule with the true angle, and is 0 before."""
FRAMES = """\
All units are SI. theta1 is the angle of link 1's root from the world's x axis, theta2 that of link 2's root from the
tangent at link 1's tip. Blocks in m and m/s are x and y in a frame whose origin is the shoulder: with `frame="link"`
its x axis lies along the root of link 1 (the world turned by the measured -theta1), with `frame="world"` nothing is
turned. Without gravity no direction is special, so in the link's frame the four sides of the square look alike.
Infos are always in the world's frame."""
BLOCK_RULES = """\
An observation is an array of float32: the blocks that `observation` names, one after the other, each divided by its
scale where `scaled` is set. `env.unwrapped.observation_blocks` says where each lies, `observation_scale` what each
number was divided by. No number passes its bound before the episode ends. The column `reads` says what
a block measures; no sensor delivers the true state, so a policy that observes `state` is privileged."""
MIRROR = """\
Without gravity the mirror image of a motion is a motion. Reflect an episode about the world's x axis: the start
corner, the direction of the reference, `elbow_branch`, and the signs of the state's angles and modal coordinates.
Without noise, the mirrored actions then give the mirrored observations and the same rewards, to the last bit. The
column `mirrored` shows the sign of each number, repeated over a block. `env.unwrapped.mirror_observation` and
`mirror_action` apply the signs, to one or to a batch; `observation_mirror` and `action_mirror` hold them, for tensors
of other libraries. Mirrored samples double a learner's data, and a policy between the two maps drives the mirrored
laps."""
LATENESS = """\
Encoders and strain gauges are current, and the gauges ideal; the sensor on link 2 is late. At the end of each control
period its reading of `delay` seconds ago arrives, not rounded to steps; if `delay` is None, that is the distance from
the shoulder over the wave speed (31.2 ms for a sensor at the tip; the "rigid" sensor reads the elbow's angle after a
delay of its own, the way from the elbow). `jitter` makes each reading older by an amount drawn evenly up to that;
with `hold`, readings are taken at the ticks of a slower clock only; with probability `dropout` none arrives, and the
last one stays. A reading that is not newer than the last one by half a control period is passed over. `sensor_error`
compares a reading with where the reference was when it was taken. For a "true" sensor at the tip, the default, it is
thus the exact error of a moment ago, not a wrong one of now; elsewhere on link 2 it is the way from that point to
where the *tip* should be, and the "rigid" sensor mixes two moments.

`second_sensor_link` adds a second position sensor on either link, for comparisons of sensor sets. It sees the true
point at `second_sensor_position`, `second_sensor_delay` ago, with noise of its own (`second_sensor_noise`), at every
control instant; `jitter`, `hold`, `dropout` and a drawn `delay` concern the first sensor only. `second_sensor_error`
compares a reading with where the *same point* of the rigid arm on the reference was when it was taken: it is 0 where
the arm is unbent and on the reference, wherever the sensor is."""
REWARD = """\
The reward judges the state after the step, by the true tip (e: its distance from the reference), whatever the sensors
see. It is the sum of terms in [0, 1] times their weights (`reward_weights`). None is negative, so ending an episode
early never pays."""
SCORE = f"""\
A lap from rest is scored mostly by its start: the reference leaves at full speed at once, and the side of the elbow
decides how well an arm can follow. So the standard score is two laps, `flexarm_env.laps.LAPS`:

{
    '''
'''.join(f"- the *{name} lap*: {lap.text}." for name, lap in LAPS.items())
}

Give three figures of each: the r.m.s. distance of the true tip from the reference over the lap, the same since 2 s, and
the maximum. `flexarm_agents.evaluate(env, policy)` computes them; `run_policy(env, policy, lap="swing")` of
`flexarm_env.rollout` runs one lap, and `env.reset(options=LAPS["swing"].reset_options())` begins it. A run that ended
early has no lap score; `run.notes["ended"]` says why."""
ENDING = """\
An episode terminates for one of the reasons below. `error_limit` and `deflection_limit` are part of the task: a
learner that has lost the path does not spend the rest of the lap far off it, and links bent so far are beyond what
linear elasticity describes. The other reasons say that the state is no longer valid; the reward of that step is 0,
and its observation is the last valid one. `max_episode_steps` truncates an episode.

`info["end_code"]` is the code of the reason at the step that terminates the episode, else 0;
`flexarm_env.end_reason` gives its name. A time limit has no code: Gymnasium's `TimeLimit` ends a single environment
from outside, and infos of single environments and of batches are the same. At an episode's end 0 thus means that the
time limit truncated it."""
INFO = """\
An info has the same keys after a reset and after every step; each value is a float64 or an array of them. In a batch
each key holds an array with a row for each arm."""
EPISODE = """\
What describes the episode as a whole is `env.unwrapped.episode` (of a batch: arrays of shape (N,)), from each reset to
the next one. Where a step begins the next episode, it describes that one:"""
SEEDS = """\
`reset(seed=s)` seeds `np_random`, of which every reset, seeded or not, draws one key. All that is random in an
episode (start, drawn quantities, noise, jitter, dropouts) is a hash of that key and a counter: key and actions alone
determine the episode, on any thread and in a batch of any size. Environment i of a batch seeded with s is the single
environment seeded with s + i, to the last bit."""


def specification(introduction: str) -> str:
    """Write `FlexArmEnv`'s docstring from the declarations; it computes no physics, so that imports stay fast.

    Args:
        introduction: the text that precedes the sections.
    """
    first, _, rest = inspect.cleandoc(introduction).partition("\n")
    sections = {
        "Description": rest,
        "Ids": table(("id", "task"), ((f"`{NAMESPACE}/{name}`", one.summary) for name, one in IDS.items())),
        "Action space": f"{ACTION}\n\n{action_table()}",
        "Observation space": f"{BLOCK_RULES}\n\n{FRAMES}\n\n{BRANCHES}\n\n{LATENESS}\n\n{MIRROR}\n\n{block_table()}",
        "Reward": f"{REWARD}\n\n{reward_table()}\n\n{SCORE}",
        "Starting state": start_table(),
        "Episode end": f"{ENDING}\n\n{end_table()}",
        "Info": f"{INFO}\n\n{info_table()}",
        "The episode": f"{EPISODE}\n\n{episode_table()}",
        "Arguments": f"With the defaults of `{NAMESPACE}/Square-v0`:\n\n{argument_table()}",
        "Reset options": f"{option_table()}\n\n{SEEDS}",
        "Version history": "\n".join(f"- `{NAMESPACE}/{name}`: {'; '.join(one.history)}" for name, one in IDS.items()),
    }
    return f"{first}\n\n" + "\n\n".join(f"## {title}\n\n{text.strip()}" for title, text in sections.items()) + "\n"


# --- tables --------------------------------------------------------------------------------------------------------


def action_table(settings: Settings | None = None) -> str:
    """Tabulate what an action means: in each action mode, or with numbers in that of `settings`."""
    if settings is None:
        header = ("`action_mode`", "an action is", "of", "quantity", "action", "unit", "mirrored")
        modes = MODES.items()
        return table(header, [(f"`{name}`", one.text, ", ".join(one.channels), *_formulas(one)) for name, one in modes])
    mode = settings.mode
    rows = [
        (str(n), channel, figure(mode.least * limit), figure(limit), *_formulas(mode))
        for n, (channel, limit) in enumerate(zip(mode.channels, settings.action_limit, strict=True))
    ]
    return table(("number", "of", "at a = -1", "at a = 1", "quantity", "action", "unit", "mirrored"), rows)


def _formulas(mode: ActionMode) -> tuple[str, str, str, str]:
    """Write the map between action and quantity, the unit, and the sign of a mirrored action."""
    return f"`{mode.quantity} = {mode.formula}`", f"`a = {mode.inverse}`", mode.unit, _signs((mode.mirror,))


def _signs(signs: tuple[int, ...]) -> str:
    """Write the signs of numbers in the mirrored episode."""
    return ", ".join("+" if sign > 0 else "-" for sign in signs)


def _only_in(modes: Sequence[str]) -> str:
    return f" (only in mode {' or '.join(modes)})" if len(modes) < len(MODES) else ""


def block_table(settings: Settings | None = None) -> str:
    """Tabulate the blocks of observations: all blocks, or with places and numbers those of `settings`."""
    if settings is None:
        rows = [
            (
                f"`{name}`",
                block.count,
                block.what + _only_in(block.modes),
                block.unit,
                block.reads or "",
                "as the action" if block.mirror is None else _signs(block.mirror),
            )
            for name, block in BLOCKS.items()
        ]
        return table(("block", "numbers (m modes a link)", "what", "unit", "reads", "mirrored"), rows)
    layout = observation_layout(settings, settings.program)
    header = ["numbers", "block", "what", "unit", "reads", "mirrored", "bound"] + ["scale"] * settings.scaled
    numbers = []
    for name, part in layout.blocks.items():
        block, scale = BLOCKS[name], layout.scale[part]
        cells = [
            f"`{part.start}:{part.stop}`",
            f"`{name}`",
            block.what,
            block.unit,
            block.reads or "",
            _signs(block.mirror or (settings.mode.mirror,)),
            figures(layout.bound[part] * scale),
        ]
        numbers.append(cells + [figures(scale)] * settings.scaled)
    return table(header, numbers)


def reward_table(settings: Settings | None = None) -> str:
    """Tabulate the terms of the reward: all with their default weights, or those with a weight in `settings`."""
    weights = DEFAULT_WEIGHTS if settings is None else settings.reward_weights
    named = [(name, weights.get(name, 0.0), text) for name, text in TERMS.items()]
    rows = [(f"`{name}`", figure(weight), text) for name, weight, text in named if weight > 0.0 or settings is None]
    return table(("term", "weight", "what"), rows)


def start_table() -> str:
    """Tabulate how episodes start."""
    return table(("`start`", "the arm"), [(f'`"{name}"`', text) for name, text in STARTS.items()])


def end_table(settings: Settings | None = None) -> str:
    """Tabulate why episodes terminate, with the limits of `settings` if they are given."""
    texts = dict(ENDS)
    if settings is not None:
        for name, limit in (("error", settings.error_limit), ("deflection", settings.deflection_limit)):
            given = "none" if limit is None else f"{figure(limit)} m"
            texts[name] = texts[name].replace(f"`{name}_limit`", f"`{name}_limit` ({given})")
    return table(
        ("code", "reason", "when"), [(str(END_CODES[name]), f"`{name}`", text) for name, text in texts.items()]
    )


def info_table(settings: Settings | None = None) -> str:
    """Tabulate the keys of infos: all, or those that infos have with `settings`."""
    names = tuple(KEYS) if settings is None else info_keys(settings)
    rows = [(f"`{name}`", KEYS[name].what, KEYS[name].unit, "" if settings else KEYS[name].where) for name in names]
    return table(("key", "what", "unit", "only where"), rows)


def episode_table() -> str:
    """Tabulate the fields of `Episode`."""
    return parameter_table(inspect.getdoc(Episode) or "", "Attributes", "field")


def argument_table(settings: Settings | None = None, options: Mapping[str, Any] | None = None) -> str:
    """Tabulate the arguments of `make`: all, or those that have an effect with `settings`.

    Args:
        settings: settings of an id.
        options: options of the id; for the others the class's defaults are shown.
    """
    rows = []
    for one in fields(Settings):
        modes, allowed = modes_reading(one.name), one.metadata["allowed"]
        if settings is not None and settings.action_mode not in modes:
            continue
        value = (options or {}).get(one.name, default_of(one))
        text = one.metadata["text"] + (_only_in(modes) if settings is None else "")
        rows.append((f"`{one.name}`", f"`{_python(value)}`", allowed.unit, allowed.text, text))
    return table(("argument", "default", "unit", "allowed", "what"), rows)


def preset_table() -> str:
    """Arms by name: what `arm` takes as a string."""
    return table(("`arm`", "what"), [(f'`"{name}"`', preset.text) for name, preset in PRESETS.items()])


def arm_table() -> str:
    """Tabulate the parameters of the arm, which `arm` takes as a mapping."""
    rows = []
    for one in fields(ArmParameters):
        allowed = one.metadata["allowed"]
        rows.append((f"`{one.name}`", f"`{_python(default_of(one))}`", allowed.unit, allowed.text))
    return table(("parameter", "default", "unit", "allowed"), rows)


def own_table(options: type[Any]) -> str:
    """Options that an id has for itself: those of a class that declares them (`allowed.declared`)."""
    rows = []
    for one in fields(options):
        allowed = one.metadata["allowed"]
        rows.append((f"`{one.name}`", f"`{_python(one.default)}`", allowed.unit, allowed.text, one.metadata["text"]))
    return table(("argument", "default", "unit", "allowed", "what"), rows)


def option_table() -> str:
    """Tabulate the keys of `reset(options=...)`."""
    return table(("option", "what"), [(f"`{name}`", text) for name, text in OPTIONS.items()])


def parameter_table(docstring: str, section: str = "Args", kind: str = "argument") -> str:
    """Tabulate the arguments, or another section, of a docstring in Google's style.

    Args:
        docstring: the docstring, without indentation.
        section: title of the section.
        kind: header of the column of names.
    """
    text = docstring.partition(f"{section}:\n")[2]
    indent = re.match(r" *", text)
    assert indent is not None
    entry = re.compile(rf"^{indent[0]}(\w+): (.*(?:\n{indent[0]} +\S.*)*)", re.MULTILINE)
    rows = [(f"`{name}`", re.sub(r"\s+", " ", what).removesuffix(".")) for name, what in entry.findall(text)]
    return table((kind, "what"), rows)


# --- Markdown ------------------------------------------------------------------------------------------------------


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Write a table; columns without any text are left out."""
    body = [list(row) for row in rows]
    kept = [n for n in range(len(header)) if any(row[n] for row in body)]
    lines = [[header[n] for n in kept], ["---"] * len(kept)] + [[row[n] for n in kept] for row in body]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)


def figure(value: float) -> str:
    """Write a number with at most four significant digits; infinity is "none", no limit."""
    if np.isinf(value):
        return "none"
    return np.format_float_positional(value, precision=4, fractional=False, trim="-")


def figures(values: Iterable[float]) -> str:
    """Write numbers as `figure` does; one number if all are equal."""
    texts = [figure(value) for value in values]
    return texts[0] if len(set(texts)) == 1 else ", ".join(texts)


def _python(value: Any) -> str:
    return repr(value).replace("'", '"')
