"""Write docs/environments: an index, and for each id a page and a moving picture, all from the code's declarations."""

from __future__ import annotations

import json
import re
import textwrap
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tyro

from flexarm_env.envs import documentation as doc
from flexarm_env.envs.batch import COSTS
from flexarm_env.envs.per_env import OPTIONS as PER_ENV
from flexarm_env.envs.registration import IDS, NAMESPACE, Id
from flexarm_env.envs.settings import Settings
from flexarm_env.envs.single import FlexArmEnv
from flexarm_env.envs.vector import FlexArmVectorEnv
from scripts.common.command_line import run
from scripts.common.markdown import DOCS
from scripts.docs import chain_figures
from scripts.docs.env_pictures import PICTURES, frames, write_moving

PAGES = DOCS / "environments"
WIDTH = 118  # of prose
_LANES = " or ".join(", ".join(map(str, COSTS)).rsplit(", ", 1))
_INTRODUCTION = """\
A very flexible two-link arm in the plane, 9 m long, whose tip should follow a path. What an action is, what an
observation holds, what is random and what is rewarded are options; the ids are choices of them. `help(env.unwrapped)`
shows the whole family's specification."""
_BATCH = """\
A batch is one environment that steps all its arms in the same compiled loop, far faster than as many single ones; its
observations, rewards and flags are arrays with a row for each arm:"""
_AUTORESET = """\
With `NextStep`, Gymnasium's default, the step after an episode's end begins the next one: its action is not read, its
reward is 0, its info is a reset's. In `infos`, `_name` says which environments have `name`; these masks are shared
among keys and cannot be written to. With `SameStep` the step that ends an episode returns the next one's first
observation; the last one is in `infos["final_obs"][i]`, with its info in `infos["final_info"]`. TorchRL takes
`SameStep` or `Disabled` only. The mode is an argument of the environment here, not of `vector_kwargs`, which
Gymnasium's `SyncVectorEnv` and `AsyncVectorEnv` take (`vectorization_mode="sync"`):"""
_KERNELS = f"""\
How many arms a batch has selects its kernel, for blocks of {_LANES}; one environment has its own. Each is
compiled once for each kind of environment, in 6 to 8 s of one core, and kept: a sweep over sizes compiles several.
`flexarm warm-up Square-v0 --num-envs 1 64 1024` does so ahead."""
_LEARNER = """\
Stable-Baselines3 takes a batch through `flexarm_agents.FlexArmVecEnv` (extra `train`). Call `torch.set_num_threads(1)`
before the training: several threads are no faster on small networks, and many times slower where other work runs.
`set_options({"parameters": {"delay": 0.02}})` is for the episodes that the next `reset()` begins; for other options
from then on, as in a curriculum, make another batch and give it to the model:"""
_CURRICULUM = f"""\
```python
import torch
from flexarm_agents import FlexArmVecEnv
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecMonitor

torch.set_num_threads(1)
easy, hard = (
    VecMonitor(FlexArmVecEnv.make("{NAMESPACE}/Square-v0", num_envs=16, error_limit=limit)) for limit in (5.0, 2.5)
)
model = PPO("MlpPolicy", easy, n_steps=64, batch_size=1024, device="cpu")
model.learn(1024)
model.set_env(hard)
model.learn(1024, reset_num_timesteps=False)
```"""
_PER_ENV = """\
With `per_env`, the environments of a batch have options of their own, for a robustness sweep, say: a list for each
option, with a value for each environment. Environment i is then the single one made with its options, to the last bit.
What selects kernels, the shapes, the links' lengths, the kinematics and the integration step are the batch's; where
arms ask for different steps, give all the same `physics_step`. The observation space has the widest bounds."""
_SWEEP = f"""\
```python
import gymnasium

envs = gymnasium.make_vec(
    "flexarm_env:{NAMESPACE}/Square-v0",
    num_envs=3,
    per_env={{"jitter": [0.0, 0.01, 0.02], "arm": [{{}}, {{"payload_mass": 0.5}}, {{"joint_friction": (1.0, 1.0)}}]}},
)
observations, infos = envs.reset(seed=0)
```"""
_OWN_OPTIONS = f"These options can differ: {', '.join(f'`{name}`' for name in PER_ENV)}."
_NAMING = """\
The part before the colon imports the package, so that it works in spawned processes too. Every argument of the pages'
tables can be given to `make` and `make_vec`. The ids differ in their options only; a version number goes up when an
id's dynamics, observation or reward changes."""

_ARMS = """\
An arm has a name, `arm="linear"`, or is a mapping of parameters, which `preset` may name a set for:
`arm={"preset": "linear", "payload_mass": 0.5}`; without it, the others are those of `"default"`."""

_ARM = """\
A mapping takes the fields of `flexarm_env.ArmParameters`, whose docstring says what each is. A range ends far from
any arm that is built; what only a combination spoils (masses too far apart for double precision, a mode so fast that
a control period takes more than 20 000 integration steps) is refused with the numbers that decide it."""

