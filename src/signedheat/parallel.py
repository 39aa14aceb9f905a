"""Threads: their number, and jobs that run on a thread of their own so that they can be cancelled."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import Future, TimeoutError
from threading import Thread
from typing import Any

INTERVAL = 0.1
"""Seconds between two progress reports."""


def n_threads() -> int:
    """Number of processors that this process may use, limited by ``NUMBA_NUM_THREADS``."""
    available = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else (os.cpu_count() or 1)
    wanted = os.environ.get("NUMBA_NUM_THREADS", "")
    return min(available, int(wanted)) if wanted.isdigit() and int(wanted) > 0 else available


def run_cancellable(job: Callable[[], Any], report: Callable[[], None] | None) -> Any:
    """Run a job on a thread of its own, calling `report` every `INTERVAL` until it ends; returns the job's result.

    An exception that `report` raises is raised at once; the job then runs to its end, and its result is discarded.

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
        except TimeoutError:
            if future.done():  # the timeout is the job's own
                raise
            report()
