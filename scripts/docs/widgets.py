"""What moves on the site: a page marks the place of a widget, and what stands there where there is none.

A place begins with `<!-- site: NAME -->` and ends with `<!-- site end -->`. The text between them is what a reader of
the repository sees; on the site it is shown to readers without JavaScript.
"""

import json
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from flexarm_agents.board.tables import best_of, place
from flexarm_env.envs import documentation
from flexarm_env.envs.blocks import INFORMATION
from flexarm_env.envs.registration import IDS
from flexarm_env.laps import LAPS
from scripts.docs.replays import FOLDER, INDEX, read

_PLACE = re.compile(r"<!-- site: (\w+) -->\n(.*?)<!-- site end -->", re.DOTALL)
_TABLE = re.compile(r"(<!-- generated: \w+ -->\n)((?:\|[^\n]*\n){10,})(?=<!-- end -->)")  # a long one
_HEADING = re.compile(r"^#+ (.*)$", re.MULTILINE)
_SPECIFICATION = re.compile(r"<!-- specification of ([\w-]+), ")
STATIC = "docs/_static"  # within the site's sources
BOARD = "board.js"
FOLDED = "docs/leaderboard.md"  # page of long tables beside a widget
BOARD_DATA = ("leaderboard.csv", "leaderboard.json")
REPLAYS = "docs/replays"  # page of the viewer
_VIEWER = ("replay.js", "replays/index.js")


class Widget(NamedTuple):
    """A part of a page that a script makes."""

    mount: str  # id of the element that it fills
    scripts: tuple[str, ...]  # files of `docs/_static`, in the order in which they are loaded
    data: tuple[str, ...] = ()  # files there that a reader may want to keep
    options: str = ""  # attributes of the element


WIDGETS: Mapping[str, Widget] = {
    "leaderboard": Widget("flexarm-leaderboard", ("leaderboard.js", BOARD), BOARD_DATA),
    "replays": Widget("flexarm-replay", _VIEWER),
    "lap": Widget("flexarm-replay", _VIEWER, options=' data-small="flsac|agent student_unknown|swing"'),
}


def with_widgets(text: str, page: Path) -> str:
    """Return a page's text with its widgets."""
    static = os.path.relpath("_static", page.parent)  # where Sphinx puts it

    def widget(place: re.Match[str]) -> str:
        """Return what stands at a place."""
        if place[1] not in WIDGETS:
            raise ValueError(f"{page}: has a place for {place[1]!r}; must be one of {', '.join(WIDGETS)}")
        one = WIDGETS[place[1]]
        scripts = "".join(f'<script defer src="{static}/{name}"></script>\n' for name in one.scripts)
        mount = f'<div id="{one.mount}" class="fx" data-files="{static}/replays/"{one.options}></div>'
        links = ", ".join(f'<a href="{static}/{name}" download>{name}</a>' for name in one.data)
        data = f'<p class="fx-hint">All figures: {links}</p>\n' if links else ""
        return f"{mount}\n{data}{scripts}\n<noscript>\n\n{place[2]}\n</noscript>\n"

    return _PLACE.sub(widget, text) + specification(text)


def specification(text: str) -> str:
    """Return the folded specification of the id that a page is about; "" for another page.

    Its titles are no headings, which would close the fold early and fill the page's contents.
    """
    place = _SPECIFICATION.match(text)
    if place is None:
        return ""
    sections = (f"**{title}**\n\n{body}" for title, body in documentation.sections(IDS[place[1]]).items())
    return "\n\n".join(
        ("", '<details class="fx-fold">\n<summary>The whole specification</summary>', *sections, "</details>", "")
    )


def with_folds(text: str) -> str:
    """Return a page's text whose long generated tables open by a click, with the names of the headings above them."""

    def fold(table: re.Match[str]) -> str:
        name = _HEADING.findall(text[: table.start()])[-1]
        return f'{table[1]}<details class="fx-fold">\n<summary>Table: {name}</summary>\n\n{table[2]}\n</details>\n'

    return _TABLE.sub(fold, text)


def replay_names() -> list[str]:
    """Return the names of the rows of which there are replays."""
    return [row["name"] for row in read(FOLDER / INDEX)[0]["rows"]]


def board_script(board: Mapping[str, Any], replayed: Sequence[str]) -> str:
    """Write what the leaderboard's page shows, as a script."""
    read, best = {name for row in board["rows"] for name in row["reads"]}, list(best_of(board))
    data = {
        "laps": list(LAPS),
        "readings": [name for name in INFORMATION if name in read],
        "replays": f"{Path(REPLAYS).name}.html",
        "tasks": board["tasks"],
        "columns": {
            name: column | {"sample": len(board["rows"][0]["columns"][name]["points"]) < len(column["values"])}
            for name, column in board["columns"].items()
        },
        "best": [
            {"head": f"{one.task} {board['tasks'][one.task]['figures'][one.figure]['title']}", "laps": list(one.values)}
            for one in best
        ],
        "rows": [
            _row(row, board) | {"replay": row["name"] in replayed, "over": [list(one.over(row, board)) for one in best]}
            for row in board["rows"]
        ],
    }
    return f"flexarm.board({json.dumps(data, allow_nan=False, separators=(',', ':'))});\n"


def _row(row: Mapping[str, Any], board: Mapping[str, Any]) -> dict[str, Any]:
    """Return an entry's rank, its points' means, and of each column what all episodes together come to."""
    rank = place(board, row["name"])
    found: dict[str, Any] = {"name": row["name"], "reads": row["reads"], "privileged": row["privileged"]}
    found |= {"limited": row["torque_limit"] is not None, "place": rank and rank[0], "columns": {}, "whole": {}}
    for name, column in row["columns"].items():
        tasks = board["columns"][name]["tasks"]
        figures = [board["tasks"][task]["figures"] for task in tasks]
        found["columns"][name] = [_point(*one) for one in zip(column["points"], figures, strict=False)]
        if whole := column.get("whole"):
            headline = whole[next(iter(figures[0]))] or {"median": None, "p90": None}
            counts = {key: whole[key] for key in ("lost", "episodes", "loss_interval")}
            found["whole"][name] = counts | {key: headline[key] for key in ("median", "p90")}
    return found


def _point(point: Mapping[str, Any] | None, figures: Iterable[str]) -> list[dict[str, Any]] | None:
    """Return the mean figures of a point's laps, and how many were lost; None where a row is not applicable."""
    if point is None or "not_applicable" in point:
        return None
    counts = ("lost", "episodes", "first_loss")
    return [
        {name: one[name] for name in counts}
        | {name: None if one.get(name) is None else one[name]["mean"] for name in figures}
        for one in point.values()
    ]
