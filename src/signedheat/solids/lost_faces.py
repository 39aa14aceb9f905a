"""Small holes, closed by the triangles between their own corners that bend least, as where faces were lost.

The surface across a hole that lost no vertices is known but for its diagonals. Of all triangulations of the hole's
loop, the one whose edges bend least, ``Σ length · angle`` with the rim's edges included (twice the total absolute mean
curvature), continues the faces around it; dynamic programming over the loop finds it (Barequet and Sharir 1995,
Liepa 2003).
"""

from __future__ import annotations

import numpy as np

from ..arrays import Bools, Floats, Ints
from ..compiled import compiled

MOST_SIDES = 16
"""Sides of a hole from which on vertices, too, may be lost."""
BENT = np.deg2rad(70.0)
"""Root mean square of the angles at the rim from which on a lid does not continue the surface around it: at the end of
a tube it is 90°."""


def least_bent(vertices: Floats, loops: list[Ints], normals: Floats, taken: Ints, most: float) -> list[Ints]:
    """(n − 2, 3) triangles on the vertices of each loop of n; none where they do not continue the surface around it.

    Parameters
    ----------
    vertices : (n, 3) float
        Positions.
    loops : list of (n,) int
        Vertices around each hole, counterclockwise as seen from outside.
    normals : (k, 3) float
        Unit normals of the faces behind the edges that begin at them, loop after loop.
    taken : (e,) int
        Sorted `edge_keys` of edges that may not be made, since they are there already.
    most : float
        Root mean square of the angles at the rim up to which they continue it.
    """
    starts = np.concatenate([[0], np.cumsum([len(loop) for loop in loops], dtype=np.int64)])
    if not len(loops):
        return []
    every = np.concatenate(loops)
    faces, closed = _least_bent(vertices[every], every, np.ascontiguousarray(normals), starts, taken, most)
    begins = starts - 2 * np.arange(len(starts))
    return [
        every[a + faces[b:c]] if closes else np.empty((0, 3), dtype=np.int64)
        for a, b, c, closes in zip(starts[:-1], begins[:-1], begins[1:], closed.tolist(), strict=True)
    ]


@compiled
def _least_bent(
    corners: Floats, ids: Ints, normals: Floats, starts: Ints, taken: Ints, most: float
) -> tuple[Ints, Bools]:
    """Triangles, by places in their loops, and whether each loop's bend at its rim at most by an angle.

    `cost[i, j]` is how much the best lid between the i-th and the j-th corner bends, but for the edge that joins the
    two; `rims[i, j]` the sum of lengths times squared angles at the rim, `across[i, j]` the normal of its triangle
    there.
    """
    n_loops = len(starts) - 1
    faces, closed = np.empty((len(corners) - 2 * n_loops, 3), dtype=np.int64), np.zeros(n_loops, dtype=np.bool_)
    size = 0
    for h in range(n_loops):
        size = max(size, starts[h + 1] - starts[h])
    cost, rims, across = np.empty((size, size)), np.empty((size, size)), np.empty((size, size, 3))
    split, stack, normal = np.empty((size, size), dtype=np.int64), np.empty((size, 2), dtype=np.int64), np.empty(3)
    count = 0
    for h in range(n_loops):
        begin, n = starts[h], starts[h + 1] - starts[h]
        points = corners[begin : begin + n]
        around = 0.0
        for i in range(n):
            around += _length(points[i], points[(i + 1) % n])
            if i < n - 1:
                cost[i, i + 1] = rims[i, i + 1] = 0.0
                across[i, i + 1] = normals[begin + i]
        for span in range(2, n):
            for i in range(n - span):
                j = i + span
                cost[i, j], split[i, j] = np.inf, i + 1
                if span < n - 1 and _is_among(taken, ids[begin + i], ids[begin + j]):
                    continue
                for k in range(i + 1, j):
                    if not cost[i, k] + cost[k, j] < cost[i, j]:
                        continue
                    _normal(points[i], points[k], points[j], normal)
                    before, behind = _angle(normal, across[i, k]), _angle(normal, across[k, j])
                    one, other = _length(points[i], points[k]), _length(points[k], points[j])
                    total = cost[i, k] + cost[k, j] + one * before + other * behind
                    if not normal.any():  # without area, which others have if there are any
                        total += np.pi * (one + other)
                    if total < cost[i, j]:
                        cost[i, j], split[i, j], across[i, j] = total, k, normal
                        rims[i, j] = rims[i, k] + rims[k, j]
                        if k == i + 1:
                            rims[i, j] += one * before**2
                        if k == j - 1:
                            rims[i, j] += other * behind**2
        last = _length(points[n - 1], points[0])
        bend = rims[0, n - 1] + last * _angle(across[0, n - 1], normals[begin + n - 1]) ** 2
        closed[h] = cost[0, n - 1] < np.inf and bend <= most**2 * around
        stack[0, 0], stack[0, 1], depth = 0, n - 1, 1
        while depth > 0:
            depth -= 1
            i, j = stack[depth]
            if j - i > 1:
                k = split[i, j]
                faces[count, 0], faces[count, 1], faces[count, 2] = i, k, j
                count += 1
                stack[depth, 0], stack[depth, 1], stack[depth + 1, 0], stack[depth + 1, 1] = i, k, k, j
                depth += 2
    return faces, closed


@compiled
def _length(a: Floats, b: Floats) -> float:
    return float(np.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2))


@compiled
def _normal(a: Floats, b: Floats, c: Floats, normal: Floats) -> None:
    """Write the unit normal of a triangle; 0 if it has no area."""
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    size = np.sqrt(x * x + y * y + z * z)
    scale = 1.0 / size if size > 0 else 0.0
    normal[0], normal[1], normal[2] = x * scale, y * scale, z * scale


@compiled
def _angle(a: Floats, b: Floats) -> float:
    """Return the angle between two unit vectors; 0 where one of them is 0."""
    if (a[0] == 0 and a[1] == 0 and a[2] == 0) or (b[0] == 0 and b[1] == 0 and b[2] == 0):
        return 0.0
    return float(np.arccos(min(max(a[0] * b[0] + a[1] * b[1] + a[2] * b[2], -1.0), 1.0)))


@compiled
def _is_among(taken: Ints, i: int, j: int) -> bool:
    key = (min(i, j) << 32) | max(i, j)
    at = np.searchsorted(taken, key)
    return bool(at < len(taken) and taken[at] == key)
