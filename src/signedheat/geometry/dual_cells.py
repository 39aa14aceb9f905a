"""The connectivity of dual contouring: which edges of a grid a level set crosses, and its pieces within each cell.

Each connected piece of the level set within a cell gets a vertex of its own, so that the surface is manifold wherever
it passes (Nielson 2004, Schaefer, Ju & Warren 2007). A piece is a cycle of crossed edges of the cell, each linked to
the next through a face. Where all four edges of a face are crossed, either way of linking them fits the signs: what is
inside at the middle of the face decides. If then both links of a face belong to one piece on either side of it, two
vertices would have two edges between them; the other way of linking divides the pieces, and is taken (Wenger 2013, Sec.
3.2, does so by exchanging table entries).

Axes b and c follow axis a cyclically. Edge ``4 a + 2 β + γ`` of a cell runs along a, from the cell's first node shifted
by β along b and γ along c. Face ``2 a + σ`` is the one across a, at the first node shifted by σ.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled

AROUND = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
"""β and γ of an edge in the four cells around it, counter-clockwise as seen from the end of the edge."""
AFTER = np.array([[0, 1, 2], [1, 2, 0], [2, 0, 1]])
"""Each axis, with those that follow it."""


@dataclass(frozen=True, eq=False)
class DualCells:
    """Cells that a level set passes through.

    Attributes
    ----------
    places : (c, 3) int
        First node of each.
    edges : (c, 12) int
        Number of each crossed edge; −1 where an edge is not crossed.
    pieces : (c, 12) int
        The piece of the level set to which each crossed edge belongs; −1 where an edge is not crossed.
    owners : (v,) int
        The cell of each piece.
    quads : (e, 4) int
        The pieces around each crossed edge, counter-clockwise as seen from its end.
    """

    places: NDArray[np.int64]
    edges: NDArray[np.int64]
    pieces: NDArray[np.int64]
    owners: NDArray[np.int64]
    quads: NDArray[np.int64]


def cells_around(
    nodes: NDArray[np.int64], axes: NDArray[np.int64], shape: tuple[int, ...]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """The cells around crossed edges, none of which is on a wall of the grid.

    Parameters
    ----------
    nodes, axes : (e, 3) int, (e,) int
        First node of each edge, and what it runs along.
    shape : tuple of int
        Nodes of the grid.

    Returns
    -------
    places : (c, 3) int
        First nodes of the cells.
    edges : (c, 12) int
        Crossed edges of each; −1 where an edge is not crossed.
    rows, sides : (e, 4) int
        The cells around each edge, as in `AROUND`, and which of their edges it is.
    """
    around = np.repeat(nodes[:, None], 4, axis=1)
    each = np.arange(len(nodes))[:, None]
    around[each, np.arange(4), AFTER[axes, 1][:, None]] -= AROUND[:, 0]
    around[each, np.arange(4), AFTER[axes, 2][:, None]] -= AROUND[:, 1]
    flat = np.ravel_multi_index(tuple(around.reshape(-1, 3).T), shape)
    cells, rows = np.unique(flat, return_inverse=True)
    rows = rows.reshape(-1, 4)
    sides = 4 * axes[:, None] + 2 * AROUND[:, 0] + AROUND[:, 1]
    edges = np.full((len(cells), 12), -1, dtype=np.int64)
    edges[rows, sides] = each
    return np.stack(np.unravel_index(cells, shape), axis=1).astype(np.int64), edges, rows, sides


def dual_cells(
    nodes: NDArray[np.int64],
    axes: NDArray[np.int64],
    rising: NDArray[np.bool_],
    shape: tuple[int, ...],
    inside: Callable[[NDArray[np.float64]], NDArray[np.bool_]],
) -> DualCells:
    """The pieces of a level set in the cells of a grid.

    Parameters
    ----------
    nodes, axes, rising : (e, 3) int, (e,) int, (e,) bool
        First node of each edge that is crossed, what it runs along, and whether that node is inside.
    shape : tuple of int
        Nodes of the grid.
    inside : callable
        Whether (n, 3) places, in cells, are inside: for the middles of faces.

    Examples
    --------
    A node that alone is inside has a cube around it.

    >>> nodes = np.array([[2, 2, 2]] * 3 + [[1, 2, 2], [2, 1, 2], [2, 2, 1]])
    >>> axes, rising = np.array([0, 1, 2, 0, 1, 2]), np.array([True] * 3 + [False] * 3)
    >>> cells = dual_cells(nodes, axes, rising, (5, 5, 5), lambda places: np.zeros(len(places), dtype=bool))
    >>> len(cells.owners), cells.quads.shape
    (8, (6, 4))
    """
    places, edges, rows, sides = cells_around(nodes, axes, shape)
    ways = np.zeros((len(places), 6), dtype=np.bool_)
    labels = _pieces(edges, ways)
    crossed = _crossed_faces(edges)
    cells, faces = np.nonzero(crossed == 4)
    if len(cells):
        across, side = faces // 2, faces % 2
        first = places[cells].copy()
        first[np.arange(len(cells)), across] += side
        keys = np.ravel_multi_index(tuple(first.T), shape) * 3 + across
        order = np.argsort(keys, kind="stable").reshape(-1, 2)  # the two cells at each face
        middles = first[order[:, 0]] + 0.5 * (np.arange(3) != across[order[:, 0], None])
        corner = rising[edges[cells, 4 * AFTER[across, 1] + side]]  # whether the first corner of the face is inside
        way = inside(middles) == corner[order[:, 0]]
        while True:
            ways[cells[order], faces[order]] = way[:, None]
            labels = _pieces(edges, ways)
            around = labels[cells[:, None], _face_edges(faces)]
            one = (around == around[:, :1]).all(axis=1)[order].all(axis=1)
            if not one.any():
                break
            way[one] ^= True
    starts = np.concatenate([[0], np.cumsum(labels.max(axis=1) + 1)])
    pieces = np.where(labels >= 0, labels + starts[:-1, None], -1)
    owners = np.repeat(np.arange(len(places)), np.diff(starts))
    return DualCells(places, edges, pieces, owners, pieces[rows, sides])


def open_cells(edges: NDArray[np.int64]) -> NDArray[np.int64]:
    """Cells with a face of which an odd number of edges is crossed: a node around them has no value."""
    found: NDArray[np.int64] = np.flatnonzero((_crossed_faces(edges) % 2 == 1).any(axis=1))
    return found


def _face_edges(faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """(n, 4) edges of faces of a cell, in order around them."""
    axis, side = faces // 2, faces % 2
    b, c = 4 * AFTER[axis, 1], 4 * AFTER[axis, 2] + 2 * side
    return np.stack([b + side, c + 1, b + 2 + side, c], axis=1)


def _crossed_faces(edges: NDArray[np.int64]) -> NDArray[np.int64]:
    """(c, 6) number of crossed edges of each face."""
    crossed: NDArray[np.int64] = (edges[:, _face_edges(np.arange(6))] >= 0).sum(axis=2)
    return crossed


@compiled
def _pieces(edges: NDArray[np.int64], ways: NDArray[np.bool_]) -> NDArray[np.int64]:
    """(c, 12) number of the piece in its cell to which each crossed edge belongs; −1 for others.

    Of a face with four crossed edges, numbered around it from the first corner, way 0 links the first with the last and
    the second with the third; way 1 the first two and the last two.
    """
    result = np.full(edges.shape, -1, dtype=np.int64)
    around, names = np.empty(4, dtype=np.int64), np.empty(12, dtype=np.int64)
    for i in range(len(edges)):
        labels = result[i]
        for k in range(12):
            if edges[i, k] >= 0:
                labels[k] = k
        for face in range(6):
            axis, side = face // 2, face % 2
            b, c = 4 * ((axis + 1) % 3), 4 * ((axis + 2) % 3) + 2 * side
            around[0], around[1], around[2], around[3] = b + side, c + 1, b + 2 + side, c
            first, crossed = -1, 0
            for k in range(4):
                if edges[i, around[k]] >= 0:
                    first = around[k] if first < 0 else first
                    crossed += 1
            for k in range(4):
                if edges[i, around[k]] < 0:
                    continue
                other = first if crossed < 4 else around[k ^ 1] if ways[i, face] else around[3 - k]
                low, high = min(labels[around[k]], labels[other]), max(labels[around[k]], labels[other])
                for m in range(12):
                    if labels[m] == high:
                        labels[m] = low
        count = 0
        for k in range(12):
            if labels[k] == k:
                names[k] = count
                count += 1
            if labels[k] >= 0:
                labels[k] = names[labels[k]]
    return result
