"""The site's widgets in a headless Chromium: the board sorts and filters, the viewer plays, both also in the dark."""

import json
import re
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from flexarm_agents.board.tables import has_rank, on_square
from flexarm_env.laps import LAPS
from scripts.docs import replays
from scripts.docs.arm_pictures import ARM, recorded
from tests.docs.test_built_site import WIDGET_PAGES
from tests.docs.test_replays import BOARD
from tests.support.browser import Browser

pytestmark = pytest.mark.slow

# --- the leaderboard ------------------------------------------------------------------------------------------------

ROWS = "return [...document.querySelectorAll('#flexarm-leaderboard tbody tr')]"
NAMES = f"{ROWS}.map(row => row.dataset.row)"
CELLS = f"{ROWS}.map(row => row.cells[arguments[0]].textContent)"
UNRANKED = [row["name"] for row in BOARD["rows"] if not (has_rank(row) and on_square(row))]


def test_the_leaderboard_sorts_by_its_headings(browser: Browser) -> None:
    browser.open("docs/leaderboard.html")
    assert sorted(browser.run(NAMES)) == sorted(row["name"] for row in BOARD["rows"])
    for column in (1, 4, 7):
        heading = f"document.querySelectorAll('#flexarm-leaderboard thead th')[{column}]"
        orders = []
        while len(orders) < 2:
            browser.run(f"{heading}.querySelector('button').click()")
            direction = browser.run(f"return {heading}.getAttribute('aria-sort')")
            names, cells = browser.run(NAMES), browser.run(CELLS, column)
            assert set(names[-len(UNRANKED) :]) == set(UNRANKED)
            cells = cells[: -len(UNRANKED)]
            figures = [float(text.strip("% ")) for text in cells if text not in ("lost", "–")]
            assert figures == sorted(figures, reverse=direction == "descending")
            orders.append(direction)
        assert sorted(orders) == ["ascending", "descending"]
    assert browser.run("return document.querySelectorAll('.fx-chart g').length") == len(BOARD["rows"])


def test_the_leaderboard_is_sorted_by_keyboard(browser: Browser) -> None:
    browser.open("docs/leaderboard.html")
    browser.run("document.querySelector('#flexarm-leaderboard thead button').focus()")
    browser.press("\ue007")  # enter
    assert browser.run(NAMES) == sorted(browser.run(NAMES), key=str.casefold)
    browser.press(" ")
    assert browser.run("return document.activeElement.closest('th').getAttribute('aria-sort')") == "descending"


def test_the_leaderboard_shows_what_reads_no_more_than_allowed(browser: Browser) -> None:
    browser.open("docs/leaderboard.html")
    for reading in ("true state", "strain gauges"):
        browser.run("document.querySelector(`#flexarm-leaderboard input[value='${arguments[0]}']`).click()", reading)
        assert reading not in browser.run("return document.querySelector('#flexarm-leaderboard tbody').textContent")
    allowed = [row["name"] for row in BOARD["rows"] if not {"true state", "strain gauges"} & set(row["reads"])]
    assert sorted(browser.run(NAMES)) == sorted(allowed)
    status = browser.run("return document.querySelector('#flexarm-leaderboard [role=status]').textContent")
    assert status == f"{len(allowed)} of {len(BOARD['rows'])} entries"


@pytest.mark.parametrize("axis", list(BOARD["columns"]))
def test_the_leaderboard_has_every_axis(browser: Browser, axis: str) -> None:
    browser.open("docs/leaderboard.html")
    browser.choose("Axis", axis)
    column = BOARD["columns"][axis]
    heads = browser.run("return [...document.querySelectorAll('#flexarm-leaderboard thead th')].length") - 1
    assert heads == (1 if axis == "unknown" else 1 + len(column["values"]))
    charted = browser.run("return document.querySelectorAll('.fx-chart g').length")
    assert charted == (len(BOARD["rows"]) if isinstance(column["values"][0], float) else 0)


def lost_points(row: dict[str, Any], axis: str) -> int:
    """Return at how many points of an axis a row loses a swing lap."""
    return sum(point["swing"]["lost"] > 0 for point in row["columns"][axis]["points"] if "swing" in point)


def test_an_axis_begins_with_the_rows_that_lose_the_path_least_often(browser: Browser) -> None:
    browser.open("docs/leaderboard.html")
    browser.choose("Axis", "payload")
    rows = {row["name"]: row for row in BOARD["rows"]}
    counts = [lost_points(rows[name], "payload") for name in browser.run(NAMES) if name not in UNRANKED]
    assert counts == sorted(counts)
    assert max(counts) > 0


