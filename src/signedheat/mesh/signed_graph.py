"""Signed graphs: signs ±1 of nodes from links between them, by merging and then turning groups of nodes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import eigh

from ..arrays import Floats, Ints
from ..compiled import compiled

_ROUNDS = 50


@dataclass(frozen=True, eq=False)
class Links:
    """Evidence about pairs of nodes: that their signs are equal, where a weight is positive, or opposite.

    Attributes
    ----------
    tails, heads : (m,) int
        Nodes.
    weights : (m,) float
        How sure that is; weights of the same pair add up.
    """

    tails: Ints
    heads: Ints
    weights: Floats

    @classmethod
    def joined(cls, *parts: Links) -> Links:
        """All links of several kinds of evidence."""
        columns = zip(*((part.tails, part.heads, part.weights) for part in parts), strict=True)
        return cls(*(np.concatenate(column) for column in columns))

    def renamed(self, nodes: Ints) -> Links:
        """The same links between other nodes: those of which the ones here are part."""
        return Links(nodes[self.tails], nodes[self.heads], self.weights)

    def scaled(self, factor: float) -> Links:
        """Links with weights that many times as large."""
        return Links(self.tails, self.heads, factor * self.weights)

    def strength(self, n_nodes: int) -> Floats:
        """(n,) sum of the sizes of the weights at each node."""
        sizes = np.abs(self.weights)
        ends = np.bincount(self.tails, sizes, n_nodes), np.bincount(self.heads, sizes, n_nodes)
        return (ends[0] + ends[1]).astype(np.float64)

    def coherence(self, found: Floats) -> float:
        """Share of the weights that signs agree with, less the share that they contradict: 1 if they agree with all."""
        total = float((self.weights * found[self.tails] * found[self.heads]).sum())
        return total / max(float(np.abs(self.weights).sum()), np.finfo(float).tiny)


def signs_of(links: Links, n_nodes: int) -> Floats:
    """(n,) signs s that make Σ w s_tail s_head large: no sign gains by turning alone, and hardly any group of them.

    Groups with the strongest links merge first, and their links to third ones add up (greedy additive contraction,
    Keuper et al. 2015, for signs instead of cuts), until no link is left. Then groups are taken
    apart in reverse, and each part turns if that agrees better with the rest.

    Examples
    --------
    >>> signs_of(Links(np.array([0, 1, 0]), np.array([1, 2, 2]), np.array([-3.0, 2.0, 1.0])), 3)
    array([ 1., -1., -1.])
    """
    levels = _contractions(_weights(links, n_nodes))
    result = np.ones(int(levels[-1][1].max()) + 1 if levels else n_nodes)
    for weights, groups, within in reversed(levels):
        result = result[groups] * within
        turn_where_better(weights.indptr, weights.indices, weights.data, result, _ROUNDS)
    return result


def nested_groups(links: Links, n_nodes: int) -> list[Ints]:
    """The groups that `signs_of` merges, each (n,) group of every node: the few large ones first.

    Examples
    --------
    >>> levels = nested_groups(Links(np.array([0, 2, 1]), np.array([1, 3, 2]), np.array([5.0, -4.0, 0.1])), 4)
    >>> [level.tolist() for level in levels]
    [[0, 0, 0, 0], [0, 0, 1, 1]]
    """
    levels, found = [], np.arange(n_nodes)
    for _, groups, _ in _contractions(_weights(links, n_nodes)):
        found = groups[found]
        levels.append(found)
    return levels[::-1]


def best_signs(weights: Floats, first: Floats) -> Floats:
    """(n,) signs s that make ``sᵀ W s`` large, of a dense symmetric matrix: more thorough than `signs_of`.

    From several starts, the groups in which signs synchronise, on all levels, are turned as long as that gains; the
    best is taken. It starts from `first`, from what `signs_of` finds, and from the first two eigenvectors. The diagonal
    of W does not matter.

    Examples
    --------
    >>> best_signs(np.array([[0.0, -3, 1], [-3, 0, 2], [1, 2, 0]]), np.ones(3)).tolist()
    [-1.0, 1.0, 1.0]
    """
    n = len(weights)
    weights = np.where(np.eye(n, dtype=bool), 0.0, weights)
    tails, heads = np.triu_indices(n, 1)
    links = Links(tails, heads, weights[tails, heads])
    vectors = eigh(weights, subset_by_index=[max(n - 2, 0), n - 1])[1].T
    starts = [first, signs_of(links, n), *np.where(vectors < 0, -1.0, 1.0)]
    levels = [np.arange(n), *reversed(nested_groups(links, n))]
    groups = [np.flatnonzero(level == group) for level in levels for group in range(int(level.max()) + 1)]
    found = [_turned_in_groups(weights, groups, start.copy()) for start in starts]
    return max(found, key=lambda one: float(one @ weights @ one))


def _turned_in_groups(weights: Floats, groups: list[Ints], found: Floats) -> Floats:
    """Signs, with groups turned one after the other as long as that makes them agree more with the others."""
    agreement, least = weights @ found, 1e-12 * float(np.abs(weights).sum())
    for _ in range(_ROUNDS):
        turned = False
        for group in groups:
            own = found[group]
            outside = float(own @ agreement[group] - own @ weights[np.ix_(group, group)] @ own)
            if outside < -least:
                found[group] = -own
                agreement -= 2 * weights[:, group] @ own
                turned = True
        if not turned:
            break
    return found


def _contractions(weights: sparse.csr_matrix) -> list[tuple[sparse.csr_matrix, Ints, Floats]]:
    """Each matrix of weights, the group of each of its nodes and the sign in it, until no link is left."""
    levels = []
    while weights.nnz:
        groups, within = _contraction(weights)
        levels.append((weights, groups, within))
        once = sparse.triu(weights, format="coo")
        tails, heads = once.coords
        between = Links(groups[tails], groups[heads], once.data * within[tails] * within[heads])
        weights = _weights(between, int(groups.max()) + 1)
    return levels


def _weights(links: Links, n_nodes: int) -> sparse.csr_matrix:
    """(n, n) symmetric sums of the weights between different nodes, those that cancel left out."""
    apart = links.tails != links.heads
    tails, heads, weights = links.tails[apart], links.heads[apart], np.tile(links.weights[apart], 2)
    ends = np.concatenate([tails, heads]), np.concatenate([heads, tails])
    total, sizes = (sparse.csr_matrix((each, ends), (n_nodes, n_nodes)) for each in (weights, np.abs(weights)))
    total.data[np.abs(total.data) <= 1e-12 * sizes.data] = 0.0
    total.eliminate_zeros()
    return total


def _contraction(weights: sparse.csr_matrix) -> tuple[Ints, Floats]:
    """Group of each node, and its sign in it: pairs that are each other's strongest, and whose strongest is in one."""
    n, neighbors = weights.shape[0], weights.indices
    degrees = np.diff(weights.indptr)
    rows = np.repeat(np.arange(n), degrees)
    low, high = np.minimum(rows, neighbors), np.maximum(rows, neighbors)
    order = np.lexsort((high, low, -np.abs(weights.data), rows))  # ties go the same way from both ends
    linked = np.flatnonzero(degrees)
    strongest = order[weights.indptr[linked]]
    nodes = np.arange(n)
    best, weight = nodes.copy(), np.ones(n)
    best[linked], weight[linked] = neighbors[strongest], weights.data[strongest]
    mutual = best[best] == nodes
    leader, sign = nodes.copy(), np.ones(n)
    later = mutual & (best < nodes)
    leader[later], sign[later] = best[later], np.sign(weight[later])
    joins = ~mutual & mutual[best]
    leader[joins], sign[joins] = leader[best[joins]], np.sign(weight[joins]) * sign[best[joins]]
    return np.unique(leader, return_inverse=True)[1].ravel(), sign


@compiled
def turn_where_better(
    starts: NDArray[np.int32], neighbors: NDArray[np.int32], weights: Floats, signs: Floats, rounds: int
) -> None:
    """Turn signs that disagree with their neighbours, one after the other, until none does."""
    for _ in range(rounds):
        turned = False
        for node in range(len(signs)):
            agreement = 0.0
            for k in range(starts[node], starts[node + 1]):
                agreement += weights[k] * signs[neighbors[k]]
            if agreement * signs[node] < 0.0:
                signs[node] = -signs[node]
                turned = True
        if not turned:
            break
