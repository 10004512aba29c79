"""`scripts.hardening`: a small sample of what it tries, and how it counts."""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import strategies as st

from scripts.hardening import __main__ as hardening
from scripts.hardening import calls, files, kills
from scripts.hardening.__main__ import PARTS, fuzz, kept, soaked, stamp_of, update_page
from scripts.hardening.campaign import Part, Tally, run_block, run_part
from scripts.hardening.files import Damage, damaged
from scripts.hardening.kills import TASKS, Task, kill_often
from scripts.hardening.page import Code, fuzzing_table, kills_table, soak_table
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
    found = kill_often(name, 1, 5, tmp_path / "killed")
    assert (found["kills"], found["faults"]) == (1, [])


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


# Counts to five, keeping what it has in a file.
COUNTS = """
import os, sys, time
from pathlib import Path
path = Path(sys.argv[1], "count")
for n in range(int(path.read_text()) if path.exists() else 0, 5):
    time.sleep(0.05)
    {forget}
    Path(sys.argv[1], "new").write_text(str(n + 1))
    os.replace(Path(sys.argv[1], "new"), path)
{child}
print("done")
"""
FORGETS = "path.unlink(missing_ok=True); time.sleep(0.1)"
CHILD = "import subprocess; subprocess.Popen(['sleep', '60'], stdout=subprocess.DEVNULL); time.sleep(0.3)"


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc")
@pytest.mark.parametrize(
    ("forget", "child", "words"),
    [("pass", "", ""), (FORGETS, "", "AssertionError: held "), ("pass", CHILD, "go on without their parent")],
)
def test_what_is_lost_or_left_running_is_counted(
    forget: str, child: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def check(folder: Path) -> int:
        return int((folder / "count").read_text()) if (folder / "count").exists() else 0

    program = COUNTS.format(forget=forget, child=child)
    task = Task("counts", lambda folder: ["-c", program, str(folder)], check, lambda folder, printed: printed)
    monkeypatch.setitem(TASKS, "counts", task)
    monkeypatch.setattr(kills, "LINGER", 0.2)
    monkeypatch.setattr(kills, "MOST_FAULTS", 1)
    monkeypatch.setattr(kills, "ALONE", 1.0)
    found = kill_often("counts", 12 if words else 3, 5, tmp_path / "killed")
    assert bool(found["faults"]) == bool(words)
    assert all(words in fault for fault in found["faults"])
    assert found["kills"] >= 1


def test_files_are_damaged_in_a_folder_that_goes_with_the_process(monkeypatch: pytest.MonkeyPatch) -> None:
    at_exit: list[Callable[[], Any]] = []
    monkeypatch.setattr(
        files.atexit, "register", lambda call, *given, **named: at_exit.append(partial(call, *given, **named))
    )
    folder = files._folder.__wrapped__()
    assert folder.is_dir()
    (end,) = at_exit
    end()
    assert not folder.exists()


def test_results_of_an_earlier_run_are_not_those_of_one_that_fails(tmp_path: Path) -> None:
    def fail() -> None:
        raise AssertionError("lost")

    kept(tmp_path / "kills.json", {"code": "x"}, lambda: [1])
    assert json.loads((tmp_path / "kills.json").read_text()) == {"stamp": {"code": "x"}, "found": [1]}
    with pytest.raises(AssertionError, match="lost"):
        kept(tmp_path / "kills.json", {"code": "x"}, fail)
    assert not (tmp_path / "kills.json").exists()


# --- faults that it found -----------------------------------------------------------------------------------------

FOUND: list[tuple[str, dict[str, Any]]] = [
    ("TeachingConfig", {"arms": None}),
    ("DescentConfig", {"critic_epochs": np.zeros(0)}),
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
    new, old = Code("0123456789", "0123456789"), Code("0123456789", "9876543210")
    text = fuzzing_table(PARTS, {"options": tally}, {"options": new})
    assert "| 3 option sets | 1 refused, 2 taken | 0.50 s | none <!-- 01234567 --> |" in text
    run = {"steps": 256, "episodes": 2, "settled": 99.9, "end": 100.2, "hash": "0a" * 16, "seconds": 1.2}
    assert "| 100 MB, 100 MB | 1 s <!-- 01234567, other code --> |" in soak_table([run], old)
    found = {name: {"kills": 7, "finished": 2, "seconds": 3.0, "faults": []} for name in TASKS}
    found["training"]["faults"] = ["lost"]
    text = kills_table(found, dict.fromkeys(TASKS, new))
    assert text.count("| 7 | 2 | 3 s | none <!-- 01234567 --> |") == len(TASKS) - 1
    assert text.count("| 7 | 2 | 3 s | 1 <!-- 01234567 --> |") == 1


def test_the_page_says_what_other_code_has_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(hardening, "DOCS", tmp_path)
    page = tmp_path / hardening.PAGE
    page.parent.mkdir()
    page.write_text("".join(f"<!-- generated: {name} -->\n<!-- end -->\n" for name in ("fuzzing", "soak", "kills")))
    found = {"kills": 3, "finished": 1, "seconds": 2.0, "faults": []}
    for name, code in (("training", stamp_of("kills")["code"]), ("compiling", "0" * 32)):
        kept(tmp_path / f"kills_{name}.json", {"code": code, "seed": 0}, lambda: found)
    update_page(tmp_path)
    lines = page.read_text().splitlines()
    tasks = [line for line in lines if line.startswith("| `flexarm") or "kernels" in line]
    marked = [line.endswith(", other code --> |") for line in tasks]
    assert marked == [False, True]
    assert lines.count("Not run yet.") == 2
    assert "lines that were made by other code than the present one: 1" in capsys.readouterr().out


def test_the_page_keeps_what_was_not_run_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Lines of this machine, whose results are elsewhere; each says anew whether the code is another one now."""
    page = tmp_path / hardening.PAGE
    page.parent.mkdir()
    page.write_text((hardening.DOCS / hardening.PAGE).read_text())
    monkeypatch.setattr(hardening, "DOCS", tmp_path)
    results = tmp_path / "results"
    results.mkdir()
    for name in (*PARTS, "soak", *map(hardening.kill_file, TASKS)):  # all of them, by other code
        found = {"kills": 7, "finished": 2, "seconds": 3.0, "faults": []}
        run = {"steps": 256, "episodes": 2, "settled": 99.9, "end": 100.2, "hash": "0a" * 16, "seconds": 1.2}
        tally = Tally(blocks=1, cases=3, ends=Counter(taken=2, refused=1), longest=0.5)
        stamp, runs = {"code": "0" * 32}, [run, run] if name == "soak" else found
        (results / f"{name}.json").write_text(json.dumps({"stamp": stamp, "found": runs, "tally": tally.plain()}))
    update_page(results)
    assert page.read_text().count("<!-- 00000000, other code --> |") == len(PARTS) + 2 + len(TASKS)
    for path in results.iterdir():
        path.unlink()
    training = {"kills": 8, "finished": 1, "seconds": 2.0, "faults": []}
    kept(results / "kills_training.json", stamp_of("kills"), lambda: training)
    whole = page.read_text()
    update_page(results)
    (was, now), *others = [
        pair for pair in zip(whole.splitlines(), page.read_text().splitlines(), strict=True) if pair[0] != pair[1]
    ]
    assert not others
    assert was.endswith("| 7 | 2 | 3 s | none <!-- 00000000, other code --> |")
    assert now.endswith(f"| 8 | 1 | 2 s | none <!-- {stamp_of('kills')['code'][:8]} --> |")
    monkeypatch.setattr(hardening, "stamp_of", lambda name: {"code": "0" * 32})
    update_page(results)
    assert page.read_text().count("<!-- 00000000 --> |") == len(PARTS) + 2 + len(TASKS) - 1
    page.write_text(page.read_text().replace("Python 3.", "Python 2."))  # another machine's
    update_page(results)
    assert page.read_text().count("<!-- 00000000") == 0
    assert page.read_text().splitlines().count("Not run yet.") == 2


def test_bad_arguments_are_refused() -> None:
    assert "parts = 'x': must be one of 'options', 'values'" in refusal("hardening", "--parts", "x")
    assert "tasks = 'x': must be one of 'training', 'leaderboard'" in refusal("hardening", "--tasks", "x")
    assert "kills = 0: must be an integer >= 1" in refusal("hardening", "--kills", "0")
    assert "jobs = 0: must be an integer >= 1" in refusal("hardening", "--parts", "soak", "--jobs", "0")
