"""Run the notebooks of docs/notebooks and keep their outputs in them (extra `test`)."""

import tempfile
from importlib import import_module
from pathlib import Path
from typing import Any

from flexarm_agents.files import put
from flexarm_env.extras import needs_extra
from scripts.common.command_line import run
from scripts.common.markdown import DOCS

FOLDER = DOCS / "notebooks"
LIMIT = 600  # for a cell [s]


def executed(path: Path, folder: Path) -> Any:
    """Return a notebook with the outputs of a new run of all its cells."""
    with needs_extra("notebooks", "test"):
        nbclient, nbformat = map(import_module, ("nbclient", "nbformat"))
    found = nbformat.read(path, as_version=nbformat.NO_CONVERT)
    language = found.metadata.get("language_info")
    place = {"metadata": {"path": str(folder)}}
    # The texts that a cell prints come in parts, which depend on its speed: they become one.
    nbclient.NotebookClient(found, timeout=LIMIT, resources=place, record_timing=False, coalesce_streams=True).execute()
    if language is not None:  # that of the interpreter, which runs it
        found.metadata["language_info"] = language
    return found


def main() -> None:
    """Command line."""
    for path in sorted(FOLDER.glob("*.ipynb")):
        with tempfile.TemporaryDirectory() as folder:
            found = executed(path, Path(folder))
        put(path, lambda aside, found=found: import_module("nbformat").write(found, aside))  # type: ignore[misc]
        print(f"{path}: written")


if __name__ == "__main__":
    run(main)
