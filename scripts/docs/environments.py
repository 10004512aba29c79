"""Write docs/environments: what all ids share, their options, and for each id a page and a moving picture."""

import re
import textwrap
from dataclasses import dataclass, fields
from pathlib import Path

from flexarm_env.envs import documentation as doc
from flexarm_env.envs import documentation_texts as texts
from flexarm_env.envs import option_types
from flexarm_env.envs.blocks import BLOCKS
from flexarm_env.envs.registration import IDS, NAMESPACE, ChainOptions, Id
from flexarm_env.envs.settings import Settings
from flexarm_env.envs.vector import FlexArmVectorEnv
from flexarm_env.parameters import ArmParameters
from scripts.common.command_line import read_options, run
from scripts.common.markdown import DOCS
from scripts.docs.env_pictures import PICTURES, frames, write
from scripts.docs.to_beat import best, to_beat

PAGES = DOCS / "environments"
WIDTH = 118  # of prose
_INTRODUCTION = """\
Which environments are there, and what do they share? All simulate a planar arm of two very flexible links, 9 m long
(`Lab-v0`: 0.4 m), whose tip should follow a path, and are one class (`SquareChain-v0`: a subclass). The ids differ in
its options: actions, sensors, what is drawn for each episode, path. Begin with `Square-v0`; `SquareUnknown-v0` ranks
the leaderboard ([concepts](../concepts.md)). [Options](options.md) lists all options, blocks of observations and keys
of infos; `flexarm show ID` prints the whole specification of an id, with the side of the elbow."""
_MAKE = """\
`gymnasium.make("flexarm_env:FlexArm/Square-v0", noise=0.002)`: the part before the colon imports the package, also in
spawned processes. Options are arguments of `make` and `make_vec`."""
_START = """\
The option `start` says how the arm begins an episode. `reset(options={"start": "corner"})` overrides it once, and
[other options of a reset](options.md#options-of-a-reset) choose time, path, direction, elbow, quantities or state."""
_BATCH = f"""\
`gymnasium.make_vec("flexarm_env:{NAMESPACE}/Square-v0", num_envs=16)` makes a [batch](../how_to/batch.md): one
environment that steps all its arms in one compiled loop. Observations, rewards and flags are arrays with a row for
each arm."""
_OPTIONS = """\
Which options does an environment have? Each is an argument of `make` and `make_vec`. The defaults here are those of
`FlexArm/Square-v0`; the page of an id lists those that it changes. [Environments](README.md) explains frames, delays,
starts and ends."""
_KEYS = "[Keys](options.md#keys-of-infos) lists them."
_ARMS = """\
`arm="linear"` selects an arm by its name. A mapping changes parameters of the default arm, or of the one that `preset`
names: `arm={"preset": "linear", "payload_mass": 0.5}`. [The default arm](../plant.md) gives the
reasons for the default, [published arms](../how_to/published_arms.md) the sources of the last four."""
_ARM = """\
The docstring of `flexarm_env.ArmParameters` explains each parameter. A combination that cannot be simulated raises an
error with the numbers that decide."""

_TERMS = re.compile(r"(\| `reward_\w+` .*\n)+")
_OF_A_TERM = (
    "| `reward_...` | each term of the reward times its weight; 0 after a reset | 1 | the term has a weight |\n"
)


@dataclass
class Options:
    """Write the pages and pictures of docs/environments."""

    docs: Path = PAGES
    """The folder to write to."""
    pictures: bool = True
    """Draw the pictures too (needs the extra `render`)."""


TYPES = Path(option_types.__file__)


def pages() -> dict[str, str]:
    """All pages by file name."""
    shared = {"README.md": index(), "options.md": options_page()}
    return shared | {f"{stem(name)}.md": page(name, one) for name, one in IDS.items()}


def types() -> str:
    """Return the module of the options' types. Its head stays; where an option keeps a tuple, a list is as good."""
    head, mark, _ = TYPES.read_text(encoding="utf-8").partition('Options`."""\n\n')
    declared = "".join(f"    {one.name}: {one.type}\n" for one in fields(Settings))
    return head + mark + re.sub(r"tuple\[(\w+), [^]]*", r"Sequence[\1", declared).replace("'", '"')


