"""One thread of BLAS, where more would only wait for one another."""

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
"""The limit that the first thread to enter `one_blas_thread` sets, and that the last one to leave removes."""


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Limit BLAS to one thread, that of MKL too, while any thread of this process is within such a ``with`` block."""
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
    """Find the BLAS libraries of this process, which takes 2 ms; SciPy's is there, and MKL's from its first use on."""
    return ThreadpoolController()
