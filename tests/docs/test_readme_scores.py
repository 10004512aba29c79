"""The scores in README and docs/agents.md, recomputed."""

from __future__ import annotations

import json
import re
from pathlib import Path

from flexarm_agents import load_policy
from flexarm_agents.load import POLICIES
from scripts.shipped import tables

README = Path(__file__).resolve().parents[2] / "README.md"
AGENTS = README.parent / "docs" / "agents.md"


BLOCK = re.compile(r"<!-- generated: (\w+) -->\n(.*?)<!-- end -->", re.DOTALL)


def committed() -> dict[str, str]:
    """Collect the generated blocks of both pages."""
    return dict(BLOCK.findall(README.read_text() + AGENTS.read_text()))


def test_every_table_of_scores_is_on_a_page() -> None:
    assert set(committed()) == {"agent_scores", "agent_seeds", "agent_conditions"}


def test_the_scores_are_what_laps_give() -> None:
    assert committed()["agent_scores"] == tables.scores(load_policy("square"))


def test_the_conditions_give_what_the_page_says() -> None:
    assert committed()["agent_conditions"] == tables.conditions(load_policy("square"))


def test_the_seeds_are_those_of_the_card() -> None:
    card = json.loads((POLICIES / "square.json").read_text())
    assert committed()["agent_seeds"] == tables.seeds(card)
