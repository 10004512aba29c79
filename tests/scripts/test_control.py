"""`python -m scripts.control`: what is run once is kept, and the pages have what a trial gives."""

import json
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from flexarm_baselines.registry import CONTROLLERS
from scripts.common.markdown import shown_blocks
from scripts.common.study import Trials, run_all
from scripts.control.__main__ import STUDIES
from scripts.control.trials import cell, run_laps


@pytest.mark.parametrize("name", STUDIES)
def test_every_table_stands_on_a_page(name: str) -> None:
    for block in STUDIES[name].tables:
        assert len(shown_blocks()[block].splitlines()) > 3


def test_the_page_has_every_controller_with_the_scores_of_its_laps() -> None:
    lines = shown_blocks()["registered"].splitlines()[2:]
    rows = {cells[1].strip(" `"): cells for cells in (line.split("|") for line in lines)}
    assert list(rows) == [name for name, one in CONTROLLERS.items() if one.environment != "FlexArm/Race-v0"]
    assert [one.strip() for one in rows["ifdc"][4:6]] == [cell(lap, 1) for lap in run_laps("ifdc").values()]


def score(duration: float, error: float | None) -> dict[str, Any]:
    return {"complete": error is not None, "duration": duration, "rms": error, "rms_after_2s": error}


def test_a_lost_lap_has_the_median_time_of_its_draws() -> None:
    lost = [score(duration, None) for duration in (3.0, 11.0, 2.0)]
    assert cell(lost) == "lost at 3.0 s (2.0 to 11.0)"
    assert cell(lost[:1]) == "lost at 3.0 s"
    assert cell([lost[0], score(16.0, 0.02)]) == "lost 1 of 2 at 3.0 s"
    assert cell([score(16.0, 0.02)], 1) == "20.0 / 20.0"


DONE: list[int] = []


def counted(value: int) -> dict[str, int]:
    DONE.append(value)
    return {"square": value**2}


def test_trials_are_run_once(tmp_path: Path) -> None:
    """Those that a run has finished are not run again; other code makes all of them anew."""
    first = Trials("scripts.control.trials", lambda: {"two": partial(counted, 2)})
    both = Trials("scripts.control.trials", lambda: {"three": partial(counted, 3), "two": partial(counted, 2)})
    assert first(tmp_path, 1) == {"two": {"square": 4}}
    assert both(tmp_path, 1) == {"three": {"square": 9}, "two": {"square": 4}}
    assert DONE == [2, 3]
    kept = json.loads((tmp_path / "results.json").read_text())
    (tmp_path / "results.json").write_text(json.dumps(kept | {"code": "another"}))
    assert both(tmp_path, 1) == {"three": {"square": 9}, "two": {"square": 4}}
    assert DONE == [2, 3, 3, 2]


def test_workers_run_trials() -> None:
    done = dict(run_all({"two": partial(counted, 2), "three": partial(counted, 3)}, 2, "squares"))
    assert done == {"two": {"square": 4}, "three": {"square": 9}}
    with pytest.raises(ZeroDivisionError):
        list(run_all({"two": partial(counted, 2), "none": partial(divmod, 1, 0)}, 2, "squares"))


def test_what_is_refused() -> None:
    with pytest.raises(ValueError, match=r"name = 'nobody'"):
        run_laps("nobody")
