"""Timing, logging and progress of the steps of a computation."""

from __future__ import annotations

import logging
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import TypeVar

from .jobs import run_cancellable

Result = TypeVar("Result")

logger: logging.Logger = logging.getLogger("signedheat")

CLEAR_LINE = "\r\x1b[2K"
"""What takes a progress bar off a terminal."""

Progress = Callable[[float, str], None]
"""Called with the fraction done, from 0 to 1, and the name of the step that begins."""


class Announcement:
    """A line that is said once in a process: in the log, and to whoever sits before a terminal or a notebook."""

    are_wanted = True
    """Whether any are printed; not where nothing but results are to be."""

    def __init__(self, text: str) -> None:
        self._text, self._is_made = text, False

    def __call__(self) -> None:
        if self._is_made:
            return
        self._is_made = True
        logger.info(self._text)
        is_terminal = sys.stderr is not None and sys.stderr.isatty()
        if self.are_wanted and (is_terminal or "ipykernel" in sys.modules):
            sys.stderr.write(f"{CLEAR_LINE if is_terminal else ''}signedheat: {self._text}\n")


class Stopwatch:
    """Times named steps, logs them, and reports progress."""

    def __init__(self, progress: Progress | None, steps: int) -> None:
        self.seconds: dict[str, float] = {}
        self._progress, self._steps = progress, steps

    def skip(self, steps: int) -> None:
        """So many steps turn out not to be needed."""
        self._steps -= steps

    @contextmanager
    def __call__(self, step: str) -> Iterator[Callable[[Callable[[], Result]], Result]]:
        """Time a step, in which the function given runs jobs: progress is called until they end, and may stop them."""
        progress, share, report = self._progress, len(self.seconds) / self._steps, None
        if progress is not None:
            progress(share, step)
            report = partial(progress, share, step)
        begin = time.perf_counter()
        yield lambda job: run_cancellable(job, report)
        self.seconds[step] = time.perf_counter() - begin
        logger.info("%s: %.3f s", step, self.seconds[step])
        if self._progress is not None and len(self.seconds) == self._steps:
            self._progress(1.0, "done")


def within(progress: Progress | None, start: float, stop: float) -> Progress | None:
    """Progress of a part of a computation, from `start` to `stop` of the whole.

    Examples
    --------
    >>> seen = []
    >>> within(lambda fraction, step: seen.append(fraction), 0.5, 1.0)(0.5, "halfway")
    >>> seen
    [0.75]
    """
    if progress is None:
        return None
    whole = progress
    return lambda fraction, step: whole(start + fraction * (stop - start), step)
