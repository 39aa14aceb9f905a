"""Jobs on threads or in new processes, with time limits, and a stopwatch that reports progress."""

from __future__ import annotations

import json
import logging
import os
import re
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeout
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from threading import Thread
from typing import Any, TypeVar

from .errors import SignedHeatError

Result = TypeVar("Result")

logger: logging.Logger = logging.getLogger("signedheat")

MOST_THREADS = 1024
"""Largest number of threads, or of processes, that is accepted."""
CLEAR_LINE = "\r\x1b[2K"
"""Escape sequence that clears the current line of a terminal."""

Progress = Callable[[float, str], None]
"""A function that is called with the fraction done, from 0 to 1, and the name of the step that begins."""


def wanted_threads() -> int | None:
    """Return the number of threads in the environment variable ``NUMBA_NUM_THREADS``, or None if it is not set."""
    word = os.environ.get("NUMBA_NUM_THREADS")
    if word is None:
        return None
    if not re.fullmatch("[0-9]{1,9}", word) or not 0 < int(word) <= MOST_THREADS:
        raise SignedHeatError(
            f"the environment variable NUMBA_NUM_THREADS is {word!r}, which is no number of threads",
            remedy=f"unset it, or set it to a number from 1 to {MOST_THREADS}",
            element="NUMBA_NUM_THREADS",
        )
    return int(word)


class Announcement:
    """A message that a call logs, and prints on standard error in terminals and notebooks, once per process.

    If `everywhere`, it is printed even if standard error is redirected.
    """

    are_wanted = True
    """Whether announcements are printed."""

    def __init__(self, text: str, everywhere: bool = False) -> None:
        self._text, self._everywhere, self.is_made = text, everywhere, False
        self.pass_on: Callable[[], None] | None = None
        """Function that is called in place of printing the message, in a process that works for another one."""

    def __call__(self) -> None:
        if self.is_made:
            return
        self.is_made = True
        logger.info(self._text)
        if self.pass_on is not None:
            self.pass_on()
            return
        with suppress(OSError, ValueError):  # standard error is full, or closed
            is_terminal = sys.stderr is not None and sys.stderr.isatty()
            if self.are_wanted and sys.stderr and (self._everywhere or is_terminal or "ipykernel" in sys.modules):
                sys.stderr.write(f"{CLEAR_LINE if is_terminal else ''}signedheat: {self._text}\n")
                sys.stderr.flush()


_thread = threading.local()  # not a `ContextVar`, which new threads inherit on some versions of Python


@dataclass(eq=False)
class Reports:
    """A callback that is bound to a thread. Calls report a fraction of the present part of the work, and a step."""

    callback: Progress
    start: float = 0.0  # the fractions of the whole work at which the present part begins
    stop: float = 1.0  # and ends
    fraction: float = 0.0  # the last fraction of the whole work that was reported; it never goes back
    step: str = "begin"  # the last step

    def __call__(self, fraction: float, step: str) -> None:
        self.fraction = max(self.fraction, self.start + fraction * (self.stop - self.start))
        self.step = step
        self.again()

    def again(self) -> None:
        """Report the last fraction and step again."""
        with reporting(None):  # the callback may call functions that report
            self.callback(self.fraction, self.step)


def bound_progress() -> Reports | None:
    """Return what is bound to this thread, to be passed on as `progress` to public functions; None if nothing is."""
    return getattr(_thread, "reports", None)


@contextmanager
def reporting(progress: Progress | None) -> Iterator[None]:
    """Within a ``with`` block, let `report` call `progress`, which is told at the end that all is done.

    None lets it call nothing. What is bound already stays as it is.
    """
    before = bound_progress()
    if progress is before:
        yield
        return
    _thread.reports = reports = None if progress is None else Reports(progress)
    try:
        yield
        if reports is not None:
            reports(1.0, "done")
    finally:
        _thread.reports = before


@contextmanager
def part_of_work(start: float, stop: float) -> Iterator[None]:
    """Within a ``with`` block, let the fractions 0 to 1 that are reported be `start` to `stop` of the part around."""
    reports = bound_progress()
    if reports is None:
        yield
        return
    before, size = (reports.start, reports.stop), reports.stop - reports.start
    reports.start, reports.stop = before[0] + start * size, before[0] + stop * size
    try:
        yield
    finally:
        reports.start, reports.stop = before


def report(fraction: float, step: str) -> None:
    """Report the fraction done of the present part, from 0 to 1, and the step that begins, if a callback is bound.

    An exception that the callback raises cancels the work.
    """
    reports = bound_progress()
    if reports is not None:
        reports(fraction, step)


def report_again() -> None:
    """Report the last fraction and step again, so that long loops can be cancelled."""
    reports = bound_progress()
    if reports is not None:
        reports.again()


class Stopwatch:
    """Measures, logs and reports each of several named steps of a part of the work."""

    def __init__(self, steps: int) -> None:
        self.seconds: dict[str, float] = {}
        self._steps = steps

    @contextmanager
    def __call__(self, step: str) -> Iterator[None]:
        """Time the ``with`` block of a step, which is a part of the work of the same size as every other."""
        done = len(self.seconds)
        with part_of_work(done / self._steps, (done + 1) / self._steps):
            report(0.0, step)
            begin = time.perf_counter()
            yield
        self.seconds[step] = time.perf_counter() - begin
        logger.info("%s: %.3f s", step, self.seconds[step])


