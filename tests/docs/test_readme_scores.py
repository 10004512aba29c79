"""The scores in README and docs/agents.md, recomputed."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from flexarm_agents import load_policy
from flexarm_agents.load import POLICIES
from scripts.shipped import tables
from scripts.shipped.agents import AGENTS

README = Path(__file__).resolve().parents[2] / "README.md"
PAGE = README.parent / "docs" / "agents.md"


BLOCK = re.compile(r"<!-- generated: (\w+) -->\n(.*?)<!-- end -->", re.DOTALL)


def committed() -> dict[str, str]:
    """Collect the generated blocks of both pages."""
    return dict(BLOCK.findall(README.read_text() + PAGE.read_text()))


def test_every_table_of_scores_is_on_a_page() -> None:
    students = {"student_seeds", "student_conditions", "unknown_plant"}
    assert set(committed()) == {"agent_scores", "agent_seeds", "agent_conditions"} | students


def test_the_scores_are_what_laps_give() -> None:
    assert committed()["agent_scores"] == tables.scores(AGENTS)


@pytest.mark.parametrize(("block", "name"), [("agent_conditions", "square"), ("student_conditions", "student")])
def test_the_conditions_give_what_the_page_says(block: str, name: str) -> None:
    assert committed()[block] == tables.conditions(load_policy(name))


def test_the_unknown_plant_is_as_the_page_says() -> None:
    lines = committed()["unknown_plant"].splitlines()
    assert [line for line in lines if "`student_unknown`" in line] == tables.unknown_plant(
        ["student_unknown"]
    ).splitlines()[2:]


def test_the_seeds_are_those_of_the_card() -> None:
    cards = {name: json.loads((POLICIES / f"{name}.json").read_text()) for name in AGENTS}
    assert committed()["agent_seeds"] == tables.seeds(cards["square"])
    assert committed()["student_seeds"] == tables.students(cards)
