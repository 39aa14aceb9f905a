"""The triangular faces of tets."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled

FACE_CORNERS = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])
"""Corners of the face opposite each corner, counter-clockwise seen from outside."""


@dataclass(frozen=True, eq=False)
class FaceTable:
    """The faces of tets, and how tets and faces are incident.

    Attributes
    ----------
    vertices : (f, 3) int
        Vertex ids, counter-clockwise as seen from outside the FIRST tet at the face.
    tet_faces : (m, 4) int
        Face opposite each corner of each tet.
    """

    vertices: NDArray[np.int64]
    tet_faces: NDArray[np.int64]

    @cached_property
    def tet_counts(self) -> NDArray[np.int64]:
        """(f,) number of tets at each face: 1 on the boundary, more than 2 where nonmanifold."""
        return np.bincount(self.tet_faces.ravel(), minlength=len(self.vertices))


def face_table(tets: NDArray[np.int64]) -> FaceTable:
    """Find the faces of tets, numbered by first appearance, in linear time.

    Examples
    --------
    >>> table = face_table(np.array([[0, 1, 2, 3], [4, 1, 3, 2]]))
    >>> table.tet_faces.tolist()
    [[0, 1, 2, 3], [0, 4, 5, 6]]
    >>> table.tet_counts.tolist()
    [2, 1, 1, 1, 1, 1, 1]
    """
    corners = tets[:, FACE_CORNERS].reshape(-1, 3)
    number, count = _number_triples(np.sort(corners, axis=1))
    first = np.empty(count, dtype=np.int64)
    first[number[::-1]] = np.arange(len(number))[::-1]
    return FaceTable(corners[first], number.reshape(-1, 4))


@compiled
def _number_triples(triples):
    """Number each distinct triple by first appearance, with a chained hash table."""
    n = len(triples)
    bits = 4
    while (1 << bits) < n:
        bits += 1
    heads = np.full(1 << bits, -1, dtype=np.int64)
    following = np.empty(n, dtype=np.int64)
    first = np.empty(n, dtype=np.int64)
    number = np.empty(n, dtype=np.int64)
    count = 0
    for i in range(n):
        mixed = np.uint64(triples[i, 0]) * np.uint64(0x9E3779B97F4A7C15) + np.uint64(triples[i, 1])
        mixed = mixed * np.uint64(0xC2B2AE3D27D4EB4F) + np.uint64(triples[i, 2])
        mixed = (mixed ^ (mixed >> np.uint64(29))) * np.uint64(0x9E3779B97F4A7C15)
        slot = np.int64(mixed >> np.uint64(64 - bits))
        k = heads[slot]
        while k >= 0:
            j = first[k]
            if triples[i, 0] == triples[j, 0] and triples[i, 1] == triples[j, 1] and triples[i, 2] == triples[j, 2]:
                break
            k = following[k]
        if k < 0:
            k = count
            first[k] = i
            following[k] = heads[slot]
            heads[slot] = k
            count += 1
        number[i] = k
    return number, count
