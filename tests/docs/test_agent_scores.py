"""The scores in docs/agents.md, recomputed."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from flexarm_agents import load_policy
from flexarm_agents.load import POLICIES
from flexarm_env.laps import LAPS
from scripts.shipped import tables
from scripts.shipped.agents import AGENTS

PAGE = Path(__file__).resolve().parents[2] / "docs" / "agents.md"


BLOCK = re.compile(r"<!-- generated: (\w+) -->\n(.*?)<!-- end -->", re.DOTALL)


def committed() -> dict[str, str]:
    """Collect the generated blocks of the page."""
    return dict(BLOCK.findall(PAGE.read_text()))


def test_every_table_of_scores_is_on_the_page() -> None:
    students = {"student_seeds", "student_conditions", "unknown_plant"}
    assert set(committed()) == {"agent_scores", "agent_seeds", "agent_conditions"} | students


def test_the_scores_are_what_laps_give() -> None:
    assert committed()["agent_scores"] == tables.scores(AGENTS)


PAGES = [("agent_conditions", "square"), ("student_conditions", "student")]
OF_THEIR_OWN = {"linear kinematics"}  # conditions whose kernels no other test uses


@pytest.mark.parametrize(("block", "name"), PAGES)
def test_the_conditions_give_what_the_page_says(block: str, name: str) -> None:
    head, rule, *lines = committed()[block].splitlines()
    told = [line.split(" | ")[0].strip("| ") for line in lines]
    assert told == [condition for condition in tables.CONDITIONS for _ in LAPS]
    kept = [line for line, condition in zip(lines, told, strict=True) if condition not in OF_THEIR_OWN]
    names = [condition for condition in tables.CONDITIONS if condition not in OF_THEIR_OWN]
    assert [head, rule, *kept] == tables.conditions(load_policy(name), names).splitlines()


@pytest.mark.slow
@pytest.mark.parametrize(("block", "name"), PAGES)
def test_all_conditions_give_what_the_page_says(block: str, name: str) -> None:
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
