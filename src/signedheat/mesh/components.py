"""Connected components of graphs and of elements; members of groups, one group after another in one array."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints, read_only
from ..compiled import compiled


def connected_components(n: int, tails: NDArray[np.integer], heads: NDArray[np.integer]) -> Ints:
    """Return (n,) the component of each node of a graph with edges tails to heads, numbered by first appearance."""
    return _component_numbers(n, *(read_only(np.ascontiguousarray(ends, dtype=np.int64)) for ends in (tails, heads)))


def element_components(elements: Ints) -> Ints:
    """Return (m,) the component of each of (m, k) elements, connected by common ids, numbered by first appearance."""
    links = np.repeat(elements[:, 0], elements.shape[1] - 1), elements[:, 1:].ravel()
    labels = connected_components(int(elements.max(initial=-1)) + 1, *links)[elements[:, 0]]
    return by_first_use(labels, int(labels.max(initial=-1)) + 1)[0]


def by_first_use(ids: NDArray[np.integer], n: int) -> tuple[Ints, Ints]:
    """Renumber ids below n in order of first appearance; return the new numbers, and the old id of each."""
    first = first_members(ids, n)
    used = np.flatnonzero(first >= 0)
    order = used[np.argsort(first[used])]
    number = np.empty(n, dtype=np.int64)
    number[order] = np.arange(len(order))
    return number[ids], order


@compiled
def _component_numbers(n: int, tails: Ints, heads: Ints) -> Ints:
    """Return for each of n nodes the number of its connected component (n,), from 0 on, in order of its least node.

    Edge k joins nodes `tails[k]` and `heads[k]`. This is union-find: trees have their least node as root.
    """
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
    """Return (n + 1,) where the members of each of n groups begin, and the members, indices into `groups`, in order."""
    starts, members = _grouped(read_only(np.ascontiguousarray(groups, dtype=np.int64)), n)
    return starts, members


def first_members(groups: NDArray[np.integer], n: int) -> Ints:
    """Return (n,) the first member of each of n groups, −1 where there is none."""
    first = np.full(n, -1)
    first[groups[::-1]] = np.arange(len(groups))[::-1]
    return first


def places_among(ordered: NDArray[np.integer], keys: NDArray[np.integer]) -> Ints:
    """Return (k,) the place of each key among ordered ones, −1 where it is none of them."""
    if not len(ordered):
        return np.full(len(keys), -1)
    places = np.minimum(np.searchsorted(ordered, keys), len(ordered) - 1)
    return np.where(ordered[places] == keys, places, -1)


def numbered(counts: Ints) -> tuple[Ints, Ints]:
    """Return the group of each member of groups of given sizes, and the number of each member within its group."""
    owners = np.repeat(np.arange(len(counts)), counts)
    return owners, np.arange(len(owners)) - (np.cumsum(counts) - counts)[owners]


def next_in_groups(starts: Ints) -> Ints:
    """Return (k,) the place of the member after each in its group, cyclically, given (n + 1,) where groups begin."""
    following, filled = np.arange(1, starts[-1] + 1), starts[1:] > starts[:-1]
    following[starts[1:][filled] - 1] = starts[:-1][filled]
    return following


def members_of(starts: Ints, members: Ints, chosen: NDArray[np.integer]) -> tuple[Ints, Ints]:
    """Return all members of the chosen groups, as pairs: index into `chosen`, and member."""
    owners, number = numbered(starts[chosen + 1] - starts[chosen])
    return owners, members[starts[chosen][owners] + number]


def sums_of(values: NDArray[np.floating], groups: NDArray[np.integer], n: int) -> Floats:
    """Return (n, ...) sums of the rows of (k, ...) values in each of n groups."""
    columns = values.reshape(len(values), int(np.prod(values.shape[1:]))).T
    sums = np.stack([np.bincount(groups, column, n) for column in columns], axis=1)
    return np.asarray(sums.reshape(n, *values.shape[1:]), np.float64)


@compiled
def _grouped(groups: Ints, n: int) -> tuple[Ints, Ints]:
    """Do the work of `grouped` by a counting sort."""
    starts = np.zeros(n + 1, dtype=np.int64)
    for group in groups:
        starts[group + 1] += 1
    for group in range(n):
        starts[group + 1] += starts[group]
    places, members = starts[:-1].copy(), np.empty(len(groups), dtype=np.int64)
    for member, group in enumerate(groups):
        members[places[group]] = member
        places[group] += 1
    return starts, members
