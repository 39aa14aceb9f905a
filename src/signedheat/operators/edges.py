"""Edges of a set of triangles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class EdgeTable:
    """Edges and how the faces run along them.

    Attributes
    ----------
    vertices : (e, 2) int
        Tail and head: the direction in which the FIRST face of the edge runs along it.
    of_faces : (m, 3) int
        Edge from corner k to corner k + 1 of each face.
    forward : (m, 3) bool
        Whether the face runs along that edge from tail to head.
    """

    vertices: NDArray[np.int64]
    of_faces: NDArray[np.int64]
    forward: NDArray[np.bool_]

    @property
    def face_counts(self) -> NDArray[np.int64]:
        """(e,) number of faces at each edge: 1 at a boundary, more than 2 where nonmanifold."""
        return np.bincount(self.of_faces.ravel(), minlength=len(self.vertices))


def face_edges(faces: NDArray[np.int64]) -> EdgeTable:
    """Find the edges of triangles, numbered by first appearance (corner 0–1, 1–2, 2–0, face after face).

    Examples
    --------
    >>> table = face_edges(np.array([[0, 1, 2], [2, 1, 3]]))
    >>> table.vertices.tolist()
    [[0, 1], [1, 2], [2, 0], [1, 3], [3, 2]]
    >>> table.of_faces.tolist()
    [[0, 1, 2], [1, 3, 4]]
    """
    tail = faces.ravel()
    head = np.roll(faces, -1, axis=1).ravel()
    key = np.minimum(tail, head) * (int(faces.max()) + 1) + np.maximum(tail, head)
    order = np.argsort(key, kind="stable")
    starts = np.ones(len(key), dtype=bool)
    starts[1:] = key[order[1:]] != key[order[:-1]]
    first = order[starts]  # the stable sort puts the first halfedge of every edge in front
    rank = np.empty(len(first), dtype=np.int64)
    rank[np.argsort(first)] = np.arange(len(first))
    edge = np.empty(len(key), dtype=np.int64)
    edge[order] = rank[np.cumsum(starts) - 1]
    first = np.sort(first)
    vertices = np.stack([tail[first], head[first]], axis=1)
    return EdgeTable(vertices, edge.reshape(-1, 3), (vertices[edge, 0] == tail).reshape(-1, 3))
