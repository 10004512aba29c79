"""The scores in README and docs/agents.md, recomputed."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import pytest

from flexarm_agents import Score, evaluate, load_policy
from flexarm_baselines import FLSAC, IFDC

README = Path(__file__).resolve().parents[2] / "README.md"
AGENTS = README.parent / "docs" / "agents.md"


def shipped() -> Score:
    agent = load_policy("square")
    return evaluate(agent.make_env(), agent.policy)


def classical(make: Any) -> Score:
    env = gymnasium.make("flexarm_env:FlexArm/SquareGain-v0")
    return evaluate(env, make(env))


ROWS: dict[str, Callable[[], Score]] = {
    "PPO, shipped (`square`)": shipped,
    "FLSAC": lambda: classical(FLSAC.for_env),
    "IFDC": lambda: classical(IFDC.for_env),
}


@pytest.mark.parametrize("name", ROWS)
def test_the_table_shows_what_a_lap_gives(name: str) -> None:
    (row,) = re.findall(rf"^\| {re.escape(name)} \|(.*)\|$", README.read_text(), re.MULTILINE)
    cells = [cell.strip() for cell in row.split("|")][1:]
    score = ROWS[name]()
    assert score.complete
    assert score.rms_after_2s is not None
    assert score.torque_change is not None

    def pair(values: tuple[float, float], digits: int) -> str:
        return " / ".join(f"{value:.{digits}f}" for value in values)

    assert cells == [
        f"{score.rms:.3f}",
        f"{score.maximum:.3f}",
        f"{score.rms_after_2s:.3f}",
        pair(score.torque_change, 1),
        pair(score.peak_deflection, 2),
        pair(score.peak_torque, 0),
    ]


def test_the_conditions_give_what_the_page_says(capsys: pytest.CaptureFixture[str]) -> None:
    (snippet,) = re.findall(r"^```python\n(.*?)^```", AGENTS.read_text(), re.MULTILINE | re.DOTALL)
    exec(snippet, {})
    printed = capsys.readouterr().out.splitlines()
    table = dict(re.findall(r"^\| ([^|]+?) \| (.*) \|$", AGENTS.read_text().split("| condition |")[1], re.MULTILINE))
    assert len(printed) == len(table)
    for line in printed:
        name, told = line.split(": ", maxsplit=1)
        figures = re.fullmatch(r"(.*) m r\.m\.s\. over 16 s, (.*) m after 2 s", told)
        rounded = re.sub(r"[\d.]+(?= s$)", lambda seconds: f"{float(seconds[0]):.1f}", told)  # it differs by machines
        assert table[name] == (" | ".join(figures.groups()) if figures else f"{rounded} |")


def test_the_agents_snippet_prints_what_the_table_says(capsys: pytest.CaptureFixture[str]) -> None:
    snippets = re.findall(r"^```python\n(.*?)^```", README.read_text(), re.MULTILINE | re.DOTALL)
    (snippet,) = [each for each in snippets if "load_policy" in each]
    exec(snippet, {})
    printed = capsys.readouterr().out.strip()
    assert f"# {printed}; or" in snippet
    (row,) = re.findall(r"^\| PPO, shipped \(`square`\) \|(.*)\|$", README.read_text(), re.MULTILINE)
    assert [cell.strip() for cell in row.split("|")][1:4:2] == re.findall(r"(\S+) m ", printed)


def test_validation_is_quoted_as_recorded() -> None:
    """The number of checks, and the shipped agent's scores on the models and on the chain."""
    record = json.loads((AGENTS.parent / "validation.json").read_text())
    assert record["passed"]
    assert f"answers with {len(record['checks'])} checks" in README.read_text()
    rows = {
        cells[0].strip(): cells[4].split("/")[0].strip()
        for line in (AGENTS.parent / "validation.md").read_text().splitlines()
        if len(cells := line.strip("| ").split("|")) > 4 and cells[1].strip() == "agent"
    }
    laps = [f"{float(rows[name]) / 1e3:.3f}" for name in ("linear, 2 modes", "foreshortened, 2 modes", "chain")]
    (sentence,) = re.findall(
        r"The agent scores (.*?) m over the lap.*?, (0\.\d+) m on the foreshortened", README.read_text(), re.S
    )
    assert [*sentence, sentence[1]] == laps
