"""Kernels: vertices that coincide, and connected components of faces."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled


def same_positions(vertices: NDArray[np.float64]) -> NDArray[np.int64]:
    """(n,) id of the first vertex at exactly the same position as each vertex.

    Examples
    --------
    >>> same_positions(np.array([[0.0, 1.0], [2.0, 3.0], [-0.0, 1.0]])).tolist()
    [0, 1, 0]
    """
    return _same_positions(np.ascontiguousarray(vertices) + 0.0)  # −0 becomes 0


def face_components(faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """(m,) connected component of each face, through shared vertices, numbered by first appearance.

    Examples
    --------
    >>> face_components(np.array([[0, 1, 2], [3, 4, 5], [2, 6, 7]])).tolist()
    [0, 1, 0]
    """
    return _face_components(np.ascontiguousarray(faces), int(faces.max()) + 1)


@compiled(nogil=True)
def _same_positions(vertices):
    count, dimension = vertices.shape
    bits = vertices.view(np.uint64)
    size = 16
    while size < 2 * count:
        size *= 2
    mask = np.uint64(size - 1)
    table = np.full(size, -1, dtype=np.int64)
    result = np.empty(count, dtype=np.int64)
    for i in range(count):
        key = np.uint64(1469598103934665603)
        for d in range(dimension):
            key = (key ^ bits[i, d]) * np.uint64(0x9E3779B97F4A7C15)
            key ^= key >> np.uint64(29)
        place = key & mask
        while True:
            other = table[place]
            if other < 0:
                table[place] = i
                result[i] = i
                break
            same = True
            for d in range(dimension):
                if bits[i, d] != bits[other, d]:
                    same = False
            if same:
                result[i] = other
                break
            place = (place + np.uint64(1)) & mask
    return result


@compiled(nogil=True)
def _face_components(faces, n_vertices):
    parent = np.arange(n_vertices)
    for f in range(faces.shape[0]):
        for c in range(1, faces.shape[1]):
            a, b = faces[f, 0], faces[f, c]
            while parent[a] != a:
                parent[a] = parent[parent[a]]
                a = parent[a]
            while parent[b] != b:
                parent[b] = parent[parent[b]]
                b = parent[b]
            if a < b:
                parent[b] = a
            else:
                parent[a] = b
    labels = np.full(n_vertices, -1, dtype=np.int64)
    result = np.empty(faces.shape[0], dtype=np.int64)
    count = 0
    for f in range(faces.shape[0]):
        a = faces[f, 0]
        while parent[a] != a:
            a = parent[a]
        if labels[a] < 0:
            labels[a] = count
            count += 1
        result[f] = labels[a]
    return result
