"""Damaged files: they are refused by their names, or what is read is what was written, to the last bit."""

import json
import re
import tempfile
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import event, example, given
from hypothesis import strategies as st

from flexarm_agents import PPOConfig, config_of, train
from flexarm_agents.board.cells import Cell, Store
from flexarm_agents.board.columns import COLUMNS
from flexarm_agents.board.entries import Entry
from flexarm_agents.policies.load import POLICIES, load_policy
from flexarm_agents.training.reward import RewardTraining
from flexarm_agents.training.run_folder import RunFolder, read_checkpoint
from flexarm_baselines.optimal.plan import PLANS, Plan
from flexarm_env import ArmParameters, FlexibleArm, Trajectory
from tests.hardening.strategies import CAMPAIGN, MOST_CHARACTERS, cases

TINY: dict[str, Any] = {"envs": 2, "rollout": 8, "batch": 16, "epochs": 1, "steps": 16, "hidden": (4,)}
MOST_BYTES = 2**20  # of a file that is damaged: larger ones are slow to write
_JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=6,
)


class Kind(NamedTuple):
    name: str  # of the file, which stays what it is
    make: Callable[[Path], bytes]  # makes a good one in a folder, and returns its content
    read: Callable[[Path], Any]  # reads one, and returns what is in it as plain values and arrays
    # the format finds any change: what is read is what was written. Where it is False, a change that leaves a good
    # file of the format is that of another good file
    checked: bool


def _values(made: Any) -> dict[str, Any]:
    return {name: value for name, value in vars(made).items() if not name.startswith("_")}


def _policy(path: Path) -> Any:
    return _values(load_policy(path).policy)


def _checkpoint(path: Path) -> Any:
    training = RewardTraining(config_of(**TINY), RunFolder(path.parent))
    kept = read_checkpoint(path, training.config)
    training.restore(kept["state"])
    training.close()
    assert training.model is not None
    return {name: value.numpy() for name, value in training.model.policy.state_dict().items()} | kept["progress"]


@cache
def _cell() -> tuple[Store, Cell]:
    store = Store(_folder() / "cells")
    cell = Cell.of(Entry("joint_pd"), COLUMNS["nominal"].points[0])
    store.write(cell, {"episodes": [{"lap": "swing", "rms": 0.5, "ended": "truncated"}], "lost": 1})
    return store, cell


def _read_cell(path: Path) -> Any:
    store, cell = _cell()
    target = store.path(cell.key)
    target.write_bytes(path.read_bytes())
    try:
        return store.read(cell)
    except ValueError as error:
        raise ValueError(str(error).replace(str(target), str(path))) from error


def _read_config(path: Path) -> Any:
    return RunFolder(path.parent).read_config(PPOConfig).plain()


def _trained(folder: Path) -> bytes:
    train(config_of(**TINY), folder / "training", progress=False)
    return (folder / "training" / "checkpoint.zip").read_bytes()


def _configured(folder: Path) -> bytes:
    RunFolder(folder / "run").enter(config_of(**TINY), {}, resume=False)
    return (folder / "run" / "config.json").read_bytes()


def _ran(folder: Path) -> bytes:
    arm = FlexibleArm(ArmParameters.linear())
    arm.record(0.1 * np.arange(9), np.ones((9, 12)), np.ones((9, 2))).save(folder / "run.npz")
    return (folder / "run.npz").read_bytes()


def _measured(folder: Path) -> bytes:
    store, cell = _cell()
    return store.path(cell.key).read_bytes()


KINDS = {
    "policy": Kind("policy.npz", lambda folder: (POLICIES / "student.npz").read_bytes(), _policy, True),
    "plan": Kind(
        "plan.npz", lambda folder: (PLANS / "default_plain.npz").read_bytes(), lambda p: _values(Plan.load(p)), True
    ),
    "run": Kind("run.npz", _ran, lambda p: _values(Trajectory.load(p)), True),
    "checkpoint": Kind("checkpoint.zip", _trained, _checkpoint, True),
    "cell of the board": Kind("cell.json", _measured, _read_cell, True),
    "configuration": Kind("config.json", _configured, _read_config, False),
}


@cache
def good_content(kind: str) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        content = KINDS[kind].make(Path(folder))
    assert len(content) < MOST_BYTES
    return content


class Damage(NamedTuple):
    kind: str  # name of the kind
    # bytes that are changed: their places as shares of the length, and what is exclusive-ored
    flips: Sequence[tuple[float, int]] = ()
    cut: float = 1.0  # share of the length that is left
    inserted: tuple[float, bytes] = (0.0, b"")  # bytes, and their place
    nested: int = 0  # opening brackets that are inserted there, too: parsers recurse
    value: tuple[int, Any] | None = None  # of a JSON file: a leaf by its number, and what replaces it; None: none


