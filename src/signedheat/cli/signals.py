"""Signals that ask to stop: they become exceptions, so that temporary files are removed on the way out."""

from __future__ import annotations

import signal
import threading
import time
from types import FrameType
from typing import Any

SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))
APART = 1.0
"""Seconds within which a further signal is taken for the same one."""


class Stopped(KeyboardInterrupt):
    """What signals raise: where Python runs text, it notes `KeyboardInterrupt` itself, and ends by SIGINT later."""


class Signals:
    """While this is entered, signals raise `Stopped`, and `caught` is the number of the last one.

    Signals that are ignored, as under ``nohup``, or that somebody else handles, are left alone; so are all where this
    is not entered by the main thread.
    """

    def __init__(self) -> None:
        self.caught: int | None = None
        self._last = -APART
        self._before: dict[int, Any] = {}

    def __enter__(self) -> Signals:
        if threading.current_thread() is threading.main_thread():
            for number in SIGNALS:
                if signal.getsignal(number) in (signal.SIG_DFL, signal.default_int_handler):
                    self._before[number] = signal.signal(number, self._raise)
        return self

    def __exit__(self, *_: object) -> None:
        for number, before in self._before.items():
            signal.signal(number, before)

    def _raise(self, number: int, frame: FrameType | None) -> None:
        now = time.monotonic()
        if self.caught is not None and now - self._last < APART:
            return
        self.caught, self._last = number, now
        raise Stopped
