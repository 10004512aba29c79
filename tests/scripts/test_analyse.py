"""`python -m scripts.analysis`: docs/analysis.md has what a small run of each study gives."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib import pyplot as plt

from scripts.analysis import figures, margins, passivity, simulated, tables, zeros
from scripts.analysis.__main__ import STUDIES
from scripts.common.markdown import DOCS, shown_blocks


def prose() -> str:
    return " ".join((DOCS / "analysis.md").read_text().split())


def assert_on_page(block: str, text: str) -> None:
    """Assert that a page's block has all lines of a table."""
    shown = shown_blocks()[block].splitlines()
    lines = text.splitlines()
    assert len(lines) > 2
    assert [line for line in lines if line not in shown] == [], f"{block}: run python -m scripts.analysis --docs"


def test_the_page_has_the_slowest_zeros() -> None:
    models = {"1 mode, undamped": zeros.undamped(1), "2 modes, undamped": zeros.undamped(2)}
    found = {"zeros": {"by_model": zeros.by_model(models), "locus": zeros.locus(models, 4)}}
    assert_on_page("zeros_by_model", tables.zeros_by_model(found))
    one, exact = found["zeros"]["by_model"][0], found["zeros"]["by_model"][-1]["zero"]
    assert found["zeros"]["locus"]["exact link 1"][0] == pytest.approx(exact)
    for sentence in (
        f"tanh z = 0: {exact:.2f} rad/s",
        f"1/z of the exact beam is {1e3 / exact:.0f} ms",
        f"{100.0 * 3.15 / exact:.0f} cm",
        f"at {one['entries'][0]:.2f} m, {100 * one['entries'][0] / 4.5:.0f} % of the link",
    ):
        assert sentence in prose()
    plt.close(figures.zeros_locus(found))


def test_the_page_says_where_the_law_is_active() -> None:
    found = {"passivity": passivity.study(20, 1)}
    plt.close(figures.passivity(found))
    law = found["passivity"]["law"]
    assert f"Kd / Kp = {1e3 * law['longest_passive_delay']:.0f} ms" in prose()
    assert f"from {law['active_from']:.0f} rad/s on" in prose()


@pytest.fixture(scope="module")
def linear() -> dict[str, Any]:
    """Return what the linear theory says of the paper's arm under IFDC."""
    rows = margins.rows(["paper's arm"], ["IFDC"])
    return {
        "rows": rows,
        "room": margins.room(rows),
        "by_modes": margins.by_modes((1, 2)),
        "profile": margins.profile(2, ["IFDC"]),
        "largest_gains": margins.largest_gains([], (1,)),
    }


def test_the_page_has_the_margins(linear: dict[str, Any]) -> None:
    results = {"linear": linear}
    assert_on_page("margins_by_modes", tables.margins_by_modes(results))
    assert_on_page("largest_gains", tables.largest_gains(results))
    assert len(linear["rows"]) == 6
    late, rates = (
        next(row for row in linear["rows"] if (row["sensor"], row["delayed"]) == ("end effector", delayed))
        for delayed in margins.DELAYED
    )
    tip = linear["largest_gains"][0]
    for sentence in (
        f"{1e3 * late['corner']['delay_margin']:.0f} to {1e3 * late['mid-side']['delay_margin']:.0f} ms for IFDC",
        f"{1e3 * rates['corner']['delay_margin']:.2f} to {1e3 * rates['mid-side']['delay_margin']:.2f} ms",
        f"lambda = {tip['corner']:.3f} on a corner and {tip['mid-side']:.3f} in the middle of a side",
    ):
        assert sentence in prose()


def test_one_simulated_case_diverges_where_the_linear_theory_says(linear: dict[str, Any]) -> None:
    """A push of the held arm, with late rates, which fail fast."""
    own = next(row["corner"] for row in linear["rows"] if row["delayed"] == "position+rate")
    step = simulated.step(own["delay_margin"], own["omega"])
    test = simulated.held_diverges("end effector", "position+rate", 1.0, margins.PLACES["corner"], step)
    found = test(own["delay_margin"] * np.geomspace(0.8, 1.25, simulated.LANES))
    assert not found[0]
    assert found[-1]


@pytest.mark.slow
def test_all_tables_are_those_of_the_page(tmp_path: Path) -> None:
    for name, study in STUDIES.items():
        results = study.results(tmp_path / name, 1)
        for block, tabulate in study.tables.items():
            assert tabulate(results) == shown_blocks()[block]
        for draw in study.pictures.values():
            plt.close(draw(results))
        if name == "margins":
            worst = max(
                abs(end / row[place]["delay_margin"] - 1.0)
                for row in results["linear"]["rows"]
                for case in results.values()
                for place in margins.PLACES
                if "lap" in case and row["arm"] == "paper's arm"
                if all(row[key] == case[key] for key in ("sensor", "delayed", "controller"))
                for end in case[place]
            )
            assert f"within {100.0 * worst:.1f} %" in prose()
