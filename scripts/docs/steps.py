"""Run a page's steps in their order, and keep what the page shows of them: printed output and pictures.

A step is a snippet, or commands whose output the page shows. That output is the block `text` after it; a line "..." in
it stands for lines that the page leaves out. Pictures that steps write go to docs/figures/tutorials/PAGE/.
"""

import importlib
import io
import os
import re
import shlex
import sys
import tempfile
from contextlib import chdir, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from cycler import cycler
from matplotlib import rc_context
from PIL import Image

from flexarm_agents import commands
from flexarm_env.validation import choice
from scripts.common.command_line import read_options, run
from scripts.common.markdown import DOCS
from scripts.common.plotting import COLOURS

TUTORIALS = {path.stem: path for path in sorted((DOCS / "tutorials").glob("*.md"))}
STEP = re.compile(r"^```(python|console)\n(.*?)^```$(?:\n\n^```text\n(.*?)^```$)?", re.DOTALL | re.MULTILINE)
PICTURE = re.compile(r"\]\(\.\./(figures/tutorials/[^)]+)\)")
FILE = re.compile(r"# (\w+\.py)\n")  # a snippet's first line: the reader puts it into this file
LEFT_OUT = "..."
NUMBER = re.compile(r"\d+(?:\.(\d+))?")
TRAINS = "flexarm train"  # its results depend on the processor
TOLERANCE = 0.05  # between processors, and as the physics moves in a release
LOOSE = 1e3  # after a training
SHADES = 64  # of a picture, which keeps its file small


class Step(NamedTuple):
    """A snippet or commands."""

    kind: str  # "python" or "console"
    code: str  # its text
    shown: str | None  # output that the page shows; None: it shows none
    line: int  # of the page where the code begins, from 1
    place: tuple[int, int]  # of the output in the page's text

    @property
    def runs(self) -> bool:
        """Whether it is run: commands without output install something, or are for a reader to try."""
        return self.kind == "python" or self.shown is not None


def steps(page: str) -> list[Step]:
    """Return the steps of a page; refuse a snippet that is indented or has no end."""
    found = [
        Step(one[1], one[2], one[3], page.count("\n", 0, one.start()) + 2, one.span(3)) for one in STEP.finditer(page)
    ]
    count, marks = sum(step.kind == "python" for step in found), page.count("```python")
    if count != marks:
        raise ValueError(f"page = {page[:60]!r}...: has {marks} snippets, of which {count} begin and end a line")
    return found


def printed(step: Step, names: dict[str, Any], page: str) -> str:
    """Run a step in the present folder, and return what it prints on stdout."""
    output = io.StringIO()
    with redirect_stdout(output):
        if step.kind == "python":
            exec(compile("\n" * (step.line - 1) + step.code, page, "exec"), names)
            if file := FILE.match(step.code):
                with Path(file[1]).open("a", encoding="utf-8") as opened:
                    opened.write(step.code)
        else:
            for line in step.code.splitlines():
                _, *arguments = shlex.split(line, comments=True)
                for own in Path().glob("*.py"):  # which has grown since it was imported
                    sys.modules.pop(own.stem, None)
                importlib.invalidate_caches()
                commands.main(arguments)
    return output.getvalue()


def excerpt(shown: str, whole: str) -> str:
    """Leave lines out of an output, as many as the page leaves out of the former one."""
    lines = shown.splitlines()
    if LEFT_OUT not in lines:
        return whole
    head = lines.index(LEFT_OUT)
    tail = len(lines) - head - 1
    rows = whole.splitlines()
    return "\n".join([*rows[:head], LEFT_OUT, *rows[len(rows) - tail :], ""])


def agree(shown: str, found: str, tolerance: float = TOLERANCE) -> bool:
    """Return whether two outputs have the same words, and numbers that differ by little or by rounding."""
    if NUMBER.sub("#", shown).split() != NUMBER.sub("#", found).split():
        return False
    pairs = zip(NUMBER.finditer(shown), NUMBER.finditer(found), strict=True)
    return all(
        abs(float(one[0]) - float(other[0])) <= tolerance * float(one[0]) + 1.01 * 0.1 ** len(one[1] or "")
        for one, other in pairs
    )


@dataclass
class Options:
    """Run the tutorials; write their outputs and pictures into docs/."""

    only: tuple[str, ...] = tuple(TUTORIALS)
    """Names of the pages."""


def write(path: Path) -> None:
    """Run a page in a folder of its own, and write its outputs and pictures anew."""
    page = path.read_text(encoding="utf-8")
    names: dict[str, Any] = {"__name__": path.stem}
    parts, done = [], 0
    with tempfile.TemporaryDirectory() as folder:
        with chdir(folder), rc_context({"axes.prop_cycle": cycler(color=COLOURS)}):
            for step in steps(page):
                output = printed(step, names, str(path)) if step.runs else ""
                if step.shown is not None:
                    parts += [page[done : step.place[0]], excerpt(step.shown, output)]
                    done = step.place[1]
        for picture in PICTURE.findall(page):
            target = DOCS / picture
            target.parent.mkdir(parents=True, exist_ok=True)
            with Image.open(next(Path(folder).rglob(target.name))) as drawn:
                drawn.convert("RGB").quantize(SHADES).save(target, optimize=True)
    path.write_text("".join([*parts, page[done:]]), encoding="utf-8")


def main() -> None:
    """Command line."""
    options = read_options("python -m scripts.docs.steps", Options())
    os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
    for page in [TUTORIALS[choice("only", name, TUTORIALS)] for name in options.only]:
        write(page)
        print(f"{page}: written", flush=True)


if __name__ == "__main__":
    run(main)
