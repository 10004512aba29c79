"""The built site, and a browser that looks at it."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from scripts.docs import site
from tests.support.browser import Browser, chromium_at
from tests.support.programs import ROOT, run_study


@pytest.fixture(scope="session")
def built() -> Path:
    for needed in ("sphinx", "myst_nb", "furo", "notfound"):
        pytest.importorskip(needed, reason="the extra `site` brings it")
    done = run_study("docs.site", cwd=ROOT)
    assert done.returncode == 0, done.stdout + done.stderr
    return site.OUTPUT


@pytest.fixture(scope="session")
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
