"""The site as it is built: no dead link; and in a headless Chromium: it plays, sorts, filters, by keyboard, on a phone.

Chromium and its driver are found by their names: on Debian `apt-get install chromium chromium-driver`.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from typing import Any
from urllib.parse import unquote

import numpy as np
import pytest

from flexarm_env.simulation.arm import FlexibleArm
from scripts.docs import replays, site
from scripts.docs.widgets import replay_names
from tests.docs.test_replays import BOARD, arguments
from tests.support.browser import DESK, PHONE, Browser, chromium_at
from tests.support.programs import ROOT, run_study

pytestmark = pytest.mark.slow

WIDGET_PAGES = {"docs/leaderboard.html": "#flexarm-leaderboard table", "docs/replays.html": "#flexarm-replay canvas"}
PAGES = (
    *WIDGET_PAGES,
    "index.html",
    "docs/environments/square.html",
    "api/flexarm_env.html",
    "search.html",
    "docs/tutorials/first_agent.html",
    "docs/notebooks/control_engineers.html",
)


@pytest.fixture(scope="module")
def built() -> Path:
    """Build the site once."""
    for needed in ("sphinx", "myst_nb", "furo", "notfound"):
        pytest.importorskip(needed, reason="the extra `site` brings it")
    done = run_study("docs.site", cwd=ROOT)
    assert done.returncode == 0, done.stdout + done.stderr
    return site.OUTPUT


def test_the_site_has_no_dead_link(built: Path) -> None:
    assert {"index.html", "404.html", "search.html"} <= {path.name for path in built.iterdir()}
    texts = {path.resolve(): path.read_text(encoding="utf-8") for path in built.rglob("*.html")}
    for page, text in texts.items():
        links = [] if page.name == "404.html" else re.findall(r'(?:href|src)="([^"]+)"', text)
        for link in (one for one in links if not re.match(r"[a-z]+:|//", one)):
            file, _, anchor = link.partition("#")
            target = (page.parent / unquote(file.partition("?")[0])).resolve() if file else page
            assert target.exists(), f"{page}: {link}"
            assert not anchor or target not in texts or f'id="{anchor}"' in texts[target], f"{page}: {link}"


def test_the_site_takes_nothing_from_the_network(built: Path) -> None:
    texts = {path.relative_to(built).as_posix(): path.read_text(encoding="utf-8") for path in built.rglob("*.html")}
    taken = r"<(?:script|link|img|iframe|source)\b[^>]*?\b(?:src|href)=\"(?:https?:)?//[^\"]*"
    assert {page: found for page, text in texts.items() if (found := re.findall(taken, text))} == {}


# --- in a browser ---------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def chromium(built: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with chromium_at(built, tmp_path_factory.mktemp("chromium")) as opened:
        yield opened


@pytest.fixture
def browser(chromium: Browser) -> Iterator[Browser]:
    """Begin at a desk in the light; complain about whatever the console says."""
    chromium.emulate()
    chromium.complaints()
    yield chromium
    assert chromium.complaints() == []


@pytest.mark.parametrize("size", [DESK, PHONE], ids=["desk", "phone"])
@pytest.mark.parametrize("page", PAGES)
def test_a_page_fits_and_its_pictures_are_there(browser: Browser, page: str, size: tuple[int, int]) -> None:
    browser.emulate(size)
    browser.open(page)
    if page in WIDGET_PAGES:
        browser.until(f"document.querySelector('{WIDGET_PAGES[page]}') !== null")
    assert browser.run("return document.documentElement.scrollWidth") <= size[0]
    missing = "return [...document.images].filter(one => one.complete && !one.naturalWidth).map(one => one.src)"
    assert browser.run(missing) == []


def test_what_is_short_in_a_table_takes_a_line(browser: Browser) -> None:
    browser.emulate(PHONE)
    browser.open("docs/leaderboard.html")
    broken = (
        "const cells = [...document.querySelectorAll('table.docutils tbody td p')];"
        "const lines = text => Math.round(text.clientHeight / parseFloat(getComputedStyle(text).lineHeight));"
        "const short = cells.filter(text => text.textContent.length <= 16);"
        "return [short.length, short.filter(text => lines(text) > 1).map(text => text.textContent)]"
    )
    count, found = browser.run(broken)
    assert count > 1000
    assert found == []


def test_the_index_is_not_cut_off_on_a_phone(browser: Browser) -> None:
    browser.emulate(PHONE)
    browser.open("genindex.html")
    ends = "return [...document.querySelectorAll('.genindextable a')].map(one => one.getBoundingClientRect().right)"
    assert max(browser.run(ends)) <= PHONE[0]


def test_search_works_from_the_disk(browser: Browser) -> None:
    browser.open("search.html?q=delay")
    browser.until("document.querySelectorAll('#search-results li').length > 5")
    browser.until("!document.querySelector('#search-results').textContent.includes('Searching')")


def test_a_wrong_address_has_a_page_of_the_site(browser: Browser) -> None:
    """Its links begin where the site does, so that a server must answer."""

    class Server(SimpleHTTPRequestHandler):
        def send_error(self, code: int, message: str | None = None, explain: str | None = None) -> None:
            self.send_response(200)
            self.end_headers()
            self.wfile.write((browser.folder / "404.html").read_bytes())

        def log_message(self, format: str, *values: Any) -> None:
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), partial(Server, directory=str(browser.folder))) as server:
        thread = Thread(target=server.serve_forever)
        thread.start()
        try:
            browser.driver.get(f"http://127.0.0.1:{server.server_port}/docs/no/such_page.html")
            assert "Page not found" in browser.run("return document.body.textContent")
            assert browser.run("return getComputedStyle(document.querySelector('.sidebar-drawer')).display") == "flex"
        finally:
            server.shutdown()
            thread.join()


def test_the_reference_takes_no_sentence_for_a_type(built: Path) -> None:
    pages = {path.name: path.read_text(encoding="utf-8") for path in (built / "api").glob("*.html")}
    assert [name for name, text in pages.items() if "Return type" in text or ">Type<" in text] == []


def test_the_reference_has_neither_raw_markup_nor_numbered_fields(built: Path) -> None:
    pages = {path.name: path.read_text(encoding="utf-8") for path in (built / "api").glob("*.html")}
    raw = r"Alias for field|[( ]\*\w[^*<]*\w\*[ ,.)]"
    assert {name: found for name, text in pages.items() if (found := re.findall(raw, text))} == {}
    assert [name for name, text in pages.items() if "<blockquote" in text] == []  # formulas and code are literal
    assert "mean_t" in "".join(re.findall(r"<pre>(.*?)</pre>", pages["flexarm_baselines.optimal.html"], re.DOTALL))


# --- the leaderboard ------------------------------------------------------------------------------------------------

ROWS = "return [...document.querySelectorAll('#flexarm-leaderboard tbody tr')]"
NAMES = f"{ROWS}.map(row => row.dataset.row)"
CELLS = f"{ROWS}.map(row => row.cells[arguments[0]].textContent)"


def test_the_leaderboard_sorts_by_its_headings(browser: Browser) -> None:
    browser.open("docs/leaderboard.html")
    assert sorted(browser.run(NAMES)) == sorted(row["name"] for row in BOARD["rows"])
    for column in (1, 4, 7):
        heading = f"document.querySelectorAll('#flexarm-leaderboard thead th')[{column}]"
        orders = []
        while len(orders) < 2:
            browser.run(f"{heading}.querySelector('button').click()")
            direction = browser.run(f"return {heading}.getAttribute('aria-sort')")
            figures = [float(text.strip("*% ")) for text in browser.run(CELLS, column) if text[0].isdigit()]
            assert figures == sorted(figures, reverse=direction == "descending")
            orders.append(direction)
        assert sorted(orders) == ["ascending", "descending"]
        assert browser.run(CELLS, column)[-1] in ("lost", "–") or column == 7


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
    assert status == f"{len(allowed)} of {len(BOARD['rows'])} rows"


@pytest.mark.parametrize("axis", list(BOARD["columns"]))
def test_the_leaderboard_has_every_axis(browser: Browser, axis: str) -> None:
    browser.open("docs/leaderboard.html")
    browser.choose("Axis", axis)
    column = BOARD["columns"][axis]
    heads = browser.run("return [...document.querySelectorAll('#flexarm-leaderboard thead th')].length") - 1
    assert heads == (1 if axis == "unknown" else len(column["values"]))
    charted = browser.run("return document.querySelectorAll('.fx-chart g').length")
    assert charted == (len(BOARD["rows"]) if isinstance(column["values"][0], float) else 0)


# --- the replay viewer ----------------------------------------------------------------------------------------------

TIME = "Number(document.querySelector('#flexarm-replay input[type=range]').value)"
PICTURE = "return document.querySelector('.fx-arm').toDataURL()"
PLAYED = "document.querySelectorAll('#flexarm-replay .fx-figures tbody tr').length === 5"


@pytest.fixture
def viewer(browser: Browser) -> Browser:
    browser.open("docs/replays.html")
    browser.until(PLAYED)
    return browser


def test_the_viewer_plays_and_pauses_by_keyboard(viewer: Browser) -> None:
    before = viewer.run(PICTURE)
    viewer.press(" ")
    viewer.until(f"{TIME} > 0.2")
    viewer.press(" ")
    stopped = viewer.run(f"return {TIME}")
    assert viewer.run(PICTURE) != before
    viewer.press("\ue014")  # right
    assert viewer.run(f"return {TIME}") == pytest.approx(stopped + 0.05, abs=0.011)
    viewer.press("\ue011")  # home
    assert viewer.run(f"return {TIME}") == 0.0
    assert viewer.run(PICTURE) == before
    viewer.press("\ue010")  # end
    assert viewer.run(f"return {TIME}") == 16.0


def test_the_viewer_draws_the_links_where_the_arm_has_them(viewer: Browser) -> None:
    arm = FlexibleArm()
    found = replays.channels(arguments(replays.FOLDER / replays.file_name("ifdc", "swing"))[2])
    q = np.concatenate([found["joints"], found["modal"]], axis=1)
    for n in (0, 57, 730, 1600):
        links = viewer.run("return flexarm.linkPoints('ifdc', 'swing', arguments[0])", n)
        for link, points in enumerate(links, 1):
            places = np.linspace(0.0, arm.parameters.link_lengths[link - 1], replays.POINTS)
            np.testing.assert_allclose(points, [arm.position(q[n], link, x) for x in places], atol=1e-6)


@pytest.mark.parametrize("name", replay_names())
@pytest.mark.parametrize("lap", ["swing", "plain"])
def test_the_viewer_shows_the_errors_of_the_board(viewer: Browser, name: str, lap: str) -> None:
    viewer.choose("First", name)
    viewer.run("document.querySelector(`#flexarm-replay input[value='${arguments[0]}']`).click()", lap)
    heading = "document.querySelector('.fx-figures thead th:nth-child(2)').textContent.replaceAll('\\u200b', '')"
    viewer.until(f"{heading} === {json.dumps(name)}")
    (row,) = [row for row in BOARD["rows"] if row["name"] == name] or [None]
    viewer.until("document.querySelector('.fx-hint + .fx-hint').textContent.includes(" + json.dumps(lap) + ")")
    shown = viewer.run("return document.querySelectorAll('.fx-figures tbody tr')[2].cells[1].textContent")
    if row is not None:
        error = row["columns"]["nominal"]["points"][0][lap]["rms"]["mean"]
        assert float(shown) == pytest.approx(1000.0 * error, abs=0.051)


def test_the_viewer_may_be_hidden_and_shown(viewer: Browser) -> None:
    before = viewer.run(PICTURE)
    mount = "document.getElementById('flexarm-replay').style.display"
    for shown in ("none", "block"):
        viewer.run(f"{mount} = '{shown}'; document.body.dataset.theme = 'light'")
        viewer.driver.execute_async_script("requestAnimationFrame(() => requestAnimationFrame(arguments[0]))")
    assert viewer.run(PICTURE) == before


def test_formulas_are_drawn_without_a_script(browser: Browser) -> None:
    browser.open("docs/model.html")
    wide = "return [...document.querySelectorAll('math')].map(one => one.getBoundingClientRect().width)"
    assert len(browser.run(wide)) > 20
    assert min(browser.run(wide)) > 0.0
    assert "\\theta" not in browser.run("return document.querySelector('article').textContent")


def test_the_traces_move_the_time(viewer: Browser) -> None:
    viewer.run(
        "const traces = document.querySelector('.fx-traces canvas'), box = traces.getBoundingClientRect();"
        "const at = {clientX: box.left + box.width / 2, buttons: 1, bubbles: true};"
        "traces.dispatchEvent(new PointerEvent('pointerdown', at))"
    )
    assert viewer.run(f"return {TIME}") == pytest.approx(7.7, abs=0.5)


def test_the_link_of_a_row_chooses_it(browser: Browser) -> None:
    browser.open("docs/leaderboard.html")
    link = "document.querySelector('[data-row=\"agent square\"] .fx-play').href"
    browser.driver.get(browser.run(f"return {link}"))
    browser.until(PLAYED)
    assert browser.run("return document.querySelector('#flexarm-replay select').value") == "agent square"


def test_motion_is_reduced_for_who_asks(browser: Browser) -> None:
    browser.emulate(prefers_reduced_motion="reduce")
    browser.open("docs/replays.html")
    browser.until(PLAYED)
    browser.press(" ")
    browser.until(f"{TIME} > 0.4")
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
