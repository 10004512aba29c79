"""The site's data: replays fit the code and the leaderboard; the board's script has every row and column."""

import csv
import json
import re
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flexarm_agents.board.entries import Entry, all_entries
from flexarm_agents.board.measure import PUBLISHED, as_csv
from flexarm_agents.board.summary import nominal_errors
from flexarm_agents.board.tables import has_rank, on_square
from scripts.common.markdown import DOCS
from scripts.docs import replays
from scripts.docs.arm_pictures import ARM, recorded
from scripts.docs.widgets import WIDGETS, board_script, replay_names, with_folds, with_widgets

BOARD = json.loads(PUBLISHED.read_text())
RANKED = sum(has_rank(row) and on_square(row) for row in BOARD["rows"])
MOST_BYTES = 60_000  # of a file
INDEX = replays.read(replays.FOLDER / replays.INDEX)[0]
FILES = [(row["name"], lap, file) for row in INDEX["rows"] for lap, file in row["files"].items()]


@given(st.lists(st.lists(st.integers(-(2**40), 2**40), min_size=5, max_size=5), min_size=1, max_size=4))
def test_numbers_are_read_as_they_were_written(values: list[list[int]]) -> None:
    assert (replays.unpacked(replays.packed(np.array(values, float), 0.5), 0.5) == values).all()


def test_the_index_names_the_files_that_are_there() -> None:
    there = {path.name for path in replays.FOLDER.iterdir()}
    assert {file for _, _, file in FILES} | {replays.INDEX} == there
    shown = {lap: {row["name"] for row in INDEX["rows"] if lap in row["files"]} for lap in INDEX["laps"]}
    assert shown == {lap: set(kind.entries) for lap, kind in replays.KINDS.items()}
    assert set(replay_names()) <= {row.name for row in all_entries(())}
    assert [INDEX["laps"][lap]["carried"] for lap in ("race", "carry")] == [[], [5.0, 17.0]]
    assert all(row["text"] == replays.text_of(row["name"]) for row in INDEX["rows"])
    assert INDEX["links"] == replays.shapes(ARM)


@pytest.mark.parametrize(("name", "lap", "file"), FILES, ids=[file for _, _, file in FILES])
def test_a_replay_has_the_error_of_the_board(name: str, lap: str, file: str) -> None:
    path = replays.FOLDER / file
    row, which, one = replays.read(path)
    assert (row, which) == (name, lap)
    assert path.stat().st_size < MOST_BYTES
    assert {channel: count for channel, count, _ in one["channels"]} == dict.fromkeys(replays.STEPS, 2) | {"modal": 6}
    assert {channel: step for channel, _, step in one["channels"]} == replays.STEPS
    distance = recorded(name, lap).away
    (row,) = [row for row in BOARD["rows"] if row["name"] == name]
    if lap == "race":
        ((point,),) = [point.values() for point in row["columns"]["race"]["points"][:1]]
        assert one["ended"] == "finished"
        assert one["interval"] * one["instants"] == pytest.approx(point["three_laps"]["mean"], abs=one["interval"])
        assert distance.max() < 0.25
    elif lap == "carry":
        assert one["ended"] == "truncated"
        assert one["interval"] * (one["instants"] - 1) == pytest.approx(24.0)
        assert distance.max() < 0.7
    else:
        errors = nominal_errors(row)[lap]
        assert errors is not None
        assert one["ended"] == "truncated"
        settled = np.arange(len(distance)) * one["interval"] >= 2.0
        assert np.sqrt(np.mean(distance**2)) == pytest.approx(errors["rms"], abs=5e-6)
        assert np.sqrt(np.mean(distance[settled] ** 2)) == pytest.approx(errors["rms_after_2s"], abs=5e-6)


def of_today(name: str, lap: str, periods: int) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the first periods of an agent's lap, and the lap that is committed."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(replays, "run_policy", partial(replays.run_policy, max_steps=periods))
        _, record = replays.record(Entry(name, f"agent {name}"), replays.KINDS[lap])
    return replays.replay(record), replays.read(replays.FOLDER / replays.file_name(f"agent {name}", lap))[2]


@pytest.mark.parametrize(("name", "lap", "periods"), [("student", "swing", 420), ("carry", "carry", 660)])
def test_a_lap_of_today_is_the_one_that_is_committed(name: str, lap: str, periods: int) -> None:
    """Past the first corner, after 4 s; a payload is taken up after 5 s, and moved from 6 s on."""
    now, then = map(replays.channels, of_today(name, lap, periods))
    for channel, step in replays.STEPS.items():
        assert len(now[channel]) == periods + 1
        np.testing.assert_allclose(now[channel][:-1], then[channel][:periods], rtol=0.0, atol=1.5 * step)


