"""`python -m scripts.leaderboard`: cells are kept, executors give the same files, tables say what is in them."""

import json
import re
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
from flexarm_agents.board.figures import ERRORS
from flexarm_agents.board.summary import point_summary, whole_summary
from flexarm_agents.board.tables import place, short_ranking, tables
from flexarm_agents.board.terms import BOARD
from flexarm_agents.commands import leaderboard as verb
from flexarm_agents.jobs.executors import executor
from scripts.common.markdown import DOCS
from scripts.leaderboard import __main__ as study
from scripts.leaderboard import pictures
from tests.support.boards import SHORT, SMALL, files, leaves
from tests.support.refusals import refuses
from tests.support.shell import Shell

LIMITS = [150.0, 50.0]
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
    for less in (["--columns", "nominal"], ["--without", "lqg"]):
        with refuses(ValueError, "docs = True", "must go without entries, without, add and columns"):
            study.check(read(["--docs", "--times", *less]))
    with refuses(ValueError, "docs = True", "must go with times"):
        study.check(read(["--docs", "--output", str(tmp_path)]))


def test_only_submitit_has_parameters(tmp_path: Path) -> None:
    with refuses(ValueError, "parameters = {'slurm_partition': 'cpu'}", "executor = 'processes' has none"):
        executor("processes", 1, tmp_path, {"slurm_partition": "cpu"})


def row(name: str, swing: float | None, plain: float | None, limit: list[float] | None = LIMITS) -> dict[str, Any]:
    """Return an entry whose unknown arms are ten times its two laps."""
    episodes = [
        {"lap": lap, "duration": 1.5, "figures": None if rms is None else dict.fromkeys(ERRORS, rms)}
        for lap, rms in (("swing", swing), ("plain", plain))
    ]
    point, absent = point_summary({"episodes": episodes}), {"not_applicable": "no plan"}
    move = {"lap": None, "duration": 16.0, "figures": dict.fromkeys(ERRORS, 0.1), "success": 1}
    moves = point_summary({"episodes": [move]})
    unknown = COLUMNS["unknown"]
    whole = whole_summary(unknown, [{"episodes": 10 * episodes}, *[{"episodes": []}] * (len(unknown.points) - 1)])
    return {
        "name": name,
        "source": name,
        "action": "torque",
        "torque_limit": limit,
        "reads": ["encoders"],
        "privileged": False,
        "columns": {
            "nominal": {"points": [point, absent, moves, point, point]},
            "payload": {"points": [point] * 6, "kept": [0.0, 0.2] if swing else [], "whole": whole},
            "unknown": {"points": [point], "whole": whole},
        },
    }


@pytest.fixture
def small() -> dict[str, Any]:
    rows = [row("slow", 0.8, 0.7), row("lost", None, 0.01), row("best", 0.06, 0.02, None)]
    rows.append(row("race", 0.1, 0.1))
    for measured in rows[-1]["columns"].values():
        measured.pop("whole", None)
        measured["points"] = [{"not_applicable": "another action"}] * len(measured["points"])
    return measuring.board(rows, {name: COLUMNS[name] for name in ("nominal", "payload", "unknown")})