def test_the_chart_of_an_axis_names_the_first_rows(browser: Browser) -> None:
    browser.open("docs/leaderboard.html")
    browser.choose("Axis", "delay")
    shown = (
        "[...document.querySelectorAll('.fx-chart .fx-label')].filter(one => one.checkVisibility())"
        ".map(one => [one.textContent, one.getBoundingClientRect().top, one.getBoundingClientRect().bottom])"
    )
    labels = sorted(browser.run(f"return {shown}"), key=lambda label: label[1])
    assert sorted(name for name, *_ in labels) == sorted(browser.run(NAMES)[: len(labels)])
    assert len(labels) == 6
    assert all(after[1] >= before[2] - 3.0 for before, after in pairwise(labels))  # [px]; letters without descent
    browser.run("document.querySelector('tr[data-row=flsac]').dispatchEvent(new MouseEvent('mouseenter'))")
    assert [name for name, *_ in browser.run(f"return {shown}")] == ["flsac"]


@pytest.mark.parametrize("axis", ["overview", "delay"])
def test_all_that_the_chart_says_is_within_it(browser: Browser, axis: str) -> None:
    browser.open("docs/leaderboard.html")
    browser.choose("Axis", axis)
    outside = (
        "const frame = document.querySelector('.fx-chart').getBoundingClientRect();"
        "return [...document.querySelectorAll('.fx-chart text')].filter(one => one.checkVisibility()).filter(one => {"
        "const own = one.getBoundingClientRect();"
        "return own.left < frame.left || own.right > frame.right || own.bottom > frame.bottom + 1;"
        "}).map(one => one.textContent)"
    )
    assert browser.run(outside) == []


# --- the replay viewer ----------------------------------------------------------------------------------------------

TIME = "Number(document.querySelector('#flexarm-replay input[type=range]').value)"
PICTURE = "return document.querySelector('.fx-arm').toDataURL()"
PLAYED = "document.querySelectorAll('#flexarm-replay .fx-figures tbody tr').length === 6"


@pytest.fixture
def viewer(browser: Browser) -> Browser:
    browser.open("docs/replays.html")
    browser.until(PLAYED)
    return browser


def test_the_viewer_plays_and_pauses_by_keyboard(viewer: Browser) -> None:
    before = viewer.run(PICTURE)
    assert viewer.run(f"return {TIME}") == 0.3  # the arms have parted
    viewer.press(" ")
    viewer.until(f"{TIME} > 0.5")
    viewer.press(" ")
    stopped = viewer.run(f"return {TIME}")
    assert viewer.run(PICTURE) != before
    viewer.press("\ue014")  # right
    assert viewer.run(f"return {TIME}") == pytest.approx(stopped + 0.05, abs=0.011)
    viewer.press("\ue011")  # home
    assert viewer.run(f"return {TIME}") == 0.0
    viewer.press("\ue010")  # end
    assert viewer.run(f"return {TIME}") == 16.0


def test_the_first_page_plays_a_lap_until_it_is_paused(browser: Browser) -> None:
    browser.open("index.html")
    browser.until(f"{TIME} > 0.5")
    browser.run("document.querySelector('#flexarm-replay .fx-button').focus()")
    browser.press("\ue007")  # enter
    stopped = browser.run(f"return {TIME}")
    assert browser.run("return document.querySelectorAll('#flexarm-replay canvas').length") == 1
    assert browser.run("return document.querySelectorAll('#flexarm-replay dt').length") == 2
    browser.press("\ue014")  # right
    assert browser.run(f"return {TIME}") == pytest.approx(stopped + 0.05, abs=0.011)


def test_the_first_page_does_not_move_for_who_wants_no_motion(browser: Browser) -> None:
    browser.emulate(prefers_reduced_motion="reduce")
    browser.open("index.html")
    browser.until(f"{TIME} === 0.3")
    assert browser.run("return document.querySelector('#flexarm-replay .fx-button').textContent") == "▶ Play"


def test_the_viewer_draws_the_links_where_the_arm_has_them(viewer: Browser) -> None:
    q = recorded("ifdc", "swing").q
    for n in (0, 57, 730, 1600):
        links = viewer.run("return flexarm.linkPoints('ifdc', 'swing', arguments[0])", n)
        for link, points in enumerate(links, 1):
            places = np.linspace(0.0, ARM.parameters.link_lengths[link - 1], replays.POINTS)
            np.testing.assert_allclose(points, [ARM.position(q[n], link, x) for x in places], atol=1e-6)


@pytest.mark.parametrize(("lap", "name"), [(lap, name) for lap in LAPS for name in replays.KINDS[lap].entries])
def test_the_viewer_shows_the_errors_of_the_board(viewer: Browser, name: str, lap: str) -> None:
    viewer.choose("First", name)
    viewer.run("document.querySelector(`#flexarm-replay input[value='${arguments[0]}']`).click()", lap)
    heading = "document.querySelector('.fx-figures thead th:nth-child(2)').textContent.replaceAll('\\u200b', '')"
    viewer.until(f"{heading} === {json.dumps(name)}")
    (row,) = [row for row in BOARD["rows"] if row["name"] == name]
    viewer.until("document.querySelector('.fx-hint + .fx-hint').textContent.includes(" + json.dumps(lap) + ")")
    shown = viewer.run("return document.querySelectorAll('.fx-figures tbody tr')[2].cells[1].textContent")
    error = row["columns"]["nominal"]["points"][0][lap]["rms"]["mean"]
    assert float(shown) == pytest.approx(1000.0 * error, abs=0.051)


