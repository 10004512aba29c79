"""`python -m scripts.leaderboard`: cells are kept, executors give the same files, tables say what is in them."""

from __future__ import annotations

import json
import re
import shutil
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest

from flexarm_agents.board import measure as measuring
from flexarm_agents.board.cells import Store
from flexarm_agents.board.columns import COLUMNS, Column, Point, measurable
from flexarm_agents.board.entries import Entry, all_entries
from flexarm_agents.board.episodes import run_points
from flexarm_agents.board.measure import delay_margins
from flexarm_agents.board.summary import point_summary
from flexarm_agents.board.tables import short_ranking, tables
from flexarm_agents.board.terms import BOARD
from flexarm_agents.commands import leaderboard as verb
from flexarm_agents.jobs.executors import executor
from flexarm_env import FlexibleArm, SensorParameters
from flexarm_env.analysis import delay_margin, law_loop
from scripts.common.markdown import DOCS
from scripts.leaderboard import __main__ as study
from scripts.leaderboard import pictures
from tests.support.boards import SHORT, SMALL, files, leaves
from tests.support.refusals import refuses

PAYLOADS = (0.0, 0.2, 0.4)
TINY = {"payload": Column("Payload", "kg", tuple(Point(x, SHORT, {**SMALL, "payload_mass": x}) for x in PAYLOADS), 0.0)}
ROWS = [Entry("square", "agent"), Entry("square", "again", options={"last_actions": 1})]


class Here:
    """Runs jobs in this process, and counts them; it may break off after some."""

    def __init__(self, most: float = float("inf")) -> None:
        self.points: list[float | str] = []
        self.most = most

    def run(self, function: Callable[[Any], Any], jobs: Sequence[Any]) -> Iterator[tuple[int, Any]]:
        for n, job in enumerate(jobs):
            if n >= self.most:
                yield n, OSError("killed")
            else:
                self.points += [cell.point.value for cell in job]
                yield n, function(job)


@pytest.mark.usefixtures("uncompiled")
def test_a_tiny_board_goes_on_after_a_cell_is_lost(tmp_path: Path) -> None:
    """The second row has the same cells, which are computed once."""
    store, first = Store(tmp_path / "cells"), Here()
    results, failed = measuring.measure(ROWS, TINY, store, first)
    assert failed == []
    assert first.points == list(PAYLOADS)
    before = files(store.folder)
    assert len(before) == 3
    lost = sorted(before)[1]
    (store.folder / lost).unlink()
    second = Here()
    assert measuring.measure(ROWS, TINY, store, second) == (results, [])
    assert len(second.points) == 1
    assert files(store.folder) == before
    (store.folder / lost).write_text("{}")
    with pytest.raises(ValueError, match="is no cell; remove it"):
        measuring.measure(ROWS, TINY, store, second)


@pytest.mark.usefixtures("uncompiled")
def test_a_row_that_lacks_cells_is_left_out_and_the_others_are_kept(tmp_path: Path) -> None:
    store = Store(tmp_path / "cells")
    others = Entry("square", "other", options={"frame": "world"})
    board, failed = measuring.measure([ROWS[0], others], TINY, store, Here(1))
    assert [row["name"] for row in board["rows"]] == ["agent"]
    assert list(map(str, failed)) == ["other: OSError: killed"]
    assert len(files(store.folder)) == 3


def test_the_board_has_everybody_once() -> None:
    names = [row.name for row in all_entries(())]
    assert len(set(names)) == len(names)
    assert {"ifdc", "ifdc_late", "plan_lqr", "agent square"} <= set(names)
    assert "agent scheduler_paper" not in names  # its arm is not the board's
    with refuses(ValueError, "two have the name 'ifdc'"):
        all_entries(("ifdc",))


def test_a_row_may_be_a_file(tmp_path: Path) -> None:
    mine = tmp_path / "mine.json"
    mine.write_text(json.dumps({"source": "square", "name": "mine", "options": {"last_actions": 1}}))
    assert all_entries((str(mine),))[-1] == Entry("square", "mine", options={"last_actions": 1})
    mine.write_text(json.dumps({"source": "square", "nam": "mine"}))
    with refuses(ValueError, "mine.json: no entry", "'nam'"):
        all_entries((str(mine),))


def test_the_page_shows_the_whole_board(tmp_path: Path) -> None:
    read = study.parser().parse_args
    study.check(read(["--entries", "lqg"]))
    study.check(read(["--docs", "--times"]))
    with refuses(ValueError, "docs = True", "must go without entries and columns"):
        study.check(read(["--docs", "--times", "--columns", "nominal"]))
    with refuses(ValueError, "docs = True", "must go with times"):
        study.check(read(["--docs", "--output", str(tmp_path)]))


