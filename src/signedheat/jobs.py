"""Jobs on threads of their own, on which progress is reported and for which nobody waits for ever."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeout  # the builtin one only since Python 3.11
from threading import Thread
from typing import Any

INTERVAL = 0.1
"""Seconds between two progress reports."""


def run_cancellable(job: Callable[[], Any], report: Callable[[], None] | None) -> Any:
    """Run a job on a thread of its own, calling `report` every `INTERVAL` until it ends; returns the job's result.

    An exception that `report` raises is raised at once. The job is then no longer waited for: it goes on to its end,
    and its result is dropped.

    Examples
    --------
    >>> run_cancellable(lambda: 6 * 7, lambda: None)
    42
    """
    if report is None:
        return job()
    future: Future[Any] = Future()

    def run() -> None:
        try:
            future.set_result(job())
        except BaseException as error:
            future.set_exception(error)

    Thread(target=run, daemon=True).start()
    while True:
        try:
            return future.result(INTERVAL)
        except FutureTimeout:
            if future.done():  # the timeout is the job's own
                raise
            report()


def run_limited(job: Callable[[], Any], seconds: float) -> Any:
    """Run a job on a thread of its own, and wait for it no longer than so many seconds; returns the job's result.

    Examples
    --------
    >>> run_limited(lambda: 6 * 7, 10.0)
    42
    """
    end = time.monotonic() + seconds

    def refuse_to_wait() -> None:
        if time.monotonic() > end:
            raise TimeoutError(f"it takes more than {seconds:.0f} seconds")

    return run_cancellable(job, refuse_to_wait)
