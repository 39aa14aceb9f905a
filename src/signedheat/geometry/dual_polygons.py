"""Triangles of dual surfaces that do not pass through each other.

Around a crossed edge from a to b lie four vertices, one in each cell. All triangles between them that stay within the
four tetrahedra of the edge and two neighbouring vertices meet no triangle of another edge, since the tetrahedra of
different edges do not overlap (Ju & Udeshi 2006, Sec. 4). On a regular grid the line between vertices of neighbouring
cells always passes through the face between them, so that no vertices on faces are needed. Where neither diagonal stays
within the tetrahedra, the four vertices are joined to the place where the edge is crossed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .dual_cells import AFTER, DualCells

SLACK = 1e-6
"""Cells by which a diagonal stays away from the sides of the tetrahedra."""


def dual_triangles(
    cells: DualCells,
    nodes: NDArray[np.int64],
    axes: NDArray[np.int64],
    rising: NDArray[np.bool_],
    shares: NDArray[np.float64],
    vertices: NDArray[np.float64],
    fanned: NDArray[np.bool_],
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
    """Triangles between the vertices of pieces, counter-clockwise as seen from outside.

    Of two diagonals that may be taken it is the one that passes nearer to the place where the edge is crossed; where
    both do, the shorter one.

    Parameters
    ----------
    cells : DualCells
        Of e edges and v pieces.
    nodes, axes, rising, shares : (e, 3) int, (e,) int, (e,) bool, (e,) float
        First node of each edge, what it runs along, whether that node is inside, and how far from it the crossing is.
    vertices : (v, 3) float
        Positions in cells, each within its own.
    fanned : (e,) bool
        Edges whose crossing becomes a vertex anyway.

    Returns
    -------
    vertices : (v + k, 3) float
        With the crossings that became vertices.
    faces : (m, 3) int
        Vertices of triangles.
    centres : (k,) int
        The edges of those crossings.
    """
    quads = cells.quads
    around = vertices[quads] - nodes[:, None]
    rows, corners = np.arange(len(quads))[:, None], np.arange(4)
    height = around[rows, corners, axes[:, None]]
    flat = np.stack([around[rows, corners, AFTER[axes, 1 + k][:, None]] for k in range(2)], axis=2)
    safe, off, length = np.empty((2, len(quads)), dtype=bool), np.empty((2, len(quads))), np.empty((2, len(quads)))
    for k in range(2):
        turned = np.roll(flat, -k, axis=1), np.roll(height, -k, axis=1)
        safe[k], at = _safe(*turned)
        off[k] = np.abs(at - shares)
        length[k] = np.linalg.norm(around[:, k] - around[:, k + 2], axis=1)
    nearer = np.where(np.abs(off[0] - off[1]) > SLACK, off[1] < off[0], length[1] < length[0])
    second = safe[1] & (nearer | ~safe[0])
    fan = fanned | ~safe.any(axis=0)
    plain, fans = np.flatnonzero(~fan), np.flatnonzero(fan)
    turned_quads = np.where(second[plain, None], np.roll(quads[plain], -1, axis=1), quads[plain])
    added = nodes[fans].astype(np.float64)
    added[np.arange(len(fans)), axes[fans]] += shares[fans]
    tips = np.repeat(len(vertices) + np.arange(len(fans)), 4)
    ends = quads[fans].ravel(), np.roll(quads[fans], -1, axis=1).ravel()
    faces = np.concatenate([turned_quads[:, [0, 1, 2]], turned_quads[:, [0, 2, 3]], np.stack([tips, *ends], axis=1)])
    falling = ~rising[np.concatenate([plain, plain, np.repeat(fans, 4)])]
    faces[falling] = faces[falling][:, ::-1]
    return np.concatenate([vertices, added]), faces, fans


def _safe(flat: NDArray[np.float64], height: NDArray[np.float64]) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """(n,) whether the diagonal from the first to the third of (n, 4, 2) corners stays within the tetrahedra.

    Seen along the edge, which is from 0 to 1 above the origin, the diagonal passes on one side of it. The triangle on
    the other side crosses the edge, at the height that is returned; and the diagonal passes between the edge and the
    corner that is left.
    """
    p, r = flat[:, 0], flat[:, 2]
    side = _cross(p, r) > 0  # the origin is to the left of the diagonal, with the fourth corner
    rows = np.arange(len(flat))
    with_origin, other = np.where(side, 3, 1), np.where(side, 1, 3)
    s, q = flat[rows, with_origin], flat[rows, other]
    # barycentric coordinates of the origin in the triangle p, r, s
    weights = np.stack([_cross(r, s), _cross(s, p), _cross(p, r)], axis=1)
    total = weights.sum(axis=1)
    total = np.where(np.abs(total) > 1e-300, total, 1e-300)
    heights = np.stack([height[:, 0], height[:, 2], height[rows, with_origin]], axis=1)
    at = (weights * heights).sum(axis=1) / total
    # where the diagonal, from p to r, passes the line from the origin to q
    along = _cross(p - r, q)
    share = _cross(p, q) / np.where(np.abs(along) > 1e-300, along, 1e-300)
    passing = p + share[:, None] * (r - p)
    reach = (passing * q).sum(axis=1) / np.maximum((q * q).sum(axis=1), 1e-300)
    level = height[:, 0] + share * (height[:, 2] - height[:, 0])
    last = height[rows, other]
    safe = (at > SLACK) & (at < 1 - SLACK) & (reach < 1 - SLACK)
    safe &= (level > reach * last + SLACK) & (level < (1 - reach) + reach * last - SLACK)
    return safe, at


def _cross(u: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float64]:
    product: NDArray[np.float64] = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    return product
