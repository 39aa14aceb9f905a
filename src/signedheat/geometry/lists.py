"""Members of groups, group after group in one array: what runs along each edge, what is around each vertex."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled
from ..frozen import read_only


def grouped(groups: NDArray[np.integer], n: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(n + 1,) where the members of each of n groups begin, and the members in order: each is in one of `groups`.

    Examples
    --------
    >>> grouped(np.array([2, 0, 2]), 3)
    (array([0, 1, 1, 3]), array([1, 0, 2]))
    """
    starts, members = _grouped(read_only(np.ascontiguousarray(groups, dtype=np.int64)), n)
    return starts, members


def members_of(
    starts: NDArray[np.int64], members: NDArray[np.int64], chosen: NDArray[np.integer]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """All members of some groups, as pairs: index into `chosen`, and member.

    Examples
    --------
    >>> members_of(*grouped(np.array([2, 0, 2]), 3), np.array([0, 2, 1]))
    (array([0, 1, 1]), array([1, 0, 2]))
    """
    begin, count = starts[chosen], starts[chosen + 1] - starts[chosen]
    which = np.repeat(np.arange(len(chosen)), count)
    return which, members[np.repeat(begin - np.cumsum(count) + count, count) + np.arange(len(which))]


@compiled
def _grouped(groups: NDArray[np.int64], n: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    starts = np.zeros(n + 1, dtype=np.int64)
    for group in groups:
        starts[group + 1] += 1
    for group in range(n):
        starts[group + 1] += starts[group]
    at, members = starts[:-1].copy(), np.empty(len(groups), dtype=np.int64)
    for member, group in enumerate(groups):
        members[at[group]] = member
        at[group] += 1
    return starts, members
