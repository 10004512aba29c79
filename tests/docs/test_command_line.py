"""docs/reference/command_line.md: what the parsers say, of every verb."""

from __future__ import annotations

from flexarm_agents.commands import VERBS
from scripts.common.markdown import shown_blocks
from scripts.docs import commands


def test_the_page_is_what_the_parsers_say() -> None:
    shown = shown_blocks()["command_line"]
    assert shown == commands.text(), "run python -m scripts.docs.commands"
    assert all(f"## `flexarm {verb}`\n" in shown for verb in VERBS)
