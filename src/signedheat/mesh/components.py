"""Connected components of graphs and of elements, and groups of members.

Groups are stored as (n + 1,) offsets `starts` and an array of members: group i is ``members[starts[i] : starts[i +
1]]``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints, read_only
from ..compiled import compiled


def connected_components(n: int, tails: NDArray[np.integer], heads: NDArray[np.integer]) -> Ints:
    """Return (n,) the connected component of each of n nodes; edge k of the graph joins tails[k] and heads[k].

    Components are numbered from 0, in order of their least node.
    """
    return _component_numbers(n, *(read_only(np.ascontiguousarray(ends, dtype=np.int64)) for ends in (tails, heads)))


def element_components(elements: Ints) -> Ints:
    """Return (m,) the connected component of each of (m, k) elements, which are connected if they share an id.

    Components are numbered from 0, in order of their first element.
    """
    links = np.repeat(elements[:, 0], elements.shape[1] - 1), elements[:, 1:].ravel()
    labels = connected_components(int(elements.max(initial=-1)) + 1, *links)[elements[:, 0]]
    return by_first_use(labels, int(labels.max(initial=-1)) + 1)[0]


def by_first_use(ids: NDArray[np.integer], n: int) -> tuple[Ints, Ints]:
    """Renumber ids below n from 0 in order of first appearance; return the new ids, and the old id of each new one."""
    first = first_members(ids, n)
    used = np.flatnonzero(first >= 0)
    order = used[np.argsort(first[used])]
    number = np.empty(n, dtype=np.int64)
    number[order] = np.arange(len(order))
    return number[ids], order


@compiled
def _component_numbers(n: int, tails: Ints, heads: Ints) -> Ints:
    """Return the component of each of n nodes that edges join, (n,), by union-find with the least nodes as roots."""
    parents = np.arange(n)
    for k in range(len(tails)):
        a, b = tails[k], heads[k]
        while parents[a] != a:
            parents[a] = parents[parents[a]]
            a = parents[a]
        while parents[b] != b:
            parents[b] = parents[parents[b]]
            b = parents[b]
        parents[max(a, b)] = min(a, b)
    count = 0
    for node in range(n):  # its ancestors already have numbers
        if parents[node] == node:
            parents[node] = -1 - count
            count += 1
        else:
            parents[node] = parents[parents[node]]
    return -1 - parents


def grouped(groups: NDArray[np.integer], n: int) -> tuple[Ints, Ints]:
    """Sort the indices of `groups`, (k,) group ids below n, by group; return (n + 1,) offsets and (k,) indices."""
    starts, members = _grouped(read_only(np.ascontiguousarray(groups, dtype=np.int64)), n)
    return starts, members


def first_members(groups: NDArray[np.integer], n: int) -> Ints:
    """Return (n,) the first index at which each id below n occurs in `groups`, −1 if it does not."""
    first = np.full(n, -1)
    first[groups[::-1]] = np.arange(len(groups))[::-1]
    return first


def places_among(ordered: NDArray[np.integer], keys: NDArray[np.integer]) -> Ints:
    """Return (k,) the index of each key in a sorted array, −1 if it is not in it."""
    if not len(ordered):
        return np.full(len(keys), -1)
    indices = np.minimum(np.searchsorted(ordered, keys), len(ordered) - 1)
    return np.where(ordered[indices] == keys, indices, -1)


def numbered(counts: Ints) -> tuple[Ints, Ints]:
    """Return the group of each member of consecutive groups with given sizes, and its number within the group."""
    owners = np.repeat(np.arange(len(counts)), counts)
    return owners, np.arange(len(owners)) - (np.cumsum(counts) - counts)[owners]


def next_in_groups(starts: Ints) -> Ints:
    """Return (k,) the index of the next member of the same group, cyclically, for groups with (n + 1,) offsets."""
    following, filled = np.arange(1, starts[-1] + 1), starts[1:] > starts[:-1]
    following[starts[1:][filled] - 1] = starts[:-1][filled]
    return following


def members_of(starts: Ints, members: Ints, chosen: NDArray[np.integer]) -> tuple[Ints, Ints]:
    """Return the members of chosen groups: the index in `chosen` of the group of each member, and the member."""
    owners, number = numbered(starts[chosen + 1] - starts[chosen])
    return owners, members[starts[chosen][owners] + number]


def sums_of(values: NDArray[np.floating], groups: NDArray[np.integer], n: int) -> Floats:
    """Return (n, ...) sums of (k, ...) values over each of n groups; row i is in group groups[i]."""
    columns = values.reshape(len(values), int(np.prod(values.shape[1:]))).T
    sums = np.stack([np.bincount(groups, column, n) for column in columns], axis=1)
    return np.asarray(sums.reshape(n, *values.shape[1:]), np.float64)


def boxes_of(points: Floats, groups: Ints, n: int) -> tuple[Floats, Floats]:
    """Return (n, 3) lower and (n, 3) upper corners of the boxes around (k, 3) points in each of n groups.

    Point i is in group groups[i]. Where a group has no point, the lower corner is ∞ and the upper one −∞.
    """
    order, counts = np.argsort(groups, kind="stable"), np.bincount(groups, minlength=n)
    used = counts > 0
    starts, columns = (np.cumsum(counts) - counts)[used], [column[order] for column in points.T]
    lower, upper = np.full((n, 3), np.inf), np.full((n, 3), -np.inf)
    if len(points):
        for corners, extreme in ((lower, np.minimum), (upper, np.maximum)):
            corners[used] = np.stack([extreme.reduceat(column, starts) for column in columns], axis=1)
    return lower, upper


@compiled
def _grouped(groups: Ints, n: int) -> tuple[Ints, Ints]:
    """Return the (n + 1,) offsets of groups and the (k,) indices of their members, by a counting sort."""
    starts = np.zeros(n + 1, dtype=np.int64)
    for group in groups:
        starts[group + 1] += 1
    for group in range(n):
        starts[group + 1] += starts[group]
    positions, members = starts[:-1].copy(), np.empty(len(groups), dtype=np.int64)
    for member, group in enumerate(groups):
        members[positions[group]] = member
        positions[group] += 1
    return starts, members
