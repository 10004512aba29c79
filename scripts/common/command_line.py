"""The command line of a study: its options, and how it ends before its time, as the command `flexarm` does."""

from collections.abc import Callable
from concurrent.futures.process import BrokenProcessPool
from inspect import cleandoc
from typing import Any, TypeVar

from flexarm_agents.commands import ending
from flexarm_agents.commands.arguments import Reader
from flexarm_agents.commands.fields import add_fields, read_fields

Options = TypeVar("Options")


def run(main: Callable[[], None]) -> None:
    """Run a study's `main`; see `flexarm_agents.commands.ending.run`."""

    def study() -> None:
        try:
            main()
        except BrokenProcessPool as error:
            raise OSError("a worker process died (killed, or out of memory?)") from error

    ending.run(study)


def read_options(prog: str, defaults: Options, text: str | None = None) -> Options:
    """Read this process's arguments, which replace defaults, a dataclass; a text, or its docstring, is the help."""
    reader = parser(prog, defaults, text)
    return read_fields(reader, type(defaults), reader.parse_args())


def parser(prog: str, defaults: Any, text: str | None = None) -> Reader:
    """Return the parser of `read_options`."""
    reader = Reader(prog, cleandoc(text or type(defaults).__doc__ or ""))
    add_fields(reader, defaults)
    return reader
