"""Triangles of a mesh that pass through each other."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled
from ..parallel import CHUNK, n_threads
from .box_tree import BoxTree
from .cut_faces import overlap

TOUCHING = 1e-10
"""Depth, over the size of the mesh, up to which triangles only touch."""
FOLDED = 1e-10
"""One less the cosine between the normal of a face and the other side of its neighbour, up to which one covers the
other."""


def self_intersections(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """(k, 2) pairs of faces that pass through each other, or cover each other in one plane.

    Those that have no vertex in common must not touch, either.

    Examples
    --------
    >>> points = np.array([[0.0, 0, 0], [2, 0, 0], [0, 2, 0], [0.5, 0.5, -1], [0.6, 0.5, 1], [0.5, 0.6, 1]])
    >>> self_intersections(points, np.array([[0, 1, 2], [3, 4, 5]])).tolist()
    [[0, 1]]
    """
    if not len(faces):
        return np.zeros((0, 2), dtype=np.int64)
    centred = np.ascontiguousarray(vertices - vertices.mean(axis=0), dtype=np.float64)
    ids = np.ascontiguousarray(faces, dtype=np.int64)
    corners = centred[ids]
    tree = BoxTree.of(corners.min(axis=1), corners.max(axis=1))
    slack = TOUCHING * float(np.ptp(centred, axis=0).max())
    flat = corners.reshape(-1, 9)

    def part(start: int) -> NDArray[np.int64]:
        found: NDArray[np.int64] = _pairs(flat, ids, start, *tree.meeting(corners[start : start + CHUNK], slack), slack)
        return found

    with ThreadPoolExecutor(n_threads()) as pool:
        pairs = np.concatenate(list(pool.map(part, range(0, len(ids), CHUNK))))
    return pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]


@compiled
def _folded(p: NDArray[np.float64], q: NDArray[np.float64]) -> bool:
    """Whether two triangles that share an edge, (9,) each, lie on each other."""
    ux, uy, uz, vx, vy, vz = p[3] - p[0], p[4] - p[1], p[5] - p[2], p[6] - p[0], p[7] - p[1], p[8] - p[2]
    sx, sy, sz, tx, ty, tz = q[3] - q[0], q[4] - q[1], q[5] - q[2], q[6] - q[0], q[7] - q[1], q[8] - q[2]
    ax, ay, az = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    bx, by, bz = sy * tz - sz * ty, sz * tx - sx * tz, sx * ty - sy * tx
    square = (ax * ax + ay * ay + az * az) * (bx * bx + by * by + bz * bz)
    return bool(ax * bx + ay * by + az * bz < -(1.0 - FOLDED) * np.sqrt(square))


@compiled
def _pairs(
    corners: NDArray[np.float64],
    faces: NDArray[np.int64],
    first: int,
    starts: NDArray[np.int64],
    near: NDArray[np.int64],
    slack: float,
) -> NDArray[np.int64]:
    """(k, 2) pairs of one of the faces from the first on and a later one, of those near each."""
    axis, chosen = np.empty(3), np.zeros(len(near), dtype=np.bool_)
    result = np.empty((len(near), 2), dtype=np.int64)
    for b in range(len(starts) - 1):
        f = first + b
        for k in range(starts[b], starts[b + 1]):
            g = near[k]
            result[k, 0], result[k, 1] = f, g
            if g <= f:
                continue
            shared = 0
            for i in range(3):
                for j in range(3):
                    shared += faces[f, i] == faces[g, j]
            if shared > 1:
                chosen[k] = _folded(corners[f], corners[g])
            else:
                chosen[k] = overlap(corners[f], corners[g], slack, slack if shared else -slack, axis)
    return result[chosen]
