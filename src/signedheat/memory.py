"""Memory that is available to this process, and errors if an array would not fit."""

from __future__ import annotations

import math
import mmap
import sys
from collections.abc import Callable
from functools import cache, wraps
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import numpy as np
from numpy.typing import DTypeLike, NDArray

from .compiled import made
from .errors import MemoryLimitError

P = ParamSpec("P")
T = TypeVar("T")

CGROUPS = Path("/proc/self/cgroup")
"""File that lists the control groups of this process, each on a line ``id:controllers:path``."""
CGROUP_ROOT = Path("/sys/fs/cgroup")
"""Folder of control groups of version 2; its subfolder ``memory`` has those of version 1."""
CGROUP_FILES = {"": ("memory.max", "memory.current"), "memory": ("memory.limit_in_bytes", "memory.usage_in_bytes")}
"""Names of the files with the limit and the usage of a group, by the controllers in its line, which are "" in version 2
and "memory" in version 1."""
BYTES_UNLOADED, BYTES_IMPORTED, BYTES_LOADED = 45_000_000, 24_000_000, 7_000_000
"""Bytes that libraries will still allocate before Numba is imported, after that, and after the first kernel. Cached
files of libraries, 75 to 140 MB, are not counted, since the system can free them."""
BYTES_MAPPED = {"VmSize": 685_000_000, "VmData": 165_000_000}
"""Bytes that libraries map but hardly touch; they count towards limits on address space and data."""
REMEDY_MARGIN = 1.1
"""Factor by which the size that an error suggests is below what fits, since free memory changes between calls."""


def libraries() -> int:
    """Estimate the bytes that libraries will still allocate, mostly for the compiler that the first kernel loads."""
    if made:
        return BYTES_LOADED
    return BYTES_IMPORTED if "numba" in sys.modules else BYTES_UNLOADED


def refuse_beyond_memory(
    problem: str, count: int, estimate: Callable[[int], float], remedy: Callable[[int], str]
) -> None:
    """Raise `MemoryLimitError` if there is not enough memory for `count` elements.

    ``estimate(count)`` returns the bytes that so many elements need. ``remedy(count)`` returns a text for the number of
    elements that would fit. The message begins with `problem`, a noun such as "the grid".
    """
    available = available_memory()
    needed = estimate(count) + libraries()
    if available is None or needed <= available:
        return
    raise MemoryLimitError(
        f"{problem} needs about {needed / 1e9:.2g} GB, and {available / 1e9:.2g} GB are free",
        remedy=remedy(fitting_count(count, estimate, (available - libraries()) / REMEDY_MARGIN)),
    )


def within_memory(function: Callable[P, T]) -> Callable[P, T]:
    """Decorate a public function so that a `MemoryError` within it becomes a `MemoryLimitError`.

    `refuse_beyond_memory` prevents the largest allocations. This is for all others.

    Examples
    --------
    >>> within_memory(np.zeros)(10**15)
    Traceback (most recent call last):
    signedheat.errors.MemoryLimitError: there is not enough memory (Unable to allocate ...
    """

    @wraps(function)
    def guarded(*args: P.args, **kwargs: P.kwargs) -> T:
        try:
            return function(*args, **kwargs)
        except MemoryError as error:
            raise MemoryLimitError(
                f"there is not enough memory ({error or 'an allocation failed'})",
                remedy="free some, or ask for less: fewer points, a lower resolution, a smaller shape",
            ) from error

    return guarded


def untouched_zeros(shape: tuple[int, ...], dtype: DTypeLike) -> NDArray[Any]:
    """Return an array of zeros whose small pages take memory only once they are written.

    `numpy.zeros` may use pages of 2 MB. Writing values near a surface in a grid would touch most of these.
    """
    count = math.prod(shape)
    if count == 0:
        return np.zeros(shape, dtype=dtype)
    pages = mmap.mmap(-1, count * np.dtype(dtype).itemsize)
    return np.frombuffer(pages, dtype=dtype, count=count).reshape(shape)


def fitting_count(count: int, estimate: Callable[[int], float], available: float) -> int:
    """Return the largest number of elements, up to `count`, whose estimated memory is at most `available` bytes."""
    low, high = 0, count
    while low < high:
        middle = (low + high + 1) // 2
        low, high = (middle, high) if estimate(middle) <= available else (low, middle - 1)
    return low


def available_memory() -> int | None:
    """Return the bytes that free memory, control groups and ``ulimit`` leave to this process; None if unknown."""
    limits = [bound for bound in (_free(), *_containers(), *_own_limits()) if bound is not None]
    return max(min(limits), 0) if limits else None


def _free() -> int | None:
    """Return the bytes of the machine's memory that are free without swapping, or None if that is unknown."""
    kilobytes = _fields("/proc/meminfo").get("MemAvailable")
    return None if kilobytes is None else 1024 * kilobytes


def _containers() -> list[int]:
    """Return the bytes that each control group around this process leaves, from its own up to the root."""
    remaining = []
    for limit_file, used_file, details in _files_of_groups(_text(CGROUPS), CGROUP_ROOT):
        limit = _text(limit_file).strip()
        used = _text(used_file).strip() if limit.isdigit() else ""
        if used.isdigit():
            remaining.append(int(limit) - int(used) + _cached(details))
    return remaining


@cache
def _files_of_groups(listed: str, folder: Path) -> list[tuple[str, str, str]]:
    """Return paths of the files with the limit, the usage and the details of each control group around this process.

    `listed` is the text of `CGROUPS`, and `folder` the root of control groups.
    """
    lines = [line.split(":", 2) for line in listed.splitlines() if line.count(":") > 1]
    own = {controllers: path for _, controllers, path in lines}
    paths = []
    for controllers, (limit, used) in CGROUP_FILES.items():
        root = folder / controllers
        group = root / own.get(controllers, "/").lstrip("/")
        for level in (group, *(parent for parent in group.parents if parent.is_relative_to(root))):
            paths.append((str(level / limit), str(level / used), str(level / "memory.stat")))
    return paths


def _cached(details: str) -> int:
    """Return the bytes of cached files in a control group, which the system can free, from its file `details`."""
    words = dict(line.split(maxsplit=1) for line in _text(details).splitlines() if " " in line)
    total = "total_" if "total_inactive_file" in words else ""
    return sum(int(words.get(f"{total}{name}", 0)) for name in ("inactive_file", "active_file"))


def _own_limits() -> list[int]:
    """Return the bytes that each limit of this process on address space or data (``ulimit``) leaves."""
    if sys.platform == "win32":
        return []
    import resource

    held = _fields("/proc/self/status")
    kinds = {"VmSize": resource.RLIMIT_AS, "VmData": resource.RLIMIT_DATA}
    limits = {name: resource.getrlimit(kind)[0] for name, kind in kinds.items() if name in held}
    share = libraries() / BYTES_UNLOADED
    return [
        limit - 1024 * held[name] - int(share * BYTES_MAPPED[name])
        for name, limit in limits.items()
        if limit != resource.RLIM_INFINITY
    ]


def _text(path: Path | str) -> str:
    """Read a system file; return an empty text if that fails."""
    try:
        with open(path) as file:
            return file.read()
    except OSError:
        return ""


def _fields(path: str) -> dict[str, int]:
    """Return whole numbers by name from lines like ``MemAvailable:  1024 kB`` of a system file."""
    pairs = (line.split(":", 1) for line in _text(path).splitlines() if ":" in line)
    return {name: int(words[0]) for name, rest in pairs if (words := rest.split()) and words[0].isdigit()}
