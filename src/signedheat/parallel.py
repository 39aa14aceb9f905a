"""Functions on rows of arrays on several threads, trees of points, and connections to Dask clusters."""

from __future__ import annotations

import os
import socket
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future
from functools import partial
from queue import SimpleQueue
from threading import Thread
from typing import Any, TypeVar

import numpy as np
import scipy
from numpy.typing import NDArray

from .arrays import Floats
from .errors import SignedHeatError
from .jobs import (
    awaited,
    briefly,
    interruptible,
    own_flag,
    run_limited,
    settle,
    start_thread,
    stop_if_abandoned,
    wanted_threads,
)
from .packages import lazy_module

distributed: Any = lazy_module("distributed", "Dask clusters")

Item = TypeVar("Item")
Result = TypeVar("Result")

ROWS_PER_TASK = 1 << 13
"""Number of rows that a thread processes at a time."""
BRIEF_ROWS = 1 << 8
"""Number of rows up to which `in_chunks` calls kernels directly, because nobody would interrupt so short a call."""
CLUSTER_SECONDS = 30.0
"""Seconds to wait for a Dask scheduler to answer, before an error is raised."""


def n_threads() -> int:
    """Return the number of processors available to this process, or ``NUMBA_NUM_THREADS`` if that is less."""
    available = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else (os.cpu_count() or 1)
    return min(available, wanted_threads() or available)


def in_chunks(
    function: Callable[[NDArray[Any]], tuple[NDArray[Any], ...]], rows: NDArray[Any]
) -> tuple[NDArray[Any], ...]:
    """Apply a function to chunks of rows on all threads, and concatenate the arrays that it returns.

    The function takes some rows and returns a tuple of arrays with one row for each. The result does not depend on the
    number of threads. Each thread needs additional memory for one chunk.
    """
    if len(rows) <= BRIEF_ROWS:
        with briefly():
            return function(rows)
    if len(rows) <= ROWS_PER_TASK:
        return function(rows)
    first = function(rows[:ROWS_PER_TASK])
    results = tuple(np.empty((len(rows), *part.shape[1:]), dtype=part.dtype) for part in first)

    def fill(start: int, parts: tuple[NDArray[Any], ...]) -> None:
        for result, part in zip(results, parts, strict=True):
            result[start : start + len(part)] = part

    fill(0, first)
    starts = range(ROWS_PER_TASK, len(rows), ROWS_PER_TASK)
    list(in_threads(lambda start: fill(start, function(rows[start : start + ROWS_PER_TASK])), starts))
    return results


def in_threads(function: Callable[[Item], Result], items: Iterable[Item]) -> Iterator[Result]:
    """Yield the results of a function for items, in their order, computed on all threads.

    Only a few results are held at a time. After Ctrl-C, threads end after their item or at the next kernel, and are not
    waited for.
    """
    tasks: SimpleQueue[tuple[Future[Result], Callable[[], Result]] | None] = SimpleQueue()

    def work() -> None:
        while (task := tasks.get()) is not None:
            settle(*task)

    def guarded(item: Item) -> Result:
        stop_if_abandoned()
        return function(item)

    flag, most = own_flag(), n_threads()
    threads: list[Thread] = []
    jobs: deque[Future[Result]] = deque()
    try:
        for item in items:
            jobs.append(Future())
            tasks.put((jobs[-1], partial(guarded, item)))
            if len(threads) < most:
                threads.append(start_thread(work, flag))
            if len(jobs) > 2 * most:
                yield awaited(jobs.popleft())
        while jobs:
            yield awaited(jobs.popleft())
    except BaseException as error:
        flag.is_raised = True
        if not isinstance(error, Exception):  # Ctrl-C, or nobody wants the rest
            threads.clear()
        raise
    finally:
        for _ in range(most):
            tasks.put(None)
        for thread in threads:
            thread.join()


class PointTree:
    """SciPy's tree of points, with queries on threads of this package.

    SciPy's own threads crash after Ctrl-C, since they use the tree after it has been freed.
    """

    def __init__(self, points: Floats, **options: Any) -> None:
        make = scipy.spatial.cKDTree
        few = len(points) <= ROWS_PER_TASK
        self.tree: Any = make(points, **options) if few else interruptible(make, points, **options)

    def __getattr__(self, name: str) -> Any:
        """Return an attribute of SciPy's tree."""
        return getattr(self.tree, name)

    def sparse_distance_matrix(self, other: PointTree, reach: float, **options: Any) -> Any:
        """Return the distances up to `reach` between the points of two trees, as SciPy does."""
        return self.tree.sparse_distance_matrix(other.tree, reach, **options)

    def query(self, x: Any, k: Any = 1, **options: Any) -> tuple[Any, Any]:
        """Return the distances and indices of the `k` nearest points of each row, as SciPy does."""
        rows = np.asarray(x, dtype=np.float64)
        if rows.ndim != 2 or len(rows) <= ROWS_PER_TASK:
            return self.tree.query(rows, k, **options)
        search = partial(self.tree.query, k=k, **options)
        distances, indices = in_chunks(search, rows)
        return distances, indices

    def query_ball_point(self, x: Any, r: Any, **options: Any) -> Any:
        """Return lists of the points within a radius of each row, as SciPy does."""
        rows = np.asarray(x, dtype=np.float64)
        if rows.ndim != 2 or len(rows) <= ROWS_PER_TASK:
            return self.tree.query_ball_point(rows, r, **options)
        search, radii = self.tree.query_ball_point, np.broadcast_to(np.asarray(r, dtype=np.float64), len(rows))
        (near,) = in_chunks(lambda own: (search(rows[own], radii[own], **options),), np.arange(len(rows)))
        return near


def connected(address: str) -> Any:
    """Connect to the Dask scheduler at an address, and return the client; raise if none answers within a minute."""
    comm = distributed.comm  # raises if Dask is missing, before errors are converted
    try:
        if comm.parse_address(address)[0] == "tcp":
            _hear_greeting(*comm.get_address_host_port(address))
        return run_limited(lambda: distributed.Client(address, timeout=CLUSTER_SECONDS), 2 * CLUSTER_SECONDS)
    except Exception as error:  # Dask raises exceptions of many types
        reason = " ".join(str(error).split()) or type(error).__name__
        raise SignedHeatError(
            f"no Dask scheduler answers at {address!r} ({reason:.200})",
            remedy="start one with `dask scheduler`, and name its address",
            element="scheduler",
        ) from error


def _hear_greeting(host: str, port: int) -> None:
    """Raise an error if a server does not greet as a Dask scheduler does.

    Dask itself would wait too long for such a server, or allocate too much memory.
    """
    with socket.create_connection((host, port), CLUSTER_SECONDS) as connection:
        try:
            greeting = connection.recv(8, socket.MSG_WAITALL)
        except TimeoutError:
            greeting = b""
    if len(greeting) < 8 or int.from_bytes(greeting, "little") > 1 << 20:  # a scheduler's first message is not as long
        raise ConnectionError("the listener there is not a scheduler")
