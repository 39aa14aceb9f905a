"""Closest points on triangles in space."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled
from .box_tree import LEAF, BoxTree


def nearest_on_triangles(
    triangles: NDArray[np.float64], tree: BoxTree, points: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Closest triangle to each of (k, 3) points, and barycentric coordinates of the closest point in it.

    Examples
    --------
    >>> triangle = np.array([[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]])
    >>> tree = BoxTree.of(triangle.min(axis=1), triangle.max(axis=1))
    >>> nearest_on_triangles(triangle, tree, np.array([[0.5, -1.0, 3.0], [2.0, 2.0, 0.0]]))
    (array([0, 0]), array([[0.5, 0.5, 0. ],
           [0. , 0.5, 0.5]]))
    """
    return _nearest(np.ascontiguousarray(triangles), tree.bounds, tree.items, points)


@compiled(nogil=True)
def _nearest(triangles, bounds, items, points):
    found = np.zeros(len(points), dtype=np.int64)
    weights = np.zeros((len(points), 3))
    stack, gaps = np.empty(128, dtype=np.int64), np.empty(128)
    leaves = len(bounds) // 2
    for p in range(len(points)):
        x, y, z = points[p]
        near = found[p - 1] if p else 0  # a first guess: consecutive points are often close to each other
        best, u, v, w = place_on_triangle(triangles[near], x, y, z)
        found[p] = near
        depth, stack[0], gaps[0] = 1, 1, 0.0
        while depth > 0:
            depth -= 1
            node = stack[depth]
            if gaps[depth] >= best:
                continue
            if node < leaves:
                near, far = 2 * node, 2 * node + 1
                gap, other = _box_distance(bounds[near], x, y, z), _box_distance(bounds[far], x, y, z)
                if gap > other:
                    near, far, gap, other = far, near, other, gap
                if other < best:
                    stack[depth], gaps[depth] = far, other
                    depth += 1
                if gap < best:
                    stack[depth], gaps[depth] = near, gap
                    depth += 1
                continue
            for k in range((node - leaves) * LEAF, (node - leaves + 1) * LEAF):
                if items[k] >= 0:
                    distance, a, b, c = place_on_triangle(triangles[items[k]], x, y, z)
                    if distance < best:
                        best, u, v, w = distance, a, b, c
                        found[p] = items[k]
        weights[p, 0], weights[p, 1], weights[p, 2] = u, v, w
    return found, weights


@compiled
def _box_distance(box, x, y, z):
    a = max(box[0] - x, x - box[3], 0.0)
    b = max(box[1] - y, y - box[4], 0.0)
    c = max(box[2] - z, z - box[5], 0.0)
    return a * a + b * b + c * c


@compiled
def place_on_triangle(triangle, x, y, z):
    """Squared distance of (x, y, z) from a triangle, and barycentric coordinates of its closest point.

    The foot of the perpendicular if that lies inside, otherwise the closest point of the three sides. Scalars instead
    of arrays, because arrays would be allocated for every triangle.
    """
    ax, ay, az = triangle[0]
    bx, by, bz = triangle[1, 0] - ax, triangle[1, 1] - ay, triangle[1, 2] - az
    cx, cy, cz = triangle[2, 0] - ax, triangle[2, 1] - ay, triangle[2, 2] - az
    px, py, pz = x - ax, y - ay, z - az
    nx, ny, nz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
    square = nx * nx + ny * ny + nz * nz
    if square > 0.0:
        v = (nx * (py * cz - pz * cy) + ny * (pz * cx - px * cz) + nz * (px * cy - py * cx)) / square
        w = (nx * (by * pz - bz * py) + ny * (bz * px - bx * pz) + nz * (bx * py - by * px)) / square
        if v >= 0.0 and w >= 0.0 and v + w <= 1.0:
            height = nx * px + ny * py + nz * pz
            return height * height / square, 1.0 - v - w, v, w
    first, s = _on_side(px, py, pz, bx, by, bz)
    second, t = _on_side(px - bx, py - by, pz - bz, cx - bx, cy - by, cz - bz)
    third, r = _on_side(px - cx, py - cy, pz - cz, -cx, -cy, -cz)
    if first <= second and first <= third:
        return first, 1.0 - s, s, 0.0
    if second <= third:
        return second, 0.0, 1.0 - t, t
    return third, r, 0.0, 1.0 - r


@compiled
def _on_side(px, py, pz, dx, dy, dz):
    """Squared distance of p from the segment from 0 to d, and the fraction of the segment at the closest point."""
    length = dx * dx + dy * dy + dz * dz
    s = min(max((px * dx + py * dy + pz * dz) / length, 0.0), 1.0) if length > 0.0 else 0.0
    ex, ey, ez = px - s * dx, py - s * dy, pz - s * dz
    return ex * ex + ey * ey + ez * ez, s
