"""`scripts.hardening`: a small sample of what it tries, and how it counts."""

from __future__ import annotations

import json
import os
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import strategies as st

from scripts.hardening import calls, files, kills
from scripts.hardening.__main__ import PARTS, fuzz, kept, soaked
from scripts.hardening.campaign import Part, Tally, run_block, run_part
from scripts.hardening.files import Damage, damaged
from scripts.hardening.kills import TASKS, Task, kill_often
from scripts.hardening.page import fuzzing_table, kills_table, soak_table
from scripts.hardening.strategies import Contrary
from scripts.hardening.values import construct
from tests.support.programs import refusal

SAMPLE = {"options": 25, "values": 60, "calls": 8, "files": 60}


def tried(name: str, size: int, seed: int = 7) -> Tally:
    tally = Tally()
    run_block(replace(PARTS[name], size=size), seed, tally)
    return tally


@pytest.mark.parametrize("name", PARTS)
def test_a_sample_has_no_faults(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(calls, "IDS", ("FlexArm/Square-v0",))  # whose kernel other tests have
    monkeypatch.delitem(files.KINDS, "checkpoint")  # needs a training
    tally = tried(name, SAMPLE[name])
    assert tally.faults == []
    assert tally.cases >= SAMPLE[name]
    assert len(tally.ends) > 1


@pytest.mark.slow
@pytest.mark.parametrize("name", PARTS)
def test_a_larger_sample_has_no_faults(name: str) -> None:
    assert [fault for seed in range(4) for fault in tried(name, PARTS[name].size, seed).faults] == []


@pytest.mark.slow
def test_a_soak_has_the_same_bits_twice() -> None:
    one, other = soaked(200_000, seed=3, jobs=2)
    assert one["steps"] >= 200_000
    assert one["episodes"] > 0
    assert one["hash"] == other["hash"]


@pytest.mark.slow
@pytest.mark.parametrize("name", TASKS)
def test_a_killed_task_loses_nothing(name: str, tmp_path: Path) -> None:
    assert kill_often(name, 1, 5, tmp_path / "killed")["kills"] == 1


@pytest.mark.skipif(not hasattr(os, "killpg"), reason="needs groups of processes")
@pytest.mark.parametrize(
    ("program", "words"),
    [("raise SystemExit(3)", "quick: ends with status 3"), ("import time; time.sleep(60)", "quick: takes longer than")],
)
def test_a_task_that_does_not_come_to_its_end_is_a_fault(
    program: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without this, a task that always fails would agree with itself."""
    task = Task("quick", lambda folder: ["-c", program], lambda folder: 0, lambda folder, printed: printed)
    monkeypatch.setitem(TASKS, "quick", task)
    monkeypatch.setattr(kills, "LONGEST", 1.0 if "sleep" in program else 60.0)
    with pytest.raises(AssertionError, match=words):
        kill_often("quick", 1, 5, tmp_path / "killed")


def test_results_of_an_earlier_run_are_not_those_of_one_that_fails(tmp_path: Path) -> None:
    def fail() -> None:
        raise AssertionError("lost")

    kept(tmp_path / "kills.json", lambda: [1])
    with pytest.raises(AssertionError, match="lost"):
        kept(tmp_path / "kills.json", fail)
    assert not (tmp_path / "kills.json").exists()


# --- faults that it found -----------------------------------------------------------------------------------------

FOUND: list[tuple[str, dict[str, Any]]] = [
    ("TeachingConfig", {"arms": None}),
    ("TrainingConfig", {"batch": 10**5000}),
    ("History", {"lags": True}),
    ("History", {"remembered": 1j}),
    ("NetworkPolicy", {"weights": None}),
    ("NetworkPolicy", {"biases": 0.5}),
    ("NetworkPolicy", {"history": {}}),
    ("TrackingProblem", {"tip_weights": Contrary()}),
    ("FLSAC", {"tip_weights": Contrary()}),
]


@pytest.mark.parametrize(("name", "values"), FOUND, ids=[f"{name} {next(iter(values))}" for name, values in FOUND])
def test_fields_are_refused_by_name(name: str, values: dict[str, Any]) -> None:
    assert construct((name, values)) == Counter(refused=1)


@pytest.mark.parametrize("kind", ["cell of the board", "configuration"])
def test_deep_nesting_is_refused(kind: str) -> None:
    assert files.read_damaged(Damage(kind, [], 1.0, (0.0, b""), 20_000, None)) == Counter(refused=1)


def test_a_changed_figure_of_a_cell_is_refused() -> None:
    content = files.good_content("cell of the board")
    places = [content.index(b"0.5"), content.index(b'"rms"')]
    for place in places:
        flip = [((place + 0.5) / (len(content) - 1), 1)]
        assert files.read_damaged(Damage("cell of the board", flip, 1.0, (0.0, b""), 0, None)) == Counter(refused=1)


# --- campaigns ----------------------------------------------------------------------------------------------------


def part_of(check: Any, size: int = 20) -> Part:
    return Part("numbers", "number", lambda: st.integers(0, 1000), check, limit=60.0, size=size)


def test_a_fault_is_kept_with_its_smallest_case_and_the_campaign_goes_on() -> None:
    def check(case: int) -> Counter[str]:
        assert case < 600, "too large"
        return Counter(small=1)

    tally = Tally()
    run_part(part_of(check), 0, 100, tally, lambda done: None)
    assert tally.total >= 100
    assert tally.blocks > 1
    assert "too large" in tally.faults[0]
    assert "case=600" in tally.faults[0]


def test_a_campaign_goes_on_with_the_next_block(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[int] = []

    def check(case: int) -> Counter[str]:
        seen.append(case)
        return Counter(fine=1)

    monkeypatch.setitem(PARTS, "options", part_of(check))
    path = tmp_path / "options.json"
    whole = fuzz("options", 60, 1, tmp_path / "whole.json")
    cases, seen[:] = list(seen), []
    fuzz("options", 20, 1, path)
    assert fuzz("options", 60, 1, path).plain() | {"longest": 0} == whole.plain() | {"longest": 0}
    assert seen == cases
    assert fuzz("options", 60, 1, path).blocks == whole.blocks  # there is nothing left to do
    assert fuzz("options", 20, 2, path).blocks == 1  # another seed begins anew
    assert Tally.of(json.loads(path.read_text())["tally"]).blocks == 1


def test_what_ends_at_once_does_not_go_on_for_ever() -> None:
    def check(case: int) -> Counter[str]:
        raise RuntimeError("always")

    tally = Tally()
    run_part(part_of(check), 0, 10**6, tally, lambda done: None)
    assert tally.blocks == 1
    assert len(tally.faults) == 1


# --- damage -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("damage", "content"),
    [
        (Damage("x", [(0.0, 1)], 1.0, (0.0, b""), 0, None), b"`bcd"),
        (Damage("x", [], 0.5, (0.0, b""), 0, None), b"ab"),
        (Damage("x", [], 1.0, (1.0, b"!"), 2, None), b"abcd![["),
        (Damage("x", [], 1.0, (0.0, b""), 0, (0, 5)), b"abcd"),
    ],
)
def test_damage(damage: Damage, content: bytes) -> None:
    assert damaged(b"abcd", damage) == content


def test_a_value_of_json_is_replaced() -> None:
    damage = Damage("x", [], 1.0, (0.0, b""), 0, (1, None))
    assert json.loads(damaged(b'{"a": 1, "b": [2, 3]}', damage)) == {"a": 1, "b": None}


def test_other_values_than_were_written_are_a_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    """A format without a checksum would be found out."""
    monkeypatch.setitem(files.KINDS, "configuration", files.KINDS["configuration"]._replace(checked=True))
    at = list(json.loads(files.good_content("configuration"))).index("seed")
    with pytest.raises(AssertionError, match="other values are read than were written"):
        files.read_damaged(Damage("configuration", [], 1.0, (0.0, b""), 0, (at, 5)))


# --- the page -----------------------------------------------------------------------------------------------------


def test_tables() -> None:
    tally = Tally(blocks=1, cases=3, ends=Counter(taken=2, refused=1), longest=0.5)
    text = fuzzing_table(PARTS, {"options": tally})
    assert "| 3 option sets | 1 refused, 2 taken | 0.50 s | none |" in text
    run = {"steps": 256, "episodes": 2, "settled": 99.9, "end": 100.2, "hash": "0a" * 16, "seconds": 1.2}
    assert "| 1 | 256 | 2 | 100 MB, 100 MB | `0a0a0a0a0a0a0a0a` | 1 s |" in soak_table([run])
    found = {name: {"kills": 7, "finished": 2, "seconds": 3.0} for name in TASKS}
    assert kills_table(found).count("| 7 | 2 | 3 s | none |") == len(TASKS)


def test_bad_arguments_are_refused() -> None:
    assert "parts = 'x': must be one of 'options', 'values'" in refusal("hardening", "--parts", "x")
    assert "kills = 0: must be an integer >= 1" in refusal("hardening", "--kills", "0")
    assert "jobs = 0: must be an integer >= 1" in refusal("hardening", "--parts", "soak", "--jobs", "0")