def test_tables_rank_by_losses_and_quantiles(small: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    best = {name: {"rms": rms, "rms_after_2s": rms} for name, rms in (("swing", 0.05), ("plain", 0.02))}
    small["tasks"]["square"]["best"] = best
    found = tables(small)
    lines = [[cell.strip() for cell in line.split("|")[1:-1]] for line in found["ranking"].splitlines()[2:]]
    assert [line[:2] for line in lines] == [["1", "slow"], ["2", "lost"], ["", "*Without a rank:*"], ["", "best†"]]
    assert lines[0][2:6] == ["0.0 % (0.0 to 16.8)", "700", "800", "+750 / +680"]
    # half of them are lost: the median is the largest of the others, the 90th percentile infinite
    assert lines[1][2:6] == ["50.0 % (27.2 to 72.8)", "10.0", "lost", "lost / -10.0"]
    assert place(small, "lost") == (2, 2)
    assert place(small, "best") is None
    assert "not applicable | 100, 100 %" in found["nominal"]
    assert "lost at 1.5 s / 10.0" in found["axis_payload"]
    assert not any("race" in found[name] for name in ("ranking", "nominal", "axis_payload", "robustness"))
    holds = [line.split("|")[2].strip() for line in found["robustness"].splitlines()]
    assert holds == ["Payload, 0 to 1 kg", "---", "0 to 0.2", "none", "0 to 0.2"]
    monkeypatch.setattr("flexarm_agents.board.tables.SHORT", ("lost", "slow"))
    few = short_ranking(small).splitlines()
    assert few[3] == "| lost | 50.0 % (27.2 to 72.8) | 10.0 | lost | lost | 10.0 |"


def test_ones_own_entry_stands_among_the_shipped_ones(small: dict[str, Any]) -> None:
    columns = {name: COLUMNS[name] for name in ("nominal", "unknown")}
    mine = measuring.board([row("mine", 0.5, 0.4), row("slow", 0.3, 0.2)], columns)
    board = measuring.beside(mine, small)
    assert place(board, "slow") == (1, 3)  # as it was measured now
    assert place(board, "mine") == (2, 3)
    assert set(board["columns"]) == set(columns)
    assert "| 2 | mine |" in tables(board)["ranking"]
    assert "robustness" not in tables(board)  # no axis was measured


def test_other_entries_have_the_points_measured(small: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mujoco", None)
    columns, _ = measurable({"nominal": COLUMNS["nominal"]})
    every = small["rows"][0]["columns"]["nominal"]["points"]
    every[3] = {"not_applicable": "on the chain"}
    board = measuring.beside(measuring.board([], columns), small)
    assert board["rows"][0]["columns"]["nominal"]["points"] == [*every[:3], every[4]]


def test_data_are_as_the_schema_says(small: dict[str, Any]) -> None:
    schema = json.loads(measuring.PUBLISHED.with_suffix(".schema.json").read_text())
    check = pytest.importorskip("jsonschema").Draft202012Validator(schema)
    check.check_schema(schema)
    for board in (small, json.loads(measuring.PUBLISHED.read_text())):
        check.validate(board)
    small["rows"][0]["columns"]["unknown"]["whole"]["rms"]["p90"] = "lost"
    assert not check.is_valid(small)


def test_what_is_shown_may_be_made_anew_without_measuring(
    small: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    docs, data = tmp_path / "docs", tmp_path / measuring.DATA
    docs.mkdir()
    blocks = "".join(f"<!-- generated: {name} -->\nold\n<!-- end -->\n" for name in ("ranking", "times"))
    (docs / study.PAGE).write_text(blocks)
    for other in study.SHOWN[1:]:
        (docs / other).write_text("")
    data.write_text(json.dumps(measuring.rounded(small)))
    monkeypatch.setattr(study, "DOCS", docs)
    monkeypatch.setattr(study, "PUBLISHED", data)
    study.present(tmp_path / "presented")
    page = (docs / study.PAGE).read_text()
    assert "| 1 | slow | " in page
    assert page.endswith("<!-- generated: times -->\nold\n<!-- end -->\n")
    assert {path.name for path in (docs / "figures" / "leaderboard").iterdir()} == {"columns.png"}
    assert json.loads(data.read_text()) == measuring.rounded(small)


def test_who_was_not_measured_at_lap_times_has_no_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    figures: list[Any] = []
    monkeypatch.setattr(pictures, "save", lambda figure, *where: figures.append(figure))
    rows = [row("lqg", 0.1, 0.2), row("nmpc_adaptive", 0.1, 0.2)]
    for one, point in zip(rows, (rows[0]["columns"]["payload"]["points"][0], None), strict=True):
        one["columns"] |= {name: {"points": [point] * len(COLUMNS[name].points)} for name in pictures.PACE}
    pictures.pace(measuring.board(rows, {name: COLUMNS[name] for name in pictures.PACE}), tmp_path)
    assert [text.get_text() for text in figures[0].legends[0].texts] == ["best plans known", "lqg"]


def test_a_board_without_an_axis_has_no_picture(tmp_path: Path) -> None:
    pictures.draw(measuring.board([row("ifdc", 0.1, 0.2)], {"nominal": COLUMNS["nominal"]}), tmp_path)
    assert not list(tmp_path.iterdir())


def test_the_page_has_a_place_for_every_table_and_picture() -> None:
    blocks = set(re.findall(r"<!-- generated: (\w+) -->", (DOCS / study.PAGE).read_text()))
    own = {"times", *(f"picture_{Path(name).stem}" for name in study.PICTURES)}
    axes = {f"axis_{name}" for name, column in COLUMNS.items() if not column.sample}
    assert {"ranking", "nominal", "robustness", *own} <= blocks
    assert blocks <= {"ranking", "nominal", "robustness", *own, *axes}


@pytest.fixture(scope="module")
def committed() -> dict[str, dict[str, Any]]:
    board = json.loads(measuring.PUBLISHED.read_text())
    assert board["board"] == BOARD
    return {row["name"]: row for row in board["rows"]}


# The gains of LQG come from linear algebra, which OpenBLAS rounds in another way on each kind of processor: errors of
# some micrometres, what float32 actions leave on the circle after 2 s, differ by some nanometres.
@pytest.mark.slow
@pytest.mark.parametrize("name", ["ifdc", "shaped", "lqg", "agent square"])
def test_the_committed_board_is_computed_again_to_its_digits(name: str, committed: dict[str, dict[str, Any]]) -> None:
    tolerance = 3e-8 if name == "lqg" else 0.0
    (row,) = [one for one in all_entries(()) if one.name == name]
    points = COLUMNS["nominal"].points[:2]
    found = dict(leaves(measuring.rounded([point_summary(one) for one in run_points(row, points)])))
    expected = dict(leaves(committed[name]["columns"]["nominal"]["points"][:2]))
    assert found.keys() == expected.keys()
    assert len(expected) > 30
    for where, figure in expected.items():
        assert found[where] == (pytest.approx(figure, rel=0.0, abs=tolerance) if isinstance(figure, float) else figure)


@pytest.mark.usefixtures("uncompiled")
def test_the_verb_measures_what_it_is_asked_for(flexarm: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(measuring, "all_entries", lambda added: ROWS)
    monkeypatch.setattr(measuring, "COLUMNS", TINY)
    monkeypatch.setattr(verb, "executor", lambda *arguments: Here())
    told = flexarm("leaderboard", "--entries", "agent", "--columns", "payload", "--output", "mine").stdout
    assert told.endswith("1 of 1 entries; the tables beside it have all\n")
    table = Path("mine/axis_payload.md").read_text()
    assert "| agent |" in table
    assert "| lqg |" in table  # as it was published
    board = json.loads(Path("mine", measuring.DATA).read_text())
    assert [row["name"] for row in board["rows"]] == ["agent"]
    monkeypatch.setattr(verb, "executor", lambda *arguments: Here(0))
    told = flexarm("leaderboard", "--entries", "again", "--columns", "payload", "--output", "other", status=1).stderr
    assert "again: OSError: killed" in told
    assert "1 failed, see above; their entries lack cells" in told


def test_added_rows_are_wanted_beside_those_that_are_named() -> None:
    rows = measuring.chosen_entries(["ifdc"], (), ["tests.support.boards:Nobody"])
    assert [row.name for row in rows] == ["ifdc", "tests.support.boards:Nobody"]
    assert [row.name for row in measuring.chosen_entries(["ifdc", "lqg"], ["lqg"])] == ["ifdc"]
    assert [row.name for row in measuring.chosen_entries([], (), ["tests.support.boards:Nobody"])] == [rows[-1].name]


def test_the_chain_is_left_out_where_its_engine_is_absent(flexarm: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first example of the verb's help ended in an error on the base install."""
    columns = {name: COLUMNS[name] for name in ("nominal", "delay")}
    assert measurable(columns) == (columns, "")
    monkeypatch.setitem(sys.modules, "mujoco", None)
    found, told = measurable(columns)
    assert [point.value for point in found["nominal"].points] == ["square", "track", "reach", "smooth"]
    assert found["delay"] == columns["delay"]
    assert told.startswith("nominal: without the chain, for which mujoco is not installed; run ")
    monkeypatch.setattr(verb, "executor", lambda *arguments: Here(0))
    assert told in flexarm("leaderboard", "--entries", "joint_pd", "--columns", "nominal", status=1).stderr
