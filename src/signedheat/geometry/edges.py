"""Edges of a set of triangles."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..frozen import Frozen, read_only
from .triangle_kernels import find_edges


@dataclass(frozen=True, eq=False)
class EdgeTable(Frozen):
    """Edges, and how faces and edges are incident.

    Attributes
    ----------
    vertices : (e, 2) int
        Tail and head: the direction in which the FIRST face of the edge runs along it.
    face_edges : (m, 3) int
        Edge from corner k to corner k + 1 of each face.
    forward : (m, 3) bool
        Whether the face runs along that edge from tail to head.
    """

    vertices: NDArray[np.int64]
    face_edges: NDArray[np.int64]
    forward: NDArray[np.bool_]

    @cached_property
    def face_counts(self) -> NDArray[np.int64]:
        """(e,) number of faces at each edge: 1 at a boundary, more than 2 where nonmanifold."""
        return read_only(np.bincount(self.face_edges.ravel(), minlength=len(self.vertices)))

    def per_edge(self, values: NDArray[Any]) -> NDArray[Any]:
        """(e,) what (m, 3) values at the sides of faces say of each edge: the last of its faces; zero where none is."""
        result = np.zeros(len(self.vertices), dtype=values.dtype)
        result[self.face_edges] = values
        return result

    def elimination_order(self, vertex_order: NDArray[np.integer]) -> NDArray[np.int64]:
        """Fill-reducing order of unknowns at edges, from one of the vertices: ``order[k]`` is eliminated k-th.

        An edge is eliminated with its first eliminated end. Where a set of vertices separates two parts of the mesh, no
        edge of one part shares a face with an edge of the other, so the edges within that set separate them too: the
        order is a nested dissection of the edges, for a fraction of the cost of finding one anew.
        """
        rank = np.empty(len(vertex_order), dtype=np.int64)
        rank[vertex_order] = np.arange(len(vertex_order))
        a, b = rank[self.vertices].T
        return np.argsort((np.minimum(a, b) + 1) * len(rank) - np.maximum(a, b), kind="stable")


def edge_table(faces: NDArray[np.int64]) -> EdgeTable:
    """Find the edges of triangles, numbered by first appearance (corner 0–1, 1–2, 2–0, face after face).

    Time is linear in the number of faces, even if all of them share a vertex.

    Examples
    --------
    >>> table = edge_table(np.array([[0, 1, 2], [2, 1, 3]]))
    >>> table.vertices.tolist()
    [[0, 1], [1, 2], [2, 0], [1, 3], [3, 2]]
    >>> table.face_edges.tolist()
    [[0, 1, 2], [1, 3, 4]]
    """
    faces = np.asarray(faces, dtype=np.int64)
    tails, heads = faces.flatten(), np.roll(faces, -1, axis=1).ravel()
    every, n_vertices = np.ones(len(tails), dtype=np.bool_), int(tails.max(initial=-1)) + 1
    edges, forward, _, first, _ = find_edges(read_only(tails), read_only(heads), every, n_vertices)
    vertices = np.stack([tails[first], heads[first]], axis=1)
    return EdgeTable(vertices, edges.reshape(-1, 3), forward.reshape(-1, 3))


def edge_keys(one: NDArray[np.integer], other: NDArray[np.integer]) -> NDArray[np.int64]:
    """(k,) a number for each pair of vertices, whichever comes first."""
    keys: NDArray[np.int64] = (np.minimum(one, other).astype(np.int64) << 32) | np.maximum(one, other)
    return keys
