"""The site as it is built: no dead link; and in a headless Chromium: search, code, pictures, on a desk and a phone.

Chromium and its driver are found by their names: on Debian `apt-get install chromium chromium-driver`.
"""

import re
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from typing import Any
from urllib.parse import unquote

import pytest

from tests.support.browser import DESK, PHONE, Browser

pytestmark = pytest.mark.slow

WIDGET_PAGES = {"docs/leaderboard.html": "#flexarm-leaderboard table", "docs/replays.html": "#flexarm-replay canvas"}
PAGES = (
    *WIDGET_PAGES,
    "index.html",
    "reference.html",
    "docs/environments/square.html",
    "api/flexarm_env.html",
    "search.html",
    "docs/tutorials/first_agent.html",
    "docs/notebooks/control_engineers.html",
)


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


def test_every_page_is_linked(built: Path) -> None:
    pages = {path.resolve() for path in built.rglob("*.html")} - {
        built.resolve() / one for one in ("404.html", "search.html")
    }
    linked = {
        (page.parent / unquote(link)).resolve()
        for page in pages
        for link in re.findall(r'<a\b[^>]*? href="([^"#?:]+)', page.read_text(encoding="utf-8"))
    }
    assert pages - linked == set()


def test_the_site_takes_nothing_from_the_network(built: Path) -> None:
    texts = {path.relative_to(built).as_posix(): path.read_text(encoding="utf-8") for path in built.rglob("*.html")}
    taken = r"<(?:script|link|img|iframe|source)\b[^>]*?\b(?:src|href)=\"(?:https?:)?//[^\"]*"
    assert {page: found for page, text in texts.items() if (found := re.findall(taken, text))} == {}


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
    browser.run("document.querySelectorAll('details').forEach(one => { one.open = true; })")
    count, found = browser.run(broken)
    assert count > 300
    assert found == []


def test_the_index_is_not_cut_off_on_a_phone(browser: Browser) -> None:
    browser.emulate(PHONE)
    browser.open("genindex.html")
    ends = "return [...document.querySelectorAll('.genindextable a')].map(one => one.getBoundingClientRect().right)"
    assert max(browser.run(ends)) <= PHONE[0]


def results(browser: Browser, query: str) -> list[str]:
    browser.open(f"search.html?q={query}")
    browser.until("document.querySelector('#search-results .search-summary').textContent !== ''")
    browser.until("!document.querySelector('#search-results').textContent.includes('Searching')")
    found: list[str] = browser.run(
        "return [...document.querySelectorAll('#search-results li a')].map(a => a.textContent)"
    )
    return found


@pytest.mark.parametrize("query", ["delay", "leaderboard", "environments", "late sensor", "unknown arm", "submit"])
def test_search_finds_first_what_has_the_words_in_its_title(browser: Browser, query: str) -> None:
    found = results(browser, query)
    words = query.removesuffix("s").split()
    titled = [n for n, title in enumerate(found) if all(word in title.lower() for word in words) and " > " not in title]
    assert titled[0] == 0


@pytest.mark.parametrize(
    ("query", "title"),
    [
        *(("leaderboard", "The leaderboard"), ("batch", "Use batches"), ("install", "Installation")),
        *(("physics step", "Options"), ("torque_limit", "Options"), ("FlexArmVectorEnv", "FlexArmVectorEnv")),
    ],
)
def test_search_finds_first_what_a_reader_looks_for(browser: Browser, query: str, title: str) -> None:
    assert results(browser, query)[0].rpartition(".")[2] == title


def test_search_asks_for_words_where_it_has_none(browser: Browser) -> None:
    browser.open("search.html")
    browser.run("document.querySelector('article [type=search]').focus()")
    browser.press("delay", "\ue007")  # enter
    browser.until("document.querySelectorAll('#search-results li').length > 5")
    assert browser.run("return document.querySelector('article [type=search]').value") == "delay"
    assert browser.run("return document.querySelectorAll('h1').length") == 1


