"""The environments' documentation in Markdown, made from the declarations that the code itself reads.

All functions are pure. `FlexArmEnv`'s docstring, `flexarm show`, the pages under docs/environments and the folded part
that these have on the site are made from them. The texts that hold for all ids are in `documentation_texts`.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import fields
from typing import Any

import numpy as np

from flexarm_env.actions import JOINTS, MODES, PACE, ActionMode, modes_reading
from flexarm_env.envs import documentation_texts as texts
from flexarm_env.envs.blocks import BLOCKS
from flexarm_env.envs.choices import DEFAULT_WEIGHTS, STARTS
from flexarm_env.envs.consistency import EFFECT
from flexarm_env.envs.info import KEYS, Episode, info_keys
from flexarm_env.envs.observation import observation_layout
from flexarm_env.envs.registration import IDS, NAMESPACE, Id
from flexarm_env.envs.reset_options import OPTIONS
from flexarm_env.envs.settings import Settings, default_of
from flexarm_env.envs.termination import END_CODES, ENDS
from flexarm_env.episode.reward import TERMS
from flexarm_env.parameters import PRESETS, SENSOR_MODELS
from flexarm_env.validation import shown

# Options whose values have names, with what each name means.
_NAMED: Mapping[str, Mapping[str, str]] = {
    "arm": {name: preset.text for name, preset in PRESETS.items()},
    "action_mode": {name: mode.text for name, mode in MODES.items()},
    "sensor": {name: model.text for name, model in SENSOR_MODELS.items()},
    "start": STARTS,
}


def specification(introduction: str) -> str:
    """Write `FlexArmEnv`'s docstring: an introduction, and sections by the declarations.

    It computes no physics, so that imports stay fast.
    """
    first, _, rest = inspect.cleandoc(introduction).partition("\n")
    ids = table(("id", "task"), ((f"`{NAMESPACE}/{name}`", one.summary) for name, one in IDS.items()))
    parts = {"Description": rest, "Ids": ids, **sections()}
    return f"{first}\n\n" + "\n\n".join(f"## {title}\n\n{text.strip()}" for title, text in parts.items()) + "\n"


def sections(one: Id | None = None) -> dict[str, str]:
    """Write the sections of the specification by their titles, with the numbers of an id; None: of all ids."""
    settings = Settings.of(one.options) if one else None
    options = argument_table(settings, one.options if one else None)
    histories = [f"- `{NAMESPACE}/{name}`: {'; '.join(each.history)}" for name, each in IDS.items()]
    return {
        "Action space": f"{texts.ACTION}\n\n{action_table(settings)}",
        "Observation space": f"{texts.OBSERVATION}\n\n{block_table(settings)}",
        "Frames and units": texts.FRAMES,
        "The side of the elbow": texts.BRANCHES,
        "The late sensor": texts.LATENESS,
        "Disturbances": texts.DISTURBANCES,
        "Mirror images": texts.MIRROR,
        "Reward": f"{texts.REWARD}\n\n{reward_table(settings)}",
        **({} if settings and not settings.paths else {"Score": texts.SCORE}),
        "Starting state": start_table(),
        "Episode end": f"{texts.ENDING}\n\n{end_table(settings)}",
        "Info": f"{texts.INFO}\n\n{info_table(settings)}\n\n{texts.EPISODE}\n\n{episode_table()}",
        "Options": f"The arguments of `make` and `make_vec`:\n\n{options}",
        **({"Options of its own": declared_table(one.options_of)} if one and one.options_of else {}),
        "Arms": preset_table(),
        "Reset options": f"{option_table()}\n\n{texts.SEEDS}",
        "Version history": "\n".join([f"- {version}" for version in one.history] if one else histories),
    }


def spaces(settings: Settings) -> tuple[str, str]:
    """Write the spaces of actions and of observations as Gymnasium does, without bounds where these differ."""
    count = len(observation_layout(settings, settings.program).scale)
    return f"Box(-1.0, 1.0, ({len(settings.action_limit)},), float32)", f"Box(({count},), float32)"


def timing(one: Id) -> str:
    """Write how long an episode of an id is."""
    settings = Settings.of(one.options)
    period, how = settings.control_period, settings.integration
    error = f", expected error of the tip {figure(1e3 * how.expected_error)} mm" if how.expected_error else ""
    return (
        f"{one.steps} steps of {figure(1e3 * period)} ms ({figure(one.steps * period)} s), integrated by steps of "
        f"{figure(1e3 * how.step)} ms ({how.method}{error})"
    )


def difference_table(one: Id) -> str:
    """Tabulate the options of an id that differ from the defaults, which are those of Square-v0; "" if none does."""
    rows = []
    for option in fields(Settings):
        if option.name in one.options:
            value, default = one.options[option.name], default_of(option)
            meaning = _NAMED.get(option.name, {}).get(str(value), option.metadata["text"])
            rows.append((f"`{option.name}`", *_changed(value, default), meaning))
    return table(("option", "here", "in Square-v0", "meaning"), rows) if rows else ""


def _changed(value: Any, default: Any) -> tuple[str, str]:
    """Write two values of an option; of blocks those that are left out, if none is new."""
    if not isinstance(value, tuple) or not isinstance(value[0], str):
        return f"`{_python(value)}`", f"`{_python(default)}`"
    left_out = [name for name in default if name not in value]
    kept = [name for name in value if name in default]
    names = left_out if len(kept) == len(value) else value
    return f"{'without ' * (names is left_out)}{', '.join(f'`{name}`' for name in names)}", f"{len(default)} blocks"


# --- tables --------------------------------------------------------------------------------------------------------


def action_table(settings: Settings | None = None) -> str:
    """Tabulate what an action means: in each action mode, or with numbers in that of `settings`."""
    if settings is None:
        header = ("`action_mode`", "an action is", "of", "quantity", "action", "unit", "mirrored")
        modes = MODES.items()
        return table(
            header, [(f"`{name}`", one.text, ", ".join(one.channels), *_formulas(one, 0)) for name, one in modes]
        )
    mode = settings.mode
    rows = [
        (str(n), channel, figure(mode.least * limit), figure(limit), *_formulas(mode, n))
        for n, (channel, limit) in enumerate(zip(mode.channels, settings.action_limit, strict=True))
    ]
    return table(("number", "of", "at a = -1", "at a = 1", "quantity", "action", "unit", "mirrored"), rows)


def _formulas(mode: ActionMode, n: int) -> tuple[str, str, str, str]:
    """Write the map between an entry of the action and its quantity, the unit, and the sign of a mirrored one."""
    quantity, formula, inverse, unit = mode.quantity, mode.formula, mode.inverse, mode.unit
    if mode.channels[n] not in JOINTS and mode.races:
        quantity, formula, inverse, unit = PACE
    return f"`{quantity} = {formula}`", f"`a = {inverse}`", unit, _signs(mode.mirror[n % len(mode.mirror) :][:1])


def _signs(signs: tuple[int, ...]) -> str:
    return ", ".join("+" if sign > 0 else "-" for sign in signs)


def _only(modes: Collection[str], where: str = "") -> str:
    mode = f"in mode {' or '.join(modes)}" if len(modes) < len(MODES) else ""
    limits = ", ".join(filter(None, (mode, where)))
    return f" (only {limits})" if limits else ""


def block_table(settings: Settings | None = None) -> str:
    """Tabulate the blocks of observations: all blocks, or with places and numbers those of `settings`."""
    if settings is None:
        rows = [
            (
                f"`{name}`",
                block.count,
                block.unit,
                block.reads or "",
                "as the action" if block.mirror is None else _signs(block.mirror),
                block.what + _only(block.modes),
            )
            for name, block in BLOCKS.items()
        ]
        return table(("block", "numbers (m modes a link)", "unit", "reads", "mirrored", "what"), rows)
    layout = observation_layout(settings, settings.program)
    header = ["block", "numbers", "unit", "reads", "mirrored", "bound", *["scale"] * settings.scaled, "what"]
    numbers = []
    for name, part in layout.blocks.items():
        block, scale = BLOCKS[name], layout.scale[part]
        cells = [
            f"`{name}`",
            f"`{part.start}:{part.stop}`",
            block.unit,
            block.reads or "",
            _signs(block.mirror or settings.mode.mirror),
            figures(layout.bound[part] * scale),
        ]
        numbers.append([*cells, *[figures(scale)] * settings.scaled, block.what])
    return table(header, numbers)


def reward_table(settings: Settings | None = None) -> str:
    """Tabulate the terms of the reward: all with their default weights, or those with a weight in `settings`."""
    weights = DEFAULT_WEIGHTS if settings is None else settings.reward_weights
    named = [(name, weights.get(name, 0.0), text) for name, text in TERMS.items()]
    rows = [(f"`{name}`", figure(weight), text) for name, weight, text in named if weight or settings is None]
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
    """Tabulate the arguments of `make`: all, or those that have an effect with an id's `settings` and `options`."""
    rows = []
    for one in fields(Settings):
        modes, allowed = modes_reading(one.name), one.metadata["allowed"]
        if settings is not None and settings.action_mode not in modes:
            continue
        value = (options or {}).get(one.name, default_of(one))
        text = one.metadata["text"] + _only(modes if settings is None else MODES, EFFECT.get(one.name, (None, ""))[1])
        rows.append((f"`{one.name}`", f"`{_python(value)}`", allowed.unit, allowed.text, text))
    return table(("argument", "default", "unit", "allowed", "what"), rows)


def preset_table() -> str:
    """Tabulate the arms by name, as the option `arm` takes it."""
    return table(("`arm`", "what"), [(f'`"{name}"`', preset.text) for name, preset in PRESETS.items()])


def declared_table(kind: type[Any], name: str = "argument") -> str:
    """Tabulate the fields of a class that declares them (`allowed.declared`); `name` is the header of their names."""
    rows = []
    for one in fields(kind):
        allowed, text = one.metadata["allowed"], one.metadata.get("text", "")
        rows.append((f"`{one.name}`", f"`{_python(default_of(one))}`", allowed.unit, allowed.text, text))
    return table((name, "default", "unit", "allowed", "what"), rows)


def option_table() -> str:
    """Tabulate the keys of `reset(options=...)`."""
    return table(("option", "what"), [(f"`{name}`", text) for name, text in OPTIONS.items()])


def parameter_table(docstring: str, section: str = "Args", kind: str = "argument") -> str:
    """Tabulate the arguments, or another section, of a docstring in Google's style without its indentation."""
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
    return getattr(value, "__qualname__", shown(value)).replace("'", '"')
