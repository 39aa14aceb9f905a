"""Threads: how many there are to use, and work that runs on one while another attends to it."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import Future, TimeoutError
from threading import Thread
from typing import Any

INTERVAL = 0.1
"""Seconds between two reports."""


def n_threads() -> int:
    """Processors this process may run on, or fewer where ``NUMBA_NUM_THREADS`` says so."""
    available = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else (os.cpu_count() or 1)
    wanted = os.environ.get("NUMBA_NUM_THREADS", "")
    return min(available, int(wanted)) if wanted.isdigit() and int(wanted) > 0 else available


def run_cancellable(job: Callable[[], Any], report: Callable[[], None] | None) -> Any:
    """What a job returns. It runs on a thread of its own, and `report` is called until it has ended.

    What `report` raises is raised at once, and what the job does from then on is lost.

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
            if future.done():  # the job's own
                raise
            report()