def test_a_race_of_today_begins_as_the_one_that_is_committed() -> None:
    """It is driven at the limits of the torques, where rounding grows: here to 0.4 mm, in a second to some 10 mm."""
    laps = map(replays.channels, of_today("race", "race", 50))
    now, then = (ARM.tip(np.concatenate([one["joints"], one["modal"]], axis=1)) for one in laps)
    np.testing.assert_allclose(now, then[:51], atol=2e-3)


def test_a_record_without_a_reading_is_no_replay() -> None:
    lap = ARM.record(np.zeros(1), np.zeros((1, 16)), np.zeros((1, 2)))
    with pytest.raises(ValueError, match="no reading"):
        replays.replay(lap)


def test_the_board_keeps_every_row_and_column() -> None:
    script = board_script(BOARD, ["lqg"])
    shown = json.loads(script[len("flexarm.board(") : script.rindex(")")])
    assert [row["name"] for row in shown["rows"]] == [row["name"] for row in BOARD["rows"]]
    values = [{name: column["values"] for name, column in one["columns"].items()} for one in (shown, BOARD)]
    assert values[0] == values[1]
    assert sorted(row["place"] for row in shown["rows"] if row["place"]) == [*range(1, RANKED + 1)]
    assert [row["name"] for row in shown["rows"] if row["replay"]] == ["lqg"]
    for row, own in zip(BOARD["rows"], shown["rows"], strict=True):
        for name, column in row["columns"].items():
            assert len(own["columns"][name]) == len(column["points"])
    lqg = next(row for row in shown["rows"] if row["name"] == "lqg")
    full = next(row for row in BOARD["rows"] if row["name"] == "lqg")
    assert lqg["columns"]["nominal"][0][0]["rms"] == full["columns"]["nominal"]["points"][0]["swing"]["rms"]["mean"]


def test_the_data_to_keep_have_every_figure_of_the_board() -> None:
    lines = list(csv.DictReader(as_csv(BOARD).splitlines()))
    points = [
        (row["name"], axis, lap, figure)
        for row in BOARD["rows"]
        for axis, column in row["columns"].items()
        for point, task in zip(column["points"], BOARD["columns"][axis]["tasks"], strict=False)
        if point is not None and "not_applicable" not in point
        for lap in point
        for figure in BOARD["tasks"][task]["figures"]
    ]
    assert [tuple(line[name] for name in ("entry", "column", "lap", "figure")) for line in lines] == points
    lost = next(line for line in lines if line["lost"] == line["episodes"])
    assert lost["mean"] == lost["p90"] == ""
    assert float(lost["first_loss"]) >= 0.0
    lqg = next(row for row in BOARD["rows"] if row["name"] == "lqg")["columns"]["payload"]["points"][1]["plain"]
    where = ["lqg", "payload", "0.2", "plain", "rms"]
    (own,) = [line for line in lines if [line[one] for one in ("entry", "column", "value", "lap", "figure")] == where]
    assert float(own["median"]) == lqg["rms"]["median"]


def test_long_tables_are_folded_and_named() -> None:
    long = "<!-- generated: {} -->\n| {} |\n|---|\n" + 10 * "| 1 |\n" + "<!-- end -->\n"
    page = with_folds(f"# A\n\n## B\n\n{long.format('times', 'row')}\n### C\n\n{long.format('other', 'row')}")
    assert re.findall(r"<summary>(.*)</summary>", page) == ["Table: B", "Table: C"]
    short = "# A\n\n<!-- generated: times -->\n| row |\n|---|\n| 1 |\n<!-- end -->\n"
    assert with_folds(short) == short


def test_a_page_without_javascript_keeps_its_text() -> None:
    page = with_widgets("a\n<!-- site: replays -->\nwithout\n<!-- site end -->\nb\n", Path("docs/replays.md"))
    assert "<noscript>\n\nwithout\n\n</noscript>" in page
    assert 'src="../_static/replay.js"' in page


def test_every_widget_has_its_place_and_its_files() -> None:
    pages = "".join(page.read_text() for page in DOCS.rglob("*.md"))
    for name, widget in WIDGETS.items():
        assert pages.count(f"<!-- site: {name} -->") == (name != "lap")  # for which the site makes room
        assert all((DOCS / "_static" / file).exists() for file in widget.scripts if file != "board.js")


def test_an_unknown_widget_is_refused() -> None:
    with pytest.raises(ValueError, match="'clock'; must be one of"):
        with_widgets("<!-- site: clock -->\n<!-- site end -->", Path("page"))