@pytest.mark.parametrize("lap", ["race", "carry"])
def test_the_viewer_offers_who_runs_a_lap_and_says_how_long_it_took(viewer: Browser, lap: str) -> None:
    viewer.run("document.querySelector(`#flexarm-replay input[value='${arguments[0]}']`).click()", lap)
    viewer.until(f"document.querySelector('.fx-hint + .fx-hint').textContent.includes('{lap}')")
    offered = "return [...document.querySelector('#flexarm-replay select').options].map(one => one.value)"
    assert set(viewer.run(offered)) == set(replays.KINDS[lap].entries)
    name = viewer.run("return document.querySelector('#flexarm-replay select').value")
    shown = viewer.run("return document.querySelectorAll('.fx-figures tbody tr')[3].cells[1].textContent")
    one = replays.read(replays.FOLDER / replays.file_name(name, lap))[2]
    assert float(shown) == pytest.approx(one["interval"] * one["instants"], abs=1.1 * one["interval"])


def test_the_viewer_may_be_hidden_and_shown(viewer: Browser) -> None:
    before = viewer.run(PICTURE)
    mount = "document.getElementById('flexarm-replay').style.display"
    for shown in ("none", "block"):
        viewer.run(f"{mount} = '{shown}'; document.body.dataset.theme = 'light'")
        viewer.driver.execute_async_script("requestAnimationFrame(() => requestAnimationFrame(arguments[0]))")
    assert viewer.run(PICTURE) == before


def test_the_traces_move_the_time(viewer: Browser) -> None:
    viewer.run(
        "const traces = document.querySelector('.fx-traces canvas'), box = traces.getBoundingClientRect();"
        "const at = {clientX: box.left + box.width / 2, buttons: 1, bubbles: true};"
        "traces.dispatchEvent(new PointerEvent('pointerdown', at))"
    )
    assert viewer.run(f"return {TIME}") == pytest.approx(7.7, abs=0.5)


@pytest.mark.parametrize(("name", "lap"), [("agent square", "swing"), ("agent carry", "carry"), ("race_lqg", "race")])
def test_the_link_of_a_row_chooses_it_and_a_lap_that_it_runs(browser: Browser, name: str, lap: str) -> None:
    browser.open("docs/leaderboard.html")
    link = f"document.querySelector('[data-row=\"{name}\"] .fx-play').href"
    browser.driver.get(browser.run(f"return {link}"))
    browser.until(PLAYED)
    assert browser.run("return document.querySelector('#flexarm-replay select').value") == name
    assert browser.run("return document.querySelector('#flexarm-replay input:checked').value") == lap


def test_motion_is_reduced_for_who_asks(browser: Browser) -> None:
    browser.emulate(prefers_reduced_motion="reduce")
    browser.open("docs/replays.html")
    browser.until(PLAYED)
    browser.press(" ")
    browser.until(f"{TIME} > 0.6")
    browser.press(" ")
    assert browser.run(f"return {TIME}") % 0.25 == pytest.approx(0.0, abs=1e-9)


# --- the theme ------------------------------------------------------------------------------------------------------

BACKGROUND = "return getComputedStyle(document.body).backgroundColor"
INK = "return getComputedStyle(document.querySelector('.fx')).getPropertyValue('--fx-text').trim()"


def by_the_system(browser: Browser) -> None:
    browser.emulate(prefers_color_scheme="dark")


def by_the_switch(browser: Browser) -> None:
    browser.run("document.body.dataset.theme = 'dark'")


@pytest.mark.parametrize("darken", [by_the_system, by_the_switch])
@pytest.mark.parametrize("page", WIDGET_PAGES)
def test_dark_is_dark(browser: Browser, page: str, darken: Callable[[Browser], None]) -> None:
    browser.open(page)
    browser.until(f"document.querySelector('{WIDGET_PAGES[page]}') !== null")
    light = browser.run(INK)
    darken(browser)
    assert browser.run(INK) != light
    assert sum(map(int, re.findall(r"\d+", browser.run(BACKGROUND))[:3])) < 150


def test_the_viewer_is_drawn_anew_in_the_dark(viewer: Browser) -> None:
    before = viewer.run(PICTURE)
    by_the_switch(viewer)
    viewer.until(f"document.querySelector('.fx-arm').toDataURL() !== {json.dumps(before)}")
