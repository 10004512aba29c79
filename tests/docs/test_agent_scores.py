"""The tables of the pages about agents, recomputed."""

import json
from pathlib import Path
from typing import Any

import pytest

from flexarm_agents.board.cells import Store
from flexarm_agents.policies.load import POLICIES
from scripts.common.markdown import shown_blocks
from scripts.shipped import board
from scripts.shipped.agents import AGENTS
from tests.support.boards import leaves


def cards() -> dict[str, dict[str, Any]]:
    """Read the cards of all shipped agents."""
    return {name: json.loads((POLICIES / f"{name}.json").read_text()) for name in AGENTS}


def test_every_table_is_on_a_page() -> None:
    assert {"nominal_plant", "unknown_plant"} <= shown_blocks().keys()
    assert shown_blocks()["own_tasks"] == board.own_tasks(cards())


# Another numpy or processor sums the network's products in another order, which moves its float32 torques by some 1e-7;
# under feedback that grows no further: 1.3e-7 of a lap's largest error was seen. The pages show three or four digits.
ROUNDING = 1e-5


@pytest.mark.parametrize(
    "part", ["square", *(pytest.param(one, marks=pytest.mark.slow) for one in ("chain", "unknown"))]
)
def test_the_shipped_student_is_one_of_its_card(part: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its laps give what the card says of that seed."""
    card = cards()["student_unknown"]
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
    assert page["nominal_plant"] == board.nominal(cards())
    assert page["unknown_plant"] == board.unknown(cards())
