"""The nearest point of many triangles."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from .box_tree import LEAF, BoxTree


def nearest_on_triangles(
    triangles: NDArray[np.float64], tree: BoxTree, points: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Triangle nearest to each of (k, 3) points, and barycentric coordinates of the nearest place in it.

    Examples
    --------
    >>> triangle = np.array([[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]])
    >>> tree = BoxTree.of(triangle.min(axis=1), triangle.max(axis=1))
    >>> nearest_on_triangles(triangle, tree, np.array([[0.5, -1.0, 3.0], [2.0, 2.0, 0.0]]))
    (array([0, 0]), array([[0.5, 0.5, 0. ],
           [0. , 0.5, 0.5]]))
    """
    return _nearest(np.ascontiguousarray(triangles), tree.bounds, tree.items, points)


@njit(cache=True)
def _nearest(triangles, bounds, items, points):
    found = np.zeros(len(points), dtype=np.int64)
    weights = np.zeros((len(points), 3))
    stack = np.empty(128, dtype=np.int64)
    trial = np.empty(3)
    leaves = len(bounds) // 2
    for p in range(len(points)):
        best = np.inf
        depth = 1
        stack[0] = 1
        while depth > 0:
            depth -= 1
            node = stack[depth]
            if _box_distance(bounds[node], points[p]) >= best:
                continue
            if node < leaves:
                left, right = 2 * node, 2 * node + 1
                if _box_distance(bounds[left], points[p]) > _box_distance(bounds[right], points[p]):
                    left, right = right, left
                stack[depth] = right
                stack[depth + 1] = left
                depth += 2
                continue
            for k in range((node - leaves) * LEAF, (node - leaves + 1) * LEAF):
                if items[k] >= 0:
                    distance = _place(triangles[items[k]], points[p], trial)
                    if distance < best:
                        best = distance
                        found[p] = items[k]
                        weights[p] = trial
    return found, weights


@njit(cache=True)
def _box_distance(box, point):
    total = 0.0
    for i in range(3):
        gap = max(box[i] - point[i], point[i] - box[3 + i], 0.0)
        total += gap * gap
    return total


@njit(cache=True)
def _place(triangle, point, weights):
    """Barycentric coordinates of the nearest place in a triangle; returns the squared distance.

    Inside if the foot of the perpendicular is; on the nearest of the sides if not.
    """
    best = np.inf
    for i in range(3):
        j = i + 1 if i < 2 else 0
        side = triangle[j] - triangle[i]
        length = (side * side).sum()
        s = min(max((side * (point - triangle[i])).sum() / length, 0.0), 1.0) if length > 0.0 else 0.0
        distance = ((point - triangle[i] - s * side) ** 2).sum()
        if distance < best:
            best = distance
            weights[:] = 0.0
            weights[i], weights[j] = 1.0 - s, s
    normal = np.cross(triangle[1] - triangle[0], triangle[2] - triangle[0])
    square = (normal * normal).sum()
    if square > 0.0:
        v = (normal * np.cross(point - triangle[0], triangle[2] - triangle[0])).sum() / square
        w = (normal * np.cross(triangle[1] - triangle[0], point - triangle[0])).sum() / square
        if v >= 0.0 and w >= 0.0 and v + w <= 1.0:
            height = (normal * (point - triangle[0])).sum()
            weights[0], weights[1], weights[2] = 1.0 - v - w, v, w
            best = height * height / square
    return best
