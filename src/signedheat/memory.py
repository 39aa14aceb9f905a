"""Available memory: free memory of the machine, and what limits leave to this process."""

from __future__ import annotations

import math
import mmap
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from .errors import MemoryLimitError

LIMITS = (
    ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory.current"),
    ("/sys/fs/cgroup/memory/memory.limit_in_bytes", "/sys/fs/cgroup/memory/memory.usage_in_bytes"),
)
"""Files with the memory limit of a container and its present use, for version 2 and version 1 of cgroups."""


UNLOADED, IMPORTED, LOADED = 130_000_000, 65_000_000, 20_000_000
"""Bytes that libraries and compiled kernels still take, whatever is computed: at first; where others have imported
Numba, which takes as much again when it is first used; and after the first use of a kernel."""


def libraries() -> int:
    """What libraries still take: most of it is the compiler, which the first kernel loads."""
    if "signedheat.kernel_compiler" in sys.modules:
        return LOADED
    return IMPORTED if "numba" in sys.modules else UNLOADED


def refuse_beyond_memory(what: str, count: int, estimate: Callable[[int], float], remedy: Callable[[int], str]) -> None:
    """Raise `MemoryLimitError` if there is not enough memory for so many elements.

    Parameters
    ----------
    what : str
        What is to be computed, for the message.
    count : int
        Number of elements.
    estimate : callable
        From a number of elements to the bytes that they take at the most, growing.
    remedy : callable
        From the largest number of elements that fits to what to do.
    """
    available = available_memory()
    needed = estimate(count) + libraries()
    if available is None or needed <= available:
        return
    raise MemoryLimitError(
        f"{what} needs about {needed / 1e9:.2g} GB, and {available / 1e9:.2g} GB are free",
        remedy=remedy(fitting_count(count, estimate, available - libraries())),
    )


def untouched_zeros(shape: tuple[int, ...], dtype: DTypeLike) -> NDArray[Any]:
    """An array of zeros, of which only the pages that are written to take memory.

    NumPy's own asks for pages of 2 MB, of which few stay untouched where a surface runs through a grid.

    Examples
    --------
    >>> untouched_zeros((2, 2), np.float32).tolist()
    [[0.0, 0.0], [0.0, 0.0]]
    """
    count = math.prod(shape)
    if count == 0:
        return np.zeros(shape, dtype=dtype)
    pages = mmap.mmap(-1, count * np.dtype(dtype).itemsize)
    return np.frombuffer(pages, dtype=dtype, count=count).reshape(shape)


def paged(array: NDArray[Any]) -> NDArray[Any]:
    """A copy in pages of its own, which the system gets back as soon as nobody needs them."""
    result = untouched_zeros(array.shape, array.dtype)
    result[...] = array
    return result


def fitting_count(count: int, estimate: Callable[[int], float], available: float) -> int:
    """The largest number of elements, at most `count`, that takes no more than the memory available.

    Examples
    --------
    >>> fitting_count(10**9, lambda n: 100 * n, 1e6)
    10000
    """
    low, high = 0, count
    while low < high:
        middle = (low + high + 1) // 2
        low, high = (middle, high) if estimate(middle) <= available else (low, middle - 1)
    return low


def available_memory() -> int | None:
    """Bytes that this process can still allocate; None if the system does not tell.

    The least of what is free in the machine, what its container leaves (cgroups), and what its own limit on address
    space leaves (``ulimit -v``).
    """
    known = [bound for bound in (_free(), *_container(), _address_space()) if bound is not None]
    return max(min(known), 0) if known else None


def _free() -> int | None:
    """What the machine can give without swapping."""
    kilobytes = _fields("/proc/meminfo").get("MemAvailable")
    return None if kilobytes is None else 1024 * kilobytes


def _container() -> list[int]:
    left = []
    for limit, used in LIMITS:
        try:
            words = Path(limit).read_text().strip(), Path(used).read_text().strip()
        except OSError:
            continue
        if words[0].isdigit() and words[1].isdigit():
            left.append(int(words[0]) - int(words[1]))
    return left


def _address_space() -> int | None:
    if sys.platform == "win32":
        return None
    import resource

    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    held = _fields("/proc/self/status").get("VmSize")
    return None if limit == resource.RLIM_INFINITY or held is None else limit - 1024 * held


def _fields(path: str) -> dict[str, int]:
    """Whole numbers by name, from lines like ``MemAvailable:  1024 kB``."""
    try:
        lines = Path(path).read_text().splitlines()
    except OSError:
        return {}
    pairs = (line.split(":", 1) for line in lines if ":" in line)
    return {name: int(words[0]) for name, rest in pairs if (words := rest.split()) and words[0].isdigit()}