_RESET = "`reset(options=...)` takes:"
_CHAIN_SCORES = """\
The same controllers on the chain and on the default arm: shipped agents by torques, without noise, and IFDC by
`action_mode="gain"`. Encoders and gauges of the chain read fast vibrations that the default arm does not have; the PPO
agent, which has been on that arm alone, reacts to them and is worse there."""
_CHAIN_STEPS = """\
MuJoCo's `implicitfast`, semi-implicit Euler with implicit dampers, is of first order. Runge-Kutta's method is
unstable even at 0.05 ms, since dampers of the material make the fastest segments stiff. A step of 0.5 ms is within a
millimetre (r.m.s.) of finer ones, 20 segments within half a millimetre. The laps are swing laps of the shipped
`student_unknown`, its loop closed on each chain. Steps per second are control periods by the processor time of one
core, while `python -m scripts.docs.chain_figures` made the tables."""


@dataclass
class Options:
    """Write the pages and pictures of docs/environments."""

    docs: Path = PAGES
    """The folder to write to."""
    pictures: bool = True
    """Draw the pictures too (needs the extra `render`)."""


# --- pages ---------------------------------------------------------------------------------------------------------


def pages() -> dict[str, str]:
    """All pages by file name."""
    return {"README.md": index()} | {f"{stem(name)}.md": page(name, one) for name, one in IDS.items()}


def stem(name: str) -> str:
    """File name of an id's page, without its ending: the versions of an environment share a page."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name.partition("-")[0]).lower()


def index() -> str:
    """Write the page of what all environments have in common."""
    vector = FlexArmVectorEnv.__init__.__doc__ or ""
    sections = {
        "Make one": [snippet("Square-v0"), _NAMING],
        "Make a batch": [
            *(_BATCH, _batch(), doc.parameter_table(vector), _KERNELS),
            *(_AUTORESET, _batch(autoreset_mode="SameStep"), _LEARNER, _CURRICULUM),
        ],
        "Environments that differ": [_PER_ENV, _SWEEP, _wrapped(_OWN_OPTIONS)],
        "Arms": [_ARMS, doc.preset_table(), _ARM, doc.arm_table()],
        "Frames and units": [doc.FRAMES],
        "The side of the elbow": [doc.BRANCHES],
        "The late sensor": [doc.LATENESS],
        "Mirror images": [doc.MIRROR],
        "Reward and score": [doc.REWARD, doc.SCORE],
        "How an episode starts": [doc.start_table(), _RESET, doc.option_table()],
        "How it ends": [doc.ENDING, doc.end_table()],
        "Seeds": [doc.SEEDS],
    }
    return _assembled("Environments", [_INTRODUCTION, _ids()], sections)


def page(name: str, one: Id) -> str:
    """Write the page of an id."""
    settings = Settings.of(one.options)
    changed = ", ".join(f"`{option}`" for option in one.options)
    arguments = [_wrapped(f"It differs from `{NAMESPACE}/Square-v0` in {changed}.")] if changed else []
    sections = {
        "Description": [_wrapped(one.text), snippet(name)],
        "Action space": [doc.ACTION, _mode(settings), doc.action_table(settings)],
        "Observation space": [doc.BLOCK_RULES, _pointers(settings), doc.block_table(settings)],
        "Reward": [doc.REWARD, doc.reward_table(settings), doc.SCORE if settings.paths else ""],
        "Starting state": [f'Here `start` is `"{settings.start}"`.', doc.start_table(), _RESET, doc.option_table()],
        "Episode end": [doc.ENDING, doc.end_table(settings)],
        "Info": [doc.INFO, doc.info_table(settings)],
        "The episode": [doc.EPISODE, doc.episode_table()],
        "Arguments": [*arguments, doc.argument_table(settings, one.options)],
        **({"Arguments of its own": [doc.own_table(one.options_of)]} if one.options_of else {}),
        **(_chain_sections() if name == chain_figures.CHAIN else {}),
        "Version history": ["\n".join(f"- {version}" for version in one.history)],
    }
    picture = f"![{NAMESPACE}/{name}]({stem(name)}.webp)\n\n*{PICTURES[name].caption}*"
    family = "[FlexArm's environments](README.md) explains what they share: batches, frames, the late sensor, seeds."
    return _assembled(
        f"{NAMESPACE}/{name}", [_wrapped(f"{one.summary}. {family}"), picture, _facts(name, one)], sections
    )


def _chain_sections() -> dict[str, list[str]]:
    """Return what was measured of the chain."""
    found = json.loads(chain_figures.FILE.read_text())
    return {
        "Scores beside the default arm's": [_CHAIN_SCORES, chain_figures.score_table(found)],
        "How fine the chain is": [
            _CHAIN_STEPS,
            chain_figures.convergence_table(found, "steps"),
            chain_figures.convergence_table(found, "segments"),
        ],
    }


def snippet(name: str) -> str:
    """Write a first program."""
    return f"""\
