"""Triangles of a mesh that pass through each other."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled
from ..parallel import CHUNK, n_threads
from .box_tree import LEAF, BoxTree
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
    with ThreadPoolExecutor(n_threads()) as pool:
        jobs = [
            pool.submit(_pairs, flat, ids, start, min(start + CHUNK, len(ids)), tree.bounds, tree.items, slack)
            for start in range(0, len(ids), CHUNK)
        ]
        pairs = np.concatenate([job.result() for job in jobs])
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
    start: int,
    stop: int,
    bounds: NDArray[np.float64],
    items: NDArray[np.int64],
    slack: float,
) -> NDArray[np.int64]:
    """(k, 2) pairs of which the first is from start to stop, and less than the second."""
    leaves = len(bounds) // 2
    stack, box, axis = np.empty(64, dtype=np.int64), np.empty(6), np.empty(3)
    result, count = np.empty((64, 2), dtype=np.int64), 0
    for f in range(start, stop):
        for k in range(3):
            x, y, z = corners[f, k], corners[f, 3 + k], corners[f, 6 + k]
            box[k], box[3 + k] = min(x, y, z), max(x, y, z)
        stack[0], depth = 1, 1
        while depth > 0:
            depth -= 1
            node = stack[depth]
            apart = False
            for k in range(3):
                apart |= bounds[node, k] > box[3 + k] or bounds[node, 3 + k] < box[k]
            if apart:
                continue
            if node < leaves:
                stack[depth], stack[depth + 1] = 2 * node, 2 * node + 1
                depth += 2
                continue
            for at in range((node - leaves) * LEAF, (node - leaves + 1) * LEAF):
                g = items[at]
                if g <= f:
                    continue
                shared = 0
                for i in range(3):
                    for j in range(3):
                        shared += faces[f, i] == faces[g, j]
                if (shared > 1 and _folded(corners[f], corners[g])) or (
                    shared < 2 and overlap(corners[f], corners[g], slack, slack if shared else -slack, axis)
                ):
                    if count == len(result):
                        wider = np.empty((2 * count, 2), dtype=np.int64)
                        wider[:count] = result
                        result = wider
                    result[count, 0], result[count, 1] = f, g
                    count += 1
    return result[:count]
