"""`Progress`: how far a command is: one line of the terminal once it takes longer than a second, or lines of a log."""

from __future__ import annotations

import sys
import time
from types import TracebackType
from typing import Self

from flexarm_agents.commands.arguments import width

PATIENCE = 1.0  # before the first line [s]
PAUSE = 0.1  # before the line is written again [s]
LOG = 30.0  # between two lines without a terminal, and before the first [s]
BAR = 30  # characters


class Progress:
    """A bar on stderr, for the length of a `with`; a line every half minute where there is no terminal."""

    def __init__(self, total: int, unit: str) -> None:
        """Prepare.

        Args:
            total: how much there is to do.
            unit: what it is, e.g. "pictures".
        """
        self._total, self._unit = total, unit
        self._done, self._shown = 0, False
        self._first: tuple[float, int] | None = None  # when something was done first, and how much: compiling is in it
        self._began = self._last = time.monotonic()
        self._terminal = sys.stderr.isatty()

    def __enter__(self) -> Self:
        """Begin."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """Take the line away."""
        if self._shown:
            sys.stderr.write(f"\r{' ' * (width() - 1)}\r")
            sys.stderr.flush()

    def __call__(self, done: int = 1) -> None:
        """Go on.

        Args:
            done: how much was done since the last call.
        """
        self._done += done
        now = time.monotonic()
        if self._first is None:
            self._first = now, self._done
        if not self._terminal:
            if now - self._last >= LOG:
                self._last = now
                print(self._line(now).strip(), file=sys.stderr, flush=True)
        elif now - self._began >= PATIENCE and now - self._last >= PAUSE:
            self._last, self._shown = now, True
            sys.stderr.write(f"\r{self._line(now)[: width() - 1]}")
            sys.stderr.flush()

    def _line(self, now: float) -> str:
        filled = BAR * self._done // max(self._total, 1)
        bar = "█" * filled + "·" * (BAR - filled)
        return f"{bar} {self._done} of {self._total} {self._unit}{self._left(now)} "

    def _left(self, now: float) -> str:
        """Estimate the time left, once what came after the first part has taken as long as that."""
        assert self._first is not None
        at, done = self._first
        if self._done == done or now - at < at - self._began:
            return ""
        return f", {(now - at) * (self._total - self._done) / (self._done - done):.0f} s left"
