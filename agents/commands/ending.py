"""How a command ends before its time: with one line and a status that says why, not with a traceback.

Bad input ends it with status 1. Where nobody reads on, as after `| head`, it ends with 141, as by SIGPIPE; where its
output is closed from the beginning, nothing is printed. A signal that asks it to stop (Ctrl-C, SIGTERM, SIGHUP) unwinds
it like an exception, so that its workers end and its unfinished results go; the status is then 128 plus the signal's
number, as in a shell. What takes long to import comes after `importing` or `end_at_once`: this module and its package
import nothing but the standard library.
"""

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from types import FrameType
from typing import Any, NoReturn

from flexarm_agents.jobs.stopping import STOPPING

Handler = Callable[[int, FrameType | None], NoReturn]


class Stopped(KeyboardInterrupt):
    """A signal asked the command to stop. What handles Ctrl-C handles this."""

    def __init__(self, number: int) -> None:
        self.signal = signal.Signals(number)
        super().__init__(f"stopped by {self.signal.name}")


def run(main: Callable[[], None]) -> None:
    """Run a command's `main`; its last line says what was wrong with the input, or which signal stopped it.

    In another thread than the main one, where Python has no handlers, signals have their usual effect.
    """
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:  # the caller has closed it
            setattr(sys, name, open(os.devnull, "w"))  # noqa: SIM115  (until the process ends)
    with _handled(_stop):
        try:
            try:
                main()
            finally:
                sys.stdout.flush()
        except BrokenPipeError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            sys.exit(128 + 13)
        except (ValueError, TypeError, OSError, ImportError) as error:
            _end(1, f"error: {' '.join(str(error).split())}")
        except KeyboardInterrupt as interrupt:
            stopped = interrupt if isinstance(interrupt, Stopped) else Stopped(signal.SIGINT)
            _end(128 + stopped.signal, f"\n{stopped}")  # below what a bar has left


def end_at_once() -> None:
    """Let signals end this process from now on as `importing` does, until `run` takes over."""
    _handle(_end_at_once)


def importing() -> AbstractContextManager[None]:
    """Within `with`, a signal ends this process as `run` does, but without unwinding it: nothing is open yet.

    An exception would not do: it is lost where the import system, or a library that is imported, cannot raise it.
    """
    return _handled(_end_at_once)


@contextmanager
def _handled(handler: Handler) -> Iterator[None]:
    before = _handle(handler)
    try:
        yield
    finally:
        for number, earlier in before.items():
            signal.signal(number, earlier)


def _handle(handler: Handler) -> dict[signal.Signals, Any]:
    here = threading.current_thread() is threading.main_thread()
    return {number: signal.signal(number, handler) for number in STOPPING if here and _is_free(number)}


def _end(status: int, line: str) -> NoReturn:
    sys.stderr.write(f"{line}\n")
    sys.exit(status)


def _is_free(number: int) -> bool:
    """Whether the caller left a signal to us: nohup and a shell's & have some of them ignored."""
    return signal.getsignal(number) not in (signal.SIG_IGN, None)


def _end_at_once(number: int, frame: FrameType | None) -> NoReturn:
    stopped = Stopped(number)
    os.write(2, f"\n{stopped}\n".encode())  # the signal may have interrupted a line of `sys.stderr`
    os._exit(128 + stopped.signal)


def _stop(number: int, frame: FrameType | None) -> NoReturn:
    for other in STOPPING:  # a second signal must not interrupt the clearing up
        signal.signal(other, signal.SIG_IGN)
    raise Stopped(number)
