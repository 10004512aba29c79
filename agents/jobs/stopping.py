"""`StopSignals`: a training stops at the next moment from which it can be resumed.

A signal stops the training of its process; `ASKED`, set in a worker, those of the worker.
"""

from __future__ import annotations

import signal
import threading
from types import FrameType, TracebackType
from typing import Any

SIGNALS = (signal.SIGINT, signal.SIGTERM)
# those that ask a process to stop; not every system has every one
STOPPING = tuple(signal.Signals[name] for name in ("SIGINT", "SIGTERM", "SIGHUP") if name in signal.Signals.__members__)
ASKED = threading.Event()  # set: the training of this process, and each that begins later, stops as after SIGTERM


class TrainingStopped(KeyboardInterrupt):
    """A signal stopped a training between two rollouts or rounds; nothing that was computed is lost.

    Attributes:
        signal: its number.
        steps: environment steps of the training so far, all of them in the checkpoint.
    """

    def __init__(self, number: int, steps: int) -> None:
        super().__init__(f"stopped by {signal.Signals(number).name} after {steps} steps")
        self.signal = number
        self.steps = steps

    def __reduce__(self) -> tuple[type[TrainingStopped], tuple[int, int]]:
        """Pickle: a worker's error travels to its parent."""
        return TrainingStopped, (self.signal, self.steps)


class StopSignals:
    """Within `with`, the first SIGINT or SIGTERM is noted; the second one has its usual effect.

    In another thread than the main one, where Python has no handlers, nothing is changed.
    """

    def __init__(self) -> None:
        self._noted: int | None = None
        self._before: dict[int, Any] = {}

    @property
    def received(self) -> int | None:
        """Number of the signal that came, None before."""
        return signal.SIGTERM if self._noted is None and ASKED.is_set() else self._noted

    def __enter__(self) -> StopSignals:
        if threading.current_thread() is threading.main_thread():
            self._before = {number: signal.signal(number, self._note) for number in SIGNALS}
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._restore()

    def _note(self, number: int, frame: FrameType | None) -> None:
        self._noted = number
        self._restore()

    def _restore(self) -> None:
        while self._before:
            number, handler = self._before.popitem()
            signal.signal(number, signal.SIG_DFL if handler is None else handler)
