"""Threads, and how rows are shared among them; Dask clusters."""

from __future__ import annotations

import os
import socket
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import SignedHeatError
from .jobs import run_limited
from .packages import lazy_module

distributed: Any = lazy_module("distributed", "Dask clusters")

CHUNK = 1 << 13
"""Rows that a thread works on at a time."""

PATIENCE = 30.0
"""Seconds within which a cluster must answer."""
GREETING = 1 << 20
"""Bytes that the first message of a Dask scheduler has at the most."""


def n_threads() -> int:
    """Number of processors that this process may use, limited by ``NUMBA_NUM_THREADS``."""
    available = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else (os.cpu_count() or 1)
    wanted = os.environ.get("NUMBA_NUM_THREADS", "")
    return min(available, int(wanted)) if wanted.isdigit() and int(wanted) > 0 else available


def in_chunks(
    function: Callable[[NDArray[Any]], tuple[NDArray[Any], ...]], rows: NDArray[Any]
) -> tuple[NDArray[Any], ...]:
    """Apply a function to chunks of rows on all threads, and put its arrays together again.

    Memory beyond that of the result is that of a chunk for each thread. Chunks do not depend on the number of threads,
    so neither does the result.

    Examples
    --------
    >>> in_chunks(lambda x: (x.sum(axis=1), x > 1), np.array([[1.0, 2.0], [3.0, 0.0]]))
    (array([3., 3.]), array([[False,  True],
           [ True, False]]))
    """
    if len(rows) <= CHUNK:
        return function(rows)
    first = function(rows[:CHUNK])
    results = tuple(np.empty((len(rows), *part.shape[1:]), dtype=part.dtype) for part in first)

    def fill(start: int, parts: tuple[NDArray[Any], ...]) -> None:
        for result, part in zip(results, parts, strict=True):
            result[start : start + len(part)] = part

    fill(0, first)
    with ThreadPoolExecutor(n_threads()) as pool:
        starts = range(CHUNK, len(rows), CHUNK)
        for job in [pool.submit(lambda k: fill(k, function(rows[k : k + CHUNK])), start) for start in starts]:
            job.result()
    return results


def connected(address: str) -> Any:
    """A client of a running Dask cluster.

    Raises
    ------
    SignedHeatError
        If none answers at the address within a minute; whatever else may listen there.
    MissingPackageError
        If Dask is not installed.

    Examples
    --------
    >>> connected("nobody")
    Traceback (most recent call last):
        ...
    signedheat.errors.SignedHeatError: no Dask scheduler answers at 'nobody' (missing port number in address 'nobody'): start one with `dask scheduler`, and name its address
    """  # noqa: E501
    comm = distributed.comm  # a missing package raises its own error
    try:
        if comm.parse_address(address)[0] == "tcp":
            _hear_greeting(*comm.get_address_host_port(address))
        return run_limited(lambda: distributed.Client(address, timeout=PATIENCE), 2 * PATIENCE)
    except Exception as error:  # Dask's own, and those of what it takes for messages
        reason = " ".join(str(error).split()) or type(error).__name__
        raise SignedHeatError(
            f"no Dask scheduler answers at {address!r} ({reason:.200})",
            remedy="start one with `dask scheduler`, and name its address",
            element="scheduler",
        ) from error


def _hear_greeting(host: str, port: int) -> None:
    """Refuse a listener that does not greet as a scheduler does: Dask would wait, or allocate what it announces."""
    with socket.create_connection((host, port), PATIENCE) as connection:
        try:
            heard = connection.recv(8, socket.MSG_WAITALL)
        except TimeoutError:
            heard = b""
    if len(heard) < 8 or int.from_bytes(heard, "little") > GREETING:
        raise ConnectionError("what listens there is no scheduler")
