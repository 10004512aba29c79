"""`StopSignals`: a training that gets a signal stops at the next moment from which it can be resumed."""

from __future__ import annotations

import signal
import threading
from types import FrameType, TracebackType
from typing import Any

SIGNALS = (signal.SIGINT, signal.SIGTERM)


class TrainingStopped(KeyboardInterrupt):
    """A signal stopped a training between two rollouts; nothing that was computed is lost.

    Attributes:
        signal: its number.
        steps: environment steps of the training so far, all of them in the checkpoint.
    """

    def __init__(self, number: int, steps: int) -> None:
        """Keep the signal and the steps."""
        super().__init__(f"stopped by {signal.Signals(number).name} after {steps} steps")
        self.signal = number
        self.steps = steps


class StopSignals:
    """Within `with`, the first SIGINT or SIGTERM is noted; the second one has its usual effect.

    In another thread than the main one, where Python has no handlers, nothing is changed.

    Attributes:
        received: number of the signal that came, None before.
    """

    def __init__(self) -> None:
        """Prepare; handlers are set when the block begins."""
        self.received: int | None = None
        self._before: dict[int, Any] = {}

    def __enter__(self) -> StopSignals:
        """Set the handlers."""
        if threading.current_thread() is threading.main_thread():
            self._before = {number: signal.signal(number, self._note) for number in SIGNALS}
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """Set the handlers of before again."""
        self._restore()

    def _note(self, number: int, frame: FrameType | None) -> None:
        self.received = number
        self._restore()

    def _restore(self) -> None:
        while self._before:
            number, handler = self._before.popitem()
            signal.signal(number, signal.SIG_DFL if handler is None else handler)