```python
import gymnasium

env = gymnasium.make("flexarm_env:{NAMESPACE}/{name}")
observation, info = env.reset(seed=0)
for _ in range(100):
    observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
    if terminated or truncated:
        observation, info = env.reset()
```"""


def _batch(**arguments: Any) -> str:
    given = "".join(f', {name}="{value}"' for name, value in arguments.items())
    call = f'gymnasium.make_vec("flexarm_env:{NAMESPACE}/Square-v0", num_envs=16{given})'
    lines = [
        "import gymnasium",
        "",
        f"envs = {call}",
        "observations, infos = envs.reset(seed=0)",
        "for _ in range(100):",
    ]
    lines.append("    observations, rewards, terminated, truncated, infos = envs.step(envs.action_space.sample())")
    if arguments:
        lines += ["    for i in (terminated | truncated).nonzero()[0]:", '        last = infos["final_obs"][i]']
    return "\n".join(["```python", *lines, "```"])


def _ids() -> str:
    rows = []
    for name, one in IDS.items():
        env = FlexArmEnv(**one.options)
        sizes = [space.shape[0] for space in (env.action_space, env.observation_space) if space.shape]
        link = f"[`{NAMESPACE}/{name}`]({stem(name)}.md)"
        rows.append((link, one.summary, env.settings.action_mode, *map(str, sizes), _milliseconds(env.settings)))
    return doc.table(("id", "task", "action is", "actions", "observations", "control period"), rows)


def _facts(name: str, one: Id) -> str:
    env = FlexArmEnv(**one.options)
    period, shape = env.settings.control_period, env.observation_space.shape
    rows = [
        ("Observation space", f"`Box({shape}, float32)`"),
        ("Control period", _milliseconds(env.settings)),
        ("Integration", _integration(env.settings)),
        ("Episode", f"{one.steps} steps, {doc.figure(one.steps * period)} s"),
        ("Import", f'`gymnasium.make("flexarm_env:{NAMESPACE}/{name}")`'),
        ("Batch", f'`gymnasium.make_vec("flexarm_env:{NAMESPACE}/{name}", num_envs=16)`'),
    ]
    if one.extra:
        rows.append(("Install", f'`pip install -e ".[{one.extra}]"` in a clone'))
    return doc.table(("Action space", f"`{env.action_space}`"), rows)


def _integration(settings: Settings) -> str:
    step = 1e3 * settings.control_period / settings.substeps
    return f"{settings.substeps} steps of {doc.figure(step)} ms in a control period"


def _milliseconds(settings: Settings) -> str:
    return f"{doc.figure(1e3 * settings.control_period)} ms"


def _pointers(settings: Settings) -> str:
    text = f"Blocks in m and m/s are in the {settings.frame}'s frame ([frames and units](README.md#frames-and-units))."
    if any(block.startswith("sens") for block in settings.observation):
        delays = settings.sensor_parameters.joint_delays(settings.flexible_arm.parameters.link_lengths[0])
        shoulder, elbow = (f"{doc.figure(1e3 * delay)} ms" for delay in delays)
        late = shoulder if shoulder == elbow else f"{shoulder} (shoulder's angle) and {elbow} (elbow's)"
        text += f" The sensor on link 2 is {late} late ([the late sensor](README.md#the-late-sensor))."
    text += " The column `mirrored` has the signs of a [mirror image](README.md#mirror-images)."
    return _wrapped(text)


def _mode(settings: Settings) -> str:
    return _wrapped(f'`action_mode` is `"{settings.action_mode}"`: {settings.mode.text}.')


def _wrapped(text: str) -> str:
    return textwrap.fill(text, WIDTH, break_long_words=False, break_on_hyphens=False)


def _assembled(title: str, top: list[str], sections: dict[str, list[str]]) -> str:
    parts = [f"<!-- written by scripts/docs/environments.py -->\n\n# {title}", *top]
    for name, paragraphs in sections.items():
        parts += [f"## {name}", *paragraphs]
    return "\n\n".join(part.strip() for part in parts if part) + "\n"


def main() -> None:
    """Command line."""
    options = tyro.cli(Options, prog="python -m scripts.docs.environments")
    options.docs.mkdir(parents=True, exist_ok=True)
    for name, text in pages().items():
        (options.docs / name).write_text(text, encoding="utf-8")
    print(f"{options.docs}: {len(IDS) + 1} pages up to date")
    if options.pictures:
        for name in IDS:
            write_moving(options.docs / f"{stem(name)}.webp", frames(name))
        print(f"{options.docs}: {len(IDS)} pictures up to date")


if __name__ == "__main__":
    run(main)
