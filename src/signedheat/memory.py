"""Available memory: free memory of the machine, and what limits leave to this process."""

from __future__ import annotations

import sys
from pathlib import Path

LIMITS = (
    ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory.current"),
    ("/sys/fs/cgroup/memory/memory.limit_in_bytes", "/sys/fs/cgroup/memory/memory.usage_in_bytes"),
)
"""Files with the memory limit of a container and its present use, for version 2 and version 1 of cgroups."""


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
