"""Upper triangles of sparse Hermitian matrices, and fill-reducing elimination orders for matrices on surfaces."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ..arrays import Ints
from ..compiled import compiled


def elimination_order(upper: Any) -> Ints:
    """Return (n,) an order of the unknowns of a sparse matrix by nested dissection; ``order[k]`` is eliminated k-th.

    It suits matrices on surfaces, whose separators are small. `upper` is the upper triangle.
    """
    graph = whole(upper)
    return _dissect(graph.indptr, graph.indices)


@compiled
def _dissect(starts: NDArray[np.int32], neighbors: NDArray[np.int32]) -> Ints:
    """Return (n,) an order of the nodes of a graph: both sides of a small separator, each in this way, then itself.

    The neighbours of node i are those from starts[i] to starts[i + 1] − 1. A separator is the smallest level near the
    middle of a breadth-first search from the end of a long path (George 1973).
    """
    n = len(starts) - 1
    order = np.arange(n)
    region = np.zeros(n, dtype=np.int64)  # the unfinished region that each unknown lies in
    level = np.empty(n, dtype=np.int64)  # and its distance, in links, from the seed of the search there
    queue = np.empty(n, dtype=np.int64)
    stack = [(0, n)]  # the parts of `order` that are regions still to be divided
    regions = 1
    while len(stack) > 0:
        begin, end = stack.pop()
        if end - begin <= 3:  # not worth dissecting
            continue
        current = region[order[begin]]
        seed = order[begin]
        depth, reached = -1, 0
        while True:  # search again from the farthest unknown, as long as it gets farther
            for p in range(begin, end):
                level[order[p]] = -1
            reached = _levels(starts, neighbors, region, current, seed, level, queue, 0)
            last = level[queue[reached - 1]]
            if last <= depth or reached < end - begin:
                break
            depth, seed = last, queue[reached - 1]
        if reached < end - begin:  # several connected components
            first = 0
            for p in range(begin, end + 1):
                if first < reached:  # a component is complete
                    for q in range(first, reached):
                        region[queue[q]] = regions
                    regions += 1
                    stack.append((begin + first, begin + reached))
                    first = reached
                if p < end and level[order[p]] < 0:
                    reached = _levels(starts, neighbors, region, current, order[p], level, queue, first)
            for p in range(begin, end):
                order[p] = queue[p - begin]
            continue
        last = level[queue[reached - 1]]
        if last < 2:
            continue
        # the separator, without the unknowns that have no neighbour beyond it
        cut = _thinnest(level, queue, reached, last)
        for p in range(reached):
            i = queue[p]
            if level[i] == cut:
                touches = False
                for q in range(starts[i], starts[i + 1]):
                    j = neighbors[q]
                    if region[j] == current and level[j] == cut + 1:
                        touches = True
                        break
                if not touches:
                    level[i] = cut - 1
        low, high = begin, end  # levels below the separator to the front, the separator to the back, the rest between
        for p in range(reached):
            if level[queue[p]] < cut:
                order[low] = queue[p]
                low += 1
        middle = low
        for p in range(reached):
            if level[queue[p]] > cut:
                order[middle] = queue[p]
                middle += 1
        for p in range(reached):
            if level[queue[p]] == cut:
                high -= 1
                order[high] = queue[p]
        for p in range(begin, low):
            region[order[p]] = regions
        for p in range(low, middle):
            region[order[p]] = regions + 1
        for p in range(middle, end):
            region[order[p]] = -1
        regions += 2
        stack.append((begin, low))
        stack.append((low, middle))
    return order


@compiled
def _levels(
    starts: NDArray[np.int32],
    neighbors: NDArray[np.int32],
    region: Ints,
    current: int,
    seed: int,
    level: Ints,
    queue: Ints,
    begin: int,
) -> int:
    """Search the nodes whose region is `current` breadth first from a seed, and return the end of the queue.

    The neighbours of node i are ``neighbors[starts[i] : starts[i + 1]]``. The nodes are written to the queue from
    `begin` on, and their distances from the seed to `level`, which is −1 for nodes that may still be reached.
    """
    level[seed] = 0
    queue[begin] = seed
    head, tail = begin, begin + 1
    while head < tail:
        i = queue[head]
        head += 1
        for q in range(starts[i], starts[i + 1]):
            j = neighbors[q]
            if region[j] == current and level[j] < 0:
                level[j] = level[i] + 1
                queue[tail] = j
                tail += 1
    return tail


@compiled
def _thinnest(level: Ints, queue: Ints, reached: int, last: int) -> int:
    """Return the level with the fewest nodes that has at least 40 % of the nodes on either side, or the median level.

    `queue` has the `reached` nodes sorted by level, from 0 to `last`.
    """
    best, size, median = -1, reached, level[queue[reached // 2]]
    p = 0
    while p < reached:
        current, first = level[queue[p]], p
        while p < reached and level[queue[p]] == current:
            p += 1
        balanced = first >= 0.4 * reached and reached - p >= 0.4 * reached
        if balanced and 0 < current < last and p - first < size:
            best, size = current, p - first
    if best < 0:
        best = min(max(median, 1), last - 1)
    return best


def upper_triangle(matrix: Any) -> sparse.csr_matrix:
    """Return the upper triangle of a Hermitian matrix, with all diagonal entries stored, as CSR with sorted indices.

    The argument may be the upper triangle itself.
    """
    if sparse.issparse(matrix) and matrix.format == "csr" and _is_upper(matrix):
        return matrix
    upper = sparse.triu(matrix, format="csr")
    upper.sum_duplicates()
    missing = upper.diagonal() == 0
    if missing.any():  # solvers need every diagonal entry to be stored, zeros included
        upper = sparse.csr_matrix(upper + sparse.diags_array(np.where(missing, 1.0, 0.0)))
        upper.sort_indices()
        upper.data[upper.indptr[:-1][missing]] = 0
    return upper


def whole(upper: sparse.csr_matrix) -> sparse.csr_matrix:
    """Return the whole Hermitian matrix, given its upper triangle."""
    return sparse.csr_matrix(upper + sparse.triu(upper, 1).conj().T)


def _is_upper(matrix: sparse.csr_matrix) -> bool:
    """Return whether every row starts with its diagonal entry and has strictly increasing columns."""
    starts = matrix.indptr[:-1]
    if (np.diff(matrix.indptr) == 0).any() or (matrix.indices[starts] != np.arange(matrix.shape[0])).any():
        return False
    increasing = np.diff(matrix.indices) > 0
    increasing[starts[1:] - 1] = True
    return bool(increasing.all())
