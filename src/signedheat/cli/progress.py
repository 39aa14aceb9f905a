"""A progress bar, on terminals only."""

from __future__ import annotations

import shutil
import sys
import time
from typing import Any

from .streams import say


class ProgressBar:
    """A progress callback that draws a bar on standard error."""

    def __init__(self, quiet: bool) -> None:
        self._is_shown = not quiet and sys.stderr is not None and sys.stderr.isatty()
        self._begin = time.perf_counter()

    def __call__(self, fraction: float, step: str) -> None:
        if not self._is_shown:
            return
        width = max(10, min(40, shutil.get_terminal_size().columns - 36))
        full = round(width * min(max(fraction, 0.0), 1.0))
        seconds = time.perf_counter() - self._begin
        say(f"\r\x1b[2K{'━' * full}{'╌' * (width - full)} {fraction:4.0%} {seconds:6.1f} s  {step}", end="")

    def clear(self) -> None:
        """Take the bar away, for a line of text."""
        if self._is_shown:
            say("\r\x1b[2K", end="")

    def __enter__(self) -> ProgressBar:
        return self

    def __exit__(self, *_: Any) -> None:
        self.clear()
