"""Saved memory of another layout is refused: batches, and copies of single environments."""

import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import flexarm_env.kernels
from flexarm_env.codegen.declarations import Entry, Names
from flexarm_env.envs.batch import BatchSimulator
from flexarm_env.envs.settings import Settings
from flexarm_env.envs.single import FlexArmEnv
from flexarm_env.kernels.entries import CLOCK_ROWS, Setting
from flexarm_env.kernels.layout import Row
from flexarm_env.kernels.stamp import TABLES, LayoutError, layout_stamp

MAKERS: dict[str, Callable[[], Any]] = {"batch": lambda: BatchSimulator(Settings(), 3), "environment": FlexArmEnv}


def declare(patch: pytest.MonkeyPatch, table: type[Names], name: str, size: int) -> None:
    """Put a part of another size at the beginning of a table, in the place of one of this name if there is one."""
    part = Entry("added by a test", "1", size)
    part.__set_name__(table, name)
    patch.setattr(table, "entries", (part, *(each for each in table.entries if each.name != name)))


@pytest.mark.parametrize("made", MAKERS)
@pytest.mark.parametrize("part", [(Row, "ADDED", 1), (Row, "TORQUE", 2), (Setting, "STEP", 2)], ids=str)
def test_a_pickle_of_another_layout_is_refused(monkeypatch: pytest.MonkeyPatch, made: str, part: Any) -> None:
    """A part is added, moved, or larger."""
    saved = pickle.dumps(MAKERS[made]())
    pickle.loads(saved)
    declare(monkeypatch, *part)
    monkeypatch.setattr("flexarm_env.envs.kernel_inputs.in_order", lambda places, values: np.zeros(1))  # it is larger
    with pytest.raises(LayoutError, match=r"saved with the layout [0-9a-f]{16}, and .* reads the layout .* make it"):
        pickle.loads(saved)


def test_a_pickle_of_other_array_shapes_or_without_a_stamp_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    thing = BatchSimulator(Settings(), 3)
    saved, state = pickle.dumps(thing), thing.__getstate__()
    del state["layout_stamp"]
    with pytest.raises(LayoutError, match="the batch was saved with no layout stamp"):
        thing.__setstate__(state)
    monkeypatch.setattr("flexarm_env.simulation.lanes.CLOCK_ROWS", CLOCK_ROWS + 1)
    with pytest.raises(LayoutError, match="the batch was saved with the layout"):
        pickle.loads(saved)


def test_the_stamp_covers_every_table_of_the_kernels(monkeypatch: pytest.MonkeyPatch) -> None:
    ours = [table for table in _all_below(Names) if table.__module__.startswith(flexarm_env.kernels.__name__)]
    assert {table for table in ours if table.entries} == set(TABLES)
    variant = BatchSimulator(Settings(), 3)._variant
    stamp = layout_stamp(variant, {})
    for table in TABLES:
        if "layout" in vars(table):  # it follows from another declaration, as `Constant` does from `Constants`
            continue
        with monkeypatch.context() as patch:
            declare(patch, table, "ADDED", 1)
            assert layout_stamp(variant, {}) != stamp, table


def _all_below(table: type[Names]) -> list[type[Names]]:
    return [found for below in table.__subclasses__() for found in (below, *_all_below(below))]
