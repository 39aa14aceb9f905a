"""Compiled kernels that find the closest points of triangles in space."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def dot(a, b):
    """Inner product of two points."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True)
def closest_on_segment(a, b, p):
    """Fraction of the way from a to b that is closest to p."""
    along = b - a
    square = dot(along, along)
    return min(max(dot(p - a, along) / square, 0.0), 1.0) if square > 0 else 0.0


@njit(cache=True)
def closest_on_triangle(corners, p, weights):
    """Barycentric coordinates of the closest point of a triangle, written to `weights`; the squared distance."""
    u, v, w = corners[1] - corners[0], corners[2] - corners[0], p - corners[0]
    uu, uv, vv, wu, wv = dot(u, u), dot(u, v), dot(v, v), dot(w, u), dot(w, v)
    area = uu * vv - uv * uv
    if area > 1e-14 * uu * vv:
        s, t = (vv * wu - uv * wv) / area, (uu * wv - uv * wu) / area
        if s >= 0 and t >= 0 and s + t <= 1:
            weights[0], weights[1], weights[2] = 1 - s - t, s, t
            away = w - s * u - t * v
            return dot(away, away)
    best = np.inf
    for k in range(3):
        a, b = corners[k], corners[(k + 1) % 3]
        s = closest_on_segment(a, b, p)
        away = p - a - s * (b - a)
        if dot(away, away) < best:
            best = dot(away, away)
            weights[:] = 0.0
            weights[k], weights[(k + 1) % 3] = 1 - s, s
    return best


@njit(cache=True)
def distance_to_box(box, p):
    """Squared distance of a point from a box."""
    total = 0.0
    for k in range(3):
        outside = max(box[k] - p[k], p[k] - box[3 + k], 0.0)
        total += outside * outside
    return total


@njit(cache=True)
def nearest_faces(corners, bounds, items, points):
    """Closest face, barycentric coordinates in it and distance, for each point; a descent of the tree of boxes."""
    n, leaves = len(points), len(bounds) // 2
    per_leaf = len(items) // leaves
    faces, weights, distances = np.zeros(n, np.int64), np.zeros((n, 3)), np.empty(n)
    stack, trial = np.empty(128, np.int64), np.empty(3)
    for i in range(n):
        p, best, size = points[i], np.inf, 1
        stack[0] = 1
        while size > 0:
            size -= 1
            node = stack[size]
            if distance_to_box(bounds[node], p) >= best:
                continue
            if node >= leaves:
                first = (node - leaves) * per_leaf
                for face in items[first : first + per_leaf]:
                    if face >= 0:
                        d = closest_on_triangle(corners[face], p, trial)
                        if d < best:
                            best, faces[i], weights[i] = d, face, trial
                continue
            a, b = 2 * node, 2 * node + 1
            if distance_to_box(bounds[a], p) < distance_to_box(bounds[b], p):
                a, b = b, a
            stack[size], stack[size + 1] = a, b
            size += 2
        distances[i] = np.sqrt(best)
    return faces, weights, distances