def test_only_submitit_has_parameters(tmp_path: Path) -> None:
    with refuses(ValueError, "parameters = {'slurm_partition': 'cpu'}", "executor = 'processes' has none"):
        executor("processes", 1, tmp_path, {"slurm_partition": "cpu"})
    with refuses(ValueError, "jobs = 0"):
        executor("processes", 0, tmp_path)


def lap(rms: float | None) -> dict[str, Any]:
    figure = None if rms is None else {"mean": rms, "least": rms, "most": rms}
    lost = {"episodes": 1, "lost": int(rms is None), "first_loss": 1.5 if rms is None else None}
    return {**lost, "rms": figure, "rms_after_2s": figure, "maximum": figure}


NOWHERE = {"low": None, "high": None}
BREAKING = {
    "swing": {"doubled": {"low": None, "high": 0.3}, "lost": {"low": 0.1, "high": 0.7}, "complete": None},
    "plain": {"doubled": NOWHERE, "lost": NOWHERE, "complete": None},
}


def row(name: str, swing: float | None, plain: float | None, privileged: bool = False) -> dict[str, Any]:
    point = {"swing": lap(swing), "plain": lap(plain)}
    others = [point, {"not_applicable": "no plan"}, {"all": lap(0.1) | {"success": 0.5}}, point]
    return {
        "name": name,
        "reads": ["encoders"],
        "privileged": privileged,
        "columns": {
            "nominal": {"points": [point, others[1], others[2], point]},
            "payload": {"points": [point] * 11, "breaking": BREAKING},
            "unknown": {"points": [point]},
        },
    }


def test_tables_rank_by_error_and_show_losses_first() -> None:
    rows = [row("ifdc", 0.8, 0.7), row("lost", None, 0.01), row("best", 0.06, 0.02, privileged=True)]
    rows[0]["columns"]["payload"]["breaking"] = dict.fromkeys(("swing", "plain"), BREAKING["plain"])
    rows[1]["columns"]["payload"]["breaking"] = {lap: {"complete": [0.2, 0.3, 0.7]} for lap in ("swing", "plain")}
    references = {name: {"rms": rms} for name, rms in (("swing", 0.05), ("plain", 0.02))}
    columns = {name: COLUMNS[name] for name in ("nominal", "payload", "unknown")}
    board = measuring.board(rows, columns) | {"references": references}
    assert board["board"] == BOARD
    found = tables(board)
    lines = found["ranking"].splitlines()[2:]
    assert [line.split("|")[1].strip() for line in lines] == ["ifdc", "lost", "*Without a rank:*", "best\\*"]
    assert "| 0.013 / 0.000 |" in lines[3]
    assert "| 1.000 / 1.000 |" in lines[0]
    assert lines[1].startswith("| lost | 50.0 % | 2500 / 10.0 | - / 10.0 | lost | 10.0 / 10.0 | - / -0.015 |")
    assert "not applicable | 100, 50 %" in found["nominal"]
    assert "lost at 1.5 s / 10.0" in found["axis_payload"]
    holds = [line.split("|")[2].strip() for line in found["robustness"].splitlines()]
    assert holds == ["Payload, 0 to 1 kg", "---", "all", "none", "0.2 to 0.6 (0.2)"]
    assert len(found["axis_payload"].splitlines()[0].split("|")) <= 2 + 1 + 13
    few = short_ranking(board, ("lost", "ifdc")).splitlines()
    assert few[2:] == ["| ifdc | 0.0 % | 750 | 800 | 700 |", "| lost | 50.0 % | 1255 | lost | 10.0 |"]


