"""Faces on the same corners: duplicates, and the two sides of a doubled wall."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled
from .welding import mixed


def coincident_faces(
    corners: NDArray[np.int64], offsets: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """First face on the same corners as each, and whether it runs the other way round.

    Parameters
    ----------
    corners, offsets : int arrays
        Vertex ids of all faces, and where those of each begin; one more offset than faces.

    Returns
    -------
    first : (p,) int
        Least id among the faces on the same corners in the same or in the opposite order. Faces that name a vertex
        twice stand for themselves; −1 for those on fewer than three vertices.
    reversed : (p,) bool
        Whether the order is opposite to that of `first`.

    Examples
    --------
    >>> coincident_faces(np.array([0, 1, 2, 1, 2, 0, 0, 2, 1, 3, 3, 1]), np.array([0, 3, 6, 9, 12]))
    (array([ 0,  0,  0, -1]), array([False, False,  True, False]))
    """
    first, reverse = _coincident(corners, offsets, int(corners.max(initial=-1)) + 1)
    return first, reverse


@compiled
def _coincident(
    corners: NDArray[np.int64], offsets: NDArray[np.int64], n_vertices: int
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    n = len(offsets) - 1
    bits = 4
    while (1 << bits) < 2 * n:
        bits += 1
    mask = (1 << bits) - 1
    table = np.full(1 << bits, -1, dtype=np.int32)
    first, reverse = np.empty(n, dtype=np.int64), np.zeros(n, dtype=np.bool_)
    seen = np.full(n_vertices, -1, dtype=np.int32)  # the last face at each vertex
    for f in range(n):
        begin, end = offsets[f], offsets[f + 1]
        least, total, squares, distinct = begin, 0, 0, 0
        first[f] = f
        for c in range(begin, end):
            corner = corners[c]
            total, squares = total + corner, squares + corner * corner
            if corner < corners[least]:
                least = c
            distinct += seen[corner] != f
            seen[corner] = f
        if distinct < end - begin:
            if distinct < 3:
                first[f] = -1
            continue
        slot = mixed(total, squares, corners[least]) & mask
        while True:
            g = table[slot]
            if g < 0:
                table[slot] = f
                break
            way = _compare(corners, offsets[g], offsets[g + 1], least, begin, end - begin)
            if way != 0:
                first[f], reverse[f] = g, way < 0
                break
            slot = (slot + 1) & mask
    return first, reverse


@compiled
def _compare(corners: NDArray[np.int64], other: int, other_end: int, least: int, begin: int, size: int) -> int:
    """1 for the same cycle, −1 for the opposite, 0 for another one; `least` is the place of the least corner."""
    if other_end - other != size:
        return 0
    start = other
    for c in range(other, other_end):
        if corners[c] < corners[start]:
            start = c
    ahead, back = True, True
    for k in range(size):
        corner = corners[begin + (least - begin + k) % size]
        ahead = ahead and corner == corners[other + (start - other + k) % size]
        back = back and corner == corners[other + (start - other + size - k) % size]
        if not (ahead or back):
            return 0
    return 1 if ahead else -1
