"""Signed graphs: signs ±1 of nodes that agree with weighted links, by merging and then flipping groups of nodes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import eigh

from ..arrays import Floats, Ints
from ..compiled import compiled

FLIP_ROUNDS = 50
"""Largest number of rounds in which signs are flipped, after which it ends in any case; usually a few suffice."""


@dataclass(frozen=True, eq=False)
class Links:
    """m links, evidence that the signs of two nodes are equal, if the weight is positive, or opposite."""

    # (m,) the two nodes of each link
    tails: Ints
    heads: Ints
    weights: Floats  # (m,) weight of the evidence; weights of the same pair add up

    @classmethod
    def joined(cls, *parts: Links) -> Links:
        """Join all links of several kinds of evidence."""
        columns = zip(*((part.tails, part.heads, part.weights) for part in parts), strict=True)
        return cls(*(np.concatenate(column) for column in columns))

    def strength(self, n_nodes: int) -> Floats:
        """Return (n,) the sum of absolute weights at each node."""
        sizes = np.abs(self.weights)
        ends = np.bincount(self.tails, sizes, n_nodes), np.bincount(self.heads, sizes, n_nodes)
        return (ends[0] + ends[1]).astype(np.float64)

    def coherence(self, signs: Floats) -> float:
        """Return the share of weights with which (n,) signs agree, minus the share that they contradict."""
        total = float((self.weights * signs[self.tails] * signs[self.heads]).sum())
        return total / max(float(np.abs(self.weights).sum()), np.finfo(float).tiny)


def signs_of(links: Links, n_nodes: int) -> Floats:
    """Return (n,) signs s that make Σ w s_tail s_head large, so that flipping no single sign increases it.

    Groups with the strongest links are merged first (Keuper et al. 2015). Merges are then undone in reverse order, and
    after each of these levels groups are flipped if that increases the sum.
    """
    levels = _contractions(_weights(links, n_nodes))
    result = np.ones(int(levels[-1][1].max()) + 1 if levels else n_nodes)
    for weights, groups, within in reversed(levels):
        result = result[groups] * within
        flip_where_better(weights.indptr, weights.indices, weights.data, result)
    return result


def best_signs(weights: Floats, first: Floats) -> Floats:
    """Return (n,) signs s that make ``sᵀ W s`` large, for dense symmetric weights W.

    Groups are flipped as long as that increases it, from several starts, of which the signs `first`, (n,), are one.
    """
    n = len(weights)
    weights = np.where(np.eye(n, dtype=bool), 0.0, weights)
    tails, heads = np.triu_indices(n, 1)
    links = Links(tails, heads, weights[tails, heads])
    vectors = eigh(weights, subset_by_index=[max(n - 2, 0), n - 1])[1].T
    starts = [first, signs_of(links, n), *np.where(vectors < 0, -1.0, 1.0)]
    # the groups of all levels of merging, single nodes first
    levels = [np.arange(n)]
    for _, merged, _ in _contractions(_weights(links, n)):
        levels.append(merged[levels[-1]])
    groups = [np.flatnonzero(level == group) for level in levels for group in range(int(level.max()) + 1)]
    candidates = [_flipped_in_groups(weights, groups, start.copy()) for start in starts]
    return max(candidates, key=lambda signs: float(signs @ weights @ signs))


def _flipped_in_groups(weights: Floats, groups: list[Ints], signs: Floats) -> Floats:
    """Negate groups of (n,) signs, one after the other, that then agree more with all others; return the signs.

    `weights`, (n, n), are positive between nodes whose signs should be equal, and negative where opposite.
    """
    agreement, least = weights @ signs, 1e-12 * float(np.abs(weights).sum())
    for _ in range(FLIP_ROUNDS):
        any_flipped = False
        for group in groups:
            group_signs = signs[group]
            within = group_signs @ weights[np.ix_(group, group)] @ group_signs
            if float(group_signs @ agreement[group] - within) < -least:
                signs[group] = -group_signs
                agreement -= 2 * weights[:, group] @ group_signs
                any_flipped = True
        if not any_flipped:
            break
    return signs


def _contractions(weights: sparse.csr_matrix) -> list[tuple[sparse.csr_matrix, Ints, Floats]]:
    """Merge nodes, level by level, until no link is left.

    Returns for each level the weights between its nodes, (n, n), and the group of each node and its sign in it, (n,).
    """
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
    """Return the sparse symmetric (n, n) matrix of summed weights between different nodes, without sums that cancel."""
    apart = links.tails != links.heads
    tails, heads, weights = links.tails[apart], links.heads[apart], np.tile(links.weights[apart], 2)
    ends = np.concatenate([tails, heads]), np.concatenate([heads, tails])
    total, sizes = (sparse.csr_matrix((entries, ends), (n_nodes, n_nodes)) for entries in (weights, np.abs(weights)))
    total.data[np.abs(total.data) <= 1e-12 * sizes.data] = 0.0
    total.eliminate_zeros()
    return total


def _contraction(weights: sparse.csr_matrix) -> tuple[Ints, Floats]:
    """Group the nodes of a level: return (n,) the group of each node, and (n,) its sign in it.

    A group is a pair of nodes each of which has its strongest link to the other, with all further nodes whose strongest
    link is to one of the two.
    """
    # the strongest link of each node; a node without links is linked with itself
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
    # groups are named by the lower node of their pair, their leader, whose sign is 1
    mutual = best[best] == nodes
    leader, sign = nodes.copy(), np.ones(n)
    later = mutual & (best < nodes)
    leader[later], sign[later] = best[later], np.sign(weight[later])
    joins = ~mutual & mutual[best]
    leader[joins], sign[joins] = leader[best[joins]], np.sign(weight[joins]) * sign[best[joins]]
    return np.unique(leader, return_inverse=True)[1].ravel(), sign


@compiled
def flip_where_better(starts: NDArray[np.int32], neighbors: NDArray[np.int32], weights: Floats, signs: Floats) -> None:
    """Flip (n,) signs in place that disagree with their neighbours, one after the other, until none does.

    Neighbours of node i, with weights, are those from starts[i] to starts[i + 1] − 1.
    """
    for _ in range(FLIP_ROUNDS):
        any_flipped = False
        for node in range(len(signs)):
            agreement = 0.0
            for k in range(starts[node], starts[node + 1]):
                agreement += weights[k] * signs[neighbors[k]]
            if agreement * signs[node] < 0.0:
                signs[node] = -signs[node]
                any_flipped = True
        if not any_flipped:
            break
