"""The checks of docs/validation.md: each is a test that compares a figure with a threshold.

Figure, threshold and the threshold's reason go into pytest's report (`--junitxml`), and so do the tables and the
figures that texts quote. The pictures lie beside the report. `scripts.docs.validation` makes the pages from it.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import pytest
from matplotlib.figure import Figure

from scripts.common.markdown import table
from scripts.common.plotting import save


class Page:
    """Records what the page shows."""

    def __init__(self, record: Callable[[str, object], None], figures: Path) -> None:
        """Write into a report.

        Args:
            record: adds a property to the test's report.
            figures: folder of the pictures.
        """
        self._record, self._figures = record, figures

    def check(
        self,
        name: str,
        figure: float,
        reason: str,
        unit: str = "",
        least: float | None = None,
        most: float | None = None,
    ) -> None:
        """Record a check, and assert that its figure is finite and within its bounds.

        Args:
            name: what is compared, a few words; unique in its module.
            figure: what was found.
            reason: why the threshold is what it is, one sentence.
            unit: unit of figure and threshold.
            least: smallest figure that passes.
            most: largest figure that passes.
        """
        bounds = {key: float(value) for key, value in (("least", least), ("most", most)) if value is not None}
        assert reason
        assert bounds
        passed = math.isfinite(figure) and bounds.get("least", -math.inf) <= figure <= bounds.get("most", math.inf)
        found = {"name": name, "figure": float(figure), "reason": reason, "unit": unit, "least": None, "most": None}
        self._record("check", json.dumps(found | bounds | {"passed": bool(passed)}))
        assert passed, f"{name}: {figure:.6g} {unit}, must be within {bounds}"

    def quote(self, figures: Mapping[str, float]) -> None:
        """Record figures that texts quote, by their names there."""
        self._record("quoted", json.dumps({name: float(figure) for name, figure in figures.items()}))

    def table(self, name: str, header: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
        """Record a table, by the name of its block."""
        self._record("table", json.dumps({name: table(header, rows)}))

    def picture(self, figure: Figure, name: str) -> None:
        """Write a picture."""
        save(figure, self._figures, name)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Print all checks where a report is written."""
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
def page(request: pytest.FixtureRequest, record_property: Callable[[str, object], None], tmp_path: Path) -> Page:
    """Record figures in the report, if there is one, and draw pictures beside it."""
    report = request.config.getoption("xmlpath")
    figures = Path(report).resolve().parent / "figures" if report else tmp_path
    figures.mkdir(parents=True, exist_ok=True)
    return Page(record_property, figures)
