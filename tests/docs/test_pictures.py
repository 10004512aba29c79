"""The pictures that introduce the benchmark: what they draw is what the board measured; README is short and true."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from flexarm_agents.board.cells import Store
from flexarm_agents.board.measure import PUBLISHED
from flexarm_agents.board.summary import nominal_errors
from flexarm_agents.policies.load import POLICIES
from scripts.common.markdown import DOCS, shown_blocks
from scripts.docs import lap_pictures, motion_pictures, overview_pictures
from scripts.docs.arm_pictures import ARM, COMPARED, LAP, links, recorded, rigid, still, terms
from scripts.docs.pictures import PICTURES
from scripts.shipped import board
from tests.support.boards import leaves
from tests.support.programs import ROOT

ROWS = {row["name"]: row for row in json.loads(PUBLISHED.read_text())["rows"]}
README = (ROOT / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("row", sorted({*COMPARED, *lap_pictures.SHOWN}))
def test_a_drawn_lap_is_the_one_that_the_board_measured(row: str) -> None:
    one = recorded(row, LAP)
    errors = nominal_errors(ROWS[row])[LAP]
    assert errors is not None
    assert np.sqrt(np.mean(one.away**2)) == pytest.approx(errors["rms"], abs=2e-4)


def test_the_arm_is_drawn_as_it_is_bent() -> None:
    lap = recorded("lqg", LAP)
    now = lap.at(0.3)
    one, two = links(lap.q[now])
    assert one[-1] == pytest.approx(two[0], abs=1e-12)
    assert two[-1] == pytest.approx(lap.tip[now], abs=1e-12)
    assert rigid(lap.q[now])[-1] == pytest.approx(ARM.rigid_tip(lap.q[now]), abs=1e-12)


@pytest.mark.parametrize(
    "draw",
    [
        *(still, terms, overview_pictures.distance_from_chain, motion_pictures.late_sensor, motion_pictures.corner),
        *(lap_pictures.corners, lap_pictures.effort, motion_pictures.best_plan, overview_pictures.payload),
    ],
)
def test_a_picture_is_written(draw: object, tmp_path: Path) -> None:
    assert callable(draw)
    draw(tmp_path / "one.png")
    with Image.open(tmp_path / "one.png") as picture:
        assert picture.width > 800


def test_every_entry_has_a_dot_and_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    axes = []
    monkeypatch.setattr(overview_pictures, "write", lambda figure, path: axes.extend(figure.axes))
    overview_pictures.error_over_loss(tmp_path / "unused.png")
    written = {word for text in axes[0].texts for word in re.findall(r"\w+", text.get_text())}
    measured = {name for name, row in ROWS.items() if "whole" in row["columns"]["unknown"]}
    assert {name.removeprefix("agent ") for name in measured} <= written


def test_the_pictures_are_there_and_small() -> None:
    for name in PICTURES:
        assert 0 < (DOCS / "figures" / name).stat().st_size < 1_500_000, name
    assert [path.name for path in DOCS.rglob("*.png") if path.stat().st_size > 150_000] == []
    with Image.open(DOCS / "figures" / "first_second.webp") as moving:
        assert getattr(moving, "n_frames", 1) == 101


def test_letters_are_large_enough_where_a_page_shows_them() -> None:
    sources = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "scripts").rglob("*.py"))
    widths = re.findall(r"figsize=\(([\w.]+)", sources)
    assert set(widths) == {"WIDTH", "9.6"}  # the moving pictures are wider
    assert widths.count("9.6") == 2
    assert min(float(size) for size in re.findall(r"\b(?:font)?size=([\d.]+)", sources)) >= 10.0


def test_what_to_beat_is_what_the_board_measured() -> None:
    plans = json.loads(PUBLISHED.read_text())["tasks"]["square"]["best"]
    errors = nominal_errors(ROWS["agent square"])
    for one in (plans, errors):
        swing, plain = (1e3 * one[name]["rms"] for name in ("swing", "plain"))
        assert f"{swing:.1f} / {plain:.1f} mm" in README


def test_the_readme_is_short() -> None:
    assert len(README.splitlines()) <= 130
    assert len(re.findall(r"\S+", README)) <= 1000


# Another numpy or processor sums the network's products in another order, which moves its float32 torques by some 1e-7;
# under feedback that grows no further: 1.3e-7 of a lap's largest error was seen. The pages show three or four digits.
ROUNDING = 1e-5


@pytest.mark.parametrize(
    "part", ["square", *(pytest.param(one, marks=pytest.mark.slow) for one in ("chain", "unknown"))]
)
def test_the_shipped_student_is_one_of_its_card(part: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its laps give what the card says of that seed."""
    card = board.cards()["student_unknown"]
    (shipped,) = (one for one in card["trainings"] if one["seed"] == card["config"]["seed"])
    monkeypatch.setattr(board, "MEASURED", {part: board.MEASURED[part]})
    found = dict(leaves(board.measured(POLICIES / "student_unknown.npz", Store(tmp_path))))
    wanted = dict(leaves({part: shipped["board"][part]}))
    assert {path: found[path] for path in wanted} == {
        path: one if one is None else pytest.approx(one, rel=ROUNDING, abs=0) for path, one in wanted.items()
    }


def test_the_tables_of_trainings_are_those_of_the_cards() -> None:
    """And of the published board, where controllers stand beside."""
    page = shown_blocks()
    assert page["nominal_plant"] == board.nominal(board.cards())
    assert page["unknown_plant"] == board.unknown(board.cards())
    assert page["own_tasks"] == board.own_tasks(board.cards())