def test_what_is_shown_may_be_made_anew_without_measuring(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    docs = tmp_path / "docs"
    docs.mkdir()
    blocks = "".join(f"<!-- generated: {name} -->\nold\n<!-- end -->\n" for name in ("ranking", "times"))
    (docs / study.PAGE).write_text(blocks)
    (tmp_path / "README.md").write_text("")
    shutil.copyfile(DOCS / measuring.DATA, docs / measuring.DATA)
    monkeypatch.setattr(study, "DOCS", docs)
    study.present(tmp_path / "presented")
    page = (docs / study.PAGE).read_text()
    assert "| lqg | 48.8 % |" in page
    assert page.endswith("<!-- generated: times -->\nold\n<!-- end -->\n")
    assert {path.name for path in (docs / "figures" / "leaderboard").iterdir()} == {"heat_map.png", "delays.png"}
    assert (docs / measuring.DATA).read_text() == (DOCS / measuring.DATA).read_text()


def test_the_exact_margin_is_that_of_the_law_on_the_late_sensor() -> None:
    found = {row.name: delay_margins(row) for row in all_entries(()) if row.name.startswith("ifdc")}
    assert found["ifdc"] is None  # its law acts on the joints
    sensor = SensorParameters(delay=0.03)
    exact = delay_margin(law_loop(FlexibleArm(), (-6.3, -6.3), sensor)).delay
    assert found["ifdc_late"]["least"] <= exact <= found["ifdc_late"]["most"]
    assert found["ifdc_late_rates"]["most"] < 1e-3 < 0.1 < found["ifdc_late"]["least"]


def test_a_board_without_an_axis_has_no_picture(tmp_path: Path) -> None:
    pictures.draw(measuring.board([row("ifdc", 0.1, 0.2, False)], {"nominal": COLUMNS["nominal"]}), tmp_path)
    assert not list(tmp_path.iterdir())


def test_the_page_has_a_place_for_every_table_and_picture(tmp_path: Path) -> None:
    blocks = set(re.findall(r"<!-- generated: (\w+) -->", (DOCS / study.PAGE).read_text()))
    assert blocks == {
        *("ranking", "nominal", "robustness", "times"),
        *(f"picture_{Path(name).stem}" for name in study.PICTURES),
    }


# --- the committed board ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def committed() -> dict[str, dict[str, Any]]:
    if not (DOCS / measuring.DATA).is_file():
        pytest.skip("the board has no page yet: make leaderboard ARGS='--docs --times'")
    board = json.loads((DOCS / measuring.DATA).read_text())
    assert board["board"] == BOARD
    return {row["name"]: row for row in board["rows"]}


# The gains of LQG come from linear algebra, which OpenBLAS rounds in another way on each kind of processor: errors of
# some micrometres, what float32 actions leave on the circle after 2 s, differ by some nanometres.
@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "tolerance"),
    [("ifdc", 0.0), ("shaped", 0.0), ("lqg", 3e-8), ("agent square", 0.0)],
    ids=["ifdc", "shaped", "lqg", "agent square"],
)
def test_the_committed_board_is_computed_again_to_its_digits(
    name: str, tolerance: float, committed: dict[str, dict[str, Any]]
) -> None:
    (row,) = [one for one in all_entries(()) if one.name == name]
    points = COLUMNS["nominal"].points[:2]
    found = dict(leaves(measuring.rounded([point_summary(one) for one in run_points(row, points)])))
    expected = dict(leaves(committed[name]["columns"]["nominal"]["points"][:2]))
    assert found.keys() == expected.keys()
    assert len(expected) > 30
    for place, figure in expected.items():
        assert found[place] == (pytest.approx(figure, rel=0.0, abs=tolerance) if isinstance(figure, float) else figure)


# --- the verb -------------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("uncompiled")
def test_the_verb_measures_what_it_is_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(measuring, "all_entries", lambda added: ROWS)
    monkeypatch.setattr(measuring, "COLUMNS", TINY)
    monkeypatch.setattr(verb, "executor", lambda *arguments: Here())
    verb.run(["--entries", "agent", "--columns", "payload", "--output", str(tmp_path)])
    assert capsys.readouterr().out.endswith("1 of 1 entries; tables beside it\n")
    board = json.loads((tmp_path / measuring.DATA).read_text())
    assert [row["name"] for row in board["rows"]] == ["agent"]
    monkeypatch.setattr(verb, "executor", lambda *arguments: Here(0))
    with pytest.raises(OSError, match="1 failed, see above; their entries lack cells"):
        verb.run(["--entries", "again", "--columns", "payload", "--output", str(tmp_path / "other")])
    assert "again: OSError: killed" in capsys.readouterr().err


def test_added_rows_are_wanted_beside_those_that_are_named() -> None:
    rows = measuring.chosen_entries(["ifdc"], (), ["tests.support.boards:Nobody"])
    assert [row.name for row in rows] == ["ifdc", "tests.support.boards:Nobody"]
    assert [row.name for row in measuring.chosen_entries(["ifdc", "lqg"], ["lqg"])] == ["ifdc"]


def test_the_chain_is_left_out_where_its_engine_is_absent(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The first example of the verb's help ended in an error on the base install."""
    columns = {name: COLUMNS[name] for name in ("nominal", "delay")}
    assert measurable(columns) == (columns, "")
    monkeypatch.setitem(sys.modules, "mujoco", None)
    found, told = measurable(columns)
    assert [point.value for point in found["nominal"].points] == ["square", "track", "reach"]
    assert found["delay"] == columns["delay"]
    assert told.startswith("nominal: without the chain, for which mujoco is not installed; run ")
    monkeypatch.setattr(verb, "executor", lambda *arguments: Here(0))
    with pytest.raises(OSError, match="failed"):
        verb.run(["--entries", "joint_pd", "--columns", "nominal", "--output", str(tmp_path)])
    assert told in capsys.readouterr().err
