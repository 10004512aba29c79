"""How a command ends before its time: with one line and a status that says why, not with a traceback.

Bad input ends it with status 1. A signal that asks it to stop (Ctrl-C, SIGTERM, SIGHUP) unwinds it like an exception,
so that its workers end and its unfinished results go; the status is then 128 plus the signal's number, as in a shell.
"""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Callable
from types import FrameType
from typing import NoReturn

# those that ask a process to stop; not every system has every one
STOPPING = tuple(signal.Signals[name] for name in ("SIGINT", "SIGTERM", "SIGHUP") if name in signal.Signals.__members__)


class Stopped(KeyboardInterrupt):
    """A signal asked the command to stop. What handles Ctrl-C handles this.

    Attributes:
        signal: which one.
    """

    def __init__(self, number: int) -> None:
        """Keep the signal."""
        self.signal = signal.Signals(number)
        super().__init__(f"stopped by {self.signal.name}")


def run(main: Callable[[], None]) -> None:
    """Run a command's `main`; its last line says what was wrong with the input, or which signal stopped it.

    In another thread than the main one, where Python has no handlers, signals have their usual effect.

    Args:
        main: the command.

    Raises:
        SystemExit: unless all went well.
    """
    here = threading.current_thread() is threading.main_thread()
    before = {number: signal.signal(number, _stop) for number in STOPPING if here and _is_free(number)}
    try:
        main()
    except (ValueError, TypeError, OSError, ImportError) as error:
        _end(1, f"error: {' '.join(str(error).split())}")
    except KeyboardInterrupt as interrupt:
        stopped = interrupt if isinstance(interrupt, Stopped) else Stopped(signal.SIGINT)
        _end(128 + stopped.signal, f"\n{stopped}")  # below what a bar has left
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _end(status: int, line: str) -> NoReturn:
    sys.stderr.write(f"{line}\n")
    sys.exit(status)


def _is_free(number: int) -> bool:
    """Whether the caller left a signal to us: nohup and a shell's & have some of them ignored."""
    return signal.getsignal(number) not in (signal.SIG_IGN, None)


def _stop(number: int, frame: FrameType | None) -> NoReturn:
    for other in STOPPING:  # a second signal must not interrupt the clearing up
        signal.signal(other, signal.SIG_IGN)
    raise Stopped(number)
