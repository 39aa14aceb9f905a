"""Triangles of a mesh that pass through each other."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from itertools import product

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled
from ..parallel import CHUNK, n_threads
from .box_tree import BoxTree
from .cut_faces import overlap
from .directions import unit
from .meshes import area_vectors

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
    flat, normals = corners.reshape(-1, 9), unit(area_vectors(corners))

    def part(start: int) -> NDArray[np.int64]:
        starts, near = tree.meeting(corners[start : start + CHUNK], slack)
        owners = start + np.repeat(np.arange(len(starts) - 1), np.diff(starts))
        one, other = owners[near > owners], near[near > owners]
        shared = sum((i == j).astype(np.int8) for i, j in product(ids[one].T.copy(), ids[other].T.copy()))
        meet, few, many = np.empty(len(one), dtype=bool), np.flatnonzero(shared < 2), np.flatnonzero(shared > 1)
        meet[many] = np.einsum("ij,ij->i", normals[one[many]], normals[other[many]]) < FOLDED - 1.0
        meet[few] = _overlapping(flat, one[few], other[few], slack, np.where(shared[few] > 0, slack, -slack))
        return np.stack([one, other], axis=1)[meet]

    with ThreadPoolExecutor(n_threads()) as pool:
        pairs = np.concatenate(list(pool.map(part, range(0, len(ids), CHUNK))))
    return pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]


@compiled
def _overlapping(
    corners: NDArray[np.float64],
    one: NDArray[np.int64],
    other: NDArray[np.int64],
    slack: float,
    depths: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """(k,) whether triangles overlap, each pair deeper than its depth."""
    result, axis = np.empty(len(one), dtype=np.bool_), np.empty(3)
    for k in range(len(one)):
        result[k] = overlap(corners[one[k]], corners[other[k]], slack, depths[k], axis)
    return result
