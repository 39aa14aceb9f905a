"""Specks of a band's sides: a few nodes on one side amid nodes on the other, though no face is near that tells so.

Where several functions meet that tell the side, a node between them may come out on the other side from all around it,
as where the fine solution reaches down between the teeth of a rim. On whole grids such regions are no solids, since no
faces bound them.
"""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

from ..operators.grid.blocks import SIDE, Blocks

MOST = 8
"""Nodes of a speck at most: those of a cube are the most that all have as many neighbours on the other side as this."""
AROUND = 3
"""Neighbours on the other side that each node of a speck has at least."""


def without_specks(blocks: Blocks, function: NDArray[np.float64], told: NDArray[np.bool_]) -> None:
    """Give nodes of specks, in place, the mean of the function at their neighbours on the other side.

    Parameters
    ----------
    blocks : Blocks
        Where the nodes are.
    function : (n, 512) float
        Negative inside.
    told : (n, 512) bool
        Nodes whose side faces tell: they are no part of a speck, however small what they are part of is.
    """
    if not len(blocks):
        return
    size = len(blocks), SIDE, SIDE, SIDE
    first = blocks.places.min(axis=0).astype(np.int64) * SIDE
    shape = tuple((blocks.places.max(axis=0).astype(np.int64) + 1) * SIDE - first)
    field = blocks.window(function.astype(np.float32).reshape(size), first, (shape[0], shape[1], shape[2]))
    nodes, around = _among_others(field)
    if not len(nodes):
        return
    at = blocks.rows((nodes + first) // SIDE), *((nodes + first) % SIDE).T
    kept, label = _specks(nodes, around, field, ~told.reshape(size)[at])
    if not len(kept):
        return
    sums, counts = np.zeros(label.max() + 1), np.zeros(label.max() + 1)
    own = field[tuple(nodes[kept].T)] < 0
    for other in around[kept].transpose(1, 0, 2):
        values = field[tuple(other.T)].astype(np.float64)
        beyond = (values < 0) != own
        sums += np.bincount(label, np.where(beyond, values, 0.0), len(sums))
        counts += np.bincount(label, beyond, len(counts))
    function.reshape(size)[tuple(index[kept] for index in at)] = (sums / counts)[label]


def _among_others(field: NDArray[np.float32]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(k, 3) nodes with at least `AROUND` neighbours on the other side, all of which are known; (k, 6, 3) these."""
    opposite = np.zeros(field.shape, dtype=np.int8)
    inside, known = field < 0, ~np.isnan(field)
    for axis in range(3):
        along = (np.moveaxis(values, axis, 0) for values in (inside, known, opposite))
        sign, there, count = along
        differ = (sign[1:] != sign[:-1]) & there[1:] & there[:-1]
        count[1:] += differ
        count[:-1] += differ
    nodes = np.argwhere(opposite >= AROUND)
    nodes = nodes[((nodes > 0) & (nodes < np.array(field.shape) - 1)).all(axis=1)]
    steps = np.concatenate([np.eye(3, dtype=np.int64), -np.eye(3, dtype=np.int64)])
    around = nodes[:, None] + steps
    whole = known[tuple(around.transpose(2, 0, 1))].all(axis=1)
    return nodes[whole], around[whole]


def _specks(
    nodes: NDArray[np.int64], around: NDArray[np.int64], field: NDArray[np.float32], free: NDArray[np.bool_]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(s,) those of the nodes that are in specks, and the number of the speck of each."""
    flat = np.ravel_multi_index(tuple(nodes.T), field.shape)  # ascending
    beside = np.ravel_multi_index(tuple(around.transpose(2, 0, 1)), field.shape)
    at = np.minimum(np.searchsorted(flat, beside), len(flat) - 1)
    same = (field.ravel()[beside] < 0) == (field.ravel()[flat] < 0)[:, None]
    found = flat[at] == beside
    start, side = np.nonzero(same & found)
    graph = scipy.sparse.coo_matrix((np.ones(len(start)), (start, at[start, side])), shape=(len(flat),) * 2)
    n, label = scipy.sparse.csgraph.connected_components(graph, directed=False)
    goes_on = ~free | (same & ~found).any(axis=1)
    speck = (np.bincount(label, goes_on, n) == 0) & (np.bincount(label, minlength=n) <= MOST)
    kept = np.flatnonzero(speck[label])
    return kept, np.unique(label[kept], return_inverse=True)[1]
