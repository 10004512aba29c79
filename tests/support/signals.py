"""Signals as the tests of signals expect them, whatever the caller of the tests ignores."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager

from flexarm_agents.commands.ending import STOPPING


@contextmanager
def heeded() -> Iterator[None]:
    """Within `with`, no signal that asks a process to stop is ignored here or in a process that is started.

    Started processes ignore what this one ignores; `nohup make test &` begins it so. One that a function handles here
    has its usual effect there.
    """
    ignored = [number for number in STOPPING if signal.getsignal(number) == signal.SIG_IGN]
    for number in ignored:
        signal.signal(number, signal.default_int_handler if number == signal.SIGINT else lambda *_: None)
    try:
        yield
    finally:
        for number in ignored:
            signal.signal(number, signal.SIG_IGN)
