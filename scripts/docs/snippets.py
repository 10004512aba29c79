"""Write the pages' long snippets as modules, which `make typecheck` gives to mypy: the fast tests do not run them.

A page's snippets run one after the other, so they are one module.
"""

from pathlib import Path

from scripts.common.command_line import run
from scripts.common.markdown import DOCS
from scripts.docs.steps import TUTORIALS, steps

# Pages whose kernels no other fast test compiles, or that take long.
LONG = (
    DOCS / "derivatives.md",
    DOCS / "how_to" / "identify.md",
    DOCS / "optimal.md",
    *(TUTORIALS[one] for one in ("first_agent", "late_sensor", "sampling", "sim_to_chain")),
)
# The snippets' own functions have no annotations, and torch's tensors stand for sequences.
HEAD = '# mypy: allow-untyped-defs, allow-untyped-calls, disable-error-code="arg-type"\n'


def module(page: str) -> str:
    """Return the snippets of a page as the text of one module."""
    return HEAD + "".join(step.code for step in steps(page) if step.kind == "python")


def main(folder: Path = DOCS.parent / "build" / "snippets") -> None:
    """Command line."""
    folder.mkdir(parents=True, exist_ok=True)
    for page in LONG:
        (folder / f"{page.stem}_snippets.py").write_text(module(page.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    run(main)
