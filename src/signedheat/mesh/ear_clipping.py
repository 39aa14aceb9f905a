"""Triangulation of polygons in space by cutting off ears."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..arrays import Floats, Ints


def cut_into_ears(polygon: Floats, normal: Floats, allowed: Callable[[int, int], bool] | None = None) -> Ints:
    """Cut a simple polygon along diagonals, best-shaped ears first: (k − 2, 3) corners; empty if it runs out of ears.

    It is counter-clockwise as seen from the normal. `allowed` says whether a diagonal may be made from one corner to
    another; by default each may. Takes cubic time in the number of corners.

    Examples
    --------
    >>> arrow = np.array([[0.0, 0, 0], [2, -1, 0], [1, 0, 0], [2, 1, 0]])
    >>> cut_into_ears(arrow, np.array([0.0, 0, 1])).tolist()
    [[0, 1, 2], [0, 2, 3]]
    """
    upright = np.eye(3)[np.abs(normal).argmin()]
    first = np.cross(upright, normal)
    second = np.cross(normal, first)
    sizes = np.linalg.norm(first), np.linalg.norm(second)
    if not min(sizes) > 0:
        return np.empty((0, 3), dtype=np.int64)
    plane = polygon @ first / sizes[0] + 1j * (polygon @ second / sizes[1])
    left = np.arange(len(polygon))
    triangles = []
    while len(left) > 3:
        before, here, after = np.roll(left, 1), left, np.roll(left, -1)
        a, b, c = plane[before], plane[here], plane[after]
        area = (np.conj(b - a) * (c - a)).imag
        size = np.abs(b - a) ** 2 + np.abs(c - b) ** 2 + np.abs(a - c) ** 2
        z = plane[left][:, None]
        inside = np.ones((len(left), len(left)), dtype=bool)  # [point, ear]
        for u, v in ((a, b), (b, c), (c, a)):
            inside &= (np.conj(v - u) * (z - u)).imag >= 0
        inside &= (left[:, None] != before) & (left[:, None] != here) & (left[:, None] != after)
        quality = np.where(inside.any(axis=0), -1.0, area / np.where(size > 0, size, 1.0))
        ears = np.argsort(-quality, kind="stable")
        found = (k for k in ears[quality[ears] > 0] if allowed is None or allowed(int(before[k]), int(after[k])))
        ear = next(found, None)
        if ear is None:
            return np.empty((0, 3), dtype=np.int64)
        triangles.append([before[ear], here[ear], after[ear]])
        left = np.delete(left, ear)
    return np.array([*triangles, left])
