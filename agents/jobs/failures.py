"""Jobs that failed: a line for each, and their tracebacks in a file."""

import sys
import traceback
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from flexarm_agents.files import write_text
from flexarm_env.validation import short

LOG = "failures.log"


class Failure(NamedTuple):
    """A job that failed."""

    job: str  # its name, e.g. of an entry of the board, or the folder of a training
    error: BaseException  # what it raised

    def __str__(self) -> str:
        """Say what failed, and why, in one line."""
        return f"{self.job}: {type(self.error).__name__}: {' '.join(short(str(self.error)).split())}"


def check_failures(failed: Sequence[Failure], folder: Path, rest: str) -> None:
    """Write the tracebacks of failed jobs to `failures.log` in a folder; without failed jobs that file is removed.

    Raises:
        OSError: if a job failed; the message has `rest`, what follows for the others.
    """
    log = folder / LOG
    if not failed:
        log.unlink(missing_ok=True)
        return
    found = "\n".join(f"{one.job}:\n{''.join(traceback.format_exception(one.error))}" for one in failed)
    folder.mkdir(parents=True, exist_ok=True)
    write_text(log, found)
    lines = dict.fromkeys(f"{one}\n" for one in failed)  # jobs of the same name may fail for the same reason
    sys.stderr.write("".join(lines))
    raise OSError(f"{len(failed)} failed, see above; {rest}; tracebacks: {log}") from failed[0].error
