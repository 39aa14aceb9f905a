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

from .compiled import made
from .errors import MemoryLimitError

GROUPS = Path("/proc/self/cgroup")
"""Where the system lists to which groups this process belongs, a line ``id:controllers:path`` for each."""
ROOT = Path("/sys/fs/cgroup")
"""Where the groups of version 2 are, and below ``memory`` those of version 1."""
FILES = {"": ("memory.max", "memory.current"), "memory": ("memory.limit_in_bytes", "memory.usage_in_bytes")}
"""Files with the limit of a group and its present use, by the controllers that its line names: version 2 and 1."""


UNLOADED, IMPORTED, LOADED = 45_000_000, 24_000_000, 7_000_000
"""Bytes that libraries and compiled kernels still take, whatever is computed: at first; where others have imported
Numba, which takes as much again when it is first used; and after the first use of a kernel. Their files are not
counted: the system takes back what it holds of them, which is 75 to 140 MB, as it sees fit."""


MAPPED = {"VmSize": 685_000_000, "VmData": 165_000_000}
"""Bytes that libraries map in addition, and hardly touch: they count where a process's own limits do."""


ROOM = 1.1
"""By how much the size that a remedy names is smaller than must be: what is free changes between two calls."""


def libraries() -> int:
    """What libraries still take: most of it is the compiler, which the first kernel loads."""
    if made:
        return LOADED
    return IMPORTED if "numba" in sys.modules else UNLOADED


def refuse_beyond_memory(what: str, count: int, estimate: Callable[[int], float], remedy: Callable[[int], str]) -> None:
    """Raise `MemoryLimitError` if there is not enough memory for so many elements."""
    available = available_memory()
    needed = estimate(count) + libraries()
    if available is None or needed <= available:
        return
    raise MemoryLimitError(
        f"{what} needs about {needed / 1e9:.2g} GB, and {available / 1e9:.2g} GB are free",
        remedy=remedy(fitting_count(count, estimate, (available - libraries()) / ROOM)),
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
    """Bytes that this process can still allocate; None if the system does not say.

    The least of what is free in the machine, what the container or job leaves (cgroups, those around them too), and
    what the process's own limits leave on address space (``ulimit -v``) and data (``ulimit -d``).
    """
    limits = [bound for bound in (_free(), *_containers(), *_own_limits()) if bound is not None]
    return max(min(limits), 0) if limits else None


def _free() -> int | None:
    """What the machine can give without swapping."""
    kilobytes = _fields("/proc/meminfo").get("MemAvailable")
    return None if kilobytes is None else 1024 * kilobytes


def _containers() -> list[int]:
    """What each group around this process leaves, the machine's whole included: some see only their own there."""
    lines = [line.split(":", 2) for line in _text(GROUPS).splitlines() if line.count(":") > 1]
    own = {controllers: path for _, controllers, path in lines}
    left = []
    for controllers, names in FILES.items():
        root = ROOT / controllers
        group = root / own.get(controllers, "/").lstrip("/")
        for place in (group, *(parent for parent in group.parents if parent.is_relative_to(root))):
            limit, used = (_text(place / name).strip() for name in names)
            if limit.isdigit() and used.isdigit():
                left.append(int(limit) - int(used) + _cached(place))
    return left


def _cached(group: Path) -> int:
    """Bytes of files that a group holds, which the system takes back before it refuses any."""
    words = dict(line.split(maxsplit=1) for line in _text(group / "memory.stat").splitlines() if " " in line)
    total = "total_" if "total_inactive_file" in words else ""
    return sum(int(words.get(f"{total}{name}", 0)) for name in ("inactive_file", "active_file"))


def _own_limits() -> list[int]:
    if sys.platform == "win32":
        return []
    import resource

    held = _fields("/proc/self/status")
    kinds = {"VmSize": resource.RLIMIT_AS, "VmData": resource.RLIMIT_DATA}
    limits = {name: resource.getrlimit(kind)[0] for name, kind in kinds.items() if name in held}
    share = libraries() / UNLOADED
    return [
        limit - 1024 * held[name] - int(share * MAPPED[name])
        for name, limit in limits.items()
        if limit != resource.RLIM_INFINITY
    ]


def _text(path: Path | str) -> str:
    """The text of a file of the system; nothing where there is none."""
    try:
        return Path(path).read_text()
    except OSError:
        return ""


def _fields(path: str) -> dict[str, int]:
    """Whole numbers by name, from lines like ``MemAvailable:  1024 kB``."""
    pairs = (line.split(":", 1) for line in _text(path).splitlines() if ":" in line)
    return {name: int(words[0]) for name, rest in pairs if (words := rest.split()) and words[0].isdigit()}
