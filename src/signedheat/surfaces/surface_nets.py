"""Smooth surfaces that separate the voxels of a set from all others: constrained elastic surface nets.

A net has a vertex in each cell between the centres of eight voxels, not all of which are in the set, and a
quadrilateral around each line between neighbouring centres of which one is. It is relaxed while vertices stay in their
cells (Gibson 1998, *Constrained elastic surface nets*), so that the set is found again from the surface. Here what is
made small is how the net bends, ``Σ |x − mean of neighbours|²``: Gibson's length would shrink it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ..mesh.components import sums_of
from ..mesh.dual_cells import Crossings, DualCells, dual_cells, separate_triangles

STAY = 0.003
"""Weight of staying in the middle of a cell: stairs some four voxels long become slopes. Mean error of normals of a
ball, an ellipsoid and a torus of 96 voxels: 1.0° to 1.4°; at .01 1.8° to 2.1°, at .001 .8° to 1.3°; of a box along the
axes, whose sides bend outwards, 5.5°, 4.4°, 6.5°."""
REACH = 0.49
"""Voxels that a vertex may go along each axis, lest two of them come together, in 32 bits either."""
STEP = 0.24
"""Step of a gradient descent that no bending mode leaves larger: below 2 / (2² + STAY)."""
MOST = 200
"""Steps at most; the modes that `STAY` lets in need about 1 / √STAY times four."""
MOVED = 1e-4
"""Voxels by which the last step moves vertices at most."""


def surface_net(volume: NDArray[np.bool_]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices and triangles, outward, of a smooth surface between the voxels of a set and all others.

    It is closed and manifold, and passes between the centres of any two neighbours of which one is in the set. Voxels
    that touch along an edge are connected. Everything beyond the array is outside. Vertices are in voxels; the centre
    of the first one is at 0.

    Examples
    --------
    >>> ball = np.linalg.norm(np.indices((21, 21, 21)) - 10.0, axis=0) < 8.5
    >>> vertices, faces = surface_net(ball)
    >>> bool(np.abs(np.linalg.norm(vertices - 10, axis=1) - 8.5).max() < 0.35)
    True
    """
    padded = np.pad(volume, 2)
    nodes, axes = [], []
    for axis in range(3):
        found = np.argwhere(np.diff(padded, axis=axis))
        nodes.append(found)
        axes.append(np.full(len(found), axis))
    first, along = np.concatenate(nodes), np.concatenate(axes)
    crossings = Crossings(first, along, padded[tuple(first.T)], np.full(len(first), 0.5))
    cells = dual_cells(crossings, padded.shape, lambda places: np.ones(len(places), dtype=bool))
    middles, room = _rooms(cells, crossings)
    relaxed = _relaxed(cells.quads, middles, room)
    rows = np.arange(len(first))
    shares = relaxed[cells.quads, along[:, None]].mean(axis=1) - first[rows, along]
    choices = np.stack([relaxed, 0.5 * (relaxed + middles), middles])
    crossings = replace(crossings, shares=np.clip(shares, 0.5 - REACH, 0.5 + REACH))
    vertices, faces = separate_triangles(cells, crossings, choices)
    return vertices - 2, faces


def _rooms(cells: DualCells, crossings: Crossings) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(v, 3) middle of each piece of the surface in a cell, (v, 1) how far from it the vertex may go along each axis.

    Where several pieces share a cell they stay where they are.
    """
    count = len(cells.owners)
    crossed = crossings.nodes + 0.5 * np.eye(3)[crossings.axes]
    degrees = np.bincount(cells.quads.ravel(), minlength=count)
    sums = sums_of(np.repeat(crossed, 4, axis=0), cells.quads.ravel(), count)
    alone = (np.bincount(cells.owners)[cells.owners] == 1)[:, None]
    middles = np.where(alone, cells.places[cells.owners] + 0.5, sums / degrees[:, None])
    return middles, np.where(alone, REACH, 0.0)


def _relaxed(quads: NDArray[np.int64], middles: NDArray[np.float64], room: NDArray[np.float64]) -> NDArray[np.float64]:
    """(v, 3) places within rooms where a net bends least, by projected accelerated gradients (Beck & Teboulle 2009).

    Where a step goes back, acceleration starts again (O'Donoghue & Candès 2015).
    """
    count = len(middles)
    tails, heads = quads.ravel(), np.roll(quads, -1, axis=1).ravel()
    links = sparse.coo_array((np.ones(len(tails)), (tails, heads)), shape=(count, count)).tocsr()
    links = links + links.T
    links.data[:] = 1
    weights = 1 / links.sum(axis=1)
    bending = sparse.csr_array(sparse.eye_array(count) - sparse.diags_array(weights) @ links)
    back = bending.T.tocsr()
    places, ahead, pace = middles, middles, 1.0
    for _ in range(MOST):
        slope = back @ (bending @ ahead) + STAY * (ahead - middles)
        new = np.clip(ahead - STEP * slope, middles - room, middles + room)
        returning = ((ahead - new) * (new - places)).sum() > 0
        faster = 1.0 if returning else 0.5 * (1 + np.sqrt(1 + 4 * pace**2))
        ahead = new + (0.0 if returning else (pace - 1) / faster) * (new - places)
        moved = float(np.abs(new - places).max())
        places, pace = new, faster
        if moved < MOVED:
            break
    return places