def test_the_sidebar_is_short(browser: Browser) -> None:
    browser.open("index.html")
    assert 4 < browser.run("return document.querySelectorAll('.sidebar-tree > ul > li').length") <= 12
    links = "return [...document.querySelectorAll('.sidebar-tree a')].filter(a => a.checkVisibility()).length"
    assert browser.run(links) <= 12


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_pictures_are_dark_where_the_page_is(browser: Browser, scheme: str) -> None:
    browser.emulate(DESK, prefers_color_scheme=scheme)
    browser.open("index.html")
    look = "return getComputedStyle(document.querySelector('article img')).filter"
    assert (browser.run(look) == "none") == (scheme == "light")


def test_code_is_copied_by_a_button(browser: Browser) -> None:
    browser.open("docs/tutorials/first_agent.html")
    browser.run("navigator.clipboard.writeText = (text) => { window.copied = text; return Promise.resolve(); }")
    code = browser.run("return document.querySelector('.highlight-python pre').textContent")
    browser.run("document.querySelector('.highlight-python .fx-copy').focus()")
    browser.press("\ue007")  # enter
    browser.until("document.querySelector('.highlight-python .fx-copy').textContent === 'Copied'")
    assert browser.run("return window.copied") == code.rstrip()


def test_what_code_prints_has_no_button(browser: Browser) -> None:
    browser.open("docs/tutorials/first_agent.html")
    count = "return document.querySelectorAll(`.highlight-${arguments[0]} .fx-copy`).length"
    assert browser.run("return document.querySelectorAll('.highlight-text').length") > 3
    assert browser.run(count, "text") == 0
    assert browser.run(count, "console") + browser.run(count, "sh") > 0


def test_the_button_covers_no_code_on_a_phone(browser: Browser) -> None:
    browser.emulate(PHONE)
    browser.open("docs/tutorials/first_agent.html")
    covered = (
        "return [...document.querySelectorAll('.highlight:has(.fx-copy)')].filter(box => {"
        "const code = document.createRange(); code.selectNodeContents(box.querySelector('pre'));"
        "return code.getBoundingClientRect().top < box.querySelector('.fx-copy').getBoundingClientRect().bottom;"
        "}).length"
    )
    assert browser.run("return matchMedia('(hover: none)').matches")
    assert browser.run(covered) == 0


def test_wide_tables_fade_where_more_of_them_is(browser: Browser) -> None:
    browser.emulate(PHONE)
    browser.open("docs/agents.html")
    wide = "[...document.querySelectorAll('.table-wrapper')].find(one => one.scrollWidth > one.clientWidth + 100)"
    browser.until(f"{wide}.classList.contains('fx-more-right')")
    browser.run(f"{wide}.scrollLeft = 1e6")
    browser.until(f"{wide}.classList.contains('fx-more-left') && !{wide}.classList.contains('fx-more-right')")


def test_a_page_says_what_it_is_about(built: Path) -> None:
    texts = {path.name: path.read_text(encoding="utf-8") for path in (built / "docs").glob("*.html")}
    told = {name: re.search(r'<meta name="description" content="([^"]{20,240})"', text) for name, text in texts.items()}
    assert [name for name, found in told.items() if not found] == []
    assert all('property="og:title"' in text for text in texts.values())
    assert (built / "_images" / "first_second.png").exists()  # which previews of links show


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


def test_the_reference_has_neither_raw_markup_nor_numbered_fields_nor_sentences_for_types(built: Path) -> None:
    pages = {path.name: path.read_text(encoding="utf-8") for path in (built / "api").glob("*.html")}
    raw = r"Alias for field|[( ]\*\w[^*<]*\w\*[ ,.)]|Return type|>Type<|<blockquote"  # formulas and code are literal
    assert {name: found for name, text in pages.items() if (found := re.findall(raw, text))} == {}
    assert "mean_t" in "".join(re.findall(r"<pre>(.*?)</pre>", pages["flexarm_baselines.optimal.html"], re.DOTALL))


def test_formulas_are_drawn_without_a_script(browser: Browser) -> None:
    browser.open("docs/model.html")
    wide = "return [...document.querySelectorAll('math')].map(one => one.getBoundingClientRect().width)"
    assert len(browser.run(wide)) > 20
    assert min(browser.run(wide)) > 0.0
    assert "\\theta" not in browser.run("return document.querySelector('article').textContent")
