"""Limitation of BLAS to one thread, where more threads would only wait for each other."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from threading import Lock
from typing import Any

from threadpoolctl import ThreadpoolController

from . import pardiso

_lock, _users = Lock(), 0
_limit: Any = None
"""The limit that the first thread in `one_blas_thread` sets, and that the last one to leave it removes."""


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Limit BLAS, also that of MKL, to one thread while any thread of this process is in such a ``with`` block."""
    global _users, _limit
    with _lock:
        _users += 1
        if _users == 1:
            _limit = _libraries(pardiso.is_loaded()).limit(limits=1, user_api="blas")
    try:
        yield
    finally:
        with _lock:
            _users -= 1
            if _users == 0:
                _limit.restore_original_limits()


@cache
def _libraries(with_mkl: bool) -> ThreadpoolController:
    """Return the controller of the BLAS libraries of this process, which takes 2 ms to find.

    MKL is among these only after its first use, so that there is a controller without and one with it.
    """
    return ThreadpoolController()
