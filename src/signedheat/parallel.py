"""How many threads there are to use."""

from __future__ import annotations

import os


def n_threads() -> int:
    """Processors this process may run on, or fewer where ``NUMBA_NUM_THREADS`` says so."""
    available = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else (os.cpu_count() or 1)
    wanted = os.environ.get("NUMBA_NUM_THREADS", "")
    return min(available, int(wanted)) if wanted.isdigit() and int(wanted) > 0 else available
