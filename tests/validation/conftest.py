"""The checks of docs/validation.md: each is a test that compares a figure with a threshold.

Figure, threshold and the threshold's reason go into pytest's report (`--junitxml`), and so do the tables and the
figures that texts quote. The pictures lie beside the report. `scripts.docs.validation` makes the pages from it.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import matplotlib.pyplot as plt
import pytest
from matplotlib.figure import Figure

from scripts.common.markdown import table
from scripts.common.plotting import headline, save


class Check(NamedTuple):
    name: str  # what is compared, a few words; unique in its module
    figure: Callable[[], float]  # finds it
    reason: str  # why the threshold is what it is, one sentence
    unit: str = ""  # of figure and threshold
    least: float | None = None  # smallest figure that passes
    most: float | None = None  # largest figure that passes


def checked(*checks: Check) -> Callable[[Check, Page], None]:
    @pytest.mark.parametrize("check", checks, ids=[check.name for check in checks])
    def test_check(check: Check, page: Page) -> None:
        page.check(check)

    return test_check


class Page:
    def __init__(self, record: Callable[[str, object], None], figures: Path | None) -> None:
        """Write into a report; `record` adds a property to it, `figures` is where its pictures lie."""
        self._record, self._figures = record, figures

    def check(self, check: Check) -> None:
        """Record a check, and assert that its figure is finite and within its bounds."""
        figure, least, most = float(check.figure()), check.least, check.most
        passed = math.isfinite(figure) and (least is None or least <= figure) and (most is None or figure <= most)
        self._record("check", json.dumps(check._asdict() | {"figure": figure, "passed": passed}))
        assert passed, f"{check.name}: {figure:.6g} {check.unit}, must be from {least} to {most}"

    def quote(self, figures: Mapping[str, float]) -> None:
        self._record("quoted", json.dumps({name: float(figure) for name, figure in figures.items()}))

    def table(self, name: str, header: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
        self._record("table", json.dumps({name: table(header, rows)}))

    def picture(self, figure: Figure, name: str, title: str = "") -> None:
        """Save a picture, or only lay it out if there is no report; `title`: what its panels compare."""
        if title:
            headline(figure, title)
        if self._figures:
            save(figure, self._figures, name)
        else:
            figure.draw_without_rendering()
            plt.close(figure)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    if not terminalreporter.config.getoption("xmlpath"):
        return
    reports = [*terminalreporter.getreports("passed"), *terminalreporter.getreports("failed")]
    checks = [json.loads(value) for one in reports for kind, value in one.user_properties if kind == "check"]
    terminalreporter.section(f"{len(checks)} checks")
    for check in checks:
        bounds = f"least {check['least']}, most {check['most']}".replace("None", "-")
        verdict = "passed" if check["passed"] else "FAILED"
        terminalreporter.write_line(f"{verdict}  {check['name']}: {check['figure']:.3g} {check['unit']} ({bounds})")


@pytest.fixture
def page(request: pytest.FixtureRequest, record_property: Callable[[str, object], None]) -> Page:
    """Record figures in the report, if there is one, and draw pictures beside it."""
    report = request.config.getoption("xmlpath")
    figures = Path(report).resolve().parent / "figures" if report else None
    if figures:
        figures.mkdir(parents=True, exist_ok=True)
    return Page(record_property, figures)
