"""Jobs on threads of their own that can be cancelled or limited in time."""

from __future__ import annotations

import ctypes
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

    An exception that `report` raises is raised at once; the job stops at the next of its steps in Python.

    Examples
    --------
    >>> run_cancellable(lambda: 6 * 7, lambda: None)
    42
    """
    if report is None:
        return job()
    thread, future = _started(job)
    try:
        while True:
            try:
                return future.result(INTERVAL)
            except FutureTimeout:
                if future.done():  # the timeout is the job's own
                    raise
                report()
    finally:
        _stop(thread, future)


def run_limited(job: Callable[[], Any], seconds: float) -> Any:
    """Run a job on a thread of its own, and stop it if it takes longer; returns the job's result.

    For code of others in plain Python that may run for ever on odd input: it is stopped at the next of its steps. What
    a step does inside another language is not interrupted, but no longer waited for.

    Raises
    ------
    TimeoutError
        If the job takes longer.

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


def _started(job: Callable[[], Any]) -> tuple[Thread, Future[Any]]:
    """A thread that runs a job, and what will have its result."""
    future: Future[Any] = Future()

    def run() -> None:
        try:
            future.set_result(job())
        except BaseException as error:
            future.set_exception(error)

    thread = Thread(target=run, daemon=True)
    thread.start()
    return thread, future


def _stop(thread: Thread, future: Future[Any]) -> None:
    """End a job that is not done."""
    if not future.done() and thread.ident is not None:
        ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread.ident), ctypes.py_object(SystemExit))