def drawn() -> st.SearchStrategy[Damage]:
    share = st.floats(0.0, 1.0)
    return st.builds(
        Damage,
        kind=st.sampled_from(sorted(KINDS if CAMPAIGN else KINDS.keys() - {"checkpoint"})),  # that needs a training
        flips=st.lists(st.tuples(share, st.integers(1, 255)), max_size=3),
        cut=st.just(1.0) | st.just(1.0) | share,
        inserted=st.tuples(share, st.just(b"") | st.binary(max_size=8)),
        nested=st.just(0) | st.just(0) | st.integers(0, 20_000),
        value=st.none() | st.tuples(st.integers(0, 200), _JSON),
    )


def damaged(content: bytes, damage: Damage) -> bytes:
    if damage.value is not None and content.startswith(b"{"):
        content = _replaced(content, *damage.value)
    changed = bytearray(content)
    for place, value in damage.flips:
        changed[int(place * (len(changed) - 1))] ^= value
    place, new = damage.inserted
    new += b"[" * damage.nested
    at = int(place * len(changed))
    return bytes(changed[:at] + new + changed[at:])[: int(damage.cut * (len(changed) + len(new)))]


def _replaced(content: bytes, number: int, value: Any) -> bytes:
    whole = json.loads(content)
    places: list[tuple[Any, Any]] = []
    waiting = [whole]
    while waiting:
        one = waiting.pop()
        keys = one if isinstance(one, dict) else range(len(one)) if isinstance(one, list) else ()
        places += [(one, key) for key in keys]
        waiting += [one[key] for key in keys]
    holder, key = places[number % len(places)]
    holder[key] = value
    return json.dumps(whole).encode()


@cache
def _good(kind: str) -> Any:
    path = _folder() / KINDS[kind].name
    path.write_bytes(good_content(kind))
    return KINDS[kind].read(path)


@cache
def _temporary() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="damaged-files-")


def _folder() -> Path:
    return Path(_temporary().name)


def outcome(damage: Damage) -> str:
    """Read a damaged file; return what came of it, which must be a refusal or what was written."""
    kind, path = KINDS[damage.kind], _folder() / KINDS[damage.kind].name
    good = _good(damage.kind)
    path.write_bytes(damaged(good_content(damage.kind), damage))
    try:
        found = kind.read(path)
    except ValueError as error:
        text = str(error)
        assert text.startswith(f"{path}: "), text
        assert len(text) < MOST_CHARACTERS + len(str(path)), f"a message of {len(text)} characters"
        return "refused"
    same = _same(found, good)
    assert same or not kind.checked, f"{damage.kind}: other values are read than were written"
    return "unharmed" if same else "another good file"


@cases(375, 10_000)
@given(drawn())
@example(Damage("cell of the board", nested=20_000))  # parsers recurse
@example(Damage("configuration", nested=20_000))
def test_damaged_files_are_refused_or_hold_what_was_written(damage: Damage) -> None:
    event(outcome(damage))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["policy", "run"])
def test_any_byte_may_be_damaged(kind: str) -> None:
    count = len(good_content(kind)) - 1
    for place in range(0, count, max(3, count // 1000)):
        share = place / count
        for damage in (Damage(kind, [(share, 0x01)]), Damage(kind, [(share, 0xFF)]), Damage(kind, cut=share)):
            outcome(damage)


@pytest.mark.parametrize("place", [b"0.5", b'"rms"'])
def test_a_changed_figure_of_a_cell_is_refused(place: bytes) -> None:
    content = good_content("cell of the board")
    path = _folder() / KINDS["cell of the board"].name
    at = content.rindex(place)  # of the result: settings are the reader's to see, the hash in the name holds them
    path.write_bytes(content[:at] + bytes([content[at] ^ 1]) + content[at + 1 :])
    with pytest.raises(ValueError, match=re.escape(f"{path}: ")):
        _read_cell(path)


def _same(one: Any, other: Any) -> bool:
    if type(one) is not type(other):
        return False
    if isinstance(one, np.ndarray):
        return one.dtype == other.dtype and one.shape == other.shape and one.tobytes() == other.tobytes()
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(_same(one[name], other[name]) for name in one)
    if isinstance(one, list | tuple):
        return len(one) == len(other) and all(map(_same, one, other))
    return bool(one == other)
