"""What moves on the site: a page marks the place of a widget, and what stands there where there is none.

A place begins with `<!-- site: NAME -->` and ends with `<!-- site end -->`. The text between them is what a reader of
the repository sees; on the site it is shown to readers without JavaScript.
"""

from __future__ import annotations

import csv
import io
import json
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from flexarm_agents.board.summary import LIMIT, gap, nominal_errors
from flexarm_env.envs import documentation
from flexarm_env.envs.blocks import READINGS
from flexarm_env.envs.registration import IDS
from flexarm_env.laps import LAPS
from scripts.docs.replays import FOLDER, INDEX, read

_PLACE = re.compile(r"<!-- site: (\w+) -->\n(.*?)<!-- site end -->", re.DOTALL)
_TABLE = re.compile(r"(<!-- generated: \w+ -->\n)((?:\|[^\n]*\n){10,})(?=<!-- end -->)")  # a long one
_HEADING = re.compile(r"^#+ (.*)$", re.MULTILINE)
_SPECIFICATION = re.compile(r"<!-- specification of ([\w-]+), ")
_FIGURES = ("rms", "rms_after_2s", "maximum")
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


def board_table(board: Mapping[str, Any]) -> str:
    """Write the leaderboard's figures as CSV, a line for each row, point and lap; errors in m, times in s."""
    file = io.StringIO()
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(("name", "axis", "value", "unit", "lap", "episodes", "lost", "first_loss", *_FIGURES))
    writer.writerows(_lines(board))
    return file.getvalue()


def _lines(board: Mapping[str, Any]) -> Iterator[tuple[Any, ...]]:
    for row in board["rows"]:
        for axis, measured in row["columns"].items():
            column, points = board["columns"][axis], measured["points"]
            values = column["values"] if len(points) > 1 else ("all",)  # plants that are drawn count together
            for value, point in zip(values, points, strict=True):
                for lap, found in zip(point or (), _point(point) or (), strict=False):
                    figures = (found[one] for one in ("episodes", "lost", "first_loss", *_FIGURES))
                    yield row["name"], axis, value, column["unit"], lap, *figures


def replay_names() -> list[str]:
    """Return the names of the rows of which there are replays."""
    return [row["name"] for row in read(FOLDER / INDEX)[0]["rows"]]


def board_script(board: Mapping[str, Any], replayed: Sequence[str]) -> str:
    """Write what the leaderboard's page shows, as a script."""
    read = {name for row in board["rows"] for name in row["reads"]}
    data = {
        "laps": list(LAPS),
        "limit": LIMIT,
        "readings": [name for name in READINGS if name in read],
        "replays": f"{Path(REPLAYS).name}.html",
        "columns": board["columns"],
        "rows": [_row(row, row["name"] in replayed) | {"gaps": _gaps(board, row)} for row in board["rows"]],
    }
    return f"flexarm.board({json.dumps(data, allow_nan=False, separators=(',', ':'))});\n"


def _row(row: Mapping[str, Any], replayed: bool) -> dict[str, Any]:
    columns = {name: [_point(one) for one in column["points"]] for name, column in row["columns"].items()}
    kept = {name: row[name] for name in ("name", "reads", "privileged")}
    return {**kept, "replay": replayed, "columns": columns}


def _gaps(board: Mapping[str, Any], row: Mapping[str, Any]) -> list[float | None]:
    """Return where each nominal lap's error lies between the best plan's and the yardstick's; None for a lost one."""
    return [None if one is None else gap(board, lap, one["rms"]) for lap, one in nominal_errors(row).items()]


def _point(point: Mapping[str, Any] | None) -> list[dict[str, Any]] | None:
    """Return the mean figures of a point's laps, and how many were lost; None where a row is not applicable."""
    if point is None or "not_applicable" in point:
        return None
    counts = ("lost", "episodes", "first_loss")
    return [
        {name: one[name] for name in counts}
        | {name: None if one.get(name) is None else one[name]["mean"] for name in _FIGURES}
        for one in point.values()
    ]
