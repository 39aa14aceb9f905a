"""Visibility along straight lines in tet meshes, and steepest ascent from cells that are not visible."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled
from .tet_faces import FaceTable


def tet_neighbors(faces: FaceTable) -> NDArray[np.int64]:
    """(m, 4) the tet beyond the face opposite each corner, −1 at the boundary.

    Examples
    --------
    >>> from signedheat.geometry.tet_faces import face_table
    >>> tet_neighbors(face_table(np.array([[0, 1, 2, 3], [4, 1, 3, 2]]))).tolist()
    [[1, -1, -1, -1], [0, -1, -1, -1]]
    """
    flat = faces.tet_faces.ravel()
    order = np.argsort(flat, kind="stable")
    same = flat[order[1:]] == flat[order[:-1]]
    beyond = np.full(len(flat), -1, dtype=np.int64)
    beyond[order[1:][same]] = order[:-1][same] // 4
    beyond[order[:-1][same]] = order[1:][same] // 4
    return beyond.reshape(-1, 4)


def visible(
    starts: NDArray[np.float64],
    targets: NDArray[np.float64],
    neighbors: NDArray[np.int64],
    tet_faces: NDArray[np.int64],
    normals: NDArray[np.float64],
    offsets: NDArray[np.float64],
    signs: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """(m,) whether the straight line from a point in each tet to its target stays in the mesh.

    Parameters
    ----------
    starts, targets : (m, 3) float
        Start points, one in each tet, and end points of the lines.
    neighbors : (m, 4) int
        From `tet_neighbors`.
    tet_faces, normals, offsets, signs
        The planes of the faces: see `tet_clipping.Planes`.
    """
    return _visible(starts, targets, neighbors, tet_faces, normals, offsets, signs)


@compiled
def _visible(starts, targets, neighbors, tet_faces, normals, offsets, signs):
    seen = np.ones(len(starts), dtype=np.bool_)
    for t in range(len(starts)):
        x, y, z = starts[t]
        u, v, w = targets[t] - starts[t]
        tet, entered = t, -1
        for _ in range(len(starts)):
            leave, at = -1, np.inf
            for k in range(4):
                f = tet_faces[tet, k]
                if f == entered:
                    continue
                slope = signs[tet, k] * (normals[f, 0] * u + normals[f, 1] * v + normals[f, 2] * w)
                if slope > 0.0:
                    height = normals[f, 0] * x + normals[f, 1] * y + normals[f, 2] * z - offsets[f]
                    part = -signs[tet, k] * height / slope
                    if part < at:
                        leave, at = k, part
            if leave < 0 or at >= 1.0 - 1e-6:
                break
            entered = tet_faces[tet, leave]
            tet = neighbors[tet, leave]
            if tet < 0:
                seen[t] = False
                break
    return seen


def uphill_roots(
    heights: NDArray[np.float64], neighbors: NDArray[np.int64], settled: NDArray[np.bool_]
) -> NDArray[np.int64]:
    """(m,) the settled tet, or the local maximum, that steepest ascent from tet to tet leads to.

    Examples
    --------
    >>> chain = np.array([[1, -1, -1, -1], [0, 2, -1, -1], [1, -1, -1, -1]])
    >>> uphill_roots(np.array([3.0, 2.0, 1.0]), chain, np.array([True, False, False])).tolist()
    [0, 0, 0]
    """
    own = np.arange(len(heights))
    beside = np.where(neighbors >= 0, heights[neighbors], -np.inf)
    best = beside.argmax(axis=1)
    higher = ~settled & (beside[own, best] > heights)
    roots = np.where(higher, neighbors[own, best], own)
    while True:  # every round doubles the length of the paths followed
        further = roots[roots]
        if (further == roots).all():
            return roots
        roots = further
