"""Run a job on a thread with progress reports or a time limit, or a function in a new Python process."""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable
from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeout  # the builtin one only since Python 3.11
from threading import Thread
from typing import Any

INTERVAL = 0.1
"""Seconds between progress reports."""
RUN = (
    "import json, sys; sys.path[:] = json.loads(sys.argv[1]); from importlib import import_module; "
    "module, name = sys.argv[2].split(':'); getattr(import_module(module), name)(*sys.argv[3:])"
)
"""Program of a new process: it starts isolated, and then takes over the import path."""


def run_cancellable(job: Callable[[], Any], report: Callable[[], None] | None) -> Any:
    """Run a job on its own thread, call `report` every `INTERVAL` seconds until it ends, and return its result.

    An exception from `report` is raised at once; the job then runs on in the background and its result is dropped.
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
    """Run a job on its own thread and return its result; raise `TimeoutError` after some seconds."""
    end = time.monotonic() + seconds

    def refuse_to_wait() -> None:
        if time.monotonic() > end:
            raise TimeoutError(f"it takes more than {seconds:.0f} seconds")

    return run_cancellable(job, refuse_to_wait)


def command_for(entry: str, *arguments: str) -> list[str]:
    """Make the command that calls a function, as ``"module:name"``, in a new Python process.

    It can import what this one can, and nothing from the current folder, which ``python -c`` would search first.
    """
    path = [os.path.abspath(folder) for folder in sys.path if folder]
    return [sys.executable, "-I", "-c", RUN, json.dumps(path), entry, *arguments]
