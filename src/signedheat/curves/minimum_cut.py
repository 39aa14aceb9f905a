"""The cheapest way to cut a graph in two."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..arrays import Bools, Floats, Ints
from ..compiled import compiled
from ..mesh.components import grouped

UNITS = 2.0**40
"""What all pulls to one side count together, as integers, so that a flow that ends ends exactly."""


@dataclass(frozen=True, eq=False)
class CutGraph:
    """A graph that is cut again and again, with other costs.

    Attributes
    ----------
    starts : (n + 1,) int
        Where the arcs of each node begin.
    heads : (2 e,) int
        Where each arc leads.
    reverse : (2 e,) int
        The arc back.
    order : (2 e,) int
        Edge of each arc, plus e if it runs backwards.
    """

    starts: Ints
    heads: Ints
    reverse: Ints
    order: Ints

    @classmethod
    def of(cls, edges: Ints, n: int) -> CutGraph:
        """Make the graph of n nodes and (e, 2) edges, each of which is two arcs: number k and, backwards, k + e."""
        tails, heads = np.concatenate([edges, edges[:, ::-1]]).T
        starts, order = grouped(tails, n)
        place = np.empty(len(order), dtype=np.int64)
        place[order] = np.arange(len(order))
        return cls(starts, np.ascontiguousarray(heads[order]), place[(order + len(edges)) % len(order)], order)

    def cut(self, falling: Floats, rising: Floats, pull: Floats) -> Floats:
        """(n,) signs s = ±1 of nodes with the least cost of edges that are cut, less Σ pull s.

        Of several such signs, those with the fewest positive. An edge whose first node is positive and whose second is
        negative costs `falling`, (e,), the reverse `rising`.

        Examples
        --------
        >>> chain = CutGraph.of(np.array([[0, 1], [1, 2], [2, 3]]), 4)
        >>> chain.cut(np.array([1.0, 0.2, 1.0]), np.ones(3), np.array([3.0, 0, 0, -3.0]))
        array([ 1.,  1., -1., -1.])
        """
        total = 2 * max(float(pull[pull > 0].sum()), -float(pull[pull < 0].sum()))
        if total == 0:
            return np.ones(len(pull))
        costs = np.minimum(np.concatenate([falling, rising])[self.order] / total, 1.0)
        residual, pulls = (np.rint(UNITS * each).astype(np.int64) for each in (costs, 2 * pull / total))
        return np.where(source_side(self.starts, self.heads, self.reverse, residual, pulls), 1.0, -1.0)


Ids = Ints

FREE, TERMINAL, ORPHAN = -1, -2, -3
"""What a node has for an arc to its parent that lies in no tree, next to a terminal, or cut off from its parent."""


@compiled
def source_side(starts: Ids, heads: Ids, reverse: Ids, residual: Ids, pull: Ids) -> Bools:
    """(n,) bool: nodes that the source still reaches when the flow is greatest; `residual` and `pull` are overwritten.

    Arcs of node i are those from starts[i] to starts[i + 1]; `reverse` is the arc back. A pull is the capacity from the
    source to a node, or, if negative, from it to the sink.
    """
    n = len(pull)
    tree = np.sign(pull).astype(np.int8)  # 1 in the source's tree, −1 in the sink's
    parent = np.where(tree == 0, FREE, TERMINAL)
    far, stamp, now = np.where(tree == 0, 0, 1), np.zeros(n, dtype=np.int64), 1
    queue, orphans, waiting = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64), tree != 0
    first = count = 0  # of the queue, which is a ring
    for i in range(n):
        if waiting[i]:
            queue[count] = i
            count += 1
    while count > 0:
        i = queue[first]
        first = (first + 1) % n
        count -= 1
        waiting[i] = False
        arc = starts[i]
        while arc < starts[i + 1] and parent[i] != FREE:
            j = heads[arc]
            forth = arc if tree[i] > 0 else reverse[arc]
            if residual[forth] == 0:
                arc += 1
            elif parent[j] == FREE:
                tree[j], parent[j], stamp[j], far[j] = tree[i], reverse[arc], stamp[i], far[i] + 1
                if not waiting[j]:  # it may wait from when it was in a tree before
                    queue[(first + count) % n] = j
                    count += 1
                    waiting[j] = True
                arc += 1
            elif tree[j] == tree[i]:
                if stamp[j] <= stamp[i] and far[j] > far[i]:
                    parent[j], stamp[j], far[j] = reverse[arc], stamp[i], far[i] + 1
                arc += 1
            else:
                now += 1
                cut_off = _augment(heads, reverse, residual, pull, parent, forth, orphans)
                k = 0
                while k < cut_off:
                    p = orphans[k]
                    k += 1
                    if _adopted(starts, heads, reverse, residual, tree, parent, far, stamp, now, p):
                        continue
                    for a in range(starts[p], starts[p + 1]):
                        q = heads[a]
                        if tree[q] != tree[p] or parent[q] == FREE:
                            continue
                        if residual[reverse[a] if tree[p] > 0 else a] > 0 and not waiting[q]:
                            queue[(first + count) % n] = q
                            count += 1
                            waiting[q] = True
                        if parent[q] >= 0 and heads[parent[q]] == p:
                            parent[q] = ORPHAN
                            orphans[cut_off] = q
                            cut_off += 1
                    parent[p], tree[p], stamp[p] = FREE, 0, 0
    return tree > 0


@compiled
def _augment(heads: Ids, reverse: Ids, residual: Ids, pull: Ids, parent: Ids, meeting: int, orphans: Ids) -> int:
    """Push what the path through an arc between the trees bears; how many nodes it cuts off."""
    least = residual[meeting]
    for end in range(2):
        i = heads[reverse[meeting]] if end == 0 else heads[meeting]
        while parent[i] != TERMINAL:
            up = parent[i]
            least = min(least, residual[reverse[up] if end == 0 else up])
            i = heads[up]
        least = min(least, abs(pull[i]))
    residual[meeting] -= least
    residual[reverse[meeting]] += least
    count = 0
    for end in range(2):
        i = heads[reverse[meeting]] if end == 0 else heads[meeting]
        while parent[i] != TERMINAL:
            up = parent[i]
            forth = reverse[up] if end == 0 else up
            residual[forth] -= least
            residual[reverse[forth]] += least
            if residual[forth] == 0:
                parent[i] = ORPHAN
                orphans[count] = i
                count += 1
            i = heads[up]
        pull[i] -= least if end == 0 else -least
        if pull[i] == 0:
            parent[i] = ORPHAN
            orphans[count] = i
            count += 1
    return count


@compiled
def _adopted(
    starts: Ids,
    heads: Ids,
    reverse: Ids,
    residual: Ids,
    tree: NDArray[np.int8],
    parent: Ids,
    far: Ids,
    stamp: Ids,
    now: int,
    p: int,
) -> bool:
    """Whether a node cut off has a neighbour with a way to the terminal; the nearest becomes its parent."""
    best, nearest = ORPHAN, np.int64(1) << 60
    for a in range(starts[p], starts[p + 1]):
        if tree[heads[a]] != tree[p] or residual[reverse[a] if tree[p] > 0 else a] == 0:
            continue
        steps, j = 0, heads[a]
        while parent[j] >= 0 and stamp[j] != now:
            steps += 1
            j = heads[parent[j]]
        if parent[j] == ORPHAN or parent[j] == FREE:
            continue
        if stamp[j] != now:
            stamp[j], far[j] = now, 1
        steps += far[j]
        if steps < nearest:
            best, nearest = a, steps
        j = heads[a]
        while stamp[j] != now:
            stamp[j], far[j] = now, steps
            steps -= 1
            j = heads[parent[j]]
    parent[p] = best
    if best < 0:
        return False
    stamp[p], far[p] = now, nearest + 1
    return True
