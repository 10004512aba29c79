"""How a study ends before its time: as the command `flexarm` does, and with a line where a worker has died."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures.process import BrokenProcessPool

from flexarm_agents.commands import ending


def run(main: Callable[[], None]) -> None:
    """Run a study's `main`; see `flexarm_agents.commands.ending.run`."""

    def study() -> None:
        try:
            main()
        except BrokenProcessPool as error:
            raise OSError("a worker process died (killed, or out of memory?)") from error

    ending.run(study)
