"""Which points are at the same place, to the last bit or to roundoff."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled

SINGLE, DOUBLE = 2.0**-22, 2.0**-46
"""How far apart, over the largest coordinate, the same place may come out in single and in double precision."""
_HALF = 0xFFFFFFFF
_CELL = 16.0
"""Side of the cells in which points are looked up, over the tolerance: few points are near a wall."""


def roundoff(points: NDArray[np.float64]) -> float:
    """Distance below which points are at one place: a few units in the last place of the largest coordinate.

    Coordinates that single precision holds without loss are taken to come from it, as those of STL files do.

    Examples
    --------
    >>> roundoff(np.array([[1.0, 0.0, 0.0]])) == SINGLE, roundoff(np.array([[0.1, 1.0, 0.0]])) == DOUBLE
    (True, True)
    """
    largest = float(np.abs(points).max(initial=0.0))
    with np.errstate(over="ignore", under="ignore"):
        is_single = largest < 1e38 and bool((points.astype(np.float32) == points).all())
    return largest * (SINGLE if is_single else DOUBLE)


def welded(points: NDArray[np.float64], tolerance: float) -> NDArray[np.int64]:
    """(n,) first point within `tolerance` of each of (n, 3) points; its own index where there is none before.

    Chains are not followed: a point is compared with such only as stand for themselves. Takes O(n) time as long as few
    points stand for themselves within one cell of 16 tolerances.

    Examples
    --------
    >>> welded(np.array([[0.0, 0, 0], [1, 0, 0], [1e-9, 0, 0], [1, 0, 0]]), 1e-6).tolist()
    [0, 1, 0, 1]
    """
    smallest = float(np.nextafter(np.abs(points).max(initial=0.0), np.inf)) * 2.0**-60
    return np.asarray(_weld(np.ascontiguousarray(points), max(tolerance, smallest, 1e-300)))


def distinct_rows(rows: NDArray[np.unsignedinteger]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Number each of (n, 3) rows by the first that equals it; in order of first appearance.

    Returns
    -------
    ids : (n,) int
        Number of each row's kind.
    firsts : (k,) int
        First row of each kind.

    Examples
    --------
    >>> distinct_rows(np.array([[5, 5, 5], [1, 2, 3], [5, 5, 5]], dtype=np.uint32))
    (array([0, 1, 0]), array([0, 1]))
    """
    ids, firsts = _distinct(np.ascontiguousarray(rows))
    return ids, firsts


@compiled
def mixed(a: int, b: int, c: int) -> int:
    """Hash of three integers, not negative: halves times odd numbers, so that no product leaves 64 bits."""
    x = ((a & _HALF) * 0x1E3779B1) ^ ((b & _HALF) * 0x2545F491) ^ ((c & _HALF) * 0x165667B1)
    x ^= (((a >> 32) & _HALF) * 0x27D4EB2F) ^ (((b >> 32) & _HALF) * 0x1B873593) ^ (((c >> 32) & _HALF) * 0x0CC9E2D5)
    x = ((x ^ (x >> 29)) & _HALF) * 0x3C6EF373
    return (x ^ (x >> 27)) & 0x7FFFFFFFFFFFFFFF


@compiled
def _weld(points: NDArray[np.float64], tolerance: float) -> NDArray[np.int64]:
    n = len(points)
    bits = 4
    while (1 << bits) < 2 * n:
        bits += 1
    mask = (1 << bits) - 1
    heads, following = np.full(1 << bits, -1, dtype=np.int32), np.full(n, -1, dtype=np.int32)
    owner = np.empty(n, dtype=np.int64)
    side = _CELL * tolerance
    for p in range(n):
        x, y, z = points[p, 0], points[p, 1], points[p, 2]
        low = (np.floor((x - tolerance) / side), np.floor((y - tolerance) / side), np.floor((z - tolerance) / side))
        high = (np.floor((x + tolerance) / side), np.floor((y + tolerance) / side), np.floor((z + tolerance) / side))
        found = np.int32(-1)
        for i in range(np.int64(low[0]), np.int64(high[0]) + 1):
            for j in range(np.int64(low[1]), np.int64(high[1]) + 1):
                for k in range(np.int64(low[2]), np.int64(high[2]) + 1):
                    q = heads[mixed(i, j, k) & mask]
                    while q >= 0:
                        gap = max(abs(points[q, 0] - x), abs(points[q, 1] - y), abs(points[q, 2] - z))
                        if gap <= tolerance and (found < 0 or q < found):
                            found = q
                        q = following[q]
        if found >= 0:
            owner[p] = found
            continue
        owner[p] = p
        home = mixed(np.int64(np.floor(x / side)), np.int64(np.floor(y / side)), np.int64(np.floor(z / side))) & mask
        following[p] = heads[home]
        heads[home] = p
    return owner


@compiled
def _distinct(rows: NDArray[np.unsignedinteger]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    n = len(rows)
    bits = 4
    while (1 << bits) < 2 * n:
        bits += 1
    mask = (1 << bits) - 1
    table = np.full(1 << bits, -1, dtype=np.int32)  # numbers of kinds
    ids, firsts = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64)
    count = 0
    for r in range(n):
        a, b, c = rows[r, 0], rows[r, 1], rows[r, 2]
        slot = mixed(np.int64(a), np.int64(b), np.int64(c)) & mask
        while True:
            kind = table[slot]
            if kind < 0:
                table[slot] = count
                firsts[count] = r
                ids[r] = count
                count += 1
                break
            first = firsts[kind]
            if rows[first, 0] == a and rows[first, 1] == b and rows[first, 2] == c:
                ids[r] = kind
                break
            slot = (slot + 1) & mask
    return ids, firsts[:count].copy()