ENTRY_PROGRAM = (
    "import json, sys; sys.path[:] = json.loads(sys.argv[1]); from importlib import import_module; "
    "module, name = sys.argv[2].split(':'); getattr(import_module(module), name)(*sys.argv[3:])"
)
"""Program of a new process: the process starts isolated, and then takes over the import path of this one."""


class Abandoned(BaseException):
    """Raised in a thread whose result nobody waits for any more."""


@dataclass(eq=False)
class Flag:
    """Tells a thread, and the threads that it starts, whether its result is still awaited."""

    parent: Flag | None  # the flag of the thread that started it
    is_raised: bool = False  # whether nobody waits for the result any more


def own_flag() -> Flag:
    """Return a new flag for a job that this thread starts, with the flag of this thread as parent."""
    return Flag(getattr(_thread, "flag", None))


def stop_if_abandoned() -> None:
    """Raise `Abandoned` in a thread whose result nobody waits for any more."""
    flag: Flag | None = getattr(_thread, "flag", None)
    while flag is not None:
        if flag.is_raised:
            raise Abandoned
        flag = flag.parent


def start_thread(job: Callable[[], None], flag: Flag) -> Thread:
    """Start a job on a daemon thread, which `stop_if_abandoned` ends once the flag is raised."""

    def run() -> None:
        _thread.flag = flag
        job()

    thread = Thread(target=run, daemon=True)
    thread.start()
    return thread


def settle(future: Future[Any], job: Callable[[], Any]) -> None:
    """Run a job, and store its result or its exception in a future."""
    try:
        future.set_result(job())
    except BaseException as error:
        future.set_exception(error)


def awaited(future: Future[Result], watch: Callable[[], None] = stop_if_abandoned) -> Result:
    """Wait for the result of a future, and call `watch` every tenth of a second.

    An exception that `watch` raises, and Ctrl-C, end the wait.
    """
    while True:
        try:
            return future.result(0.1)
        except FutureTimeout:
            if future.done():  # the job itself raised the error
                raise
            watch()


def run_cancellable(job: Callable[[], Result]) -> Result:
    """Run a job and return its result. If a callback is bound, it can cancel the job, however long that takes."""
    return job() if bound_progress() is None else run_watched(job, report_again)


def run_watched(job: Callable[[], Result], watch: Callable[[], None]) -> Result:
    """Run a job on its own thread, call `watch` every tenth of a second until it ends, and return its result.

    An exception from `watch` is raised at once, and so is Ctrl-C; the job then ends at the next kernel that it calls.
    """
    future: Future[Result] = Future()
    flag = own_flag()
    try:
        start_thread(partial(settle, future, job), flag)
        return awaited(future, watch)
    except BaseException:
        flag.is_raised = True
        raise


@contextmanager
def briefly() -> Iterator[None]:
    """Within a ``with`` block, let `interruptible` call functions directly, which saves the start of a thread."""
    before = getattr(_thread, "is_brief", False)
    _thread.is_brief = True
    try:
        yield
    finally:
        _thread.is_brief = before


def interruptible(function: Callable[..., Result], *arguments: Any, **named: Any) -> Result:
    """Call a compiled function in such a way that Ctrl-C ends the wait for it, although it cannot be interrupted.

    Python handles signals on its main thread, between two instructions. A call from the main thread therefore runs on
    another thread. After Ctrl-C that thread continues to the end of the function, and nobody waits for it.
    """
    stop_if_abandoned()
    if threading.get_ident() != threading.main_thread().ident or getattr(_thread, "is_brief", False):
        return function(*arguments, **named)
    future: Future[Result] = Future()
    try:
        thread = start_thread(partial(settle, future, partial(function, *arguments, **named)), own_flag())
    except RuntimeError:  # no more threads can be started
        return function(*arguments, **named)
    try:
        return awaited(future)
    finally:
        if future.done():
            thread.join()


def run_limited(job: Callable[[], Result], seconds: float) -> Result:
    """Run a job on its own thread and return its result; raise `TimeoutError` if it takes longer than `seconds`.

    A late job is told to stop, and ends at the next kernel that it calls.
    """
    end = time.monotonic() + seconds

    def refuse_to_wait() -> None:
        if time.monotonic() > end:
            raise TimeoutError(f"it takes more than {seconds:.0f} seconds")

    return run_watched(job, refuse_to_wait)


def command_for(entry: str, *arguments: str) -> list[str]:
    """Return the command line of a Python process that calls the function `entry`, written "module:name".

    The process imports modules from the same folders as this one, but never from the current folder, which
    ``python -c`` would search first.
    """
    path = [os.path.abspath(folder) for folder in sys.path if folder]
    return [sys.executable, "-I", "-c", ENTRY_PROGRAM, json.dumps(path), entry, *arguments]
