"""One thread of BLAS, where more would only wait for one another."""

from __future__ import annotations

from contextlib import AbstractContextManager
from functools import cache

from threadpoolctl import ThreadpoolController

from . import pardiso


def one_blas_thread() -> AbstractContextManager[object]:
    """Limit BLAS to one thread within a ``with`` block, that of MKL too."""
    return _libraries(pardiso.is_loaded()).limit(limits=1, user_api="blas")


@cache
def _libraries(with_mkl: bool) -> ThreadpoolController:
    """Find the BLAS libraries of this process, which takes 2 ms; SciPy's is there, and MKL's from its first use on."""
    return ThreadpoolController()
