"""`python -m scripts.control`: its tables stand in their pages, and say when a lap was lost."""

from __future__ import annotations

import json
import re
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flexarm_agents.evaluation.scoring import Score
from flexarm_baselines.joint_space.tracking import DECOUPLED, JointFeedback
from flexarm_baselines.registry import controller_names
from scripts.common.markdown import DOCS
from scripts.control import robust
from scripts.control.__main__ import STUDIES
from scripts.control.joint import slowest_decay
from scripts.control.parts import cell_of
from scripts.control.trials import Trial, cell
from tests.support.programs import refusal, run_study

run_script = partial(run_study, "control")


def block(name: str) -> str:
    """Return a table as its page shows it."""
    page = (DOCS / STUDIES[name].page).read_text()
    found = re.search(rf"<!-- generated: {name} -->\n(.*?)<!-- end -->", page, re.DOTALL)
    assert found, f"{STUDIES[name].page} has no place for {name}"
    return found[1]


@pytest.mark.parametrize("name", [name for name, study in STUDIES.items() if (DOCS / study.page).exists()])
def test_every_table_stands_in_its_page(name: str) -> None:
    """With a line for the head, one below it, and some for what was tried."""
    study = STUDIES[name]
    assert len(block(name).splitlines()) > 3
    assert 1 <= len(study.trials(True)) <= len(study.trials(False))


def test_the_page_has_every_controller_of_the_registry() -> None:
    assert re.findall(r"^\| `(\w+)` \|", block("controllers"), re.MULTILINE) == list(controller_names())


def test_a_lost_lap_has_its_time_and_no_errors() -> None:
    lap: Any = Score._make([None] * len(Score._fields))._replace(duration=3.14159, rms=0.5, rms_after_2s=0.25)
    assert cell(lap) == "500 / 250"
    assert cell(lap._replace(rms=None, rms_after_2s=None)) == "lost at 3.1 s"


def test_a_lost_lap_has_the_median_time_of_its_draws() -> None:
    def lap(ended: str, duration: float, error: float | None) -> Score:
        return Score(ended, duration, *[error] * 4, (1.0, 1.0), 0, (0.1, 0.1), (1.0, 1.0), 0.0)

    lost = [lap("error", duration, None) for duration in (3.0, 11.0, 2.0)]
    assert cell_of(lost) == "lost at 3.0 s (2.0 to 11.0)"
    assert cell_of([lost[0], lap("truncated", 16.0, 0.02)]) == "lost 1 of 2 at 3.0 s"
    assert cell_of([lap("truncated", 16.0, 0.02)]) == "20.0 / 20.0"


def test_decays_of_joint_feedback() -> None:
    """As read, the usual gains destabilise; filtered and soft, they settle."""
    assert slowest_decay(JointFeedback((1000.0, 130.0), (40.0, 30.0), 0.0, 0.0)) < -50.0
    assert slowest_decay(JointFeedback()) > 0.25
    assert slowest_decay(DECOUPLED) > 0.25
    none = JointFeedback((0.0, 0.0), (0.0, 0.0))
    assert slowest_decay(none) == pytest.approx(0.0, abs=1e-5)  # rigid motions neither grow nor decay


def test_what_is_refused() -> None:
    assert "tables = 'none': must be one of 'controllers'" in refusal("control", "--tables", "none")
    assert "jobs = 0" in refusal("control", "--jobs", 0)
    assert "quick run has no whole tables" in refusal("control", "--quick", "--docs")
    with pytest.raises(ValueError, match=r"name = 'nobody'"):
        Trial("nobody").score()


@pytest.mark.slow
def test_a_quick_run_writes_tables(tmp_path: Path) -> None:
    result = run_script("--quick", "--tables", "joint_gains", "command_shaping", "--output", tmp_path)
    assert result.returncode == 0, result.stderr
    for name in ("joint_gains", "command_shaping"):
        assert len((tmp_path / f"{name}.md").read_text().splitlines()) == 3
        (scores,) = json.loads((tmp_path / f"{name}.json").read_text()).values()
        assert set(scores) == {"swing", "plain"}


def test_a_robust_search_keeps_the_best_of_its_designs(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The cost is the mean of the worst quarter of the corners, here of 2 of 8."""

    def errors(envs: object, design: robust.RobustDesign) -> np.ndarray:
        return np.arange(8.0) * design.tip / robust.START.tip

    monkeypatch.setattr(robust, "errors", errors)
    cost = robust.Cost(None)
    better, worse = (robust.START._replace(tip=factor * robust.START.tip) for factor in (0.5, 2.0))
    assert [round(cost(robust.searched(one)), 9) for one in (robust.START, better, worse)] == [6.5, 3.25, 13.0]
    assert cost.design.tip == pytest.approx(better.tip)
    assert capsys.readouterr().out.count("RobustDesign") == 2
