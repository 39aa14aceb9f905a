"""Limits on threads of BLAS."""

import numpy as np
import pytest
from threadpoolctl import threadpool_info

from signedheat.linear.threads import one_blas_thread


def blas_threads():
    return [library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"]


def test_the_last_thread_to_leave_restores_how_many_threads_blas_has():
    """Whichever of two that overlap leaves first."""
    np.ones((2, 2)) @ np.ones((2, 2))
    before = blas_threads()
    if max(before) == 1:
        pytest.skip("BLAS has one thread here anyway")
    first, second = one_blas_thread(), one_blas_thread()
    first.__enter__()
    second.__enter__()
    first.__exit__(None, None, None)
    assert set(blas_threads()) == {1}
    second.__exit__(None, None, None)
    assert blas_threads() == before
    with pytest.raises(ValueError, match="within"), one_blas_thread():
        raise ValueError("within")
    assert blas_threads() == before