def stem(name: str) -> str:
    """File name of an id's page, without its ending: the versions of an environment share a page."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name.partition("-")[0]).lower()


def index() -> str:
    """Write the page of what all environments have in common."""
    vector = FlexArmVectorEnv.__init__.__doc__ or ""
    sections = {
        "Make one": [_MAKE],
        "Actions": [_wrapped(texts.ACTION, "[Action modes](options.md#action-modes) has the quantities and formulas.")],
        "Observations": [_wrapped(texts.OBSERVATION, "[Blocks](options.md#blocks-of-observations) lists them.")],
        "Reward and score": [texts.REWARD, doc.reward_table(), texts.SCORE],
        "How an episode starts": [_START, doc.start_table()],
        "How it ends": [texts.ENDING, doc.end_table()],
        "Seeds": [texts.SEEDS],
        "Infos": [_wrapped(texts.INFO, _KEYS), texts.EPISODE, doc.episode_table()],
        "Make a batch": [_BATCH, doc.parameter_table(vector)],
        "Frames and units": [texts.FRAMES],
        "The late sensor": [texts.LATENESS],
        "Disturbances": [texts.DISTURBANCES],
        "Mirror images": [texts.MIRROR],
    }
    ids = [(f"[`{NAMESPACE}/{name}`]({stem(name)}.md)", one.summary) for name, one in IDS.items()]
    return _assembled("Environments", [_INTRODUCTION, doc.table(("id", "task"), ids)], sections)


def options_page() -> str:
    """Write the reference of all options."""
    sections = {
        "Options of an environment": [doc.argument_table()],
        "Arms": [_ARMS, doc.preset_table(), _ARM, doc.declared_table(ArmParameters, "parameter")],
        "Action modes": [doc.action_table()],
        "Blocks of observations": [doc.block_table()],
        "Keys of infos": [_TERMS.sub(_OF_A_TERM, doc.info_table())],
        "Options of a reset": ["`reset(options=...)` takes:", doc.option_table()],
    }
    return _assembled("Options", [_OPTIONS], sections)


def page(name: str, one: Id) -> str:
    """Write the page of an id; the site appends the specification (`scripts.docs.widgets`)."""
    picture = f"![{NAMESPACE}/{name}]({stem(name)}.webp)\\\n*{PICTURES[name].caption}*"
    different = _chain() if one.options_of else doc.difference_table(one)
    different = re.sub(r"\d\.\d{9,}", lambda number: f"{float(number[0]):.4g}", different)  # of fractions
    sections = {"What is different from Square-v0": [different]} if different else {}
    parts = to_beat(name).split("\n\n")  # paragraphs and tables
    sections |= {"What to beat": [part if part.startswith("|") else _wrapped(part) for part in parts]}
    top = [_wrapped(f"{one.summary}. {best(name)}"), picture, _wrapped(one.text), _facts(name, one)]
    return _assembled(f"{NAMESPACE}/{name}", top, sections, f"specification of {name}, ")


def _chain() -> str:
    """Tabulate what the chain has in place of the arm."""
    rows = [("`arm`", "rigid segments", '`"default"`', "simulated by MuJoCo, with the default parameters")]
    for option in fields(ChainOptions):
        allowed, text = option.metadata["allowed"], option.metadata["text"]
        rows.append(
            (f"`{option.name}`", f"`{option.default}`", "", f"{text} ({allowed.text} {allowed.unit}".strip() + ")")
        )
    return doc.table(("option", "here", "in Square-v0", "meaning"), rows)


def _facts(name: str, one: Id) -> str:
    settings = Settings.of(one.options)
    actions, observations = doc.spaces(settings)
    readings = dict.fromkeys(BLOCKS[block].reads or "" for block in settings.observation)
    install = f', after `pip install -e ".[{one.extra}]"` in a clone' if one.extra else ""
    rows = [
        ("Observation", f"`{observations}`, from {', '.join(filter(None, readings))}"),
        ("Episode", _timing(one)),
        ("Make", f'`gymnasium.make("flexarm_env:{NAMESPACE}/{name}")`{install}'),
    ]
    return doc.table(("Action", f"`{actions}`"), rows)


def _timing(one: Id) -> str:
    text = re.sub(r"(?<=the tip )[\d.]+", lambda number: f"{max(float(number[0]), 1e-3):.2g}", doc.timing(one))
    step = f"MuJoCo in steps of {1e3 * ChainOptions().chain_step:g} ms"
    return re.sub(r"(?<=integrated by ).*", step, text) if one.options_of else text


def _wrapped(*parts: str) -> str:
    return textwrap.fill(" ".join(" ".join(parts).split()), WIDTH, break_long_words=False, break_on_hyphens=False)


def _assembled(title: str, top: list[str], sections: dict[str, list[str]], mark: str = "") -> str:
    parts = [f"<!-- {mark}written by scripts/docs/environments.py -->\n# {title}", *top]
    for name, paragraphs in sections.items():
        parts += [f"## {name}", *paragraphs]
    return "\n\n".join(part.strip() for part in parts) + "\n"


def main() -> None:
    """Command line."""
    options = read_options("python -m scripts.docs.environments", Options())
    options.docs.mkdir(parents=True, exist_ok=True)
    written = pages()
    TYPES.write_text(types(), encoding="utf-8")
    for name, text in written.items():
        (options.docs / name).write_text(text, encoding="utf-8")
    print(f"{options.docs}: {len(written)} pages up to date")
    if options.pictures:
        for name in IDS:
            write(options.docs / f"{stem(name)}.webp", frames(name))
        print(f"{options.docs}: {len(IDS)} pictures up to date")


if __name__ == "__main__":
    run(main)
